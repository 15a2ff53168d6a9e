"""Work is done in order and once, whatever happens to the processes that do it."""

from __future__ import annotations

import multiprocessing
import os
import signal
import time
from pathlib import Path

import pytest

import scenicq.processes
from scenicq.errors import DataError
from scenicq.processes import LostTask, Workers

pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals")


def squares(_):
    def work(task, tell):
        tell(-task)
        return task * task

    return work


def deadly(folder: Path):
    """Dies at 3 always, and at 5 once."""

    def work(task, tell):
        mark = folder / str(task)
        if task == 3 or (task == 5 and not mark.exists()):
            mark.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return os.getpid(), task

    return work


def patient(_):
    def work(task, tell):
        tell(os.getpid())
        time.sleep(task)
        return task

    return work


def failing(_):
    class Local(Exception):
        """One that cannot be sent."""

    def work(task, tell):
        if task == "own":
            raise ValueError("mine")
        raise Local("there")

    return work


def killed_at_the_start(connection, start, setup):
    """Serves at the sixth attempt, or never."""
    (folder,) = setup
    mark = folder / str(len(list(folder.iterdir())))
    if mark.name != "5":
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    scenicq.processes._serve(connection, start, setup)


def broken(_):
    raise KeyError("at the start")


@pytest.mark.parametrize("count", [1, 3])
def test_answers_come_in_order(count):
    said = []
    with Workers(count, squares, (0,)) as workers:
        assert list(workers.run(range(20), said.append)) == [(n, n * n) for n in range(20)]
    assert sorted(said) == sorted(-n for n in range(20))
    assert multiprocessing.active_children() == []


@pytest.mark.parametrize("where", ["send", "join"])
def test_an_interrupt_while_processes_end_leaves_none(monkeypatch, where):
    def interrupted(*_):
        monkeypatch.undo()
        raise KeyboardInterrupt

    owner = "connection.Connection" if where == "send" else "context.SpawnProcess"

    def work():
        with Workers(2, squares, (0,)) as workers:
            assert len(list(workers.run(range(8)))) == 8
            monkeypatch.setattr(f"multiprocessing.{owner}.{where}", interrupted)

    with pytest.raises(KeyboardInterrupt):
        work()
    assert multiprocessing.active_children() == []


def test_tasks_are_taken_when_there_is_room():
    taken = []
    with Workers(2, squares, (0,)) as workers:
        found = workers.run(taken.append(n) or n for n in range(1000))
        next(found)
        assert len(taken) <= 5
        found.close()
        assert list(workers.run([7])) == [(7, 49)]


def test_a_task_that_kills_is_lost_and_no_other(tmp_path):
    with Workers(2, deadly, (tmp_path,)) as workers:
        found = dict(workers.run(range(8)))
    assert found[3] == LostTask(3)
    assert [task for task, answer in found.items() if isinstance(answer, LostTask)] == [3]
    assert [answer[1] for task, answer in found.items() if task != 3] == [0, 1, 2, 4, 5, 6, 7]


def test_processes_that_are_killed_from_outside_are_replaced():
    with Workers(2, patient, (0,)) as workers:
        killed = []

        def kill(pid):
            if len(killed) < 2:
                killed.append(pid)
                os.kill(pid, signal.SIGKILL)

        assert [answer for _, answer in workers.run([0.1] * 6, kill)] == [0.1] * 6
        assert len(set(killed)) == 2


def test_a_run_within_a_run():
    with Workers(2, squares, (0,)) as workers:
        found = []
        for task, _ in workers.run(range(6)):
            found += workers.run([10 * task])
    assert found == [(10 * n, 100 * n * n) for n in range(6)]


@pytest.mark.parametrize(("task", "kind"), [("own", ValueError), ("local", RuntimeError)])
def test_what_work_raises_is_raised_here(task, kind):
    with pytest.raises(kind, match=r"mine|there"), Workers(1, failing, (0,)) as workers:
        list(workers.run([task]))
    assert multiprocessing.active_children() == []


def test_a_start_that_fails_is_no_endless_loop():
    with pytest.raises(KeyError, match="at the start"), Workers(1, broken, (0,)) as workers:
        list(workers.run([1]))


@pytest.mark.slow
def test_starting_processes_may_be_killed_now_and_then(monkeypatch, tmp_path):
    monkeypatch.setattr("scenicq.processes._serve", killed_at_the_start)
    monkeypatch.setattr("scenicq.processes._KILLED_STARTS", 6)
    with Workers(1, squares, (tmp_path,)) as workers:
        assert list(workers.run([7])) == [(7, 49)]
    (tmp_path / "always").touch()
    with pytest.raises(DataError, match="before they have started"), Workers(1, squares, (tmp_path,)) as workers:
        list(workers.run([7]))


@pytest.mark.slow
def test_processes_that_never_start_are_no_endless_loop(monkeypatch):
    monkeypatch.setattr("scenicq.processes._serve", os._exit)
    with pytest.raises(DataError, match="before they have started"), Workers(1, squares, (0,)) as workers:
        list(workers.run([1]))


def test_an_interrupt_ends_the_processes_at_once():
    def interrupt(_):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt), Workers(1, patient, (0,)) as workers:
        list(workers.run([60], interrupt))
    assert multiprocessing.active_children() == []
