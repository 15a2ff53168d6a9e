"""The passes over the forest agree with plain evaluation."""

from __future__ import annotations

import math
import random
import sys
from pathlib import Path

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

sys.path.insert(0, str(Path(__file__).parent))
from drawing import draw_scene
from expressions import expressions, near

from scenicq.compiler.program import compile_scenario
from scenicq.errors import Source
from scenicq.forest import build
from scenicq.forest.bounds import point_boxes, vector_bounds
from scenicq.forest.condition import condition, expand
from scenicq.forest.evaluate import admits, evaluate
from scenicq.forest.groups import Comparison, group_constraints
from scenicq.forest.interval_ends import FLOATS
from scenicq.forest.intervals import IntervalDomain
from scenicq.forest.nodes import (
    Arithmetic,
    ArithmeticOp,
    Compare,
    CompareOp,
    Constant,
    DirectionAt,
    Feature,
    Index,
    Logic,
    LogicOp,
    PointIn,
    Range,
    Scale,
    Select,
    Undefined,
)
from scenicq.forest.show import show
from scenicq.forest.simplify import simplify
from scenicq.forest.walk import features, leaves, postorder, transform
from scenicq.geometry.default_street import street
from scenicq.geometry.membership import contains
from scenicq.geometry.regions import PolygonSet

STREET = street()


def compiled(text: str):
    return compile_scenario(Source("test.scenic", "model scenic.domains.driving.model\n" + text), STREET)


def interval(low: float, high: float) -> Range:
    return Range(build.constant(low), build.constant(high))


@given(expressions())
@settings(max_examples=300, deadline=None)
def test_values_lie_within_bounds(case):
    root, values = case
    value = evaluate(root, values)
    assume(not isinstance(value, Undefined))
    for number, (low, high) in zip(value, vector_bounds(root), strict=True):
        slack = 1e-9 * max(1.0, abs(number))
        assert low - slack <= number <= high + slack


@given(expressions())
@settings(max_examples=300, deadline=None)
def test_a_point_lies_in_the_box_that_its_expression_leaves_it(case):
    root, values = case
    value = evaluate(root, values)
    assume(not isinstance(value, Undefined))
    boxes = point_boxes(root, tuple((number - 0.1, number + 0.1) for number in value))
    for identity, box in boxes.items():
        for number, (low, high) in zip(values[identity], box, strict=True):
            slack = 1e-6 * max(1.0, abs(number), *(abs(v) for v in value))
            assert low - slack <= number <= high + slack


@given(expressions())
@settings(max_examples=300, deadline=None)
def test_conditioning_on_all_variables_is_evaluating(case):
    root, values = case
    folded = condition(root, {}, values)
    assert isinstance(folded, Constant)
    expected = evaluate(root, values)
    if isinstance(expected, Undefined):
        assert isinstance(folded.value, Undefined)
    else:
        assert all(near(a, b) for a, b in zip(folded.value, expected, strict=True))


@given(expressions(), st.integers(0, 5))
@settings(max_examples=200, deadline=None)
def test_conditioning_on_some_variables_keeps_the_others(case, number):
    root, values = case
    some = dict(list(values.items())[: number % (len(values) + 1)])
    folded = condition(root, {}, some)
    rest = {leaf.identity for leaf in leaves(folded)}
    assert rest <= values.keys() - some.keys()
    expected, found = evaluate(root, values), evaluate(folded, values)
    if not isinstance(expected, Undefined) and not isinstance(found, Undefined):
        assert all(near(a, b) for a, b in zip(found, expected, strict=True))


def test_one_range_used_twice_is_one_variable_and_two_alike_are_two():
    twice = interval(0, 1)
    one = Arithmetic(ArithmeticOp.SUB, (twice, twice))
    two = Arithmetic(ArithmeticOp.SUB, (interval(0, 1), interval(0, 1)))
    assert len(leaves(one)) == 1
    assert len(leaves(two)) == 2
    assert show(one) != show(two)
    assert show(two) == show(Arithmetic(ArithmeticOp.SUB, (interval(0, 1), interval(0, 1))))


def test_rewriting_a_variable_s_parameters_keeps_its_identity():
    leaf = Range(build.constant(0.0), Feature(0, "width", "scalar"))
    (changed,) = leaves(condition(leaf, {(0, "width"): 2.0}))
    assert changed is not leaf
    assert changed.identity is leaf.identity


