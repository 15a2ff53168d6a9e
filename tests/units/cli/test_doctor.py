"""`scenicq doctor`."""

import json

import pytest

import scenicq_cli.doctor
from scenicq import __version__
from scenicq.smt.answer import SolverStatus

BROKEN = SolverStatus("dreal", ok=False, detail="missing libraries: libibex.so", hint="do this; do that")


@pytest.fixture
def solvers(monkeypatch):
    def put(*statuses):
        monkeypatch.setattr(scenicq_cli.doctor, "available", lambda: list(statuses))

    return put


def test_the_portable_solver_loads_here(run):
    content = json.loads(run("doctor", "--format", "json").stdout)
    status = {solver["name"]: solver["ok"] for solver in content["solvers"]}
    assert status["portable"] is True
    assert "dreal" in status
    assert content["versions"]["scenicq"] == __version__
    assert {"python", "duckdb", "pyarrow", "shapely", "numpy"} <= set(content["versions"])


def test_it_says_what_is_missing_and_what_to_do(run, solvers):
    solvers(BROKEN, SolverStatus("portable", ok=True, detail="built in"))
    result = run("doctor")
    assert result.exit_code == 0
    assert "dreal does not load: missing libraries: libibex.so" in result.stdout
    assert result.stdout.count("hint: do th") == 2


def test_without_any_solver_it_fails(run, solvers):
    solvers(BROKEN)
    assert run("doctor").exit_code == 2
