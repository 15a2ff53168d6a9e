"""Processes that work side by side and may die: what one of them was doing is done again by another.

`concurrent.futures` gives up for good when one process is killed; a run of hours must not. The answers come in the
order of the tasks, so that nothing depends on how many processes there are or which of them died.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import signal
import sys
import threading
from collections import deque
from collections.abc import Callable, Generator, Iterable, Sequence
from dataclasses import dataclass, field
from itertools import islice
from types import ModuleType, TracebackType
from typing import TYPE_CHECKING, Any, Generic, Self, TypeVar

from scenicq.errors import DataError, Diagnostic
from scenicq.garbage import collect_seldom
from scenicq.refusals import refused_by_system

if TYPE_CHECKING:  # whoever starts no process need not load what starts them
    import subprocess
    from multiprocessing.connection import Connection
    from multiprocessing.context import SpawnProcess

__all__ = [
    "LostTask",
    "Work",
    "Workers",
    "default_processes",
    "discard_output",
    "end_group",
    "kill_after",
    "kill_on_exit",
    "lead_output_away",
    "limit_memory",
    "processors",
]

Task = TypeVar("Task")
Answer = TypeVar("Answer")

Work = Callable[[Task, Callable[[Any], None]], Answer]
"""Does a task in a worker; the second argument sends a value to the process that waits for the answer."""

_STARTS, _KILLED_STARTS = 3, 30
"""Processes in a row that may end before they have started: of those that end by themselves, and of those killed."""
_AT_MOST = 8
"""Processes where nobody says how many: each may take some 300 MB."""
_END_S = 2.0
"""Seconds that a worker has to end by itself."""
_LEASHED = """(read -r word < "/dev/fd/$1"; kill -s KILL -- "-$$") < /dev/null > /dev/null 2>&1 &
shift; exec "$@\""""
"""A shell script that becomes a command, whose process group is killed when the other end of a pipe is closed."""


@dataclass(frozen=True, slots=True)
class LostTask:
    """In place of an answer: every process that took the task died.

    Attributes:
        tries: How many.
    """

    tries: int


@dataclass(eq=False, slots=True)
class _Piece(Generic[Task]):
    """A task on its way."""

    task: Task
    told: Callable[[Any], None] | None
    most: int
    tries: int = 0
    given_up: bool = False
    outcome: list[Any] = field(default_factory=list[Any])
    """Its answer, `LostTask` or `_Failure`; empty until there is one."""


@dataclass(frozen=True, slots=True)
class _Failure:
    error: BaseException


@dataclass(eq=False, slots=True)
class _Worker:
    process: SpawnProcess
    connection: Connection[Any, Any]
    piece: _Piece[Any] | None = None
    ready: bool = False


