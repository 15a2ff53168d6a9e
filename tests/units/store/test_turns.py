"""How far a lane leads from the heading of who is in it, by hand on straight lanes."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from shapely import box

from scenicq.geometry.features import MapFeature
from scenicq.store.dataset import open_dataset
from scenicq.store.labels import Label, LabelObject, Recording
from scenicq.store.map_index import NO_WAY
from scenicq.store.writer import write_dataset

NORTH = {"centerline": [[[0, -50], [0, 50]]]}
MAP = (
    MapFeature("up", "lane", box(-2, -50, 2, 50), NORTH),
    MapFeature("east", "lane", box(-50, -2, 50, 2), {"centerline": [[[-50, 0], [50, 0]]]}),
    MapFeature("plain", "lane", box(8, 8, 20, 20), {}),
    # its own line is what it leads along; whose lane it is says its lane
    MapFeature("up_1", "lane_section", box(-2, 0, 2, 50), {"lane": "up", "centerline": [[[0, 50], [0, 0]]]}),
    MapFeature("all", "road", box(-50, -50, 50, 50), {}),
)


@pytest.mark.parametrize(
    ("place", "heading", "expected"),
    [
        ((0.0, 20.0), 0.0, {"up": 0.0, "up_1": 0.0}),
        ((1.0, 20.0), 2.0, {"up": 2.0, "up_1": 2.0}),
        ((1.0, -20.0), -3.0, {"up": 3.0}),
        ((0.5, 1.0), 0.5, {"up": 0.5, "up_1": 0.5, "east": math.pi / 2 + 0.5}),
        ((0.5, 1.0), 3.0, {"up": 3.0, "up_1": 3.0, "east": 3 * math.pi / 2 - 3.0}),
        ((0.5, 1.0), None, {"up": 0.0, "up_1": 0.0, "east": 0.0}),
        ((10.0, 10.0), 1.0, {}),
        ((10.0, 10.0), None, {"plain": 0.0}),
        ((3.0, 20.0), 0.0, {}),
    ],
)
def test_a_lane_leads_so_far_from_a_heading(
    tmp_path: Path, place: tuple[float, float], heading: float | None, expected: dict[str, float]
) -> None:
    def member(name: str) -> LabelObject:
        return LabelObject(name, "Car", "car", *place, heading, 2.0, 4.5)

    label = Label("f", "r", 0, "m", member("ego"), (member("o"),))
    write_dataset(tmp_path / "d", iter([Recording("r", "m", (label,))]), {"m": MAP}, name="d")
    dataset = open_dataset(tmp_path / "d")
    rows = dataset.connect().sql("SELECT object, region, turn FROM memberships WHERE turn IS NOT NULL").fetchall()
    for who in ("ego", "o"):
        assert {region: turn for name, region, turn in rows if name == who} == pytest.approx(expected)
    own = (
        dataset.connect().sql("SELECT region, section_turn FROM memberships WHERE section_turn IS NOT NULL").fetchall()
    )
    back = {"up_1": 0.0 if heading is None else math.pi - abs(heading)} if "up_1" in expected else {}
    assert dict(own) == pytest.approx(back)
    assert len(own) == 2 * len(back)


def test_a_section_whose_line_leads_nowhere_leads_far_from_all(tmp_path: Path) -> None:
    line = {"lane": "up", "centerline": [[[0, 0], [0, 0]]]}
    features = (MAP[0], MapFeature("up_1", "lane_section", box(-2, 0, 2, 50), line))
    ego = LabelObject("ego", "Car", "car", 0.0, 20.0, 0.0, 2.0, 4.5)
    write_dataset(
        tmp_path / "d", iter([Recording("r", "m", (Label("f", "r", 0, "m", ego, ()),))]), {"m": features}, name="d"
    )
    own = open_dataset(tmp_path / "d").connect().sql("SELECT region, turn, section_turn FROM memberships").fetchall()
    assert {region: (turn, section) for region, turn, section in own if region == "up_1"} == {"up_1": (0.0, NO_WAY)}
