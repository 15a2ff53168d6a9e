"""Regions that are known once the label is, as tests of positions: of one, or of columns of them.

A position that surely lies in a region is a point of it. Within tolerance of the boundary nothing is said.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TypeAlias, cast

import numpy as np
from numpy.typing import NDArray

from scenicq.forest.nodes import (
    Constant,
    DiscAt,
    Identity,
    Node,
    RectangleAt,
    RegionDifference,
    RegionIntersection,
    RegionUnion,
    SectorAt,
    Select,
    Value,
)
from scenicq.forest.walk import children, postorder
from scenicq.geometry.membership import distance, may_be_within
from scenicq.geometry.regions import Disc, Rectangle, Region, Sector
from scenicq.geometry.shape_distances import to_discs, to_rectangles, to_sectors
from scenicq.limits import LIMITS
from scenicq.match.decide.closed_form import each_position
from scenicq.match.decide.compiled_expressions import CompiledExpressions
from scenicq.match.decide.range_forms import Columns, Exact, Lookup, Scalar, by_option
from scenicq.match.problem.map_lookups import XY, MapLookups

__all__ = ["RegionTest", "region_test"]


_Truths: TypeAlias = "bool | NDArray[np.bool_]"
_Test: TypeAlias = Callable[[Lookup, Value, MapLookups, float], "tuple[_Truths, _Truths]"]
"""From what is observed, a position, what is known of the map and the tolerance, whether the position surely lies in a
region, and whether it surely lies further than the tolerance from it; of columns, columns."""


@dataclass(frozen=True, slots=True, eq=False)
class RegionTest:
    """A region as a test.

    Attributes:
        evaluate: The test.
        regions: Those of the map that it asks for.
    """

    evaluate: _Test
    regions: tuple[Region, ...]


def region_test(root: Node, chosen: Mapping[Identity, float]) -> RegionTest | None:
    """The test of a region; None if something else about it is random, or it is made of too many.

    Args:
        root: The region.
        chosen: The number of the option of each choice.
    """
    formulas = CompiledExpressions(chosen)
    made: dict[int, _Test | None] = {}
    regions: dict[int, Region] = {}
    parts = 0
    options = {id(option) for node in postorder((root,)) if isinstance(node, Select) for option in node.options}
    for node in postorder((root,)):
        match node:
            case Constant() if isinstance(node.value, Region):
                if id(node) not in options:
                    regions[id(node.value)] = node.value
                made[id(node)] = _constant(node.value)
            case Select() if (number := formulas.exact(node.index)) is not None:
                made[id(node)] = _selected(cast(Scalar, number), [made.get(id(option)) for option in node.options])
            case DiscAt() | SectorAt() | RectangleAt():
                made[id(node)] = _placed(node, [formulas.exact(child) for child in children(node)])
            case RegionUnion() | RegionIntersection() | RegionDifference():
                below = [made.get(id(child)) for child in children(node)]
                parts += len(below)
                tests = [test for test in below if test is not None]
                made[id(node)] = _combined(node, tests) if len(tests) == len(below) > 0 else None
            case _:
                continue
    test = made.get(id(root))
    return None if test is None or parts > LIMITS.closed_form_regions else RegionTest(test, tuple(regions.values()))


def _constant(region: Region) -> _Test:
    def test(get: Lookup, position: Value, lookups: MapLookups, reach: float) -> tuple[_Truths, _Truths]:
        places = each_position(position)
        held = np.array(lookups.within(region, places), dtype=np.bool_)
        missed = np.zeros(len(places), dtype=np.bool_)
        missed[~held] = ~may_be_within(region, np.array(places)[~held], reach)
        return (held, missed) if isinstance(get, Columns) else (bool(held[0]), bool(missed[0]))

    return test


def _selected(number: Scalar, tests: list[_Test | None]) -> _Test:
    """Each place in the region that is meant there; nothing is said where that is none or has no test."""

    def test(get: Lookup, position: Value, lookups: MapLookups, reach: float) -> tuple[_Truths, _Truths]:
        if not isinstance(get, Columns):
            one = tests[round(number(get))]
            return (False, False) if one is None else one(get, position, lookups, reach)
        held, missed = np.zeros((2, get.size), dtype=np.bool_)
        for option, mine in by_option(number, get, get.size):
            one = tests[option]
            if one is not None:
                x, y = cast("tuple[NDArray[np.float64], NDArray[np.float64]]", position)
                some = get.some(mine)
                held[mine], missed[mine] = one(some, cast(Value, (x[mine], y[mine])), lookups, reach)
        return held, missed

    return test


def _placed(node: DiscAt | SectorAt | RectangleAt, known: list[Exact | None]) -> _Test | None:
    if any(each is None for each in known):
        return None
    center, *numbers = cast("list[Exact]", known)
    of_many = {DiscAt: to_discs, SectorAt: to_sectors, RectangleAt: to_rectangles}[type(node)]
    kind = {DiscAt: Disc, SectorAt: Sector, RectangleAt: Rectangle}[type(node)]

    def test(get: Lookup, position: Value, lookups: MapLookups, reach: float) -> tuple[_Truths, _Truths]:
        (x, y), given = cast(XY, center(get)), [number(get) for number in numbers]
        px, py = cast(XY, position)
        if isinstance(get, Columns):
            off = np.broadcast_to(of_many(px - x, py - y, *given), get.size)
        else:
            off = distance(cast(Region, kind((x, y), *given)), px, py)  # type: ignore[arg-type]
        return off <= 0.0, off > reach

    return test


def _combined(node: RegionUnion | RegionIntersection | RegionDifference, tests: list[_Test]) -> _Test:
    if isinstance(node, RegionDifference):
        base, removed = tests

        def without(get: Lookup, position: Value, lookups: MapLookups, reach: float) -> tuple[_Truths, _Truths]:
            held, missed = base(get, position, lookups, reach)
            # whoever is surely off what is removed, by whatever little
            _, off = removed(get, position, lookups, 0.0)
            return held & off, missed

        return without
    each_holds = isinstance(node, RegionIntersection)

    def test(get: Lookup, position: Value, lookups: MapLookups, reach: float) -> tuple[_Truths, _Truths]:
        held, missed = tests[0](get, position, lookups, reach)
        for one in tests[1:]:
            also, off = one(get, position, lookups, reach)
            held, missed = (held & also, missed | off) if each_holds else (held | also, missed & off)
        return held, missed

    return test
