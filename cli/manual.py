"""Lay out `--help`: purpose, arguments, options by topic, exit codes, examples."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

import click

from .streams import redirect_prints

__all__ = ["OPEN", "Manual", "variable_of", "write_examples", "write_exit_codes"]

_ALWAYS = {2: "an error, which standard error explains", 130: "interrupted; nothing is left half-written"}
OPEN = "something is undecided: --deadline or --limit ended the run, or a frame is unknown"
"""What the exit code of an undecided query means."""
_AS_IT_IS = "\b\n"
_DONE = {0: "the command did its work"}


def write_exit_codes(formatter: click.HelpFormatter, exits: Mapping[int, str]) -> None:
    """Write the section of the exit codes.

    Args:
        formatter: Where to.
        exits: What the codes mean that are not the same for every command.
    """
    with formatter.section("Exit codes"):
        formatter.write_dl([(str(code), meaning) for code, meaning in sorted({**exits, **_ALWAYS}.items())])


def write_examples(formatter: click.HelpFormatter, epilog: str | None) -> None:
    """Write the examples as they are.

    Args:
        formatter: Where to.
        epilog: A heading and lines, after click's mark for text that is not to be filled.
    """
    if epilog:
        formatter.write(f"\n{epilog.removeprefix(_AS_IT_IS)}\n")


def variable_of(command: click.Command, option: click.Option) -> str:
    """The environment variable that stands for an option, such as `SCENICQ_MATCH_MIN_DURATION`."""
    name = next((each.removeprefix("--") for each in option.opts if each.startswith("--")), option.name or "")
    return f"SCENICQ_{command.name}_{name}".replace("-", "_").upper()


class Manual(click.Command):
    """A command with help like a page of a manual."""

    def __init__(
        self,
        *args: Any,
        arguments: Mapping[str, str],
        exits: Mapping[int, str] | None = None,
        topics: Mapping[str, Collection[str]] | None = None,
        **attributes: Any,
    ) -> None:
        """Take what the help says and click does not know.

        Args:
            args: What click's command takes.
            arguments: What each argument is, by the name that the usage shows.
            exits: Meaning of 0 and 1; the other codes mean the same everywhere.
            topics: Names of options (as parameters) by the heading that they stand under, those of no topic first.
            attributes: What click's command takes by name.
        """
        super().__init__(*args, **attributes)
        self.arguments = arguments
        self.exits = exits or _DONE
        self.topics = topics or {}

    def make_context(
        self, info_name: str | None, args: list[str], parent: click.Context | None = None, **extra: Any
    ) -> click.Context:
        """Read the words and the environment, whose variables have the names that people write after `--`."""
        for parameter in self.params:
            if isinstance(parameter, click.Option):
                parameter.envvar = variable_of(self, parameter)
        return super().make_context(info_name, args, parent, **extra)

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command; standard output is for its results alone."""
        with redirect_prints():
            return super().invoke(ctx)

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse the command line; a word that looks like a wrong option may be a file's name, and the message says so.

        Raises:
            click.UsageError: They do not fit.
        """
        try:
            return super().parse_args(ctx, args)
        except click.NoSuchOption as error:
            if not self.arguments:
                raise
            message = f"{error.message} (a name that begins with '-' stands after '--')"
            raise click.NoSuchOption(error.option_name, message, error.possibilities, ctx) from None

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the arguments, the options by topic, and the exit codes."""
        if self.arguments:
            with formatter.section("Arguments"):
                formatter.write_dl(list(self.arguments.items()))
        found: dict[str, tuple[str, str]] = {}
        for parameter in self.get_params(ctx):
            record = parameter.get_help_record(ctx)
            if isinstance(parameter, click.Option) and record is not None:
                # click has a name of its own for this one
                found["help" if "--help" in parameter.opts else parameter.name or ""] = record
        listed = frozenset[str]().union(*self.topics.values())
        for title, names in {"Options": found.keys() - listed, **self.topics}.items():
            records = [record for name, record in found.items() if name in names]
            if records:
                with formatter.section(title):
                    formatter.write_dl(records)
        write_exit_codes(formatter, self.exits)

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the examples."""
        write_examples(formatter, self.epilog)
