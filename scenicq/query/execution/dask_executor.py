"""Pieces of a query on Dask, the extra `scenicq[dask]`: on processes of this machine, or on a cluster.

A cluster of our own listens on the loopback interface only, and takes tasks only from us: what passes between its
processes is encrypted with keys that live as long as it does.
"""

# distributed is optional and has hardly any types.
# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false, reportMissingImports=false, reportUntypedFunctionDecorator=false

from __future__ import annotations

import contextlib
import logging
import math
import platform
import shutil
import tempfile
import threading
import time
from collections import deque
from collections.abc import Generator, Iterable, Iterator
from concurrent.futures import Future
from dataclasses import dataclass, replace
from importlib.util import find_spec
from itertools import islice
from pathlib import Path
from typing import Any

from scenicq import __version__
from scenicq.budget import time_left_s
from scenicq.errors import DataError, Diagnostic
from scenicq.limits import LIMITS
from scenicq.processes import processors
from scenicq.query.execution.executors import Done, Executor, Progress, Question, run_frame_by_frame, run_piece
from scenicq.query.execution.pieces import DatasetPiece
from scenicq.query.execution.run import Query
from scenicq.store.read_lock import Reading, nobody_reads

__all__ = ["DaskPatience", "count_workers", "dask"]

_LOOPBACK = "127.0.0.1"
_SCRATCH = "scenicq-dask-"
_BEGINS_S = 60
"""Seconds after which a folder that nobody uses is one that is left."""

_LATER = ("`--resume` with `-o FILE` goes on where a query stopped",)


@dataclass(frozen=True, slots=True)
class DaskPatience:
    """How long to wait for a cluster.

    Attributes:
        connect_s: Seconds in which a scheduler must answer first.
        look_s: Seconds between looks at who is there.
        nobody_s: Seconds for which no worker may be there, or the scheduler may not answer.
    """

    connect_s: float = 20
    look_s: float = 2
    nobody_s: float = 60


def dask(address: str | None = None, patience: DaskPatience | None = None) -> Executor:
    """An executor that runs pieces on Dask.

    Args:
        address: Address of a scheduler (`tcp://host:8786`) whose workers have this version of scenicq and see the
            dataset under the same path. By default workers are started on this machine for the time of the query, as
            many as the query's `jobs` or, if that is None, as there are processors.
        patience: How long to wait for it.

    Raises:
        DataError: option-invalid: Dask is not installed.
    """
    waits = patience or DaskPatience()
    missing = [name for name in ("distributed", "cryptography") if find_spec(name) is None]
    if missing:
        message = f"`--engine dask` needs the package {missing[0]}, which is not installed"
        raise DataError(Diagnostic("option-invalid", message, hints=("`pip install 'scenicq[dask]'` adds it",)))

    def run(query: Query, pieces: Iterable[DatasetPiece], progress: Progress) -> Generator[tuple[DatasetPiece, Done]]:
        with _quiet(), _client(query, address, waits.connect_s) as client:
            for piece, done in _run(client, query, pieces, waits):
                progress(piece.frames)
                yield piece, done

    return run


@contextlib.contextmanager
def _quiet() -> Generator[None]:
    """Dask tells of every worker that dies, on standard error; what matters is told by us."""
    log = logging.getLogger("distributed")
    before = log.level
    log.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        log.setLevel(before)


@contextlib.contextmanager
def _client(query: Query, address: str | None, connect_s: float) -> Generator[Any]:
    from distributed import Client, LocalCluster  # noqa: PLC0415 - optional, and slow to load
    from distributed.security import Security  # noqa: PLC0415

    if address is not None:
        try:
            client = Client(address, timeout=connect_s, set_as_default=False)
        except (OSError, ValueError) as error:
            message = f"no Dask scheduler answers at {address}: {str(error).splitlines()[0]}"
            raise DataError(Diagnostic("engine-failed", message)) from error
        with client:
            yield client
        return
    jobs = query.options.jobs or processors()
    with _scratch() as folder, contextlib.ExitStack() as stack:
        try:
            cluster = LocalCluster(
                n_workers=jobs,
                threads_per_worker=1,
                host=_LOOPBACK,
                dashboard_address=f"{_LOOPBACK}:0",
                worker_dashboard_address=None,
                security=Security.temporary(),
                local_directory=folder,
                silence_logs=logging.CRITICAL,
            )
            client = Client(stack.enter_context(cluster), set_as_default=False)
        except (OSError, RuntimeError, ImportError, TimeoutError) as error:
            # as where there is no /dev/shm for what processes share
            first: BaseException = error
            while first.__cause__ is not None:
                first = first.__cause__
            message = f"Dask starts no processes here: {' '.join(str(first).split()) or type(first).__name__}"
            hints = ("without `--engine dask`, `--jobs N` runs processes that need less",)
            raise DataError(Diagnostic("engine-failed", message, hints=hints)) from error
        yield stack.enter_context(client)


