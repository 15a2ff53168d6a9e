"""Bounds as SQL hold the value of every row, and say nothing of what a row lacks."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import duckdb
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

sys.path.insert(0, str(Path(__file__).parents[2] / "forest"))
from expressions import expressions
from test_intervals import observing

from scenicq.forest import build
from scenicq.forest.evaluate import evaluate
from scenicq.forest.nodes import Bearing, Compare, CompareOp, DiscreteRange, Feature, Logic, LogicOp, Norm, Undefined
from scenicq.query.prefilter.sql_bounds import SqlBounds
from scenicq.query.prefilter.sql_ends import number

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