def test_a_chain_of_ten_thousand_nodes_is_no_problem():
    node = interval(0, 1)
    for _ in range(10_000):
        node = Arithmetic(ArithmeticOp.ADD, (node, build.constant(1.0)))
    assert len(list(postorder((node,)))) == 20_003
    assert evaluate(node, {leaves(node)[0].identity: 0.5}) == 10_000.5
    assert show(transform(node, lambda part: part)) == show(node)


def test_an_undefined_part_makes_a_conjunction_undefined_unless_it_is_false_anyway():
    nowhere = Constant(Undefined("far from roads"))
    false, true = build.constant(False), build.constant(True)
    assert condition(Logic(LogicOp.AND, (nowhere, false)), {}).value is False
    assert isinstance(condition(Logic(LogicOp.AND, (nowhere, true)), {}).value, Undefined)
    assert condition(Logic(LogicOp.OR, (nowhere, true)), {}).value is True


@given(st.sampled_from([LogicOp.AND, LogicOp.OR]), st.lists(st.sampled_from(["yes", "no", "lost", "open"]), min_size=1))
def test_what_is_left_of_a_combination_of_truth_values_decides_as_before(op, parts):
    variable = interval(0, 1)
    made = {
        "yes": build.constant(True),
        "no": build.constant(False),
        "lost": Constant(Undefined("far from roads")),
        "open": Compare(CompareOp.LT, variable, build.constant(0.5)),
    }
    root = Logic(op, tuple(made[part] for part in parts))
    left = condition(root, {})
    for number in (0.2, 0.8):
        before, after = (evaluate(each, {variable.identity: number}) for each in (root, left))
        # what has no value does not hold
        assert (before is True) == (after is True)
        assert "lost" in parts or before is after


class _Fork:
    name = "fork"

    def values(self, x: float, y: float) -> tuple[float, ...]:
        return (0.5, -0.5) if x > 0 else ()

    def cells(self, bounds):
        return []


def test_several_directions_are_a_choice_and_none_is_undefined():
    field = build.constant(_Fork())
    split = condition(DirectionAt(field, build.constant((1.0, 0.0))), {})
    assert isinstance(split, Select)
    assert isinstance(split.index, Index)
    lost = condition(DirectionAt(field, build.constant((-1.0, 0.0))), {})
    assert isinstance(lost, Constant)
    assert "fork" in lost.value.reason


def test_expanding_replaces_chains_of_features():
    definitions = {"a": Feature(0, "b", "scalar"), "b": Feature(0, "c", "scalar")}
    found = expand(Feature(0, "a", "scalar"), lambda feature: definitions.get(feature.property))
    assert features(found) == {(0, "c")}


@given(st.lists(st.lists(st.integers(0, 7), min_size=0, max_size=3), min_size=1, max_size=10))
def test_groups_are_the_connected_components_over_shared_variables(uses):
    pool = [interval(0, 1) for _ in range(8)]
    items = [
        Comparison(
            number, "heading", Arithmetic(ArithmeticOp.ADD, (build.constant(0.0), *(pool[i] for i in use))), None
        )
        for number, use in enumerate(uses)
    ]
    # The transitive closure by repetition, instead of union-find.
    component = list(range(len(uses)))
    for _ in uses:
        for i, first in enumerate(uses):
            for j, second in enumerate(uses):
                if set(first) & set(second):
                    component[i] = component[j] = min(component[i], component[j])
    groups = group_constraints(items)
    found = {item.object: number for number, group in enumerate(groups) for item in group.constraints}
    assert sum(len(group.constraints) for group in groups) == len(items)
    for i in range(len(uses)):
        for j in range(len(uses)):
            assert (found[i] == found[j]) == (component[i] == component[j])


