"""Operations on areas have a result for any polygons, also such as GEOS cannot tell how their edges cross."""

from __future__ import annotations

import ast
import random
from pathlib import Path

import numpy as np
import pytest
import shapely

import scenicq
from scenicq.geometry import shapes

OVERLAYS = {
    "difference", "disjoint_subset_union_all", "intersection", "intersection_all", "symmetric_difference",
    "unary_union", "union", "union_all",
}  # fmt: skip
ELSEWHERE = {"geometry/shapes.py", "importers/opendrive_worker.py"}
"""The helpers themselves; what runs where scenicq is not."""


def test_all_of_scenicq_goes_through_them():
    root = Path(scenicq.__file__).parent
    for path in root.rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        if "shapely" not in text or path.relative_to(root).as_posix() in ELSEWHERE:
            continue
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "shapely":
                assert node.attr not in OVERLAYS, (path, node.lineno)
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("shapely"):
                assert not {each.name for each in node.names} & OVERLAYS, (path, node.lineno)


OPERATIONS = {
    "union": lambda a, b: shapes.union_all([a, b]),
    "snapped union": lambda a, b: shapes.snapped_union([a, b]),
    "intersection": shapes.intersection,
    "difference": shapes.difference,
    "shared area": lambda a, b: shapes.shared_areas(np.array([a]), np.array([b])),
    "division": lambda a, b: shapes.divide_polygon(a, [b]),
}


def crooked(rng: random.Random) -> shapely.Polygon:
    """A polygon of few corners on a coarse grid, nearly: it crosses itself, folds back and touches others."""
    corners = [(rng.randint(0, 4) + rng.choice((0, 1e-12, 3e-10)), rng.randint(0, 4)) for _ in range(rng.randint(3, 8))]
    return shapely.Polygon(corners)


@pytest.mark.parametrize("name", OPERATIONS)
@pytest.mark.one_in(3)
def test_they_have_a_result_for_polygons_that_cross_themselves(name):
    rng = random.Random(name)
    for _ in range(300):
        OPERATIONS[name](crooked(rng), crooked(rng))


@pytest.mark.parametrize("failures", [0, 1, 2, 3, 4])
@pytest.mark.parametrize("name", OPERATIONS)
def test_they_go_on_where_geos_fails(name, failures, monkeypatch):
    """The result is that of the exact operation, within the grid, however often GEOS fails before."""
    a, b = shapely.box(0, 0, 3, 2), shapely.box(1, 1, 4, 4)
    wanted = OPERATIONS[name](a, b)
    function = "intersection" if name.startswith(("inter", "shared")) else name if name == "difference" else "union_all"
    plain, left = getattr(shapely, function), [failures - (name == "snapped union" and failures > 0)]

    def failing(*operands, **options):
        if left[0]:
            left[0] -= 1
            raise shapely.GEOSException("TopologyException: found non-noded intersection")
        return plain(*operands, **options)

    monkeypatch.setattr(shapely, function, failing)
    found = OPERATIONS[name](a, b)
    if name == "division":
        found, wanted = shapes.union_all(found), shapes.union_all(wanted)
    if name == "shared area":
        assert found == pytest.approx(wanted)
    else:
        assert shapely.symmetric_difference(found, wanted).area < 1e-4