@contextlib.contextmanager
def _scratch() -> Generator[str]:
    """A folder for whatever Dask writes, which is gone at the end; that of a run that was killed goes with the next."""
    from dask import config  # noqa: PLC0415 - optional

    with tempfile.TemporaryDirectory(prefix=_SCRATCH, ignore_cleanup_errors=True) as folder:
        # ages by the clock of the file system alone: nothing here depends on the time that the machine is set to
        begun = Path(folder).stat().st_mtime
        for left in Path(tempfile.gettempdir()).glob(f"{_SCRATCH}*"):
            with contextlib.suppress(OSError):
                if begun - left.stat().st_mtime > _BEGINS_S:
                    with nobody_reads(left) as is_left:
                        if is_left:
                            shutil.rmtree(left, ignore_errors=True)
        using = Reading(Path(folder))
        try:
            with config.set({"temporary-directory": folder}):
                yield folder
        finally:
            using.end()


def _run(
    client: Any, query: Query, pieces: Iterable[DatasetPiece], patience: DaskPatience
) -> Iterator[tuple[DatasetPiece, Done]]:
    """Hand out a bounded number of pieces ahead, and take what they give in order."""
    from distributed import CancelledError, KilledWorker  # noqa: PLC0415

    question = Question.of(query)
    waiting = iter(pieces)
    pending: deque[tuple[DatasetPiece, Any]] = deque()
    try:
        while True:
            room = 3 * max(1, count_workers(client, patience.nobody_s)) - len(pending)
            for piece in islice(waiting, max(0, room)):
                work = client.submit(
                    _work,
                    question,
                    piece,
                    __version__,
                    platform.node(),
                    time_left_s(query.options.until),
                    pure=False,
                    retries=LIMITS.piece_retries,
                )
                pending.append((piece, work))
            if not pending:
                return
            piece, future = pending.popleft()
            try:
                done = _taken(client, future, patience)
            except KilledWorker:
                done = run_frame_by_frame(query, piece)
            future.release()
            yield piece, done
    except (OSError, CancelledError) as error:
        message = f"the Dask cluster has stopped: {getattr(error, 'reason', error)}"
        raise DataError(Diagnostic("engine-failed", message, hints=_LATER)) from error
    finally:
        with contextlib.suppress(Exception):
            client.cancel([future for _, future in pending], force=True)


def _taken(client: Any, future: Any, patience: DaskPatience) -> Done:
    """What a piece gave; where nobody is there to do it for long, an error.

    Raises:
        DataError: engine-failed.
    """
    since = time.monotonic()
    while True:
        try:
            return future.result(timeout=patience.look_s)
        except TimeoutError:
            if count_workers(client, patience.nobody_s):
                since = time.monotonic()
            elif time.monotonic() - since > patience.nobody_s:
                message = f"the Dask cluster has had no worker for {patience.nobody_s:g} s"
                hints = ("start workers of this scheduler, such as `dask worker ADDRESS`", *_LATER)
                raise DataError(Diagnostic("engine-failed", message, hints=hints)) from None


def count_workers(client: Any, nobody_s: float) -> int:
    """How many workers the scheduler of a client has, which answers within some seconds.

    Raises:
        DataError: engine-failed: it does not answer, for which the client would wait for ever.
    """
    answer = Future[int]()

    def ask() -> None:
        try:
            answer.set_result(len(client.scheduler_info(n_workers=-1)["workers"]))
        except BaseException as error:  # noqa: BLE001 - whoever waits is told
            answer.set_exception(error)

    threading.Thread(target=ask, daemon=True).start()
    try:
        return answer.result(timeout=nobody_s)
    except TimeoutError:
        message = f"the Dask scheduler has not answered for {nobody_s:g} s"
        raise DataError(Diagnostic("engine-failed", message, hints=_LATER)) from None


_known = threading.local()


def _work(question: Question, piece: DatasetPiece, client_version: str, machine: str, left_s: float) -> Done:
    """Run a piece in a worker, which keeps what it has compiled."""
    if __version__ != client_version:
        message = f"a worker has version {__version__} of scenicq, the client {client_version}"
        raise DataError(Diagnostic("engine-failed", message, hints=("install the same version on both",)))
    if getattr(_known, "fingerprint", None) != question.fingerprint:
        query = question.query()
        if math.isfinite(left_s) and machine != platform.node():
            query.options = replace(query.options, until=time.monotonic() + left_s)
        _known.query, _known.fingerprint = query, question.fingerprint
    return run_piece(_known.query, piece)
