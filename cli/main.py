"""The command `scenicq`: finds the subcommand, and turns every error into a message and an exit code.

Subcommands are imported when they are called, so that `--help` and `--version` start at once.
"""

from __future__ import annotations

import contextlib
import errno
import gc
import os
import sys
from collections.abc import Generator
from importlib import import_module
from typing import Any, NoReturn

import click

from scenicq import __version__
from scenicq.errors import Diagnostic, ScenicqError, similar
from scenicq.garbage import collect_seldom
from scenicq.refusals import refused_by_system

from .interrupts import Interrupts
from .manual import OPEN, write_examples, write_exit_codes
from .report import show
from .streams import redirect_prints

__all__ = ["COMMANDS", "NOTHING", "UNDECIDED", "cli", "main"]

COMMANDS = {
    "ingest": "Make a dataset from a source, such as a nuScenes folder.",
    "match": "Find the frames or intervals of a dataset that match a scenario.",
    "gather": "Put the shards of a query together, in the order of the dataset or by what the program records.",
    "check": "Say whether a scenario is sound, and how it is read.",
    "sample": "Draw scenes from a scenario, as labels.",
    "explain": "Say why a frame or recording matches, or what prevents it and which change would make it match.",
    "show": "Draw one frame from above: map, boxes, and what a scenario says of it.",
    "evaluate": "Say whether a model fails on the frames that match.",
    "report": "Say which matches came, went and stayed between two result files.",
    "info": "Say what a dataset holds and what was left out of it.",
    "index": "Compute anew what a dataset holds beside the labels.",
    "doctor": "Say which solvers load here and what is missing.",
    "codes": "Say what the code of a message means, and what to do.",
    "completion": "Print what makes a shell complete commands and options.",
}
"""Every subcommand, each in the module of its name, with the first line of its help."""

_MODULES = {"report": "compare"}
"""Modules whose command has another name."""

NOTHING, ERROR, UNDECIDED, INTERRUPTED = 1, 2, 3, 130
"""Exit codes besides 0, in the manner of grep; `UNDECIDED` is of what would be 0 or 1 else."""

_NO_ROOM = {errno.ENOSPC, errno.EFBIG, errno.EIO, getattr(errno, "EDQUOT", errno.ENOSPC)}

INTERRUPTS = Interrupts()
"""The interrupts of this process."""


