"""The constructors of combined regions simplify without changing what the region is."""

# pyright: basic

import pytest
from shapely.geometry import LineString, MultiPolygon, box

from scenicq.geometry.regions import (
    DifferenceOf,
    Disc,
    Everywhere,
    IntersectionOf,
    Nowhere,
    PolygonSet,
    UnionOf,
    difference,
    intersection,
    orientation_of,
    union,
)
from scenicq.geometry.road_direction import along_lines

A, B, C = (Disc((float(x), 0.0), 1.0) for x in range(3))


def test_union_flattens() -> None:
    nested = union(union(A, B), Nowhere(), C)
    assert isinstance(nested, UnionOf)
    assert nested.parts == (A, B, C)
    assert union(A) is A
    assert isinstance(union(), Nowhere)
    assert isinstance(union(A, Everywhere()), Everywhere)


def test_intersection_flattens() -> None:
    nested = intersection(intersection(A, B), Everywhere(), C)
    assert isinstance(nested, IntersectionOf)
    assert nested.parts == (A, B, C)
    assert intersection(A) is A
    assert isinstance(intersection(), Everywhere)
    assert isinstance(intersection(A, Nowhere()), Nowhere)


def test_difference_collects_what_is_removed() -> None:
    twice = difference(difference(A, B), C)
    assert isinstance(twice, DifferenceOf)
    assert twice.base is A
    assert isinstance(twice.removed, UnionOf)
    assert twice.removed.parts == (B, C)
    assert difference(A, Nowhere()) is A
    assert isinstance(difference(A, Everywhere()), Nowhere)


def test_regions_have_identity() -> None:
    assert Disc((0, 0), 1) != Disc((0, 0), 1)
    assert len({A, A, B}) == 2


def test_a_polygon_set_finds_the_pieces_of_its_polygons() -> None:
    parts = (box(0, 0, 1, 1), MultiPolygon([box(5, 0, 6, 1), box(10, 0, 11, 1)]))
    region = PolygonSet(parts, "three")
    assert len(region.pieces) == 3
    assert region.near((5.5, 0, 12, 1)) == [box(5, 0, 6, 1), box(10, 0, 11, 1)]
    assert region.extent == (0, 0, 11, 1)
    assert "1 1" not in repr(region)


@pytest.mark.parametrize("wrap", [lambda r: intersection(A, r), lambda r: difference(r, A), lambda r: union(A, r)])
def test_combinations_keep_the_orientation(wrap) -> None:  # pyright: ignore
    field = along_lines([LineString([(0, 0), (1, 1)])], "diagonal")
    oriented = PolygonSet((box(0, 0, 1, 1),), "oriented", field)
    assert orientation_of(wrap(oriented)) is field
    assert orientation_of(A) is None
