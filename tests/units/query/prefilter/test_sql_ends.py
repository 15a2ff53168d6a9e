"""Ends of intervals as SQL: of numbers alone they are the numbers."""

from __future__ import annotations

import itertools
import math

import pytest

from scenicq.forest.interval_ends import FLOATS
from scenicq.query.prefilter.sql_ends import SQL, columns_of, number, renamed_tables

VALUES = (-math.inf, -2.5, -1.0, 0.0, 0.5, 1.0, 3.0, math.inf)


@pytest.mark.parametrize("name", ["at_most", "least", "most", "plus", "times"])
def test_of_numbers_sql_knows_what_is_known(name):
    for a, b in itertools.product(VALUES, repeat=2):
        endless = math.isinf(a) or math.isinf(b)
        if name in ("plus", "times") and endless:
            continue  # what is without an end is bounded as SQL can say it
        given = ([a, b],) if name in ("least", "most") else (a, b)
        found, expected = getattr(SQL, name)(*given), getattr(FLOATS, name)(*given)
        assert type(found) is type(expected)
        assert found == expected


def test_what_has_no_end_is_compared_whatever_a_column_holds():
    assert [SQL.at_most(-math.inf, "a"), SQL.at_most("a", math.inf)] == [True, True]
    assert [SQL.at_most(math.inf, "a"), SQL.at_most("a", -math.inf)] == [False, False]
    assert SQL.at_most("a", 1.0) == f"a <= {number(1.0)}"


def test_columns_in_texts_are_no_columns():
    condition = "a.class = 'b.x, it''s a.y' AND (b.x + ego.ego_x) > 3.5 AND data.b = 1"
    assert columns_of("a", [condition, True]) == ["class"]
    assert columns_of("b", [condition]) == ["x"]
    renamed = "p0.class = 'b.x, it''s a.y' AND (p1.x + ego.ego_x) > 3.5 AND data.b = 1"
    assert renamed_tables(condition, {"a": "p0", "b": "p1"}) == renamed
