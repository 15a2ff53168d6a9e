"""Formulas: folding and negation keep the meaning, deep and shared graphs are no problem."""

from __future__ import annotations

import copy
import math
import pickle

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenicq.smt.evaluation import Evaluator, evaluate, holds
from scenicq.smt.formula import (
    FALSE,
    TRUE,
    Conjunction,
    Disjunction,
    Formula,
    Num,
    Op,
    Operator,
    Problem,
    Relation,
    Term,
    TermComparison,
    Var,
    Variable,
    apply,
    compare,
    conjunction,
    disjunction,
    flatten,
    free_variables,
    negation,
    postorder,
    unflatten,
)

X, Y = Var("x"), Var("y")
POINTS = st.fixed_dictionaries({"x": st.floats(-4, 4), "y": st.floats(-4, 4)})
TOTAL = (Operator.ADD, Operator.MUL, Operator.SUB, Operator.NEG, Operator.ABS, Operator.MIN, Operator.MAX, Operator.SIN)


def _extended(inner: st.SearchStrategy[tuple[Operator, tuple[object, ...]]]) -> st.SearchStrategy[object]:
    unary = st.tuples(st.sampled_from((Operator.NEG, Operator.ABS, Operator.SIN)), st.tuples(inner))
    binary = st.tuples(st.sampled_from((Operator.SUB, *TOTAL[:2], *TOTAL[5:7])), st.tuples(inner, inner))
    return unary | binary


RECIPES = st.recursive(st.sampled_from((X, Y)) | st.floats(-3, 3).map(Num), _extended, max_leaves=8)


def _raw(recipe: object) -> Term:
    return Op(recipe[0], tuple(_raw(arg) for arg in recipe[1])) if isinstance(recipe, tuple) else recipe


def _folded(recipe: object) -> Term:
    return apply(recipe[0], *(_folded(arg) for arg in recipe[1])) if isinstance(recipe, tuple) else recipe


@given(RECIPES, POINTS)
def test_folding_keeps_the_value(recipe: object, point: dict[str, float]) -> None:
    assert Evaluator(_folded(recipe))(point) == pytest.approx(Evaluator(_raw(recipe))(point), abs=1e-9)


