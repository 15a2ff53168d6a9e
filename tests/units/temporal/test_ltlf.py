"""Temporal formulas on random traces against a recursive evaluator; unknown is what completions tell apart."""

import random
from itertools import product

import numpy as np
import pytest

from scenicq.forest.nodes import Compare, CompareOp, Constant, Logic, LogicOp
from scenicq.forest.temporal import Always, And, Atom, Eventually, Next, Not, Or, Until
from scenicq.temporal.formula_values import FormulaValues
from scenicq.temporal.truth import FALSE, TRUE, UNKNOWN

ATOMS = 3


def recursive(formula, trace, k):
    """The value at sample k of a trace, a list of tuples of truth values: LTL on finite traces by its definition."""
    rest = range(k, len(trace))
    match formula:
        case Atom():
            return trace[k][formula.number]
        case Not():
            return not recursive(formula.operand, trace, k)
        case And() | Or():
            return (all if isinstance(formula, And) else any)(recursive(f, trace, k) for f in formula.operands)
        case Always() | Eventually():
            return (all if isinstance(formula, Always) else any)(recursive(formula.operand, trace, m) for m in rest)
        case Next():
            return k + 1 < len(trace) and recursive(formula.operand, trace, k + 1)
        case Until():
            return any(
                recursive(formula.right, trace, m) and all(recursive(formula.left, trace, b) for b in range(k, m))
                for m in rest
            )


def random_formula(draw, depth):
    if not depth or draw.random() < 0.2:
        return Atom(draw.randrange(ATOMS))
    kind = draw.choice([Not, And, Or, Always, Eventually, Next, Until])
    if kind in (And, Or):
        return kind(tuple(random_formula(draw, depth - 1) for _ in range(draw.randint(2, 3))))
    if kind is Until:
        return Until(random_formula(draw, depth - 1), random_formula(draw, depth - 1))
    return kind(random_formula(draw, depth - 1))


def values_of(formula, trace, conditions=()):
    """The production's values from each sample to the last; `trace` holds 0, 1 and 2."""
    columns = np.array(trace, dtype=np.int8).reshape(-1, ATOMS)
    return FormulaValues(formula, conditions).to_the_end(lambda atom: columns[:, atom.number], len(trace)).tolist()


def random_trace(draw, most):
    return [tuple(draw.random() < 0.5 for _ in range(ATOMS)) for _ in range(draw.randint(1, most))]


def with_gaps(draw, trace, most):
    """Some values of a trace unknown, and all traces that it may be."""
    places = [(k, atom) for k in range(len(trace)) for atom in range(ATOMS)]
    gaps = draw.sample(places, draw.randint(0, min(most, len(places))))
    shown = [[UNKNOWN if (k, a) in gaps else 2 * value for a, value in enumerate(row)] for k, row in enumerate(trace)]
    completions = []
    for values in product((False, True), repeat=len(gaps)):
        told = dict(zip(gaps, values, strict=True))
        completions.append([tuple(told.get((k, a), value) for a, value in enumerate(r)) for k, r in enumerate(trace)])
    return shown, completions


def test_agrees_with_the_recursive_definition(rounds):
    draw = random.Random(7)
    for _ in range(rounds(4_000)):
        formula, trace = random_formula(draw, 4), random_trace(draw, 6)
        found = values_of(formula, [[2 * value for value in sample] for sample in trace])
        assert found == [2 * recursive(formula, trace, k) for k in range(len(trace))]


@pytest.mark.slow
def test_unknown_is_what_completions_tell_apart():
    draw = random.Random(8)
    unknown = 0
    for _ in range(1_000):
        formula = random_formula(draw, 3)
        shown, completions = with_gaps(draw, random_trace(draw, 5), 5)
        for k, value in enumerate(values_of(formula, shown)):
            ways = {recursive(formula, each, k) for each in completions}
            assert value == (UNKNOWN if len(ways) > 1 else 2 * ways.pop())
            unknown += value == UNKNOWN
    assert unknown > 500


@pytest.mark.slow
def test_what_more_samples_can_make_hold_may_hold():
    """Where one more sample makes it hold, however it is, it may; where none of many can, it rarely may."""
    draw = random.Random(9)
    lost = open_ = 0
    for _ in range(1_000):
        formula, trace = random_formula(draw, 3), random_trace(draw, 4)
        columns = 2 * np.array(trace, dtype=np.int8)
        may = FormulaValues(formula).may_hold(lambda atom, c=columns: c[:, atom.number], len(trace))
        later = [recursive(formula, [*trace, *random_trace(draw, 3)], 0) for _ in range(40)]
        assert may or not any(later)
        lost += not may
        open_ += may and not any(later)
    assert lost > 200
    assert open_ < lost / 4


def test_one_condition_twice_comes_out_once():
    one, other = Compare(CompareOp.LT, Constant(1.0), Constant(2.0)), Constant(True)
    conditions = (one, Logic(LogicOp.NOT, (one,)), other)
    trace = [[UNKNOWN, UNKNOWN, TRUE]] * 3
    assert values_of(Always(Or((Atom(0), Atom(1)))), trace, conditions) == [TRUE] * 3
    assert values_of(Always(Or((Atom(0), Atom(1)))), trace) == [UNKNOWN] * 3
    assert values_of(Eventually(And((Atom(0), Atom(1)))), trace, conditions) == [FALSE] * 3
