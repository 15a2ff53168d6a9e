"""One table of problems for every solver: what a solver may answer, and that its witnesses hold.

A solver may always say that it does not know, except where the table insists; it may never be wrong.
"""

from __future__ import annotations

import contextlib
import math
import os
import shutil
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from built_in import BuiltIn
from formulas import Var, Variable

from scenicq.errors import SolverError
from scenicq.forest.nodes import ArithmeticOp
from scenicq.smt.answer import Answer, NoAnswer, Sat, SolverSession, Unsat
from scenicq.smt.problem import Formula, Problem, Term, holds
from scenicq.smt.solver import open_solver
from scenicq.smt.terms import FALSE, TRUE, apply, compare, conjunction, disjunction, negation

Fn = ArithmeticOp
X, Y, Z, H = Var("x"), Var("y"), Var("z"), Var("h")
PRECISION = 1e-3
INF = math.inf


@dataclass(frozen=True)
class Example:
    """A problem with the answers that are right.

    Attributes:
        name: What it is about.
        problem: The problem.
        answers: Of "sat", "unsat" and "unknown", those that are right.
        polynomial: Whether solvers without transcendental functions are asked too.
    """

    name: str
    problem: Problem
    answers: str
    polynomial: bool = True


def _example(
    name: str, answers: str, *parts: Formula, polynomial: bool = True, **ranges: tuple[float, float]
) -> Example:
    variables = tuple(Variable(variable, *ends) for variable, ends in ranges.items())
    return Example(name, Problem(variables, conjunction(parts)), answers, polynomial)


def _square(term: Term) -> Term:
    return apply(Fn.POW, term, 2.0)


def _sum(*terms: Term | float) -> Term:
    return apply(Fn.ADD, *terms)


def _times(*terms: Term | float) -> Term:
    return apply(Fn.MUL, *terms)


CIRCLE = compare("==", _sum(_square(X), _square(Y)), 4.0)
WIDE, UNIT = (-10.0, 10.0), (0.0, 1.0)
ALL = (-INF, INF)


