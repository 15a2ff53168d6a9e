"""One affine feature inverted: whether it is reached, and values of the random variables that reach it."""

from __future__ import annotations

import itertools
import math
import random

import pytest
import shapely

from scenicq.forest import build
from scenicq.forest.evaluate import admits
from scenicq.forest.nodes import Constant, Feature, Normal, PointIn, Range, TruncatedNormal
from scenicq.forest.walk import children
from scenicq.geometry.angles import distance
from scenicq.geometry.regions import PolygonSet
from scenicq.match.linear.affine_forms import Affine
from scenicq.match.linear.affine_reach import ends, reach_heading, reach_number, reach_position
from scenicq.match.tolerance import Margin

TRIANGLE = PolygonSet((shapely.Polygon([(0, 0), (8, 0), (0, 6)]),), "triangle")


def random_leaf(rng, *, normal=False):
    a, b = rng.uniform(-4, 4), rng.uniform(0, 3)
    match rng.randrange(3 if normal else 2):
        case 0:
            return Range(build.constant(a + b), build.constant(a))
        case 1:
            return TruncatedNormal(*map(build.constant, (a, 1.0, a, a + b)))
        case _:
            return Normal(build.constant(a), build.constant(1.0))


def inside(leaf, value):
    return admits(leaf, tuple(part.value for part in children(leaf)), value, 1e-6)


def random_form(rng, leaves):
    factors = {(leaf.identity, 0): rng.choice([-2.0, -0.5, 1.0, 3.0]) for leaf in leaves}
    return Affine(rng.uniform(-3, 3), factors)


def value_of(form, values):
    total = form.constant
    for (identity, axis), factor in form.terms.items():
        value = values[identity]
        total += factor * (value[axis] if isinstance(value, tuple) else value)
    return total


@pytest.mark.parametrize("reached", [reach_number, reach_heading])
@pytest.mark.parametrize("seed", range(50))
def test_numbers_and_headings(reached, seed):
    rng = random.Random(seed)
    leaves = [random_leaf(rng, normal=seed % 3 == 0) for _ in range(rng.randint(1, 3))]
    form, known = random_form(rng, leaves), {leaf.identity: leaf for leaf in leaves}
    observed, tolerance = rng.uniform(-25, 25), rng.choice([0.0, 0.3])
    off = distance if reached is reach_heading else lambda a, b: abs(a - b)
    found = reached(form, known, observed, tolerance)
    unbounded = any(isinstance(leaf, Normal) for leaf in leaves)
    if not found.possible:
        assert found.possible is False
        assert not unbounded
        limits = [ends(leaf) for leaf in leaves]
        for share in itertools.product([0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 1.0], repeat=len(leaves)):
            values = {
                leaf.identity: low + part * (high - low)
                for leaf, part, (low, high) in zip(leaves, share, limits, strict=True)
            }
            assert off(value_of(form, values), observed) > tolerance
        return
    assert off(value_of(form, found.values), observed) <= tolerance + 1e-8
    assert all(inside(leaf, found.values[leaf.identity]) for leaf in leaves)


def test_of_several_turns_one_that_is_reached_counts():
    leaf = Range(build.constant(3.0), build.constant(20.0))
    form = Affine(0.0, {(leaf.identity, 0): 1.0})
    for turns in range(-3, 4):
        found = reach_heading(form, {leaf.identity: leaf}, 1.0 + turns * math.tau, 0.0)
        assert found.possible
        assert distance(found.values[leaf.identity], 1.0) < 1e-9


def test_a_number_between_the_ends_of_several_ranges_is_shared_out():
    leaves = [Range(build.constant(low), build.constant(low + 2)) for low in (-1.0, 4.0)]
    form = Affine(1.0, {(leaves[0].identity, 0): -2.0, (leaves[1].identity, 0): 1.0})
    known = {leaf.identity: leaf for leaf in leaves}
    assert reach_number(form, known, 2.0, 0.0).possible is False
    assert reach_number(form, known, 3.0, 0.0).values == {leaves[0].identity: 1.0, leaves[1].identity: 4.0}
    assert reach_number(form, known, 9.5, 0.5).possible
    assert reach_number(form, known, 9.6, 0.5).possible is False


def test_ends_that_are_not_known_are_not_decided():
    open_end = Range(build.constant(0.0), Feature(0, "width", "scalar"))
    empty = TruncatedNormal(*map(build.constant, (0.0, 1.0, 2.0, 1.0)))
    for leaf in (open_end, empty):
        form = Affine(0.0, {(leaf.identity, 0): 1.0})
        for reached in (reach_number, reach_heading):
            assert reached(form, {leaf.identity: leaf}, 0.5, 0.1).possible is None
        assert (
            reach_position((form, form), {leaf.identity: leaf}, (0.5, 0.5), Margin("disc", 0.1, 0.1)).possible is None
        )


def position_of(form, values):
    return tuple(value_of(part, values) for part in form)


