"""Choosing a solver by name, and what is said where it cannot be used."""

from __future__ import annotations

import subprocess
import sys

import pytest
from formulas import Var, Variable

from scenicq.errors import SolverError
from scenicq.smt import solver as module
from scenicq.smt.answer import Sat, SolverStatus
from scenicq.smt.problem import Problem
from scenicq.smt.solver import available, open_solver
from scenicq.smt.terms import compare

PROBLEM = Problem((Variable("x", 0.0, 4.0),), compare(">=", Var("x"), 3.0))


@pytest.fixture
def without_dreal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "DREAL", "no_such_package:check")


def test_the_built_in_solver_is_none_of_them() -> None:
    assert open_solver("portable") is None


def test_auto_is_dreal_where_it_loads(monkeypatch: pytest.MonkeyPatch) -> None:
    # this one loads everywhere, in a process of its own as dReal would
    monkeypatch.setattr(module, "DREAL", "built_in:check")
    opened = open_solver("auto")
    assert opened is not None
    with opened:
        assert opened.loads()
        assert isinstance(opened.check(PROBLEM, precision=1e-3, timeout_s=20.0), Sat)


@pytest.mark.usefixtures("without_dreal")
def test_auto_is_the_built_in_solver_where_dreal_does_not_load() -> None:
    assert open_solver("auto") is None


@pytest.mark.usefixtures("without_dreal")
def test_a_missing_solver_is_named_with_what_helps() -> None:
    with pytest.raises(SolverError) as caught:
        open_solver("dreal")
    (diagnostic,) = caught.value.diagnostics
    assert diagnostic.code == "solver-missing"
    assert "no_such_package" in diagnostic.message
    assert any("portable" in hint for hint in diagnostic.hints)


def test_unknown_names_are_commands_that_do_not_exist() -> None:
    with pytest.raises(SolverError) as caught:
        open_solver("dreaal")
    assert "dreaal" in caught.value.diagnostics[0].message
    assert "auto, dreal and portable" in caught.value.diagnostics[0].hints[0]


@pytest.mark.usefixtures("without_dreal")
def test_available() -> None:
    statuses = available()
    assert [status.name for status in statuses] == ["dreal", "portable"]
    assert not statuses[0].ok
    assert statuses[0].hint
    assert statuses[1] == SolverStatus("portable", ok=True, detail="built in")


@pytest.mark.parametrize(
    ("reason", "words"),
    [
        ("ImportError: missing libraries: libibex.so", ("/opt/libibex/2.7.4/lib",)),
        ("ImportError: missing libraries: libClp.so.1, libnlopt.so.0", ("apt-get install libnlopt0",)),
        ("the process ended while it loaded the solver", ("--solver portable",)),
    ],
)
def test_hints_fit_the_reason(reason: str, words: tuple[str, ...]) -> None:
    hints = " ".join(module._dreal_hints(reason))
    assert all(word in hints for word in words)


def test_opening_imports_no_solver() -> None:
    """dReal and numpy stay out of the caller's process, and the start is quick."""
    script = "import sys; import scenicq.smt.solver; print(*sys.modules)"
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    loaded = set(run.stdout.split())
    assert "scenicq.smt.worker_solver" in loaded
    assert not loaded & {"dreal", "codac", "numpy", "scenicq.smt.dreal"}
