"""Bounds as SQL hold the value of every row, and say nothing of what a row lacks."""

from __future__ import annotations

import itertools
import math
import random
import sys
from pathlib import Path

import duckdb
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

sys.path.insert(0, str(Path(__file__).parents[2] / "forest"))
from expressions import expressions
from test_intervals import observing

from scenicq.forest import build
from scenicq.forest.draws import draw_leaf
from scenicq.forest.evaluate import evaluate
from scenicq.forest.interval_ends import FLOATS
from scenicq.forest.nodes import (
    ArithmeticOp,
    Bearing,
    Compare,
    CompareOp,
    DiscreteRange,
    Feature,
    Index,
    Logic,
    LogicOp,
    Node,
    Norm,
    Range,
    Select,
    Undefined,
)
from scenicq.query.prefilter.sql_bounds import SqlBounds
from scenicq.query.prefilter.sql_ends import SQL, number

ROWS = 4


def asked(columns: dict[str, list[float | None]], wanted: list[str]) -> list[tuple]:
    """The values of SQL over rows with some columns."""
    rows = ", ".join(
        "(" + ", ".join("NULL" if value is None else number(value) for value in row) + ")"
        for row in zip(*columns.values(), strict=True)
    )
    with duckdb.connect() as connection:
        return connection.execute(
            f"SELECT {', '.join(wanted)} FROM (VALUES {rows}) AS t({', '.join(columns)})"
        ).fetchall()


@given(expressions(), st.integers(0, 1000))
@settings(max_examples=60, deadline=None, derandomize=True)
def test_one_of_the_alternatives_holds_the_value_of_each_row(case, seed):
    root, kinds = observing(case[0])
    rng = np.random.default_rng(seed)
    columns: dict[str, list[float]] = {}
    names: dict[tuple[int, str], str | tuple[str, str]] = {}
    for n, kind in kinds:
        found = (f"x{n}", f"y{n}") if kind == "vector" else f"v{n}"
        names[n, "seen"] = found
        for name in found if isinstance(found, tuple) else (found,):
            columns[name] = rng.uniform(-9, 9, ROWS).tolist()
    bounds = SqlBounds(names)
    boxes, far = bounds.boxes(root), Compare(CompareOp.GT, Norm(root), build.constant(20.0))
    ahead = Compare(CompareOp.LE, Bearing(root), build.constant(1.0))
    conditions = [far, Logic(LogicOp.NOT, (far,)), Logic(LogicOp.AND, (far, ahead))]
    held = [str(bounds.can_hold(condition)) for condition in conditions]
    ends = [number(end) for box in boxes for each in box for end in each[:2]]
    for row, values in enumerate(asked({"one": [1.0] * ROWS, **columns}, [*ends, *held])):
        seen = {
            key: tuple(columns[part][row] for part in name) if isinstance(name, tuple) else columns[name][row]
            for key, name in names.items()
        }
        value = evaluate(root, case[1], seen)
        if isinstance(value, Undefined):
            continue
        x, y = value
        slack = 1e-9 * max(1.0, abs(x), abs(y))
        limits = [values[k : k + 4] for k in range(0, len(ends), 4)]
        assert any(
            a - slack <= x <= b + slack and c - slack <= y <= d + slack
            for a, b, c, d in limits
            if None not in (a, b, c, d)
        )
        for condition, possible in zip(conditions, values[len(ends) :], strict=True):
            assert possible or evaluate(condition, case[1], seen) is not True


def test_what_a_row_lacks_is_null_and_options_are_alternatives():
    speed = Feature(0, "speed", "scalar")
    bounds = SqlBounds({(0, "speed"): "speed"})
    root = build.add(speed, DiscreteRange(build.constant(1.0), build.constant(3.0)))
    found = bounds.intervals(root)
    assert [each.exact for each in found] == [True] * 3
    rows = asked({"speed": [2.0, None]}, [number(each.low) for each in found])
    assert rows == [(3.0, 4.0, 5.0), (None, None, None)]
    assert bounds.intervals(Feature(0, "width", "scalar")) == ((-math.inf, math.inf, False),)


DRAWS, BINS = 500, 3


