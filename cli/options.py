"""What the options of the command line mean to a query."""

from __future__ import annotations

import shlex
import shutil
from typing import Any

from scenicq.errors import Diagnostic, SolverError
from scenicq.match.options import MatchOptions
from scenicq.query.execution.option_texts import OptionTexts, read_options
from scenicq.query.execution.run import QueryOptions
from scenicq.temporal.interval_options import DEFAULT_GAP_S

__all__ = ["DEFAULTS", "ONE_FRAME", "SHARED", "TOPICS", "query_options"]

DEFAULTS = MatchOptions()
"""What counts as a match unless options say otherwise."""
_SOLVERS = ("auto", "dreal", "portable")
SHARED = frozenset({
    "tolerance", "classes", "ego", "radius", "enforce", "exact", "solver", "method", "timeout", "budget", "scenic",
    "initial", "behaviors", "ignore_params", "strict",
})  # fmt: skip
"""Options of `match` that say what a match is; the others say which frames and what to show of them."""
TOPICS = {
    "What counts as a match": SHARED - {"solver", "method", "timeout", "budget", "strict", "behaviors"},
    "Over time": {"behaviors", "min_duration", "intervals", "gap"},
    "How it is decided": {"solver", "method", "timeout", "budget", "prefilter", "jobs", "engine"},
    "What comes out": {
        "limit", "every", "all_matches", "near", "rank", "sample", "diverse", "advised",
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


def _check_solver(name: str) -> None:
    """Refuse a name that nothing answers to at once, rather than at the first frame that needs the solver."""
    try:
        words = shlex.split(name)
    except ValueError:
        words = []
    if name not in _SOLVERS and (not words or shutil.which(words[0]) is None):
        hint = f"known are {', '.join(_SOLVERS)}, or a command that reads SMT-LIB 2, such as 'z3 -in'"
        raise SolverError(Diagnostic("solver-missing", f"`{name}` is no solver, and no command here", hints=(hint,)))


def query_options(given: dict[str, Any]) -> QueryOptions:
    """The options of a query from those of the command line."""
    _check_solver(given["solver"])
    return read_options(**{name: given[name] for name in OptionTexts.__annotations__ if name in given})
