"""Problems: folding and negation keep the meaning, deep and shared graphs are no problem."""

from __future__ import annotations

import math
import pickle

import pytest
from formulas import Var, Variable, evaluate, value
from hypothesis import given
from hypothesis import strategies as st

from scenicq.forest.nodes import Arithmetic, ArithmeticOp, Compare, CompareOp, Constant, Logic, LogicOp
from scenicq.forest.walk import postorder
from scenicq.smt.problem import Formula, Problem, Term, holds
from scenicq.smt.terms import FALSE, TRUE, apply, compare, conjunction, disjunction, negation, number

X, Y = Var("x"), Var("y")
POINTS = st.fixed_dictionaries({"x": st.floats(-4, 4), "y": st.floats(-4, 4)})
TOTAL = (
    ArithmeticOp.ADD,
    ArithmeticOp.MUL,
    ArithmeticOp.SUB,
    ArithmeticOp.NEG,
    ArithmeticOp.ABS,
    ArithmeticOp.MIN,
    ArithmeticOp.MAX,
    ArithmeticOp.SIN,
)


def _extended(inner: st.SearchStrategy[tuple[ArithmeticOp, tuple[object, ...]]]) -> st.SearchStrategy[object]:
    unary = st.tuples(st.sampled_from((ArithmeticOp.NEG, ArithmeticOp.ABS, ArithmeticOp.SIN)), st.tuples(inner))
    binary = st.tuples(st.sampled_from((ArithmeticOp.SUB, *TOTAL[:2], *TOTAL[5:7])), st.tuples(inner, inner))
    return unary | binary


RECIPES = st.recursive(st.sampled_from((X, Y)) | st.floats(-3, 3).map(number), _extended, max_leaves=8)


def _raw(recipe: object) -> Term:
    return Arithmetic(recipe[0], tuple(_raw(arg) for arg in recipe[1])) if isinstance(recipe, tuple) else recipe


def _folded(recipe: object) -> Term:
    return apply(recipe[0], *(_folded(arg) for arg in recipe[1])) if isinstance(recipe, tuple) else recipe


@given(RECIPES, POINTS)
def test_folding_keeps_the_value(recipe: object, point: dict[str, float]) -> None:
    assert value(_folded(recipe), point) == pytest.approx(value(_raw(recipe), point), abs=1e-9)


@st.composite
def formulas(draw: st.DrawFn) -> Formula:
    """Formulas of total functions, of a few levels."""
    atoms = st.builds(
        compare,
        st.sampled_from(("<=", "<", ">=", ">", "==")),
        RECIPES.map(_folded),
        st.sampled_from((X, Y, number(0.0), number(1.0))),
    )
    groups = st.recursive(
        atoms,
        lambda inner: st.lists(inner, max_size=3).flatmap(
            lambda parts: st.sampled_from((conjunction(parts), disjunction(parts)))
        ),
        max_leaves=6,
    )
    return draw(groups)


@given(formulas(), POINTS)
def test_negation_is_the_opposite(formula: Formula, point: dict[str, float]) -> None:
    assert evaluate(negation(formula), point) is not evaluate(formula, point)


@given(formulas(), POINTS)
def test_problems_cross_a_pipe(formula: Formula, point: dict[str, float]) -> None:
    there = Problem((Variable("x"), Variable("y")), formula)
    again = pickle.loads(pickle.dumps(there))
    assert [variable.name for variable in again.variables] == ["x", "y"]
    assert holds(again, point) is holds(there, point)


@given(formulas(), POINTS, st.floats(0, 1))
def test_slack_only_weakens(formula: Formula, point: dict[str, float], slack: float) -> None:
    assert evaluate(formula, point, slack) or not evaluate(formula, point)


def test_constants_fold() -> None:
    folded = apply(ArithmeticOp.ADD, 1.0, X, 2.0)
    assert isinstance(folded, Arithmetic)
    assert folded.args[0] is X
    assert value(folded.args[1], {}) == 3.0
    assert apply(ArithmeticOp.ADD, X, 1.0, -1.0) is X
    assert apply(ArithmeticOp.MUL, 2.0, 0.5, X) is X
    assert apply(ArithmeticOp.NEG, apply(ArithmeticOp.NEG, X)) is X
    for op, args, known in (
        (ArithmeticOp.MUL, (0.0, X), 0.0),
        (ArithmeticOp.MAX, (1, 2), 2.0),
        (ArithmeticOp.ATAN2, (1.0, 0.0), math.pi / 2),
    ):
        constant = apply(op, *args)
        assert isinstance(constant, Constant)
        assert constant.value == known