class Commands(click.Group):
    """A group whose subcommands are imported when they are needed."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Read the arguments; where there are none, show the help, and that nothing was done."""
        if not args and not ctx.resilient_parsing:
            click.echo(ctx.get_help(), err=True)
            ctx.exit(ERROR)
        return super().parse_args(ctx, args)

    def list_commands(self, ctx: click.Context) -> list[str]:
        """The names, in the order in which one meets them."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import a subcommand."""
        if cmd_name not in COMMANDS:
            return None
        with redirect_prints():
            module = import_module(f"{__package__}.{_MODULES.get(cmd_name, cmd_name)}")
        if not gc.isenabled():
            # the process is our own (`main`), and what is loaded stays: neither now nor at the end need the collector
            # go through it; DuckDB, which reports what is never freed, is loaded later
            gc.freeze()
            collect_seldom()
        command: click.Command = getattr(module, cmd_name)
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the subcommands without importing them."""
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))
        write_exit_codes(
            formatter, {0: "something matched, or the command did its work", 1: "nothing matched", 3: OPEN}
        )

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the examples."""
        write_examples(formatter, self.epilog)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find a subcommand, or say which one may be meant."""
        name = args[0]
        if name not in COMMANDS and not name.startswith("-"):
            near = similar(name, COMMANDS)
            hint = f" Did you mean '{near}'?" if near else ""
            raise click.UsageError(f"No such command '{name}'.{hint}", ctx)
        return super().resolve_command(ctx, args)

    def make_context(self, *given: Any, **more: Any) -> click.Context:
        """Read the command line; `--help` and `--version` write there and then."""
        with _worded_end():
            return super().make_context(*given, **more)

    def invoke(self, ctx: click.Context) -> Any:
        """Run a subcommand; whatever it raises becomes a message and an exit code."""
        if os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb":
            ctx.color = False
        with _worded_end():
            result = super().invoke(ctx)
            sys.stdout.flush()
        return result


@contextlib.contextmanager
def _worded_end() -> Generator[None]:
    """Turn whatever the block raises into a message and an exit code.

    Raises:
        Exit: The code of click's.
        OSError: Standard output takes no more.
    """
    try:
        yield
    except (click.ClickException, click.exceptions.Exit, click.Abort):
        raise
    except ScenicqError as error:
        if INTERRUPTS.noticed:
            _interrupted()
        refused = refused_by_system(error)
        show([Diagnostic("resources-exhausted", refused)] if refused else error.diagnostics)
        raise click.exceptions.Exit(ERROR) from None
    except KeyboardInterrupt:
        _interrupted()
    except BrokenPipeError:
        raise click.exceptions.Exit(0) from None  # the reader has what it wanted
    except Exception as error:
        if INTERRUPTS.noticed:
            _interrupted()
        if _is_of_output(error):
            raise
        if (refused := refused_by_system(error)) is not None:
            show([Diagnostic("resources-exhausted", refused)])
            raise click.exceptions.Exit(ERROR) from None
        # our own mistake, whatever it is
        click.echo(f"internal error: this is a mistake in scenicq; please report it with {_written()}", err=True)
        raise click.exceptions.Exit(ERROR) from None


def _is_of_output(error: Exception) -> bool:
    """Whether an error says that standard output takes no more; errors of other files are told elsewhere."""
    if not isinstance(error, OSError) or error.filename is not None:
        return False
    if error.errno == errno.EBADF:
        return not _takes_data(sys.stdout.fileno())
    if error.errno == errno.EAGAIN:
        return not os.get_blocking(sys.stdout.fileno())
    return error.errno in _NO_ROOM


def _takes_data(descriptor: int) -> bool:
    """Whether the caller has opened standard output for writing."""
    try:
        os.write(descriptor, b"")
    except OSError:
        return False
    return True


def _let_go_of_output() -> None:
    """Drop what standard output did not take: it would fail again when Python ends, and change the exit code."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _interrupted() -> NoReturn:
    INTERRUPTS.done()
    click.echo("interrupted", err=True)
    if INTERRUPTS.advice:
        click.echo(INTERRUPTS.advice, err=True)
    raise click.exceptions.Exit(INTERRUPTED)


def _written() -> str:
    """Write a file with what is needed to find the mistake, and return its name."""
    import tempfile  # noqa: PLC0415 - these take long to load, and no run should need them
    import traceback  # noqa: PLC0415

    with tempfile.NamedTemporaryFile(
        "w", prefix="scenicq-error-", suffix=".txt", delete=False, encoding="utf-8", errors="backslashreplace"
    ) as file:
        file.write(f"scenicq {__version__}, Python {sys.version}, {sys.platform}\n{sys.argv}\n\n")
        file.write(traceback.format_exc())
    return file.name


@click.command(
    cls=Commands,
    context_settings={
        "help_option_names": ["-h", "--help"],
        "max_content_width": 100,
        "show_default": True,
    },
    epilog="\b\nExample:\n  scenicq ingest sample_data/crossroads demo/crossroads\n"
    "  scenicq match sample_data/scenarios/02_crossing_cars.scenic demo/crossroads",
)
@click.version_option(__version__, message="%(prog)s %(version)s")
def cli() -> None:
    """Find the recorded frames that match a Scenic scenario.

    A source of recordings becomes a dataset once (`ingest`); then scenarios are matched with it (`match`). Every option
    can also be given as an environment variable, such as SCENICQ_MATCH_JOBS=4.
    """


def main() -> None:
    """Run the command line of this process."""
    # so that a terminated run leaves nothing half-written, like an interrupted one
    INTERRUPTS.heed()
    # work is shared out among processes: threads for linear algebra would only take their time to start
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # until the subcommand is loaded there is no garbage to be looked for
    gc.disable()
    try:
        cli(prog_name="scenicq")
    except OSError as error:
        if not _is_of_output(error):
            raise
        show([Diagnostic("target-unwritable", f"standard output cannot be written: {error.strerror}")])
        raise SystemExit(ERROR) from None
    finally:
        _let_go_of_output()