def test_a_pick_from_a_list_becomes_one_region_only_if_nothing_else_depends_on_it():
    alone = simplify(compiled("ego = new Car on Uniform(*network.lanes), facing roadDirection"))
    (point,) = [node for node in leaves(alone.objects[0].properties["position"].value) if isinstance(node, PointIn)]
    assert isinstance(point.region, Constant)
    assert isinstance(point.region.value, PolygonSet)
    assert len(point.region.value.polygons) == len(STREET.lanes)
    nested = "road = Uniform(*network.roads)\nlane = Uniform(*road.lanes)\nego = new Car on lane, facing roadDirection"
    (point,) = leaves(simplify(compiled(nested)).objects[0].properties["position"].value)
    assert isinstance(point, PointIn)
    assert sorted(point.region.value.ids) == sorted(lane.id for road in STREET.roads for lane in road.lanes)
    shared = simplify(compiled("lane = Uniform(*network.lanes)\nego = new Car on lane\nother = new Car on lane"))
    picks = [leaves(each.properties["position"].value) for each in shared.objects]
    indices = [[node for node in pick if isinstance(node, Index)] for pick in picks]
    assert indices[0][0].identity is indices[1][0].identity


def test_drawn_scenes_satisfy_the_program():
    scenario = compiled("ego = new Car\nother = new Car ahead of ego by Range(4, 10)\nrequire (distance to other) > 10")
    for seed in range(20):
        scene = draw_scene(scenario, random.Random(seed))
        assert scene is not None
        (x, y), (u, v) = scene.values[0, "position"], scene.values[1, "position"]
        assert math.hypot(u - x, v - y) > 10
        assert 4 + 4.5 <= math.hypot(u - x, v - y) + 1e-9 <= 10 + 4.5 + 1e-6


def test_a_support_s_ends_belong_to_it_and_nothing_beyond():
    leaf = interval(2, 1)
    ends = (2.0, 1.0)
    assert admits(leaf, ends, 1.0, 0.0)
    assert admits(leaf, ends, 2.0, 0.0)
    assert not admits(leaf, ends, 2.0001, 0.0)
    assert admits(leaf, ends, 2.0001, 0.001)
    assert not admits(Index((1.0, 1.0)), (), 2.0, 0.5)


@pytest.mark.parametrize("tiny", [2.2e-309, -5e-324])
def test_quotients_of_the_tiniest_numbers_are_bounded(tiny):
    domain = IntervalDomain(FLOATS)
    assert domain.divide(FLOATS.between(tiny, tiny), FLOATS.between(tiny, tiny)) == (1.0, 1.0, True)
    assert domain.divide(FLOATS.between(0.0, 1.0), FLOATS.between(abs(tiny), 2.0)) == (0.0, math.inf, False)


def test_a_point_times_the_tiniest_number_may_lie_anywhere_its_product_allows():
    point = PointIn(region=build.constant(PolygonSet((), "none")))
    boxes = point_boxes(Scale(point, build.constant(2.2e-309)), ((2.2e-309, 4.4e-309), (0.0, 0.0)))
    (((west, east), (south, north)),) = boxes.values()
    assert (west, east) == pytest.approx((1.0, 2.0))
    assert (south, north) == (0.0, 0.0)


def test_operators_are_shown_between_what_they_join_and_functions_before():
    a, b = build.constant(1.0), Feature(0, "width", "scalar")
    assert show(Arithmetic(ArithmeticOp.ADD, (b, a))) == "(0.width + 1)"
    assert show(Arithmetic(ArithmeticOp.MAX, (b, a))) == "max(0.width, 1)"
    assert show(Arithmetic(ArithmeticOp.NEG, (b,))) == "neg(0.width)"
    assert show(Arithmetic(ArithmeticOp.ADD, (b, a, b))) == "+(0.width, 1, 0.width)"


def test_a_point_in_one_of_several_regions_is_in_their_union_whatever_they_are_made_of():
    text = "Uniform(CircularRegion((500, 500), 2), PolygonalRegion([(0, 0), (9, 0), (9, 9)]), {})"
    for more in ("RectangularRegion((-50, -50), 0, 4, 4)", "PolygonalRegion([(-9, 0), (0, 0), (0, -9)])"):
        scenario = simplify(compiled(f"ego = new Object in {text.format(more)}"))
        (point,) = leaves(scenario.objects[0].properties["position"].value)
        assert all(contains(point.region.value, *place) for place in ((500.5, 500.5), (8.0, 1.0)))
        assert contains(point.region.value, -50.0, -50.0) or contains(point.region.value, -1.0, -1.0)