@given(st.data())
@settings(max_examples=150, deadline=None, derandomize=True)
def test_what_is_attained_is_drawn_in_every_part_of_the_alternatives(data):
    """Sums, choices and products whose random variables may be shared, which attain less than their bounds then."""
    numbers = [build.constant(float(data.draw(st.integers(-4, 4)))) for _ in range(2)]
    made: list[Node] = [Range(*numbers), Range(build.constant(-1.0), build.constant(3.0)), *numbers]
    made += [DiscreteRange(build.constant(-1.0), build.constant(1.0)), Feature(0, "speed", "scalar")]
    index = Index((1.0, 2.0))
    operations = (ArithmeticOp.ADD, ArithmeticOp.SUB, ArithmeticOp.MUL, ArithmeticOp.DIV, ArithmeticOp.ABS)
    for _ in range(data.draw(st.integers(1, 5))):
        one, other = data.draw(st.sampled_from(made)), data.draw(st.sampled_from(made))
        kind = data.draw(st.integers(0, 6))
        if kind < 5:
            args = (one,) if operations[kind] is ArithmeticOp.ABS else (one, other)
            made.append(build.arithmetic(operations[kind], *args))
        else:
            made.append(Select(index if kind == 5 else Index((1.0, 1.0)), (one, other)))
    root, rng = made[-1], random.Random(data.draw(st.integers(0, 99)))
    found = SqlBounds({(0, "speed"): number(2.5)}).intervals(root, attained=True)
    if not found:
        return
    ends = asked({"one": [1.0]}, [number(end) for each in found for end in each[:2]])[0]
    drawn = sorted(
        value
        for _ in range(DRAWS)
        if isinstance(
            value := evaluate(root, lambda leaf, args: draw_leaf(leaf, args, rng), {(0, "speed"): 2.5}), float
        )
    )
    for low, high in zip(ends[::2], ends[1::2], strict=True):
        width = (high - low) / BINS
        for part in range(BINS):
            assert any(low + part * width - 1e-9 <= value <= low + (part + 1) * width + 1e-9 for value in drawn)


def test_what_is_chosen_by_one_number_twice_is_not_all_attained():
    index, x = Index((1.0, 1.0)), Range(build.constant(0.0), build.constant(1.0))
    inner = Select(index, (x, build.constant(9.0)))
    bounds = SqlBounds({})
    assert bounds.intervals(Select(Index((1.0, 1.0)), (inner, x)), attained=True)
    assert not bounds.intervals(Select(index, (inner, x)), attained=True)
    assert not bounds.intervals(build.add(x, x), attained=True)


def test_conditions_that_are_gone_leave_no_bounds_behind():
    """What is asked of nodes made for the question is not answered from others that lay at the same place in memory."""
    columns = {(0, "speed"): "v"}
    bounds, found = SqlBounds(columns), list[tuple[object, object]]()
    for limit in range(300):
        # not two nodes at a time: each may take the place of the one before
        found.append((bounds.can_hold(_slower(limit)), SqlBounds(columns).can_hold(_slower(limit))))
    assert [pair for pair in found if pair[0] != pair[1]] == []
    assert len({text for text, _ in found}) == 300


def _slower(limit: int) -> Compare:
    return Compare(CompareOp.LT, Feature(0, "speed", "scalar"), build.constant(float(limit)))


NUMBERS = (-2.5, -1.0, 0.0, 0.75, 1.0, 4.0)
ONE = ("negative", "magnitude", "root", "sine", "cosine", "turned")
TWO = ("plus", "times", "divided", "hypot", "heading", "least", "most", "at_most")


def written(value):
    """A number, and SQL of it."""
    return (value, f"({value!r}::DOUBLE)")


def applied(ends, name, args):
    return getattr(ends, name)([*args]) if name in ("least", "most") else getattr(ends, name)(*args)


@pytest.mark.parametrize("name", [*ONE, *TWO])
def test_each_step_in_sql_is_that_of_numbers(name):
    made = []
    for values in itertools.product(NUMBERS, repeat=1 if name in ONE else 2):
        if (
            (name == "root" and values[0] < 0)
            or (name == "divided" and not values[1])
            or (name, *values) == ("heading", 0, 0)
        ):
            continue
        expected = applied(FLOATS, name, values)
        for args in itertools.product(*map(written, values)):
            found = applied(SQL, name, args)
            # not a number: nothing is said
            if not isinstance(found, float) or not math.isnan(found):
                made.append((name, args, expected, found))
    assert made
    texts = [str(found) if isinstance(found, bool) else number(found) for *_, found in made]
    with duckdb.connect() as connection:
        (row,) = connection.execute(f"SELECT {', '.join(texts)}").fetchall()
    for (_, args, expected, _), value in zip(made, row, strict=True):
        # half a turn has two names
        assert value == pytest.approx(expected, abs=1e-12) or abs(value) == abs(expected) == math.pi, args


@pytest.mark.parametrize("condition", [True, False, "1 < 2", "2 < 1"])
def test_truth_values_in_sql_are_those_of_python(condition):
    with duckdb.connect() as connection:

        def value(text):
            return connection.execute(f"SELECT {text if isinstance(text, str | bool) else number(text)}").fetchone()[0]

        holds = value(condition)
        for one, other in itertools.product((1.0, 2.0, "3.0"), repeat=2):
            assert float(value(SQL.where(condition, one, other))) == float(one if holds else other)
        for also in (True, False, "1 < 2", "2 < 1"):
            assert value(SQL.both(condition, also)) == (holds and value(also))
            assert value(SQL.either(condition, also)) == (holds or value(also))
        assert value(SQL.negation(condition)) == (not holds)
