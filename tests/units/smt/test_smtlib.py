"""SMT-LIB text and replies, and solvers behind a command line."""

from __future__ import annotations

import math
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from formulas import Var, Variable, evaluate
from hypothesis import given, settings
from hypothesis import strategies as st

from scenicq.errors import SolverError
from scenicq.forest.nodes import ArithmeticOp
from scenicq.smt import command
from scenicq.smt.answer import Answer, NoAnswer, Sat, Unsat
from scenicq.smt.command import SmtlibSolver
from scenicq.smt.problem import Formula, Problem, Term
from scenicq.smt.smtlib import read_reply, to_smtlib
from scenicq.smt.terms import TRUE, apply, compare, conjunction, disjunction, number

Fn = ArithmeticOp
X, Y = Var("x"), Var("y")
ONE = Problem((Variable("x"),), TRUE)


def test_script() -> None:
    """The text of a small problem, in full."""
    problem = Problem(
        (Variable("x", -3.0, 3.0), Variable("spot of `Car`")),
        conjunction(
            [
                compare("<=", apply(Fn.ADD, apply(Fn.POW, X, 2.0), Var("spot of `Car`")), 1e-7),
                disjunction([compare("<", X, -0.5), compare("==", apply(Fn.DIV, 1.0, X), 2.0)]),
            ]
        ),
    )
    assert to_smtlib(problem, 0.001).splitlines() == [
        "(set-option :produce-models true)",
        "(set-logic QF_NRA)",
        "(set-info :precision 0.001)",
        "(declare-fun x () Real)",
        "(assert (<= (- 3.0) x))",
        "(assert (<= x 3.0))",
        "(declare-fun v!1 () Real)",
        "(assert (and (<= (+ (* x x) v!1) 0.0000001) (or (< x (- 0.5)) (and (not (= x 0.0)) (= (/ 1.0 x) 2.0)))))",
        "(check-sat)",
        "(get-model)",
        "(exit)",
    ]


def test_names_that_mean_something_are_replaced() -> None:
    names = ["let", "sin", "a|b", "x y", "", "ok_1", "1x", "t!3"]
    script = to_smtlib(Problem(tuple(Variable(name) for name in names), TRUE), 1.0)
    declared = [line.split()[1] for line in script.splitlines() if line.startswith("(declare-fun")]
    assert declared == ["v!0", "v!1", "v!2", "v!3", "v!4", "ok_1", "v!6", "v!7"]


def test_shared_and_deep_parts_are_defined_once() -> None:
    shared: Term = X
    deep: Term = X
    for _ in range(300):
        shared = apply(Fn.ADD, shared, apply(Fn.SIN, shared))
        deep = apply(Fn.SIN, deep)
    script = to_smtlib(Problem((Variable("x"),), compare("<=", shared, deep)), 1e-3)
    assert len(script) < 60_000
    nesting = deepest = 0
    for character in script:
        nesting += (character == "(") - (character == ")")
        deepest = max(deepest, nesting)
    assert deepest < 100
    assert nesting == 0


@pytest.mark.parametrize(
    ("reply", "answer"),
    [
        ('unsat\n(error "line 9: model is not available")\n', Unsat()),
        ("sat\n(\n  (define-fun x () Real\n    (/ 1.0 4.0))\n)\n", Sat({"x": 0.25})),
        ("sat\n(model (define-fun x () Real (- (/ 1 4))))", Sat({"x": -0.25})),
        ("sat\n((x 0.5))\n", Sat({"x": 0.5})),
        ("sat\n((|x| (- 2.0)))\n", Sat({"x": -2.0})),
        ("sat\n((define-fun x () Real 1.41421356?))", Sat({"x": 1.41421356})),
        ("delta-sat with delta = 0.001\nx : [0.5, 1.5]\n", Sat({"x": 1.0})),
        ("delta-sat with delta = 0.001\n(model\n  (define-fun x () Real [0.5, 1.5])\n)", Sat({"x": 1.0})),
        ("delta-sat\nx : [ -inf, 7 ]\n", Sat({"x": 7.0})),
        ("sat\n(\n)\n", Sat({"x": 0.0})),
        ("success\nunknown\n", NoAnswer("budget")),
        ("timeout\n", NoAnswer("timeout")),
        ('(error "unknown constant sin")\nsat\n((x 0.0))', NoAnswer("unsupported: unknown constant sin")),
        (
            "sat\n((define-fun x () Real (root-obj (+ (^ x 2) (- 2)) 2)))",
            NoAnswer("unsupported: a value in the model is no number"),
        ),
        ("", NoAnswer("garbage")),
        ("Segmentation fault\n", NoAnswer("garbage")),
        ("saturday\n", NoAnswer("garbage")),
        ("\x00\ufffd)))((", NoAnswer("garbage")),
        ("sat\n" + "(" * 5000, Sat({"x": 0.0})),
    ],
)
def test_replies(reply: str, answer: Answer) -> None:
    assert read_reply(reply, ONE) == answer


