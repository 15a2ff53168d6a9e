"""Programs as the command line takes them: a file, standard input, or the text itself."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from scenicq.errors import DataError, Diagnostic, Source
from scenicq.query.execution.option_texts import DRIVING
from scenicq.query.execution.program_files import read_program

__all__ = ["SCENARIO", "given_program", "read_scenario"]

SCENARIO = "A Scenic program, as a file; `-` is standard input."
"""What the help says of the argument."""


def read_scenario(path: Path) -> Source:
    """The program of a file, or of standard input for `-`.

    Raises:
        DataError: file-missing; file-invalid where it is not UTF-8 text.
    """
    if str(path) != "-":
        return read_program(path)
    data: bytes = sys.stdin.buffer.read()
    try:
        return Source("<stdin>", data.decode("utf-8-sig"))
    except UnicodeDecodeError:
        raise DataError(Diagnostic("file-invalid", "standard input is not text in UTF-8")) from None


def given_program(
    ctx: click.Context, text: str | None, first: Path | None, second: str | None
) -> tuple[Source, str, str | None]:
    """The program and the dataset of a command whose program may be an option.

    Args:
        ctx: Of the command, for its usage.
        text: The program itself, where it is given.
        first: The program, or the dataset where the program is an option.
        second: The dataset, where the program is no option.

    Returns:
        The program, the dataset, and the world model of a program that names none.

    Raises:
        click.UsageError: An argument is missing or too many.
        DataError: As `read_scenario`.
    """
    if text is not None and second is not None:
        raise click.UsageError(f"-e gives the program: `{first}` and `{second}` cannot both be the dataset", ctx)
    if first is None or (text is None and second is None):
        missing = "SCENARIO" if first is None and text is None else "DATASET"
        raise click.UsageError(f"Missing argument '{missing}'.", ctx)
    if text is not None:
        return Source("<program>", text), str(first), DRIVING
    return read_scenario(first), str(second), None
