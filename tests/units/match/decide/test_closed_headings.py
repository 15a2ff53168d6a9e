"""Closed forms of headings: yes within its ranges, no beyond the tolerance, alone and in columns."""

from __future__ import annotations

import math

import numpy as np
import pytest

from scenicq.forest import build
from scenicq.forest.groups import Comparison
from scenicq.forest.nodes import Arithmetic, ArithmeticOp, Feature, Index, Range, Select
from scenicq.match.decide.closed_numbers import heading
from scenicq.match.decide.range_forms import Columns
from scenicq.match.options import MatchOptions
from scenicq.match.problem.map_lookups import MapLookups
from scenicq.match.problem.outcome import Refuted, Satisfied
from scenicq.match.tolerance import Tolerance

OPTIONS = MatchOptions(tolerance=Tolerance(heading=0.1))
SPREAD = Range(build.constant(-0.5), build.constant(0.5))
EGO = Feature(0, "heading", "scalar")


def closed(node):
    found = heading(Comparison(1, "heading", node, None), {})
    assert found is not None
    return found


def decided(form, seen, ego=0.0):
    return form.decide(lambda index, _: seen if index else ego, OPTIONS, MapLookups())


@pytest.mark.parametrize("turns", [-1, 0, 1])
@pytest.mark.parametrize(
    ("off", "expected"),
    [(0.0, Satisfied), (0.4, Satisfied), (-0.55, Satisfied), (0.65, Refuted), (-2.0, Refuted), (math.pi, Refuted)],
)
def test_a_heading_along_another(off, turns, expected):
    form = closed(Arithmetic(ArithmeticOp.ADD, (EGO, SPREAD)))
    for ego in (0.0, 2.0, -3.0):
        answer = decided(form, ego + off + turns * math.tau, ego)
        assert isinstance(answer, expected)
        if expected is Satisfied:
            assert answer.values[SPREAD.identity] == pytest.approx(min(max(off, -0.5), 0.5))
    seen, egos = np.array([off + 1.0, 1.0, 3.0]), np.array([1.0, 1.0, 1.0])
    columns = Columns(3, lambda index, _: seen if index else egos)
    many = form.evaluate_many(
        lambda number: lambda index, name: columns(index, name)[number], columns, OPTIONS, MapLookups()
    )
    assert np.asarray(many.holds).tolist() == [expected is Satisfied, True, False]
    assert np.asarray(many.fails).tolist() == [expected is Refuted, False, True]


def test_one_of_several_headings_is_enough():
    choice = Index((1.0, 1.0))
    form = closed(Select(choice, (SPREAD, build.constant(2.0))))
    assert decided(form, 2.05).values[choice.identity] == 1.0
    assert decided(form, 0.3).values[choice.identity] == 0.0
    assert isinstance(decided(form, 1.2), Refuted)