@given(st.text())
def test_any_reply_is_an_answer(text: str) -> None:
    assert isinstance(read_reply("sat\n" + text, ONE), (Sat, NoAnswer))


def _stub(tmp_path: Path, body: str) -> str:
    script = tmp_path / "solver.py"
    script.write_text(body)
    return f"'{sys.executable}' -S '{script}'"


STUBS = {
    "import sys; sys.stdin.read(); print('sat'); print('((x 0.5))')": Sat({"x": 0.5}),
    "print('unsat')": Unsat(),
    "print('sat'); print('((x 7.0))')": NoAnswer("precision"),
    "import os; os._exit(3)": NoAnswer("crash"),
    "import os, signal; os.kill(os.getpid(), signal.SIGSEGV)": NoAnswer("crash"),
    "print('hello')": NoAnswer("garbage"),
    "while True: print('sat' * 1000)": NoAnswer("garbage"),
    "import time; time.sleep(600)": NoAnswer("timeout"),
    "import os, time; os.close(1); time.sleep(600)": NoAnswer("timeout"),
    "import subprocess, time; subprocess.Popen(['sleep', '600']); time.sleep(600)": NoAnswer("timeout"),
}


@pytest.mark.parametrize(("body", "answer"), STUBS.items())
def test_commands(tmp_path: Path, body: str, answer: Answer) -> None:
    problem = Problem((Variable("x", 0.0, 1.0),), TRUE)
    with SmtlibSolver(_stub(tmp_path, body)) as solver:
        assert solver.check(problem, precision=1e-3, timeout_s=1.0 if answer == NoAnswer("timeout") else 20.0) == answer


@pytest.mark.parametrize("command", ["no-such-solver -in", "", "'unclosed", "/"])
def test_commands_that_cannot_start(command: str) -> None:
    with pytest.raises(SolverError):
        SmtlibSolver(command)


POINTS = st.fixed_dictionaries(
    {"x": st.integers(-8, 8).map(lambda n: n / 2), "y": st.integers(-8, 8).map(lambda n: n / 2)}
)


@st.composite
def polynomials(draw: st.DrawFn) -> Formula:
    """Small formulas over sums, products, extremes and quotients."""
    terms: list[Term] = [X, Y, number(draw(st.integers(-4, 4)) / 2.0)]
    for _ in range(draw(st.integers(1, 5))):
        operator = draw(st.sampled_from((Fn.ADD, Fn.SUB, Fn.MUL, Fn.MIN, Fn.MAX, Fn.DIV, Fn.ABS, Fn.NEG)))
        one, two = draw(st.sampled_from(terms)), draw(st.sampled_from(terms))
        terms.append(apply(operator, one) if operator in (Fn.ABS, Fn.NEG) else apply(operator, one, two))
    relations = st.sampled_from(("<=", "<", ">=", ">", "=="))
    atoms = [compare(draw(relations), draw(st.sampled_from(terms)), draw(st.sampled_from(terms))) for _ in range(4)]
    return disjunction([conjunction(atoms[:2]), conjunction(atoms[2:])])


@settings(max_examples=200, deadline=None)
@given(polynomials(), POINTS)
def test_text_means_what_evaluation_says(formula: Formula, point: dict[str, float]) -> None:
    """z3, in the test only, reads the text at a point where everything is exact."""
    z3 = pytest.importorskip("z3")
    script = to_smtlib(Problem((Variable("x"), Variable("y")), formula), 0.0)
    solver = z3.Solver()
    solver.set("timeout", 2000)
    solver.add(z3.parse_smt2_string(script.partition("(check-sat)")[0]))
    for name, value in point.items():
        solver.add(z3.Real(name) == z3.Q(int(value * 2), 2))
    said = solver.check()
    if said == z3.unknown or _is_close(formula, point):
        return
    assert (said == z3.sat) is evaluate(formula, point)


def _is_close(formula: Formula, point: dict[str, float]) -> bool:
    """Whether rounding decides."""
    return evaluate(formula, point, slack=1e-9) is not evaluate(formula, point) and not math.isnan(0.0)


@pytest.mark.skipif(sys.platform != "linux", reason="the limit exists on Linux")
def test_commands_have_a_memory_limit(tmp_path: Path) -> None:
    body = "import time; time.sleep(0.2); x = bytearray(900 * 2**20); print('unsat')"
    for memory_mb, answer in ((400, NoAnswer("crash")), (4000, Unsat())):
        with SmtlibSolver(_stub(tmp_path, body), memory_mb=memory_mb) as solver:
            assert solver.check(ONE, precision=1e-3, timeout_s=20.0) == answer


def test_a_script_for_a_stream_that_is_closed_is_let_go(monkeypatch):
    with subprocess.Popen(["cat"], stdin=subprocess.PIPE, stdout=subprocess.DEVNULL) as process:
        assert process.stdin is not None
        process.stdin.close()
        raised = []
        monkeypatch.setattr(threading, "excepthook", raised.append)
        writer = threading.Thread(target=command._write, args=(process.stdin, b"(check-sat)"))
        writer.start()
        writer.join()
    assert raised == []
