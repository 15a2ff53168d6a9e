"""How near regions of a map may be, in SQL, against exact distances."""

from __future__ import annotations

import math
import random

import duckdb
import pytest
from nudged_scenes import STREET

from scenicq.geometry.membership import distance
from scenicq.geometry.regions import Disc, PolygonSet, UnionOf, union
from scenicq.limits import LIMITS
from scenicq.query.prefilter.decision import new_table
from scenicq.query.prefilter.regions import RegionNames, nearest_box

LINE = STREET.lanes[0].centerline


@pytest.mark.parametrize(
    "region",
    [STREET.intersectionRegion, STREET.crossingRegion, STREET.laneRegion, STREET.shoulderRegion, LINE,
     union(STREET.crossingRegion, LINE)],
    ids=["intersections", "crossings", "lanes", "shoulders", "line", "union"],
)  # fmt: skip
def test_no_region_is_nearer_than_the_nearest_box(region):
    names = RegionNames(STREET)
    rng = random.Random(4)
    points = [(rng.uniform(-150, 150), rng.uniform(-150, 150)) for _ in range(300)]
    with duckdb.connect() as connection:
        bound = nearest_box(region, names, "p.x", "p.y")
        assert bound is not None
        for table, query in names.tables.items():
            connection.execute(new_table(table, query))
        values = ", ".join(f"({number}, {x!r}::DOUBLE, {y!r}::DOUBLE)" for number, (x, y) in enumerate(points))
        (missing,) = connection.execute(f"SELECT {bound} FROM (VALUES (NULL::DOUBLE, 1.0)) p(x, y)").fetchone()
        rows = connection.execute(f"SELECT {bound} FROM (VALUES {values}) p(n, x, y) ORDER BY n").fetchall()
    assert missing is None
    tight = 0
    for (low,), point in zip(rows, points, strict=True):
        exact = distance(region, *point)
        assert 0 <= low <= exact + 1e-9
        tight += math.isclose(low, exact, abs_tol=1e-6)
    assert tight > 20


def test_what_is_not_made_of_few_pieces_has_no_box():
    names = RegionNames(STREET)
    polygon = STREET.lanes[0].polygon
    many = PolygonSet((polygon,) * (LIMITS.region_boxes + 1), "many")
    for region in (Disc((0.0, 0.0), 1.0), UnionOf((STREET.crossingRegion, Disc((0.0, 0.0), 1.0))), many,
                   PolygonSet((), "nothing")):  # fmt: skip
        assert nearest_box(region, names, "x", "y") is None
    assert not names.tables
