"""Python's cycle collector, paused where millions of records are made that hold no cycles."""

from __future__ import annotations

import gc
from collections.abc import Generator
from contextlib import contextmanager

__all__ = ["without_collector"]


@contextmanager
def without_collector() -> Generator[None]:
    """Keep the collector from walking through all records again and again."""
    collects = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collects:
            gc.enable()