def test_undefined_constants_stay_and_fail() -> None:
    for term in (apply(ArithmeticOp.SQRT, -1.0), apply(ArithmeticOp.DIV, 1.0, 0.0), apply(ArithmeticOp.LOG, 0.0)):
        assert isinstance(term, Arithmetic)
        assert math.isnan(value(term, {}))
        assert not evaluate(compare("<=", term, 5.0), {}, slack=100.0)
        assert not evaluate(compare(">", term, 5.0), {}, slack=100.0)
        # what does not hang on it holds all the same
        assert evaluate(disjunction([compare("<=", term, 5.0), compare("<", X, 1.0)]), {"x": 0.0})
        assert not evaluate(conjunction([compare("<=", term, 5.0), compare("<", X, 1.0)]), {"x": 0.0}, slack=100.0)
    # 0 times something undefined is undefined
    assert isinstance(apply(ArithmeticOp.MUL, 0.0, apply(ArithmeticOp.SQRT, X)), Arithmetic)


def test_comparisons_of_numbers_fold_unless_rounding_decides() -> None:
    assert compare("<=", 1.0, 2.0) is TRUE
    assert compare(">", 1.0, 2.0) is FALSE
    assert compare("==", 1.0, 1.0) is TRUE
    near = compare("==", 0.1 + 0.2, 0.3)
    assert isinstance(near, Compare)
    assert evaluate(near, {}, slack=1e-9)
    assert not evaluate(near, {})


def test_connectives_fold() -> None:
    atom = compare("<=", X, Y)
    assert conjunction([]) is TRUE
    assert disjunction([]) is FALSE
    assert conjunction([atom, TRUE]) is atom
    assert conjunction([atom, FALSE]) is FALSE
    assert disjunction([atom, TRUE]) is TRUE
    assert disjunction([atom, FALSE, atom]) is atom
    other = compare("<", Y, 0.0)
    merged = conjunction([conjunction([atom, other]), atom])
    assert isinstance(merged, Logic)
    assert (merged.op, merged.args) == (LogicOp.AND, (atom, other))


def test_comparisons_turn_round() -> None:
    atom = compare(">=", X, 1.0)
    assert isinstance(atom, Compare)
    assert (atom.op, atom.right) == (CompareOp.LE, X)
    unequal = negation(compare("==", X, 1.0))
    assert isinstance(unequal, Logic)
    assert evaluate(unequal, {"x": 1.5})
    assert not evaluate(unequal, {"x": 1.0})


def test_strict_comparisons_fail_at_equality() -> None:
    assert not evaluate(compare("<", X, 1.0), {"x": 1.0})
    assert evaluate(compare("<", X, 1.0), {"x": 1.0}, slack=1e-12)


def test_deep_graphs() -> None:
    term: Term = X
    for _ in range(20_000):
        term = apply(ArithmeticOp.SIN, term)
    problem = Problem((Variable("x"),), negation(negation(compare("<=", term, 0.5))))
    assert holds(pickle.loads(pickle.dumps(problem)), {"x": 1.0})


def test_deep_connectives() -> None:
    formula: Formula = compare("<=", X, 0.0)
    for level in range(10_000):
        formula = (conjunction, disjunction)[level % 2]([formula, compare("<=", Y, float(level))])
    assert evaluate(formula, {"x": 1.0, "y": 0.0})
    assert not evaluate(negation(formula), {"x": 1.0, "y": 0.0})


def test_shared_graphs_do_not_blow_up() -> None:
    term: Term = X
    for _ in range(200):
        term = apply(ArithmeticOp.MUL, 0.5, apply(ArithmeticOp.ADD, term, term))
    assert len(list(postorder((term,)))) < 1000
    problem = Problem((Variable("x"),), compare("==", term, 3.0))
    assert len(pickle.dumps(problem)) < 100_000
    assert holds(problem, {"x": 3.0})


def test_ranges_count() -> None:
    problem = Problem((Variable("x", 0.0, 1.0),), TRUE)
    assert holds(problem, {"x": 1.0})
    assert not holds(problem, {"x": 1.1})
    assert holds(problem, {"x": 1.1}, slack=0.2)
    assert not holds(problem, {})
