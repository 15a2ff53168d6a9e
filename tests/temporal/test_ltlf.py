"""Temporal formulas on random traces against a recursive evaluator; unknown values never contradict a completion."""

import random
from itertools import product

import numpy as np

from scenicq.forest.temporal import Always, And, Atom, Eventually, Next, Not, Or, Until
from scenicq.temporal.ltlf import evaluate
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


def values_of(formula, trace):
    """The production's values of all first and last samples; `trace` holds 0, 1 and 2."""
    columns = np.array(trace, dtype=np.int8).reshape(-1, ATOMS)
    return evaluate(formula, lambda atom: columns[:, atom.number], np.arange(len(trace)))


def test_agrees_with_the_recursive_definition():
    draw = random.Random(7)
    for _ in range(10_000):
        formula = random_formula(draw, 4)
        trace = [tuple(draw.random() < 0.5 for _ in range(ATOMS)) for _ in range(draw.randint(1, 6))]
        found = values_of(formula, [[2 * value for value in sample] for sample in trace])
        start, end = sorted(draw.randrange(len(trace)) for _ in range(2))
        assert found[start, end] == 2 * recursive(formula, trace[: end + 1], start)


def test_what_is_unknown_never_contradicts_a_completion():
    draw = random.Random(8)
    decided = 0
    for _ in range(1_000):
        formula = random_formula(draw, 4)
        trace = [[draw.choice([FALSE, UNKNOWN, TRUE, TRUE]) for _ in range(ATOMS)] for _ in range(draw.randint(1, 6))]
        found = values_of(formula, trace)
        for _ in range(5):
            whole = [[draw.choice([FALSE, TRUE]) if v == UNKNOWN else v for v in sample] for sample in trace]
            completed = values_of(formula, whole)
            over = np.triu(found != UNKNOWN)  # only where the trace is not empty
            assert (found[over] == completed[over]).all()
            decided += int(over.sum())
    assert decided > 10_000


def test_no_completion_of_few_gaps_contradicts():
    draw = random.Random(9)
    decided = 0
    for _ in range(300):
        formula = random_formula(draw, 3)
        trace = [[draw.choice([FALSE, TRUE]) for _ in range(ATOMS)] for _ in range(draw.randint(1, 4))]
        gaps = draw.sample([(n, atom) for n in range(len(trace)) for atom in range(ATOMS)], min(5, ATOMS * len(trace)))
        for n, atom in gaps:
            trace[n][atom] = UNKNOWN
        found = values_of(formula, trace)[0]
        for values in product((False, True), repeat=len(gaps)):
            whole = [[value == TRUE for value in sample] for sample in trace]
            for (n, atom), value in zip(gaps, values, strict=True):
                whole[n][atom] = value
            for end in range(len(trace)):
                if found[end] != UNKNOWN:
                    assert (found[end] == TRUE) == recursive(formula, whole[: end + 1], 0)
                    decided += 1
    assert decided > 3_000
