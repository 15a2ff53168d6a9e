"""What the options of the command line mean to a query."""

from __future__ import annotations

from typing import Any

import click

from scenicq.match.options import MatchOptions
from scenicq.option_values import OneOf
from scenicq.query.execution.option_texts import KINDS, OptionTexts, read_options
from scenicq.query.execution.run import QueryOptions
from scenicq.temporal.interval_options import DEFAULT_GAP_S

from .option_type import OptionType

__all__ = ["DEFAULTS", "ONE_FRAME", "OVER_TIME", "SHARED", "TOPICS", "option_type", "query_options"]

DEFAULTS = MatchOptions()
"""What counts as a match unless options say otherwise."""
SHARED = frozenset({
    "tolerance", "classes", "ego", "radius", "enforce", "exact", "solver", "method", "timeout", "budget", "scenic",
    "initial", "map_defaults", "lanes", "behaviors", "reaction", "ignore_params", "strict",
    "run_scenario", "params",
})  # fmt: skip
"""Options of `match` that say what a match is; the others say which frames and what to show of them."""
OVER_TIME = frozenset({"min_duration", "gap"})
"""Options of `match` that say what an interval is."""
TOPICS = {
    "What counts as a match": SHARED - {"solver", "method", "timeout", "budget", "strict", "behaviors", "reaction"},
    "Over time": {"behaviors", "reaction", "min_duration", "intervals", "gap"},
    "How it is decided": {"solver", "method", "timeout", "budget", "prefilter", "jobs", "engine"},
    "What comes out": {
        "limit", "every", "all_matches", "near", "where", "sort", "rank", "sample", "diverse", "advised",
        "format_", "output", "report", "sensors", "export", "explain",
    },
    "Long runs": {"shard", "resume"},
    "Messages and exit code": {"strict", "exit_zero", "summary", "quiet", "help"},
}  # fmt: skip
"""The options of `match` as its help lists them."""
ONE_FRAME = {
    "prefilter": False, "jobs": 1, "limit": None, "every": True, "all_matches": False,
    "min_duration": None, "intervals": "longest", "gap": DEFAULT_GAP_S,
}  # fmt: skip
"""The rest of the options of a query about one frame."""


def option_type(name: str) -> click.ParamType[Any, Any]:
    """The values of an option of a query, by its name."""
    kind = KINDS[name]
    return click.Choice(kind.texts) if isinstance(kind, OneOf) else OptionType(kind)


def query_options(given: dict[str, Any]) -> QueryOptions:
    """The options of a query from those of the command line."""
    return read_options(**{name: given[name] for name in OptionTexts.__annotations__ if name in given})
