"""Programs as the command line takes them: a file, standard input, or the text itself."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import click

from scenicq.errors import DataError, Diagnostic, Source
from scenicq.query.execution.option_texts import DRIVING
from scenicq.query.execution.program_files import read_program
from scenicq.store.remote_path import local_path

from .path_type import check_here

__all__ = ["PROGRAM_TEXT", "SCENARIO", "given_program", "read_scenario"]

SCENARIO = "A Scenic program, as a file; `-` is standard input. Not with -e."
"""What the help says of the argument."""

PROGRAM_TEXT = click.option(
    "-e",
    "--program",
    metavar="TEXT",
    help="The program itself, in place of SCENARIO; `;` separates statements, and the driving world model is there "
    "unless it imports another.",
)
"""The option for a program in place of the argument; see `given_program`."""


def read_scenario(path: str | Path) -> Source:
    """Read the program from a file, or from standard input for `-`.

    Raises:
        DataError: file-missing; file-invalid where it is not UTF-8 text or cannot be read; option-invalid where it lies
            elsewhere.
    """
    if str(path) != "-":
        check_here(path)
        return read_program(local_path(str(path)))
    if sys.stdin is None:  # pyright: ignore[reportUnnecessaryComparison] - the caller closed it
        raise DataError(Diagnostic("file-missing", "standard input is closed"))
    try:
        return Source("<stdin>", sys.stdin.buffer.read().decode("utf-8-sig"))
    except UnicodeDecodeError:
        raise DataError(Diagnostic("file-invalid", "standard input is not text in UTF-8")) from None
    except OSError as error:
        reason = error.strerror or str(error)
        raise DataError(Diagnostic("file-invalid", f"standard input cannot be read: {reason}")) from None


def given_program(
    ctx: click.Context, text: str | None, words: Sequence[str | None], needed: int = 0
) -> tuple[Source, list[str | None], str | None]:
    """Tell the program from the other arguments, where the program may be an option.

    Args:
        ctx: The command's context, for its usage.
        text: The program itself, where it is given.
        words: The arguments in the order of the command's: the program, unless it is an option, and the others.
        needed: How many of the others must be there.

    Returns:
        The program, the other arguments, and the world model of a program that names none.

    Raises:
        click.UsageError: An argument is missing or too many.
        DataError: As `read_scenario`.
    """
    names = [str(each.metavar) for each in ctx.command.params if isinstance(each, click.Argument)]
    if text is not None and words[-1] is not None:
        raise click.UsageError(f"-e gives the program: `{words[0]}` is one argument too many", ctx)
    there = words if text is None else [text, *words[:-1]]
    for name, word in zip(names[: needed + 1], there, strict=False):
        if word is None:
            raise click.UsageError(f"Missing argument '{name}'.", ctx)
    if text is not None:
        return Source("<program>", text), [*there[1:]], DRIVING
    return read_scenario(str(there[0])), [*there[1:]], None
