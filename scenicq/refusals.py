"""What the system refuses: memory, open files, processes. It is no mistake of ours, and never means "no match"."""

from __future__ import annotations

import errno

__all__ = ["refused_by_system"]

_TEXTS = {
    "memory": ("out of memory", "cannot allocate memory", "bad_alloc", "failed to map segment", "unable to allocate"),
    "files": ("too many open files",),
    "processes": ("can't start new thread", "resource temporarily unavailable"),
}
"""What libraries say, in lower case."""
_NUMBERS = {
    errno.ENOMEM: "memory",
    errno.EMFILE: "files",
    errno.ENFILE: "files",
    errno.EAGAIN: "processes",
}
_MESSAGES = {
    "memory": "there is not enough memory",
    "files": "more files are needed than the system lets this process open",
    "processes": "the system starts no more threads or processes",
}
_DEEPEST = 20
"""Errors behind errors that are looked at."""


def refused_by_system(error: BaseException | None) -> str | None:
    """What the system refused, if that is what is behind an error; None where it is something else.

    Args:
        error: Raised by anybody, perhaps because of another one.
    """
    for _ in range(_DEEPEST):
        if error is None:
            return None
        kind = _kind(error)
        if kind is not None:
            return _MESSAGES[kind]
        error = error.__cause__ or error.__context__
    return None


def _kind(error: BaseException) -> str | None:
    if isinstance(error, MemoryError):
        return "memory"
    if isinstance(error, OSError) and error.errno in _NUMBERS:
        return _NUMBERS[error.errno]
    text = f"{type(error).__name__}: {error}".lower().replace("outofmemory", "out of memory")
    return next((kind for kind, known in _TEXTS.items() if any(each in text for each in known)), None)
