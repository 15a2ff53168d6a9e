"""Sums of ranges are shared out: the values of their variables add up to what is asked of them."""

from __future__ import annotations

import math
import random

import numpy as np
import pytest

from scenicq.forest.nodes import Identity
from scenicq.match.decide.range_forms import Form, clip, cos_sin, spread


def random_form(rng, count, *, unbounded=False):
    terms = {}
    for _ in range(count):
        low = rng.uniform(-5, 5)
        terms[Identity()] = (rng.choice([-2.0, -0.5, 1.0, 3.0]), low, low + rng.choice([0.0, 1.0, 4.0]))
    if unbounded:
        terms[Identity()] = (rng.choice([-2.0, 1.0]), -math.inf, math.inf)
    return Form(terms=terms)


def total(form, values):
    return sum(factor * values[identity] for identity, (factor, _, _) in form.terms.items())


@pytest.mark.parametrize("count", [1, 2, 3, 5])
@pytest.mark.parametrize("seed", range(8))
def test_values_between_the_ends_are_reached_within_the_ranges(count, seed):
    rng = random.Random(seed)
    form = random_form(rng, count)
    wanted = [form.low, form.high, *(rng.uniform(form.low, form.high) for _ in range(5))]
    for value in wanted:
        values = spread(form, value)
        assert total(form, values) == pytest.approx(value, abs=1e-9)
        assert all(low - 1e-9 <= values[each] <= high + 1e-9 for each, (_, low, high) in form.terms.items())
    # of columns, columns
    columns = spread(form, np.array(wanted))
    for number, value in enumerate(wanted):
        alone = spread(form, value)
        assert {each: float(np.broadcast_to(column, len(wanted))[number]) for each, column in columns.items()} == alone


@pytest.mark.parametrize("count", [0, 1, 3])
def test_what_is_unbounded_takes_the_rest(count):
    form = random_form(random.Random(count), count, unbounded=True)
    assert form.unbounded
    for value in (-70.0, 0.0, 1e4):
        values = spread(form, value)
        assert total(form, values) == pytest.approx(value)
        assert all(low <= values[each] <= high for each, (_, low, high) in form.terms.items())


def test_forms_are_added_and_multiplied():
    one, other = Form(terms={Identity(): (2.0, 0.0, 3.0)}, constant=1.0), Form(terms={Identity(): (-1.0, 1.0, 5.0)})
    both = one.plus(other)
    assert (both.low, both.high, both.constant) == (-5.0, 5.0, 1.0)
    assert one.plus(one) is None
    half = one.times(-0.5)
    assert (half.low, half.high, half.constant) == (-3.0, 0.0, -0.5)
    assert one.times(0.0) is None
    assert Form(constant=2.0).number == 2.0
    assert one.number is None
    endless = Form(terms={Identity(): (1.0, -math.inf, math.inf)})
    assert endless.plus(one).unbounded
    assert endless.plus(Form(terms={Identity(): (1.0, -math.inf, math.inf)})) is None


def test_columns_are_what_single_values_are():
    angles = np.linspace(-4, 4, 9)
    assert [np.array(part).tolist() for part in cos_sin(angles)] == [
        [math.cos(each) for each in angles], [math.sin(each) for each in angles],
    ]  # fmt: skip
    assert clip(angles, -1.0, 2.0).tolist() == [clip(each, -1.0, 2.0) for each in angles.tolist()]
    assert [clip(each, -1.0, 2.0) for each in (-3.0, 0.5, 3.0)] == [-1.0, 0.5, 2.0]