def _lane(count: int, x: Term, y: Term) -> Formula:
    """A point in a quarter of a ring between 20 and 24 m, cut into triangles."""
    inner, outer = ([(r * math.cos(t), r * math.sin(t)) for t in _angles(count // 2)] for r in (20.0, 24.0))
    pieces = list(zip(inner, outer, outer[1:], strict=False)) + list(zip(inner, outer[1:], inner[1:], strict=False))
    sides = [zip(piece, (*piece[1:], piece[0]), strict=True) for piece in pieces]
    return disjunction(conjunction(_left_of(a, b, x, y) for a, b in side) for side in sides)


def _angles(steps: int) -> list[float]:
    return [step * math.pi / 2 / steps for step in range(steps + 1)]


def _left_of(a: tuple[float, float], b: tuple[float, float], x: Term, y: Term) -> Formula:
    along = _times(b[0] - a[0], apply(Fn.SUB, y, a[1]))
    across = _times(b[1] - a[1], apply(Fn.SUB, x, a[0]))
    return compare(">=", apply(Fn.SUB, along, across), 0.0)


def _relative(answers: str, name: str, ego: tuple[float, float], heading: tuple[float, float]) -> Example:
    """An object stands `x` to the right and `y` ahead of a point of a lane: the formulas of real queries."""
    cos, sin = apply(Fn.COS, H), apply(Fn.SIN, H)
    place_x = apply(Fn.SUB, ego[0], apply(Fn.SUB, _times(X, cos), _times(Y, sin)))
    place_y = apply(Fn.SUB, ego[1], _sum(_times(X, sin), _times(Y, cos)))
    spot_x, spot_y = Var("sx"), Var("sy")
    return _example(
        name,
        answers,
        compare("==", spot_x, place_x),
        compare("==", spot_y, place_y),
        _lane(20, spot_x, spot_y),
        polynomial=False,
        x=(2.0, 4.0),
        y=(5.0, 10.0),
        h=heading,
        sx=ALL,
        sy=ALL,
    )


EXAMPLES = [
    _example("nothing to satisfy", "sat", x=UNIT),
    _example("no variables", "sat"),
    _example("false", "unsat", FALSE, x=UNIT),
    _example("ground", "sat", compare("<=", _sum(0.1, 0.2), 0.3)),
    _example("empty range", "unsat", TRUE, x=(1.0, 0.0)),
    _example("one point", "sat", compare("==", X, 0.1), x=(0.1, 0.1)),
    _example("a range cuts", "unsat", compare(">=", X, 1.5), x=UNIT),
    _example("linear", "sat", compare("<=", _sum(X, Y), 1.0), compare(">=", apply(Fn.SUB, X, Y), 0.5), x=WIDE, y=WIDE),
    _example("linear, empty", "unsat", compare("<=", _sum(X, Y), 1.0), compare(">=", _sum(X, Y), 1.5), x=WIDE, y=WIDE),
    _example("strict", "sat", compare("<", X, 1.0), compare(">", X, 0.5), x=WIDE),
    _example("between two constants", "unsat", compare("<", X, 1.0), compare(">", X, 1.1), x=WIDE),
    _example("circle and line", "sat", CIRCLE, compare("==", Y, X), x=WIDE, y=WIDE),
    _example("circle far from line", "unsat", CIRCLE, compare("==", _sum(X, Y), 3.5), x=WIDE, y=WIDE),
    _example(
        "circle touches line within the precision",
        "sat unsat unknown",
        CIRCLE,
        compare("==", X, 2.0 + 1e-5),
        x=WIDE,
        y=WIDE,
    ),
    _example("touching", "sat unknown", CIRCLE, compare("==", X, 2.0), x=WIDE, y=WIDE),
    _example("just apart", "sat unsat unknown", compare("<=", X, 1.0), compare(">=", X, 1.0 + 1e-4), x=WIDE),
    _example("apart by more than the precision", "unsat", compare("<=", X, 1.0), compare(">=", X, 1.01), x=WIDE),
    _example("half bounded", "sat", compare(">=", X, 1e6), compare("<=", Y, _times(-2.0, X)), x=(0.0, INF), y=ALL),
    _example("half bounded, empty", "unsat", compare("<=", _sum(X, Y), -1.0), x=(0.0, INF), y=(0.0, INF)),
    _example("unbounded", "sat", compare("==", Y, _sum(_times(3.0, X), 1.0)), compare(">=", Y, 50.0), x=ALL, y=ALL),
    _example("unbounded square", "sat", compare("<=", _square(X), 2.0), compare(">=", X, 1.0), x=ALL),
    _example("negative square", "unsat", compare("<=", _square(X), -1.0), x=ALL),
    _example(
        "chain of equalities",
        "sat",
        compare("==", Y, _sum(X, 1.0)),
        compare("==", Z, _times(Y, 2.0)),
        compare("==", Z, 7.0),
        x=ALL,
        y=ALL,
        z=ALL,
    ),
    _example(
        "chain of equalities, broken",
        "unsat",
        compare("==", Y, _sum(X, 1.0)),
        compare("==", Z, _times(Y, 2.0)),
        compare("==", Z, 7.0),
        compare("<=", X, 2.0),
        x=ALL,
        y=ALL,
        z=ALL,
    ),
    _example(
        "choices",
        "sat",
        disjunction([compare("<=", X, 1.0), compare(">=", X, 8.0)]),
        disjunction([compare("==", X, Y), compare("<=", Y, -5.0)]),
        compare(">=", Y, 8.5),
        x=WIDE,
        y=WIDE,
    ),
    _example(
        "choices, none fits",
        "unsat",
        disjunction([compare("<=", X, 1.0), compare(">=", X, 8.0)]),
        disjunction([compare("==", _square(X), 9.0), compare("==", X, 5.0)]),
        compare(">=", X, 0.0),
        x=WIDE,
    ),
    _example("negated choice", "unsat", negation(disjunction([compare("<=", X, 1.0), compare(">", X, 0.5)])), x=WIDE),
    _example("absolute value", "sat", compare("==", apply(Fn.ABS, X), 3.0), compare("<=", X, 0.0), x=WIDE),
    _example(
        "extremes",
        "sat",
        compare("==", apply(Fn.MAX, X, 2.0), 2.0),
        compare(">=", apply(Fn.MIN, X, Y), 1.0),
        x=WIDE,
        y=WIDE,
    ),
    _example(
        "extremes, empty", "unsat", compare("<=", apply(Fn.MAX, X, Y), 1.0), compare(">=", X, 1.5), x=WIDE, y=WIDE
    ),
    _example("quotient", "sat", compare("==", apply(Fn.DIV, X, Y), 0.5), compare(">=", X, 1.0), x=WIDE, y=WIDE),
    _example(
        "powers", "sat", compare("==", apply(Fn.POW, X, 3.0), -8.0), compare(">=", apply(Fn.POW, X, -2.0), 0.1), x=WIDE
    ),
    _example("in the lane", "sat", _lane(20, X, Y), compare(">=", X, 21.0), compare("<=", Y, 3.0), x=ALL, y=ALL),
    _example(
        "beside the lane",
        "unsat",
        _lane(20, X, Y),
        compare("<=", X, 13.0),
        compare("<=", Y, 13.0),
        x=(-100.0, 100.0),
        y=(-100.0, 100.0),
    ),
    _example(
        "beside the lane, unbounded",
        "unsat unknown",
        _lane(20, X, Y),
        compare("<=", X, 13.0),
        compare("<=", Y, 13.0),
        x=ALL,
        y=ALL,
    ),
    _example("square root", "sat", compare("==", apply(Fn.SQRT, X), 1.5), polynomial=False, x=WIDE),
    _example(
        "square root of less than nothing",
        "unsat",
        compare("<=", apply(Fn.SQRT, X), 5.0),
        polynomial=False,
        x=(-5.0, -1.0),
    ),
    _example("sine", "sat", compare("==", apply(Fn.SIN, X), 0.5), polynomial=False, x=(10.0, 20.0)),
    _example("sine too big", "unsat", compare(">=", apply(Fn.SIN, X), 1.01), polynomial=False, x=ALL),
    _example("sine of anything", "sat", compare("==", apply(Fn.SIN, X), 0.5), polynomial=False, x=ALL),
    _example("tangent", "sat", compare("==", apply(Fn.TAN, X), -5.0), polynomial=False, x=(1.6, 4.0)),
    _example(
        "direction",
        "sat",
        compare("==", apply(Fn.ATAN2, Y, X), 3.0),
        compare("==", _sum(_square(X), _square(Y)), 1.0),
        polynomial=False,
        x=WIDE,
        y=WIDE,
    ),
    _example(
        "direction, wrong quadrant",
        "unsat",
        compare(">=", apply(Fn.ATAN2, Y, X), 0.1),
        polynomial=False,
        x=WIDE,
        y=(-10.0, -0.1),
    ),
    _example(
        "direction at the seam", "sat", compare(">=", apply(Fn.ATAN2, Y, X), 3.14), polynomial=False, x=WIDE, y=WIDE
    ),
    _example(
        "direction on an axis", "sat", compare("<=", apply(Fn.ATAN2, Y, 0.0), -0.9), polynomial=False, y=(-2.0, 3.0)
    ),
    _example(
        "inverse functions",
        "sat",
        compare("==", apply(Fn.ASIN, X), apply(Fn.ACOS, X)),
        compare(">=", apply(Fn.ATAN, Y), 1.0),
        polynomial=False,
        x=WIDE,
        y=WIDE,
    ),
    _example("inverse sine out of reach", "unsat", compare(">=", apply(Fn.ASIN, X), 1.6), polynomial=False, x=WIDE),
    _example(
        "growth",
        "sat",
        compare("==", apply(Fn.EXP, X), 5.0),
        compare("==", apply(Fn.LOG, Y), X),
        polynomial=False,
        x=WIDE,
        y=WIDE,
    ),
    _relative("sat", "beyond a lane", (15.0, 26.0), (0.1, 0.5)),
    _relative("unsat", "too far beyond a lane", (40.0, 40.0), (0.1, 0.5)),
]

KANGAROO = Problem(
    tuple(Variable(f"k{number}", -4.0, 4.0) for number in range(12)),
    conjunction(
        compare(
            "==", _sum(*(apply(Fn.SIN, _times(Var(f"k{a}"), Var(f"k{b}"), float(a + 1))) for a in range(12))), 0.777
        )
        for b in range(12)
    ),
)
"""Far too hard to be decided in a second."""


def _open(name: str) -> SolverSession | BuiltIn:
    if name == "portable":
        return BuiltIn()
    if name == "z3":
        command = Path(sys.executable).with_name("z3")
        path = str(command) if command.exists() else shutil.which("z3")
        if path is None:
            pytest.skip("no z3 command: the package z3-solver brings one")
        opened = open_solver(f"'{path}' -in pp.decimal=true")
        assert opened is not None
        return opened
    try:
        opened = open_solver(name)
    except SolverError as error:
        pytest.skip(error.diagnostics[0].message)
    assert opened is not None
    return opened


DOUBLE = Path(__file__).parents[1] / "units" / "smt" / "double"
"""Where a package `dreal` lies that takes what dReal's own takes: the adapter runs where that does not load."""


@pytest.fixture(scope="module", params=["portable", "dreal", "double of dreal", "z3"])
def solver(request: pytest.FixtureRequest) -> Iterator[SolverSession | BuiltIn]:
    with pytest.MonkeyPatch.context() as patch:
        if request.param == "double of dreal":
            patch.syspath_prepend(DOUBLE)
        with _open(request.param.removeprefix("double of ")) as opened:
            yield opened


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda example: example.name)
@pytest.mark.one_in(3)
def test_answers(solver: SolverSession | BuiltIn, example: Example) -> None:
    if not example.polynomial and "z3" in solver.name:
        pytest.skip("z3 has no transcendental functions")
    answer = solver.check(example.problem, precision=PRECISION, timeout_s=20.0)
    match answer:
        case Sat(witness):
            assert "sat" in example.answers.split()
            assert set(witness) == {variable.name for variable in example.problem.variables}
            assert holds(example.problem, witness, PRECISION)
        case Unsat():
            assert "unsat" in example.answers.split()
        case NoAnswer(reason):
            assert "unknown" in example.answers.split(), reason


def test_timeouts_end_the_search(solver: SolverSession | BuiltIn) -> None:
    answer = solver.check(KANGAROO, precision=1e-9, timeout_s=1.0)
    if "z3" not in solver.name:
        # z3 may give up at once
        assert answer == NoAnswer("timeout")
    assert isinstance(solver.check(Problem((), TRUE), precision=1e-3, timeout_s=10.0), Sat)


def test_a_killed_process_costs_one_problem(
    solver: SolverSession | BuiltIn, started_processes: Callable[[], dict[int, bytes]]
) -> None:
    """Whatever runs the solver is killed at work: that problem is unknown, the next is decided."""
    if isinstance(solver, BuiltIn):
        pytest.skip("it has no process of its own")
    if not Path(f"/proc/self/task/{os.getpid()}/children").exists():
        pytest.skip("processes are found in /proc")
    answers: list[Answer] = []
    work = threading.Thread(
        target=lambda: answers.append(solver.check(KANGAROO, precision=1e-9, timeout_s=20.0)), daemon=True
    )
    work.start()
    time.sleep(0.5)
    for _ in range(15):
        for pid, command in started_processes().items():
            # Python's own looks after resources
            if b"resource_tracker" not in command:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
        work.join(1.0)
        if not work.is_alive():
            break
    assert not work.is_alive()
    if "z3" not in solver.name:
        # z3 may have given up before
        assert answers == [NoAnswer("crash")]
    assert isinstance(solver.check(Problem((), TRUE), precision=1e-3, timeout_s=10.0), Sat)
