"""The options of commands, made from where they are declared, and what those of a query mean."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from typing import Any, TypeVar

import click

from scenicq.option_values import FileName, Flag, OneOf, Option, Parameters, Text
from scenicq.query.execution.option_texts import QUERY_OPTIONS, OptionTexts, read_options
from scenicq.query.execution.run import QueryOptions

from .option_type import OptionType
from .path_type import LOCAL_PATH

__all__ = ["ONE_FRAME", "OVER_TIME", "SHARED", "add_options", "by_topic", "query_options"]

_Command = TypeVar("_Command", bound=Callable[..., Any] | click.Command)

SHARED = frozenset(name for name, each in QUERY_OPTIONS.items() if each.about == "label")
"""Options of `match` that say what a match is; the others say which frames and what to show of them."""
OVER_TIME = frozenset(name for name, each in QUERY_OPTIONS.items() if each.about == "interval")
"""Options of `match` that say what an interval is."""
ONE_FRAME = {"prefilter": False, "every": True}
"""The other options of a query about one frame."""


def add_options(options: Mapping[str, Option], *names: str, **changes: Any) -> Callable[[_Command], _Command]:
    """Give a command some of the options that are declared, in the order of their declaration.

    Args:
        options: What is declared, by name.
        names: The names of the options.
        changes: What click is told otherwise than is declared, such as another `help`.
    """

    def decorate(command: _Command) -> _Command:
        for name in reversed([each for each in options if each in names]):
            command = _as_click(name, options[name], changes)(command)
        return command

    return decorate


def _as_click(name: str, option: Option, changes: Mapping[str, Any]) -> Callable[[_Command], _Command]:
    """An option as click has it."""
    flags = option.flags or (f"--{name.replace('_', '-')}",)
    told: dict[str, Any] = {"help": option.help, "metavar": option.metavar, "default": option.default}
    match option.kind:
        case Flag() if option.default:
            flags = (f"{flags[0]}/--no-{flags[0].removeprefix('--')}",)
        case Flag():
            told["is_flag"] = True
        case OneOf(texts):
            told["type"] = click.Choice(texts)
        case Parameters():
            told |= {"nargs": 2, "multiple": True, "default": ()}
        case FileName():
            told["type"] = LOCAL_PATH
        case Text():
            pass
        case kind:
            told["type"] = OptionType(kind)
    return click.option(*flags, name, **{**told, **changes})


def by_topic(options: Mapping[str, Option], others: Mapping[str, Collection[str]]) -> Mapping[str, Collection[str]]:
    """The names of options by the heading that they stand under, as `Manual` takes them.

    Args:
        options: What is declared, by name.
        others: Names of a command's other options by heading, in the order of the help.
    """
    return {
        topic: {*names, *(name for name, each in options.items() if each.topic == topic)}
        for topic, names in others.items()
    }


def query_options(given: Mapping[str, Any]) -> QueryOptions:
    """The options of a query from those of the command line."""
    texts: OptionTexts = {name: given[name] for name in QUERY_OPTIONS if name in given}  # pyright: ignore[reportAssignmentType]
    return read_options(**texts)
