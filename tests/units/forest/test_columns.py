"""The domain of columns agrees with plain evaluation, place by place, in values and in what has none."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

sys.path.insert(0, str(Path(__file__).parent))
from expressions import expressions
from test_intervals import observing

from scenicq.errors import CannotEvaluate
from scenicq.forest import build
from scenicq.forest.column_domain import ColumnDomain
from scenicq.forest.columns import (
    DEFINED,
    UNDEFINED,
    UNKNOWN,
    CodedValues,
    Column,
    PlacedRegions,
    column_of,
    constant_column,
    truth_of,
)
from scenicq.forest.evaluate import evaluate
from scenicq.forest.interpret import interpret, steps_of
from scenicq.forest.nodes import (
    Arithmetic,
    ArithmeticOp,
    Bearing,
    Compare,
    CompareOp,
    Contains,
    Coordinate,
    DirectionAt,
    DiscAt,
    Distance,
    Encloses,
    Feature,
    Intersects,
    Logic,
    LogicOp,
    Norm,
    RectangleAt,
    RegionUnion,
    Rotate,
    Scale,
    SectorAt,
    Select,
    Undefined,
    VectorOf,
    VectorSum,
)
from scenicq.geometry.default_street import street
from scenicq.geometry.membership import contains, contains_many, distance
from scenicq.geometry.regions import Disc, PolygonSet, Rectangle, Sector

ROWS, DRAWS = 3, 4
X, Y = Feature(0, "x", "scalar"), Feature(0, "y", "scalar")
AT = VectorOf(X, Y)


def domain_of(values, drawn=None, pick=lambda node, counts: np.zeros(1, np.intp), most=math.inf):
    return ColumnDomain(
        lambda node: values.get((node.object, node.property), Column(np.full(1, np.nan), np.full(1, UNKNOWN))),
        lambda leaf, args: constant_column((drawn or {})[leaf.identity]),
        pick,
        most,
    )


def computed(root, domain):
    with np.errstate(all="ignore"):
        return interpret(steps_of(root), domain)[id(root)]


def at(array, place, shape):
    return np.broadcast_to(array, shape)[place].item()


def agrees(column, place, shape, expected):
    """Whether a column has an expected value at a place, or none where that is undefined."""
    status = at(column.status, place, shape)
    if isinstance(expected, Undefined):
        return status == UNDEFINED
    assert status == DEFINED
    axes = column.data if isinstance(column.data, tuple) else (column.data,)
    parts = expected if isinstance(expected, tuple) else (expected,)
    return all(
        at(axis, place, shape) == pytest.approx(part, rel=1e-9, abs=1e-6)
        for axis, part in zip(axes, parts, strict=True)
    )


@given(expressions(), st.integers(0, 1000))
@settings(max_examples=200, deadline=None, derandomize=True)
def test_columns_have_the_value_of_each_place(case, seed):
    """Labels along one axis, draws along another; the condition has a seam nowhere near."""
    root, kinds = observing(case[0])
    rng = np.random.default_rng(seed)
    shapes = [(ROWS, 1) if n % 2 else (1, DRAWS) for n, _ in kinds]
    columns = {
        (n, "seen"): Column(
            (rng.uniform(-9, 9, shape), rng.uniform(-9, 9, shape)) if kind == "vector" else rng.uniform(-9, 9, shape),
            np.full(1, DEFINED),
        )
        for (n, kind), shape in zip(kinds, shapes, strict=True)
    }
    far = Compare(CompareOp.GT, Norm(root), build.constant(30.0))
    held = Contains(
        RectangleAt(root, Coordinate(root, 0), build.constant(6.0), build.constant(9.0)), build.constant((1.0, 2.0))
    )
    both = Logic(LogicOp.OR, (far, held))
    for wanted in (root, both):
        found = computed(wanted, domain_of(columns, case[1]))
        for place in np.ndindex(ROWS, DRAWS):
            seen = {
                key: tuple(at(axis, place, (ROWS, DRAWS)) for axis in column.data)
                if isinstance(column.data, tuple)
                else at(column.data, place, (ROWS, DRAWS))
                for key, column in columns.items()
            }
            try:
                expected = evaluate(wanted, case[1], seen)
            except CannotEvaluate:
                continue
            assert agrees(found, place, (ROWS, DRAWS), expected)


def test_what_is_undefined_or_unknown_spreads_and_nothing_else():
    values = {(0, "x"): column_of([4.0, -4.0, None]), (0, "y"): column_of([1.0, 1.0, 1.0])}
    root = Arithmetic(ArithmeticOp.SQRT, (X,))
    low, certain = (Compare(CompareOp.LT, node, build.constant(3.0)) for node in (root, Y))
    domain = domain_of(values)
    assert computed(low, domain).status.tolist() == [DEFINED, UNDEFINED, UNKNOWN]
    either, both = (
        computed(Logic(LogicOp.OR, (low, certain)), domain),
        computed(Logic(LogicOp.AND, (low, certain)), domain),
    )
    assert either.status.tolist() == [DEFINED] * 3
    assert either.data.tolist() == [True] * 3
    assert both.status.tolist() == [DEFINED, UNDEFINED, UNKNOWN]
    index = Feature(0, "which", "scalar")
    chosen = computed(Select(index, (root, Y)), domain_of({**values, (0, "which"): column_of([0.0, 1.0, 1.0])}))
    assert chosen.status.tolist() == [DEFINED] * 3
    assert chosen.data.tolist() == [2.0, 1.0, 1.0]


def test_texts_and_regions_are_compared_once_for_equal_ones():
    colour = Feature(0, "colour", "other")
    values = {(0, "colour"): column_of(["red", "blue", "red", None]), (0, "x"): column_of([1.0, 2.0, 30.0, 4.0])}
    found = computed(Compare(CompareOp.EQ, colour, build.constant("red")), domain_of(values))
    assert found.status.tolist() == [DEFINED, DEFINED, DEFINED, UNKNOWN]
    assert found.data[:3].tolist() == [True, False, True]
    mixed = computed(Compare(CompareOp.EQ, colour, X), domain_of(values))
    assert mixed.data[:3].tolist() == [False] * 3
    point = VectorOf(X, build.constant(0.0))
    small, large = (build.constant(Disc((0.0, 0.0), radius)) for radius in (1.5, 10.0))
    union = RegionUnion((DiscAt(point, X), small))
    for region in (small, Select(Feature(0, "which", "scalar"), (small, large)), union):
        which = {(0, "which"): column_of([0.0, 1.0, 1.0, 0.0])}
        held = computed(Contains(region, point), domain_of({**values, **which}))
        expected = [
            evaluate(Contains(region, point), {}, {(0, "x"): x, (0, "which"): w})
            for x, w in ((1.0, 0.0), (2.0, 1.0), (30.0, 1.0), (4.0, 0.0))
        ]
        assert held.data.tolist() == expected
    touching = computed(Intersects(DiscAt(point, build.constant(1.0)), small), domain_of(values))
    assert touching.data.tolist() == [True, True, False, False]


def test_shapes_at_columns_agree_with_regions():
    rng = np.random.default_rng(3)
    rows = 300
    x, y, heading = rng.uniform(-9, 9, rows), rng.uniform(-9, 9, rows), rng.uniform(-4, 4, rows)
    radius, angle = rng.uniform(0, 9, rows), rng.uniform(0, 7, rows)
    numbers = {"x": x, "y": y, "heading": heading, "radius": radius, "angle": angle}
    values = {(0, name): Column(each, np.full(1, DEFINED)) for name, each in numbers.items()}
    by_name = {name: Feature(0, name, "scalar") for name in numbers}
    centre, target = build.constant((1.0, -2.0)), VectorOf(X, Y)
    shapes = {
        DiscAt(centre, by_name["radius"]): lambda k: Disc((1.0, -2.0), radius[k]),
        SectorAt(centre, by_name["radius"], by_name["heading"], by_name["angle"]): lambda k: Sector(
            (1.0, -2.0), radius[k], heading[k], angle[k]
        ),
        RectangleAt(centre, by_name["heading"], by_name["radius"], by_name["angle"]): lambda k: Rectangle(
            (1.0, -2.0), heading[k], radius[k], angle[k]
        ),
    }
    for node, region in shapes.items():
        domain = domain_of(values)
        assert isinstance(computed(node, domain).data, PlacedRegions)
        away, held = computed(Distance(node, target), domain), computed(Contains(node, target), domain)
        for k in range(rows):
            assert away.data[k] == pytest.approx(distance(region(k), x[k], y[k]), abs=1e-9)
            assert held.data[k] == contains(region(k), x[k], y[k])
    fixed = Sector((0.0, 1.0), 7.0, 0.4, 1.0)
    many = contains_many(fixed, np.column_stack((x, y)))
    assert many.tolist() == [contains(fixed, *point) for point in zip(x, y, strict=True)]


def test_many_places_are_asked_together_of_chosen_regions(monkeypatch):
    """Boxes and points against the region that is chosen at each place, of which one may be missing."""
    lanes = [PolygonSet((lane.polygon,), "lane") for lane in street().lanes[:6]]
    both = PolygonSet(tuple(lane.polygon for lane in street().lanes[:6]), "lanes")
    rng = np.random.default_rng(8)
    west, south, east, north = both.extent
    rows = 400
    numbers = {
        "x": rng.uniform(west - 3, east + 3, rows),
        "y": rng.uniform(south - 3, north + 3, rows),
        "heading": rng.choice([0.0, math.pi / 2, 0.3], rows),
        "width": rng.choice([0.0, 0.5, 1.9], rows),
        "length": rng.choice([0.5, 4.6], rows),
        "which": rng.integers(0, len(lanes) + 2, rows).astype(float),
    }
    by_name = {name: Feature(0, name, "scalar") for name in numbers}
    values = {(0, name): Column(each, np.full(1, DEFINED)) for name, each in numbers.items()}
    region = Select(by_name["which"], tuple(map(build.constant, (*lanes, both, Undefined("no lane")))))
    point = VectorOf(X, Y)
    box = RectangleAt(point, by_name["heading"], by_name["width"], by_name["length"])
    asked = [Encloses(region, box), Distance(region, point), Contains(region, point)]
    expected = [
        [evaluate(node, {}, {(0, name): float(each[row]) for name, each in numbers.items()}) for row in range(rows)]
        for node in asked
    ]
    one_by_one = []
    monkeypatch.setattr("scenicq.forest.column_domain.compute", lambda *args: one_by_one.append(args))
    for node, wanted in zip(asked, expected, strict=True):
        data, status = computed(node, domain_of(values))
        found = np.broadcast_to(data, rows).tolist()
        for row, each in enumerate(wanted):
            missing = isinstance(each, Undefined)
            assert np.broadcast_to(status, rows)[row] == (UNDEFINED if missing else DEFINED)
            assert missing or found[row] == each
    assert not one_by_one
    assert {each for each in expected[0] if isinstance(each, bool)} == {True, False}


def test_directions_are_picked_where_a_field_allows_several():
    network = street()
    field = build.constant(network.roadDirection)
    xy = np.random.default_rng(5).uniform(-60, 60, (200, 2))
    allowed = network.roadDirection.values_many(xy)
    values = {(0, "x"): Column(xy[:, 0], np.full(1, DEFINED)), (0, "y"): Column(xy[:, 1], np.full(1, DEFINED))}
    met = []

    def pick(node, counts):
        met.append(counts.tolist())
        return np.full(1, 1)

    found = computed(DirectionAt(field, AT), domain_of(values, pick=pick))
    for heading, status, each in zip(found.data.tolist(), found.status.tolist(), allowed, strict=True):
        assert status == (DEFINED if each else UNDEFINED)
        assert not each or heading == each[min(1, len(each) - 1)]
    assert met == [list(map(len, allowed))]
    with pytest.raises(CannotEvaluate, match="directions at 200 points"):
        computed(DirectionAt(field, AT), domain_of(values, most=100))


def test_a_heading_of_a_vector():
    values = {(0, "x"): column_of([0.0, -1.0, 0.0]), (0, "y"): column_of([1.0, 0.0, 0.0])}
    assert computed(Bearing(AT), domain_of(values)).data.tolist() == pytest.approx([0.0, math.pi / 2, -math.pi / 2])


@pytest.mark.parametrize("kind", ["scalar", "boolean", "vector", "other"])
@pytest.mark.parametrize(
    "seen",
    [["much", 2.0, None], ["much"] * 3, [True, False, True], [1.0, 2.0, 3.0], [(1.0, 2.0)] * 3, [(1.0, 2.0), "a", 1.0]],
)
def test_what_is_observed_is_undefined_where_it_is_of_another_kind(kind, seen):
    mood = Feature(0, "mood", kind)
    column = computed(mood, domain_of({(0, "mood"): column_of(seen)}))
    for place, value in enumerate(seen):
        if value is None:
            assert at(column.status, place, (3,)) == UNKNOWN
            continue
        expected = evaluate(mood, {}, {(0, "mood"): value})
        if isinstance(expected, Undefined | float | bool | tuple):
            assert not isinstance(column.data, CodedValues) or column.data.options[column.data.which[place]] == expected
            if not isinstance(column.data, CodedValues):
                assert agrees(column, place, (3,), expected)
        else:
            assert kind == "other"
            assert isinstance(column.data, CodedValues)


@pytest.mark.parametrize("text", ["much", ""])
def test_directions_at_what_is_no_point_are_undefined(text):
    root = DirectionAt(build.constant(street().roadDirection), Feature(0, "mood", "vector"))
    column = computed(root, domain_of({(0, "mood"): column_of([text, (1.75, 20.0), text])}))
    assert np.broadcast_to(column.status, (3,)).tolist() == [UNDEFINED, DEFINED, UNDEFINED]


class _Fork:
    """Three headings to the right, one in the middle, none to the left."""

    name = "fork"

    def values(self, x, y):
        return (0.1, 0.2, 0.3) if x > 1 else (0.5,) if x >= -1 else ()

    def values_many(self, xy):
        return [self.values(x, y) for x, y in xy.tolist()]

    def cells(self, bounds):
        return []


@pytest.mark.parametrize("wanted", [0, 1, 2, 7])
def test_the_heading_that_is_picked_is_taken_or_the_last(wanted):
    values = {(0, "x"): column_of([2.0, 0.0, -2.0, 3.0]), (0, "y"): column_of([0.0] * 4)}
    root = DirectionAt(build.constant(_Fork()), AT)
    found = computed(root, domain_of(values, pick=lambda node, counts: np.full(1, wanted)))
    assert found.status.tolist() == [DEFINED, DEFINED, UNDEFINED, DEFINED]
    taken = (0.1, 0.2, 0.3)[min(wanted, 2)]
    assert [found.data[place] for place in (0, 1, 3)] == [taken, 0.5, taken]


NUMERIC = {
    "vector": AT, "sum": VectorSum(AT, AT), "scale": Scale(AT, X), "rotate": Rotate(AT, Y), "norm": Norm(AT),
    "coordinate": Coordinate(VectorSum(AT, AT), 1), "bearing": Bearing(AT), "compare": Compare(CompareOp.LT, X, Y),
    "arithmetic": Arithmetic(ArithmeticOp.ATAN2, (X, Y)), "one": Arithmetic(ArithmeticOp.COS, (X,)),
    "not": Logic(LogicOp.NOT, (Compare(CompareOp.LT, X, Y),)), "select": Select(Compare(CompareOp.LT, X, Y), (X, Y)),
    "vectors": Select(Compare(CompareOp.LT, X, Y), (AT, VectorSum(AT, AT))), "disc": Contains(DiscAt(AT, X), AT),
    "box": Distance(RectangleAt(AT, X, X, Y), VectorSum(AT, AT)),
}  # fmt: skip


@pytest.mark.parametrize("name", NUMERIC)
def test_numbers_and_vectors_are_computed_for_all_places_together(name):
    rng = np.random.default_rng(3)
    values = {(0, key): Column(rng.uniform(0.5, 9, 50), np.full(1, DEFINED)) for key in "xy"}
    found = computed(NUMERIC[name], domain_of(values, most=0))
    for place in range(50):
        seen = {key: float(column.data[place]) for key, column in values.items()}
        assert agrees(found, place, (50,), evaluate(NUMERIC[name], {}, seen))


@pytest.mark.parametrize(
    "value", [2.0, True, (1.0, 2.0), "text", None, Disc((0.0, 0.0), 1.0), Undefined("nothing there")], ids=repr
)
def test_a_value_that_is_the_same_everywhere_is_so_at_any_number_of_places(value):
    column = constant_column(value)
    parts = column.data if isinstance(column.data, tuple) else (column.data,)
    arrays = [part.which if isinstance(part, CodedValues) else part for part in parts]
    for count in (1, 5):
        assert {np.broadcast_to(each, count).shape for each in (*arrays, column.status)} == {(count,)}
        assert np.broadcast_to(truth_of(column.data), count).shape == (count,)
