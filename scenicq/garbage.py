"""Python's cycle collector, in processes that make millions of small records which hold no cycles."""

from __future__ import annotations

import gc
from collections.abc import Generator
from contextlib import contextmanager

__all__ = ["collect_seldom", "pause_collector"]

_YOUNG = 50_000
"""Records that are made before the collector looks at them: by then most are gone, and few cycles are kept waiting."""


def collect_seldom() -> None:
    """Let the collector run, but seldom, in a process that is the program's own."""
    gc.set_threshold(_YOUNG, 10, 10)
    gc.enable()


@contextmanager
def pause_collector() -> Generator[None]:
    """Keep the collector from walking through all records again and again."""
    collects = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collects:
            gc.enable()