@st.composite
def formulas(draw: st.DrawFn) -> Formula:
    """Formulas of total functions, of a few levels."""
    atoms = st.builds(
        compare,
        st.sampled_from(("<=", "<", ">=", ">", "==")),
        RECIPES.map(_folded),
        st.sampled_from((X, Y, Num(0.0), Num(1.0))),
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
def test_flattening_round_trip(formula: Formula, point: dict[str, float]) -> None:
    again = unflatten(flatten(formula))
    assert flatten(again) == flatten(formula)
    assert evaluate(again, point) is evaluate(formula, point)
    assert flatten(pickle.loads(pickle.dumps(formula))) == flatten(formula)


@given(formulas(), POINTS, st.floats(0, 1))
def test_slack_only_weakens(formula: Formula, point: dict[str, float], slack: float) -> None:
    assert evaluate(formula, point, slack) or not evaluate(formula, point)


def test_constants_fold() -> None:
    assert apply(Operator.ADD, 1.0, X, 2.0) != apply(Operator.ADD, 3.0, X)
    assert flatten(apply(Operator.ADD, 1.0, X, 2.0)) == flatten(apply(Operator.ADD, X, 3.0))
    assert apply(Operator.ADD, X, 1.0, -1.0) is X
    assert apply(Operator.MUL, 2.0, 0.5, X) is X
    assert apply(Operator.MUL, 0.0, X) == Num(0.0)
    assert apply(Operator.NEG, apply(Operator.NEG, X)) is X
    assert apply(Operator.MAX, 1, 2) == Num(2.0)
    assert apply(Operator.ATAN2, 1.0, 0.0) == Num(math.pi / 2)


def test_undefined_constants_stay_and_fail() -> None:
    for term in (apply(Operator.SQRT, -1.0), apply(Operator.DIV, 1.0, 0.0), apply(Operator.ATAN2, 0.0, 0.0)):
        assert isinstance(term, Op)
        assert math.isnan(Evaluator(term)({}))
        assert not evaluate(compare("<=", term, 5.0), {}, slack=100.0)
        assert not evaluate(compare(">", term, 5.0), {}, slack=100.0)
    # 0 times something undefined is undefined
    assert isinstance(apply(Operator.MUL, 0.0, apply(Operator.SQRT, X)), Op)


def test_ground_atoms_fold_unless_rounding_decides() -> None:
    assert compare("<=", 1.0, 2.0) is TRUE
    assert compare(">", 1.0, 2.0) is FALSE
    assert compare("==", 1.0, 1.0) is TRUE
    near = compare("==", 0.1 + 0.2, 0.3)
    assert isinstance(near, TermComparison)
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
    assert isinstance(merged, Conjunction)
    assert merged.args == (atom, other)


def test_comparisons_turn_round() -> None:
    atom = compare(">=", X, 1.0)
    assert isinstance(atom, TermComparison)
    assert (atom.relation, atom.left, atom.right) == (Relation.LE, Num(1.0), X)
    unequal = negation(compare("==", X, 1.0))
    assert isinstance(unequal, Disjunction)
    assert evaluate(unequal, {"x": 1.5})
    assert not evaluate(unequal, {"x": 1.0})


def test_strict_atoms_fail_at_equality() -> None:
    assert not evaluate(compare("<", X, 1.0), {"x": 1.0})
    assert evaluate(compare("<", X, 1.0), {"x": 1.0}, slack=1e-12)


def test_deep_graphs() -> None:
    term: Term = X
    for _ in range(20_000):
        term = apply(Operator.SIN, term)
    formula = compare("<=", term, 0.5)
    assert evaluate(formula, {"x": 1.0})
    assert free_variables(formula) == ("x",)
    assert flatten(pickle.loads(pickle.dumps(formula))) == flatten(formula)
    assert flatten(copy.deepcopy(negation(negation(formula)))) == flatten(formula)
    assert "20002 nodes" in repr(term) or "nodes" in repr(term)


def test_deep_connectives() -> None:
    formula: Formula = compare("<=", X, 0.0)
    for level in range(10_000):
        formula = (conjunction, disjunction)[level % 2]([formula, compare("<=", Y, float(level))])
    assert evaluate(formula, {"x": 1.0, "y": 0.0})
    assert not evaluate(negation(formula), {"x": 1.0, "y": 0.0})


def test_shared_graphs_do_not_blow_up() -> None:
    term: Term = X
    for _ in range(200):
        term = apply(Operator.MUL, 0.5, apply(Operator.ADD, term, term))
    assert len(postorder(term)) < 1000
    assert len(flatten(term)) == 402
    assert Evaluator(term)({"x": 3.0}) == 3.0


def test_problem_bounds_count() -> None:
    problem = Problem((Variable("x", 0.0, 1.0),), TRUE)
    assert holds(problem, {"x": 1.0})
    assert not holds(problem, {"x": 1.1})
    assert holds(problem, {"x": 1.1}, slack=0.2)
    assert not holds(problem, {})


@settings(max_examples=50)
@given(st.floats(allow_nan=False, allow_infinity=False))
def test_numbers_round_trip(value: float) -> None:
    again = unflatten(flatten(Num(value)))
    assert isinstance(again, Num)
    assert math.copysign(1.0, again.value) == math.copysign(1.0, value)
    assert again.value == value


def test_operator_values() -> None:
    point = {"x": -8.0, "y": 2.0}
    expected = {
        Op(Operator.POW, (X, Num(3.0))): -512.0,
        Op(Operator.POW, (Y, Num(-2.0))): 0.25,
        Op(Operator.SUB, (X, Y)): -10.0,
        Op(Operator.DIV, (X, Y)): -4.0,
        Op(Operator.EXP, (Num(1e6),)): math.inf,
        Op(Operator.POW, (Num(-1e300), Num(3.0))): -math.inf,
        Op(Operator.ATAN2, (Num(-0.0), Num(-1.0))): math.pi,
        Op(Operator.MIN, (X, Y, Num(-9.0))): -9.0,
    }
    for term, value in expected.items():
        assert Evaluator(term)(point) == value
    assert math.isnan(Evaluator(Op(Operator.ACOS, (Y,)))(point))
    assert math.isnan(Evaluator(Op(Operator.MIN, (Op(Operator.LOG, (X,)), Y)))(point))
