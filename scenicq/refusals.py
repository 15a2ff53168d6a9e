"""What the system refuses: memory, open files, processes. It is no mistake of ours, and never means "no match".

Whoever words an error otherwise, as a file that is missing, need not ask: what is behind it is looked at where it ends.
"""

from __future__ import annotations

import errno

from scenicq.errors import ScenicqError

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
_LIMITS = {
    "memory": ("RLIMIT_AS", "v", 1024),
    "files": ("RLIMIT_NOFILE", "n", 1),
    "processes": ("RLIMIT_NPROC", "u", 1),
}
"""Names of limits, letters of the shell's `ulimit`, and its units."""
_DEEPEST = 20
"""Errors behind errors that are looked at."""


def refused_by_system(error: BaseException | None) -> str | None:
    """What the system refused, if that is what is behind an error; None where it is something else.

    Args:
        error: Raised by anybody, perhaps because of another one.
    """
    told = isinstance(error, ScenicqError)
    for _ in range(_DEEPEST):
        if error is None:
            return None
        kind = None if isinstance(error, ScenicqError) or (told and _is_lock(error)) else _kind(error)
        if kind is not None:
            return _MESSAGES[kind] + _named_limit(kind)
        error = error.__cause__ or error.__context__
    return None


def _is_lock(error: BaseException) -> bool:
    """Whether an error may be that of a lock that somebody else holds: processes that cannot start have its number."""
    return isinstance(error, OSError) and error.errno == errno.EAGAIN


def _named_limit(kind: str) -> str:
    """The limit that the caller has set, as the shell says it; nothing where there is none."""
    try:
        import resource  # noqa: PLC0415 - not everywhere
    except ImportError:
        return ""
    name, letter, unit = _LIMITS[kind]
    limit = resource.getrlimit(getattr(resource, name))[0]
    return "" if limit == resource.RLIM_INFINITY else f" (`ulimit -{letter}` is {limit // unit})"


def _kind(error: BaseException) -> str | None:
    if isinstance(error, MemoryError):
        return "memory"
    if isinstance(error, OSError) and error.errno in _NUMBERS:
        return _NUMBERS[error.errno]
    text = f"{type(error).__name__}: {error}".lower().replace("outofmemory", "out of memory")
    return next((kind for kind, known in _TEXTS.items() if any(each in text for each in known)), None)
