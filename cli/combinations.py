"""Which options of `scenicq match` can be combined: one table of what needs what, and of what excludes what."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import click

__all__ = ["check_combination", "check_over_time"]

_NEEDS = {
    ("diverse", "sample"): "--diverse needs --sample N",
    ("resume", "output"): "--resume needs -o FILE, beside which it keeps what is done",
    ("shard", "output"): "--shard needs -o FOLDER, which the shards of a query share",
}
"""An option, another that must be there with it, and what is said where it is not."""

_AFTERWARDS = ": give it to `scenicq gather`"
_EXCLUDES = {
    ("shard", "near"): "",
    ("shard", "limit"): "",
    ("shard", "resume"): "",
    ("shard", "engine"): "",
    ("shard", "report"): _AFTERWARDS,
    ("shard", "export"): _AFTERWARDS,
    ("shard", "rank"): "",
    ("shard", "sample"): "",
    ("shard", "advise"): "",
    ("shard", "where"): _AFTERWARDS,
    ("shard", "sort"): _AFTERWARDS,
    ("rank", "sort"): "",
}
"""Two options that cannot be combined, and what to do instead."""

_FRAMES_ONLY = ("advise",)
"""Options that mean nothing where intervals are looked for."""


def check_combination(ctx: click.Context, given: Mapping[str, object]) -> None:
    """Refuse options that cannot be combined.

    Args:
        ctx: The command's context.
        given: The value of each option by its name; what is None or false is not given.

    Raises:
        click.UsageError: They do not.
    """
    for (option, other), message in _NEEDS.items():
        if given.get(option) and not given.get(other):
            raise click.UsageError(message, ctx)
    for (option, other), instead in _EXCLUDES.items():
        if given.get(option) and given.get(other):
            raise click.UsageError(f"--{option} cannot be combined with --{other}{instead}", ctx)


def check_over_time(ctx: click.Context, given: Mapping[str, object], is_over_time: Callable[[], bool]) -> None:
    """Refuse options that are about frames where intervals are looked for.

    Args:
        ctx: The command's context.
        given: As `check_combination` has it.
        is_over_time: Whether intervals are looked for; asked where it matters.

    Raises:
        click.UsageError: There is one.
    """
    for option in _FRAMES_ONLY:
        if given.get(option) and is_over_time():
            raise click.UsageError(f"--{option} is about frames: it cannot be combined with intervals", ctx)
