"""The entry of the process: an error while the program loads ends it with 2, never with Python's own 1.

1 means that nothing matched, and whoever runs a query in a script must be able to believe it.

Standard output holds results and nothing else: they have a descriptor of their own from the start, and what any library
writes to descriptor 1, here or in a process that is started from here, goes where messages go.
"""

from __future__ import annotations

import contextlib
import io
import os
import sys
from typing import TYPE_CHECKING, TextIO

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer

__all__ = ["main"]

_ERROR, _INTERRUPTED = 2, 130
_ARENA_MAX = -8
"""The number of a parameter of `mallopt`."""
_LEAST_GB = 2
"""With less, libraries end the process by themselves while they load, and choose exit code 1."""


def main() -> None:
    """Run the command line of this process, and choose the exit code."""
    _fill_streams()
    results = _set_results_apart()
    if (limit := _address_space()) is not None and limit < _LEAST_GB * 10**9:
        _end(f"error[resources-exhausted]: {_LEAST_GB} GB of address space are needed (see `ulimit -v`)", _ERROR)
    try:
        if limit is not None:
            _save_memory()
        from .main import main as run  # noqa: PLC0415 - loading may fail, too

        # what has been loaded may have printed
        sys.stdout = sys.__stdout__ = results
        run()
    except SystemExit:
        raise
    except KeyboardInterrupt:
        _end("interrupted", _INTERRUPTED)
    except BaseException as error:  # noqa: BLE001 - Python would exit with 1
        _end(_line(error), _ERROR)


def _fill_streams() -> None:
    """Open the streams that the caller closed: else the next file gets their number, and messages go into it."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
    encoding = "utf-8" if sys.stderr is None else sys.stderr.encoding  # pyright: ignore[reportUnnecessaryComparison] - the caller closed it
    messages = io.BufferedWriter(_Messages(2, "w", closefd=False))
    sys.stderr = sys.__stderr__ = io.TextIOWrapper(messages, encoding, "backslashreplace", line_buffering=True)


class _Messages(io.FileIO):
    """Standard error; if it takes nothing, messages are lost and the command goes on."""

    def write(self, b: ReadableBuffer, /) -> int:
        taken: int | None = None  # also of what takes nothing now
        with contextlib.suppress(OSError):
            taken = super().write(b)
        return memoryview(b).nbytes if taken is None else taken


def _set_results_apart() -> TextIO:
    """Standard output as a duplicate of descriptor 1, which no other process has; 1 leads to 2 from now on."""
    caller = sys.stdout
    results = os.dup(1)
    os.dup2(2, 1)
    encoding, errors = ("utf-8", None) if caller is None else (caller.encoding, caller.errors)  # pyright: ignore[reportUnnecessaryComparison] - the caller closed it
    return open(results, "w", encoding=encoding, errors=errors, buffering=1 if os.isatty(results) else -1)


def _address_space() -> int | None:
    """The limit of address space that the caller set, in bytes; None if there is none."""
    try:
        import resource  # noqa: PLC0415 - not everywhere
    except ImportError:
        return None
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    return None if limit == resource.RLIM_INFINITY else limit


def _save_memory() -> None:
    """Make libraries take little address space, and OpenBLAS its buffer now: if it fails later, it exits with 1.

    By default the C library sets 64 MB aside for each thread: a third of all that a query takes.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ.setdefault("MALLOC_ARENA_MAX", "1")
    import ctypes  # noqa: PLC0415 - loading may fail, too

    if hasattr(library := ctypes.CDLL(None), "mallopt"):
        library.mallopt(_ARENA_MAX, 1)
    import numpy as np  # noqa: PLC0415 - as above

    # larger than what it multiplies without a buffer
    square = np.ones((256, 256))
    _ = square @ square


def _line(error: BaseException) -> str:
    try:
        from scenicq.refusals import refused_by_system  # noqa: PLC0415 - loading may fail, too

        refused = refused_by_system(error)
    except BaseException:  # noqa: BLE001 - as above
        refused = None
    return f"error[resources-exhausted]: {refused}" if refused else f"internal error: {type(error).__name__}: {error}"


def _end(text: str, code: int) -> None:
    """Print a line and exit at once: Python's own clean-up may fail again and change the exit code."""
    try:
        os.write(2, f"{text}\n".encode(errors="backslashreplace"))
    finally:
        os._exit(code)
