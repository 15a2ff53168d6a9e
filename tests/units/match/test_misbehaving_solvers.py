"""`scenicq match` with solvers that die, hang, talk nonsense or eat memory: each frame gets its verdict or a reason."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import sys
import threading
from pathlib import Path

import pytest
from click.testing import CliRunner
from left_to_solvers import leave_to_solvers

from scenicq.smt import solver, worker_solver
from scenicq_cli.main import cli

HERE = Path(__file__).parent

# The angle is hidden and turns both the place and the heading: no linear program decides that.
PROGRAM = """
model scenic.domains.driving.model
angle = Range(-60, 60) deg
ego = new Car
other = new Car offset along angle relative to ego.heading by (Range(-6, 6), Range(0, 14)),
    facing angle relative to ego.heading
"""


@pytest.fixture(autouse=True, scope="module")
def no_search(honest):
    """From what is right on, nothing of our own decides before a solver is asked."""
    with pytest.MonkeyPatch.context() as patch:
        leave_to_solvers(patch)
        yield


@pytest.fixture(scope="module")
def verdicts(crossroads, tmp_path_factory):
    """Verdict and cause by frame, under options."""
    file = tmp_path_factory.mktemp("program") / "hidden.scenic"
    file.write_text(PROGRAM)

    def decide(*options):
        words = ["match", str(file), str(crossroads), "--all", "--format", "jsonl", "--exit-zero", *options]
        told = CliRunner().invoke(cli, words, prog_name="scenicq")
        assert told.exit_code == 0, told.stderr
        rows = [json.loads(line) for line in told.stdout.splitlines()]
        return {row["frame"]: row for row in rows}

    return decide


def reason_of(row):
    """Why a frame is unknown."""
    return json.dumps(row.get("cause"))


@pytest.fixture(scope="module")
def honest(verdicts):
    found = verdicts("--solver", "portable")
    assert {row["verdict"] for row in found.values()} == {"match", "no_match"}
    return found


@pytest.mark.slow
def test_frames_that_a_broken_solver_decides_are_as_ever_and_the_others_are_named(honest, verdicts, monkeypatch):
    monkeypatch.syspath_prepend(str(HERE))
    monkeypatch.setattr(solver, "DREAL", "mixed_checks:check")
    monkeypatch.setattr(worker_solver, "GRACE_S", 0.05)
    found = verdicts("--solver", "dreal", "--timeout", "0.2")
    assert found.keys() == honest.keys()
    unknown = {frame: reason_of(row) for frame, row in found.items() if row["verdict"] == "unknown"}
    assert all(found[frame]["verdict"] == honest[frame]["verdict"] for frame in found.keys() - unknown.keys())
    for reason in ("crash", "timeout", "garbage", "memory"):
        assert any(reason in told for told in unknown.values()), (reason, unknown)
    assert all(any(reason in told for reason in ("crash", "timeout", "garbage", "memory")) for told in unknown.values())
    assert sum(row["verdict"] == "match" for row in found.values())


COMMANDS = {
    "crash": "import os, signal; os.kill(os.getpid(), signal.SIGSEGV)",
    "timeout": "import subprocess, time; subprocess.Popen(['sleep', '600']); time.sleep(600)",
    "garbage": "while True: print('(' * 4096 + '\\x00\\u20ac sat)')",
    "precision": "print('sat')",
    "memory": "print('(error \"out of memory\")', bytearray(2**45))",
}


@pytest.mark.parametrize("reason", COMMANDS)
@pytest.mark.slow
def test_a_command_that_misbehaves_leaves_its_frames_unknown(reason, honest, verdicts, tmp_path):
    stub = tmp_path / "stub.py"
    stub.write_text(COMMANDS[reason])
    found = verdicts("--solver", f"'{sys.executable}' -S '{stub}'", "--timeout", "0.1" if reason == "timeout" else "20")
    assert found.keys() == honest.keys()
    unknown = [row for row in found.values() if row["verdict"] == "unknown"]
    assert unknown
    # what eats memory fails under its limit
    expected = "crash" if reason == "memory" else reason
    assert all(expected in reason_of(row) for row in unknown), [reason_of(row) for row in unknown[:3]]
    others = [frame for frame, row in found.items() if row["verdict"] != "unknown"]
    assert others
    assert all(found[frame]["verdict"] == honest[frame]["verdict"] for frame in others)


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="worker processes are found in /proc")
@pytest.mark.slow
def test_workers_killed_from_outside_cost_no_frame_its_verdict_but_those_at_work(
    honest, verdicts, started_processes, monkeypatch
):
    monkeypatch.setattr(solver, "DREAL", "built_in:check")
    done = threading.Event()
    killed, seen, most = [], [], 0

    def run():
        nonlocal most
        # a solver that is killed at each of three starts does not load, and that is another story
        most = len(killed) + 2
        return verdicts("--solver", "dreal", "--method", "smt")

    def killer():
        # one as soon as it is seen, that is at its start, the next when it is at work, and so on
        while not done.wait(0.1):
            for pid, command in started_processes().items():
                if b"scenicq.smt.worker" not in command or pid in killed or len(killed) >= most:
                    continue
                at_once = len(killed) % 2 == 1
                if at_once or pid in seen:
                    with contextlib.suppress(ProcessLookupError):
                        os.kill(pid, signal.SIGKILL)
                        killed.append(pid)
                seen.append(pid)

    thread = threading.Thread(target=killer)
    thread.start()
    try:
        runs = [run()]
        # a run may be over before its second worker was seen
        while len(killed) < 2 and len(runs) < 10:
            runs.append(run())
    finally:
        done.set()
        thread.join()
    assert len(killed) >= 2
    for found in runs:
        assert found.keys() == honest.keys()
        for frame, row in found.items():
            assert row["verdict"] == honest[frame]["verdict"] or "crash" in reason_of(row), (frame, row)
        assert any(row["verdict"] != "unknown" for row in found.values())


@pytest.mark.slow
def test_solvers_that_hang_end_with_their_timeouts(verdicts, honest, tmp_path):
    stub = tmp_path / "stub.py"
    stub.write_text("import time; time.sleep(600)")
    found = verdicts("--solver", f"'{sys.executable}' -S '{stub}'", "--timeout", "0.05")
    asked = sum(row["verdict"] == "unknown" for row in found.values())
    assert asked
