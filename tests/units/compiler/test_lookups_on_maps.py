"""Look-ups at the places of recorded objects agree with plain geometry."""

from __future__ import annotations

from pathlib import Path

import pytest
import shapely

from scenicq import Query, ingest, open_dataset
from scenicq.errors import Source
from scenicq.store.classes import class_matches

BOSTON = Path(__file__).parents[4] / "shared" / "data" / "boston"
TEXT = """model scenic.domains.driving.model
ego = new Car facing Range(-180, 180) deg
other = new Car facing Range(-180, 180) deg
require ego._lane is other._lane
"""


@pytest.mark.slow
@pytest.mark.skipif(not BOSTON.is_dir(), reason=f"{BOSTON} is not there")
def test_who_is_in_the_same_lane_or_both_in_none(tmp_path: Path) -> None:
    ingest(BOSTON, tmp_path / "dataset")
    dataset = open_dataset(tmp_path / "dataset")
    matched = {result.frame for result in Query(dataset, Source("same.scenic", TEXT)).results()}
    network = dataset.network(next(iter(dataset.maps)))
    lanes = shapely.STRtree([lane.polygon for lane in network.lanes])
    road = shapely.union_all([element.polygon for element in (*network.allRoads, *network.intersections)])

    def on_road(x: float, y: float) -> bool:
        return shapely.dwithin(road, shapely.Point(x, y), 1e-3)

    def lanes_at(x: float, y: float) -> set[int]:
        near = (lanes.query(shapely.Point(x, y), predicate="dwithin", distance=reach) for reach in (1e-9, 0.05))
        return next((set(found.tolist()) for found in near if len(found)), set())

    same: set[str] = set()
    neither: set[str] = set()
    for label in dataset.labels():
        if not on_road(label.ego.x, label.ego.y):
            continue
        own = lanes_at(label.ego.x, label.ego.y)
        for each in label.objects:
            if class_matches("Car", each.category, "fine") and on_road(each.x, each.y):
                others = lanes_at(each.x, each.y)
                if own & others:
                    same.add(label.frame)
                elif not own and not others:
                    neither.add(label.frame)
    assert same
    assert neither
    assert matched == same | neither