class Workers(Generic[Task, Answer]):
    """Processes with a state of their own; a context manager that ends them.

    Processes start when there is something to do, and ignore an interrupt: the caller, who is interrupted too, ends
    them.
    """

    def __init__(self, count: int, start: Callable[..., Work[Task, Answer]], setup: tuple[Any, ...] = ()) -> None:
        """Prepare; no process starts yet.

        Args:
            count: Processes at most.
            start: Called once in each process; what it returns does the tasks. To be found by name.
            setup: Its arguments.
        """
        self._count = max(1, count)
        self._call = (start, setup)
        self._workers: list[_Worker] = []
        self._waiting: deque[_Piece[Task]] = deque()
        self._stillborn = 0

    def __enter__(self) -> Self:
        """Nothing is started yet."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, traceback: TracebackType | None
    ) -> None:
        """End all processes; at once where the block failed, or where an interrupt comes while they end."""
        try:
            for worker in self._workers:
                if kind is None and worker.piece is None:
                    with contextlib.suppress(OSError):
                        worker.connection.send(None)
                else:
                    worker.process.kill()
            for worker in self._workers:
                worker.process.join(_END_S)
        finally:
            # one that were left would be waited for, for ever, when this process ends
            with _uninterrupted() if self._workers else contextlib.nullcontext():
                while self._workers:
                    _end(self._workers.pop())

    def run(
        self, tasks: Iterable[Task], told: Callable[[Any], None] | None = None, *, tries: int = 3
    ) -> Generator[tuple[Task, Answer | LostTask]]:
        """Do tasks side by side, taking a bounded number ahead; may be called while another run waits.

        Args:
            tasks: Taken when there is room.
            told: Called in this process with what the work sends. A task that is done again sends again.
            tries: Processes that a task may cost before it counts as lost.

        Yields:
            Each task with its answer, in order.

        Raises:
            Exception: What the work raised.
            DataError: engine-failed: processes end before they have started.
        """
        source = iter(tasks)
        pending: deque[_Piece[Task]] = deque()
        try:
            while True:
                for task in islice(source, max(0, 2 * self._count + 1 - len(pending))):
                    pending.append(_Piece(task, told, tries))
                    self._waiting.append(pending[-1])
                if not pending:
                    return
                self._hand_out()
                while not pending[0].outcome:
                    self._listen()
                    self._hand_out()
                piece = pending.popleft()
                (outcome,) = piece.outcome
                if isinstance(outcome, _Failure):
                    raise outcome.error
                yield piece.task, outcome
        finally:
            for piece in pending:
                piece.given_up = True

    def _hand_out(self) -> None:
        while self._waiting:
            idle = next((worker for worker in self._workers if worker.piece is None), None)
            if idle is None and len(self._workers) >= self._count:
                return
            piece = self._waiting.popleft()
            if piece.given_up:
                continue
            worker = idle or self._begin()
            worker.piece = piece
            try:
                worker.connection.send(piece.task)
            except OSError:
                self._bury(worker)

    def _begin(self) -> _Worker:
        import multiprocessing  # noqa: PLC0415 - see above

        context = multiprocessing.get_context("spawn")
        mine, theirs = context.Pipe()
        process = context.Process(target=_serve, args=(theirs, *self._call), daemon=False)
        hidden = self._call[0].__module__ != "__main__"
        with _uninterrupted(), _main_hidden() if hidden else contextlib.nullcontext():
            process.start()
            theirs.close()  # so that the end of the process is the end of the pipe
            self._workers.append(_Worker(process, mine))
        return self._workers[-1]

    def _listen(self) -> None:
        """Wait until a worker says something or dies."""
        from multiprocessing.connection import wait  # noqa: PLC0415

        by_connection = {worker.connection: worker for worker in self._workers}
        for ready in wait(list(by_connection)):
            worker = by_connection[ready]  # pyright: ignore[reportArgumentType]
            try:
                kind, value = worker.connection.recv()
            except (EOFError, OSError, pickle.UnpicklingError):
                self._bury(worker)
                continue
            piece = worker.piece
            if kind == "ready":
                worker.ready, self._stillborn = True, 0
            if kind == "ready" or piece is None:
                continue
            if kind != "told":
                worker.piece = None
                piece.outcome.append(_Failure(value) if kind == "failed" else value)
            elif piece.told is not None and not piece.given_up:
                piece.told(value)

    def _bury(self, worker: _Worker) -> None:
        """Take a dead worker away; its task goes first to the next one."""
        self._workers.remove(worker)
        killed = (_end(worker) or 0) < 0
        piece = worker.piece
        if piece is None:
            return
        piece.tries += worker.ready
        self._stillborn += not worker.ready
        if self._stillborn >= (_KILLED_STARTS if killed else _STARTS):
            message = "worker processes end before they have started"
            raise DataError(Diagnostic("engine-failed", message, hints=("`--jobs 1` needs none",)))
        if piece.tries >= piece.most:
            piece.outcome.append(LostTask(piece.tries))
        else:
            self._waiting.appendleft(piece)


@contextlib.contextmanager
def _uninterrupted() -> Generator[None]:
    """Hold interrupts back: in this process until the block ends, in one that is started there until it is ready.

    Else one that comes while a worker is still importing modules would make it tell of that.
    """
    from multiprocessing import resource_tracker  # noqa: PLC0415

    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    resource_tracker.ensure_running()  # whose start would let interrupts through
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _interrupts())
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _interrupts() -> set[signal.Signals]:
    """What a caller may take for an interrupt."""
    return {signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGALRM}


def _end(worker: _Worker) -> int | None:
    """End a worker; its exit code, which is negative if it was killed."""
    worker.process.kill()
    worker.process.join()
    code = worker.process.exitcode
    worker.process.close()
    worker.connection.close()
    return code


@contextlib.contextmanager
def _main_hidden() -> Generator[None]:
    """Keeps workers from running the caller's script once more, as `multiprocessing` does with what is `__main__`."""
    main = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = main