@pytest.mark.parametrize("kind", ["disc", "box"])
@pytest.mark.parametrize("scalars", [0, 1, 2, 3])
@pytest.mark.parametrize("with_point", [False, True])
@pytest.mark.parametrize("seed", range(6))
def test_positions(kind, scalars, with_point, seed):
    rng = random.Random(seed)
    margin = Margin(kind, 0.4, 0.2 if kind == "box" else 0.4)
    numbers = [random_leaf(rng) for _ in range(scalars)]
    forms = [random_form(rng, numbers) for _ in "xy"]
    leaves = {leaf.identity: leaf for leaf in numbers}
    if with_point:
        leaf = PointIn(Constant(TRIANGLE))
        leaves[leaf.identity] = leaf
        turn, size = rng.uniform(-3, 3), rng.choice([0.5, 1.0, 2.0])
        c, s = size * math.cos(turn), size * math.sin(turn)
        rows = ((c, -s), (s, c))
        for form, row in zip(forms, rows, strict=True):
            form.terms.update({(leaf.identity, axis): row[axis] for axis in (0, 1)})
    form = (forms[0], forms[1])
    # places that are reached, and what is off them
    for _ in range(4):
        values = {}
        for leaf in leaves.values():
            if isinstance(leaf, PointIn):
                u, v = sorted((rng.random(), rng.random()))
                values[leaf.identity] = (8 * u, 6 * (1 - v))
            else:
                low, high = ends(leaf)
                values[leaf.identity] = rng.choice([low, high, rng.uniform(low, high)])
        exact = position_of(form, values)
        seen = (exact[0] + rng.uniform(-0.2, 0.2), exact[1] + rng.uniform(-0.15, 0.15))
        found = reach_position(form, leaves, seen, margin)
        assert found.possible, (seen, values)
        assert margin.allows(position_of(form, found.values), seen, 1e-3)
        assert all(inside(leaf, found.values[leaf.identity]) for leaf in leaves.values())
    far = (seen[0] + 200.0, seen[1] - 150.0)
    assert reach_position(form, leaves, far, margin).possible is False


def test_offsets_without_end_are_not_decided():
    one, other = (Normal(build.constant(mean), build.constant(1.0)) for mean in (1.0, 5.0))
    leaves = {leaf.identity: leaf for leaf in (one, other)}
    for across in (one, other):
        form = (Affine(1.0, {(one.identity, 0): 1.0}), Affine(0.0, {(across.identity, 0): 2.0}))
        assert reach_position(form, leaves, (5.0, 8.05), Margin("disc", 0.1, 0.1)).possible is None


def test_a_mean_that_is_not_known_is_no_centre():
    one = Normal(build.constant(1.0), build.constant(1.0))
    other = Normal(Feature(0, "width", "scalar"), build.constant(1.0))
    form = Affine(1.0, {(one.identity, 0): 2.0, (other.identity, 0): -3.0})
    for leaves in ((one, other), (other, one)):
        form = Affine(1.0, {(leaf.identity, 0): 2.0 for leaf in leaves})
        found = reach_number(form, {leaf.identity: leaf for leaf in leaves}, 9.0, 0.0)
        assert found.possible
        assert value_of(form, found.values) == pytest.approx(9.0)


def test_what_is_no_similarity_is_not_decided():
    leaf = PointIn(Constant(TRIANGLE))
    for rows in (
        ((1.0, 0.0), (0.0, 2.0)),
        ((1.0, 1.0), (0.0, 1.0)),
        ((0.0, 0.0), (0.0, 0.0)),
        ((2.0, 0.0), (1.0, 2.0)),
    ):
        form = tuple(
            Affine(0.0, {(leaf.identity, axis): part for axis, part in enumerate(row) if part}) for row in rows
        )
        if any(part.terms for part in form):
            assert reach_position(form, {leaf.identity: leaf}, (1.0, 1.0), Margin("disc", 0.1, 0.1)).possible is None
    mirrored = (Affine(0.0, {(leaf.identity, 0): 1.0}), Affine(0.0, {(leaf.identity, 1): -1.0}))
    assert reach_position(mirrored, {leaf.identity: leaf}, (1.0, -1.0), Margin("disc", 0.1, 0.1)).possible
    assert reach_position(mirrored, {leaf.identity: leaf}, (1.0, 1.0), Margin("disc", 0.1, 0.1)).possible is False


@pytest.mark.parametrize("slant", [1.0, 0.2, 0.05, 0.01])
def test_offsets_that_are_said_lead_to_the_place_however_parallel_they_are(slant):
    """`(slant * b, a + b)` in a disc: the closer to parallel, the slower they are found."""
    a, b = (Range(build.constant(-20.0), build.constant(20.0)) for _ in range(2))
    x, y = Affine(0.0, {(b.identity, 0): slant}), Affine(0.0, {(a.identity, 0): 1.0, (b.identity, 0): 1.0})
    known = {leaf.identity: leaf for leaf in (a, b)}
    for share in (-0.9, -0.3, 0.5, 1.0):
        place = (20 * slant * share, 0.0)
        found = reach_position((x, y), known, place, Margin("disc", 0.1 * slant, 0.1 * slant))
        assert found.possible
        assert math.dist((value_of(x, found.values), value_of(y, found.values)), place) <= 0.101 * slant
