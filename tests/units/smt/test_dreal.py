"""The adapter to dReal against a double of its package, and the double against the bindings of the package itself."""

from __future__ import annotations

import importlib
import re
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest
from formulas import Var, Variable

from scenicq.forest.nodes import ArithmeticOp
from scenicq.smt.answer import NoAnswer, Sat, Unsat
from scenicq.smt.problem import Problem, holds
from scenicq.smt.terms import apply, compare, conjunction, disjunction

DOUBLE = Path(__file__).parent / "double"
X, Y = Var("x"), Var("y")
TERMS = {
    "every function": [
        apply(op, X)
        for op in (
            ArithmeticOp.NEG,
            ArithmeticOp.ABS,
            ArithmeticOp.SQRT,
            ArithmeticOp.SIN,
            ArithmeticOp.COS,
            ArithmeticOp.TAN,
            ArithmeticOp.ASIN,
            ArithmeticOp.ACOS,
            ArithmeticOp.ATAN,
            ArithmeticOp.EXP,
            ArithmeticOp.LOG,
        )
    ],
    "every operator": [
        apply(op, X, Y)
        for op in (
            ArithmeticOp.ADD,
            ArithmeticOp.SUB,
            ArithmeticOp.MUL,
            ArithmeticOp.DIV,
            ArithmeticOp.MIN,
            ArithmeticOp.MAX,
            ArithmeticOp.ATAN2,
        )
    ],
    "numbers": [apply(ArithmeticOp.POW, X, 3.0), apply(ArithmeticOp.ADD, X, 1.0), apply(ArithmeticOp.DIV, 2.0, X)],
}


@pytest.fixture
def adapter(monkeypatch: pytest.MonkeyPatch):
    """The adapter, loaded over the double."""
    monkeypatch.syspath_prepend(DOUBLE)
    for name in ("dreal", "scenicq.smt.dreal"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    yield importlib.import_module("scenicq.smt.dreal")
    for name in ("dreal", "scenicq.smt.dreal"):
        sys.modules.pop(name, None)


@pytest.mark.parametrize("terms", TERMS.values(), ids=list(TERMS))
def test_every_operation_is_one_of_the_bindings(adapter, terms) -> None:
    """Whatever the encoder makes is translated, in all relations and connectives."""
    parts = [conjunction([compare(op, term, 0.5) for op in ("<=", "<", "==", ">=", ">")]) for term in terms]
    variables = (Variable("x", 0.25, 0.75), Variable("y", 0.5, 1.0))
    # one of these has a solution, found or not: what counts is that nothing is asked that the bindings do not take
    answer = adapter.check(
        Problem(variables, disjunction([*parts, compare("<=", X, Y)])), precision=1e-3, timeout_s=60.0
    )
    assert isinstance(answer, Sat)


def test_alternatives_are_tried_one_by_one(adapter) -> None:
    either = disjunction([compare("<=", X, 0.1), compare(">=", X, 0.9)])
    other = disjunction([compare("==", Y, X), compare("<=", Y, -1.0)])
    variables = (Variable("x", 0.0, 1.0), Variable("y", 0.0, 1.0))
    problem = Problem(variables, conjunction([either, other, compare(">=", Y, 0.5)]))
    answer = adapter.check(problem, precision=1e-3, timeout_s=60.0)
    assert isinstance(answer, Sat)
    assert holds(problem, answer.witness, 1e-3)
    none = Problem(variables, conjunction([problem.constraint, compare("<=", Y, 0.8)]))
    assert adapter.check(none, precision=1e-3, timeout_s=60.0) == Unsat()


def test_what_dreal_refuses_is_unsupported(adapter) -> None:
    undefined = compare("<=", apply(ArithmeticOp.SQRT, -1.0), X)
    answer = adapter.check(Problem((Variable("x", 0.0, 1.0),), undefined), precision=1e-3, timeout_s=60.0)
    assert isinstance(answer, NoAnswer)
    assert answer.reason.startswith("unsupported: ")


def test_the_double_takes_nothing_else(adapter) -> None:
    """As the bindings do: no argument by name, none too few, none of another type."""
    dreal = adapter.dreal
    yes = dreal.Formula.TRUE()
    for wrong in (
        lambda: dreal.CheckSatisfiability(yes),
        lambda: dreal.CheckSatisfiability(yes, delta=0.1),
        lambda: dreal.CheckSatisfiability(True, 0.1),
        lambda: dreal.logical_and(yes, True),
        lambda: dreal.sin("x"),
        lambda: dreal.Min(dreal.Expression(1.0)),
        lambda: dreal.Variable(1.0),
        lambda: dreal.Expression("x"),
        lambda: dreal.Formula(True),
        lambda: dreal.Expression(1.0) <= "x",
        lambda: dreal.CheckSatisfiability(yes, 0.1)["x"],
    ):
        with pytest.raises(TypeError):
            wrong()
    assert not hasattr(dreal, "atan2")


def test_what_the_double_has_is_in_the_package(adapter) -> None:
    """The names of the bindings are in the package's library, which can be read where it does not load."""
    sys.modules.pop("dreal")
    sys.path.remove(str(DOUBLE))
    package = find_spec("dreal")
    if package is None or package.origin is None:
        pytest.skip("dReal's package is not installed")
    library = b"".join(file.read_bytes() for file in Path(package.origin).parent.glob("_dreal_py*.so"))
    names = set(re.findall(rb"[A-Za-z_][A-Za-z0-9_]*", library)) | {b"logical_and", b"logical_or"}
    of_python = {"__init__", "__eq__", "__hash__", "__version__"}
    used = set(re.findall(r"dreal\.(\w+)", Path(adapter.__file__).read_text())) - {"smt", "import_module"}
    for name in used | {"mid", "has_key", "__getitem__", "TRUE", "FALSE", "__abs__"}:
        assert name in of_python or name.encode() in names, name