def _serve(connection: Connection[Any, Any], start: Callable[..., Work[Any, Any]], setup: tuple[Any, ...]) -> None:
    """The life of a worker."""
    import multiprocessing  # noqa: PLC0415

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    lead_output_away()
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, _interrupts())
    parent = multiprocessing.parent_process()
    assert parent is not None
    collect_seldom()
    work: Work[Any, Any] | None = None
    with contextlib.suppress(EOFError, OSError):
        try:
            threading.Thread(target=_end_with, args=(parent.sentinel,), daemon=True).start()
        except RuntimeError as error:
            connection.send(("failed", _portable(error)))
            return
        connection.send(("ready", None))
        while (task := connection.recv()) is not None:
            try:
                work = work or start(*setup)
                answer = work(task, lambda value: connection.send(("told", value)))
            except Exception as error:  # noqa: BLE001 - the caller raises it
                connection.send(("failed", _portable(error)))
            else:
                connection.send(("done", answer))


def _end_with(sentinel: int) -> None:
    """A parent that is killed says nothing."""
    from multiprocessing.connection import wait  # noqa: PLC0415

    wait([sentinel])
    os._exit(1)


def lead_output_away() -> None:
    """Have what libraries write to descriptor 1 go to 2 from now on, in a process of our own: results are elsewhere."""
    with contextlib.suppress(OSError):
        os.dup2(2, 1)


@contextlib.contextmanager
def discard_output() -> Generator[None]:
    """Drop what is written to descriptor 1 within the block, which must be short: the process may be the user's."""
    try:
        before = os.dup(1)
    except OSError:  # it is closed
        yield
        return
    try:
        nothing = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nothing, 1)
        os.close(nothing)
        yield
    finally:
        os.dup2(before, 1)
        os.close(before)


@contextlib.contextmanager
def kill_after(process: subprocess.Popen[bytes], seconds: float) -> Generator[threading.Event]:
    """End a process with its group if the block takes longer; the event says whether it did.

    Args:
        process: It leads a process group.
        seconds: By the wall.
    """
    expired = threading.Event()
    timer = threading.Timer(seconds, lambda: (expired.set(), end_group(process)))
    timer.daemon = True
    timer.start()
    try:
        yield expired
    finally:
        timer.cancel()


def end_group(process: subprocess.Popen[bytes]) -> None:
    """Kill a process that leads a process group, with the group."""
    if process.poll() is not None:
        return
    if hasattr(os, "killpg"):
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)
    else:
        process.kill()


@contextlib.contextmanager
def kill_on_exit(words: Sequence[str]) -> Generator[tuple[Sequence[str], tuple[int, ...]]]:
    """Have a command be killed with its process group when the block or this process ends, however it ends.

    Args:
        words: The command.

    Yields:
        The words to run in place of the command's, and the descriptors to pass.
    """
    if not hasattr(os, "killpg"):
        yield words, ()
        return
    theirs, ours = os.pipe()
    try:
        yield ["/bin/sh", "-c", _LEASHED, "sh", str(theirs), *words], (theirs,)
    finally:
        os.close(ours)
        os.close(theirs)


def limit_memory(size: int, process: int = 0) -> None:
    """Limit the address space of a process and of all that it starts; a limit that is lower stays.

    Args:
        size: Bytes.
        process: Its number; this one by default.
    """
    if sys.platform != "linux":
        return
    import resource  # noqa: PLC0415 - not everywhere

    before = resource.prlimit(process, resource.RLIMIT_AS)
    least = min([size, *(limit for limit in before if limit != resource.RLIM_INFINITY)])
    resource.prlimit(process, resource.RLIMIT_AS, (least, least))


def processors() -> int:
    """How many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def default_processes() -> int:
    """How many processes to use where nobody says how many."""
    return min(processors(), _AT_MOST)


def _portable(error: Exception) -> Exception:
    """The error, or one that says the same where it cannot be sent: what is behind it never is."""
    if (refused := refused_by_system(error)) is not None:
        return DataError(Diagnostic("resources-exhausted", refused))
    try:
        copy: Exception = pickle.loads(pickle.dumps(error))  # noqa: S301 - our own
    except Exception:  # noqa: BLE001 - whatever pickling raises
        return RuntimeError(f"{type(error).__name__}: {error}")
    return copy
