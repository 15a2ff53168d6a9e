"""Standard output while a command runs: `results`, and nothing that anybody else prints.

What libraries of C write to descriptor 1 never gets there either: `start` gives results a descriptor of their own.
"""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Generator
from typing import TextIO

import click

__all__ = ["redirect_prints", "results", "say"]

_STREAMS: list[TextIO] = []
"""Standard output as it was when the command began, of commands that run within each other."""


@contextlib.contextmanager
def redirect_prints() -> Generator[None]:
    """In the block, what libraries print in Python goes to standard error; `results` is standard output."""
    _STREAMS.append(sys.stdout)
    try:
        with contextlib.redirect_stdout(sys.stderr):
            yield
    finally:
        _STREAMS.pop()


def results() -> TextIO:
    """Standard output."""
    return _STREAMS[-1] if _STREAMS else sys.stdout


def say(text: str = "", *, nl: bool = True) -> None:
    """Write a line to standard output; with colours only on a terminal."""
    click.echo(text, file=results(), nl=nl)
