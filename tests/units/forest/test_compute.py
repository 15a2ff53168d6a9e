"""The meaning of nodes is total: of values of any kinds it is a value, or a question that cannot be answered.

Only where a region is asked for there is one: the compiler sees to that, and no label says what a region is.
"""

import itertools
from contextlib import suppress

import pytest

from scenicq.errors import CannotEvaluate
from scenicq.forest.compute import compute, directions
from scenicq.forest.kinds import kind_of_value
from scenicq.forest.nodes import (
    Arithmetic,
    ArithmeticOp,
    Bearing,
    Compare,
    CompareOp,
    Constant,
    Contains,
    Coordinate,
    DiscAt,
    Distance,
    Encloses,
    Intersects,
    Logic,
    LogicOp,
    Norm,
    RectangleAt,
    RegionDifference,
    RegionIntersection,
    RegionUnion,
    Rotate,
    Scale,
    SectorAt,
    Select,
    Undefined,
    VectorOf,
    VectorSum,
)
from scenicq.forest.walk import children
from scenicq.geometry.default_street import street
from scenicq.geometry.regions import Disc, Rectangle

STREET = street()
VALUES = (
    0.0, -2.0, 1e308, 0.5, True, False, "text", "", None, (1.0, 2.0), (1e308, -1e308), Undefined("nothing"),
    Disc((0.0, 0.0), 2.0), Rectangle((1.0, 1.0), 0.3, 2.0, 4.0), STREET.intersectionRegion, STREET.roadDirection,
)  # fmt: skip
REGIONS = [value for value in VALUES if kind_of_value(value) == "region"]
X = Constant(None)
UNARY = {
    ArithmeticOp.NEG, ArithmeticOp.ABS, ArithmeticOp.SQRT, ArithmeticOp.SIN, ArithmeticOp.COS, ArithmeticOp.TAN,
    ArithmeticOp.ASIN, ArithmeticOp.ACOS, ArithmeticOp.ATAN, ArithmeticOp.EXP, ArithmeticOp.LOG, ArithmeticOp.FLOOR,
    ArithmeticOp.CEIL, ArithmeticOp.WRAP,
}  # fmt: skip
NODES = [
    *(Arithmetic(op, (X,) if op in UNARY else (X, X)) for op in ArithmeticOp),
    *(Compare(op, X, X) for op in CompareOp),
    *(Logic(op, (X,) if op is LogicOp.NOT else (X, X)) for op in LogicOp),
    Select(X, (X,)), Coordinate(X, 0), Coordinate(X, 1), Norm(X), Bearing(X), VectorOf(X, X), VectorSum(X, X),
    Scale(X, X), Rotate(X, X), DiscAt(X, X), SectorAt(X, X, X, X), RectangleAt(X, X, X, X), RegionUnion((X, X)),
    RegionIntersection((X, X)), RegionDifference(X, X), Contains(X, X), Distance(X, X), Intersects(X, X),
    Encloses(X, X),
]  # fmt: skip


def name_of(node):
    return f"{type(node).__name__}{getattr(node, 'op', '')}"


@pytest.mark.parametrize("node", NODES, ids=name_of)
def test_values_of_any_kinds_give_a_value_or_a_question_without_answer(node):
    size = len(children(node))
    given = VALUES if size <= 2 else (0.5, -2.0, True, "text", (1.0, 2.0), REGIONS[0])
    match node:
        case Contains() | Distance():
            places = [REGIONS, given]
        case RegionUnion() | RegionIntersection() | RegionDifference() | Intersects() | Encloses():
            places = [REGIONS, REGIONS]
        case Select():
            places = [[value for value in VALUES if value == 0 or not isinstance(value, bool | float)], VALUES]
        case _:
            places = [given] * size
    for args in itertools.product(*places):
        with suppress(CannotEvaluate):
            assert kind_of_value(compute(node, args))


@pytest.mark.parametrize("field", VALUES, ids=lambda value: type(value).__name__)
def test_directions_of_anything_anywhere(field):
    for point in VALUES:
        try:
            found = directions(field, point)
        except CannotEvaluate:
            continue
        assert isinstance(found, Undefined) or (kind_of_value(field) == "field" and kind_of_value(point) == "vector")
