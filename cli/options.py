"""What the options of the command line mean to a query."""

from __future__ import annotations

import shlex
import shutil
from typing import Any

from scenicq.compiler.temporal import Behaviors
from scenicq.errors import DataError, Diagnostic, SolverError
from scenicq.forest.scenario import BuiltIn
from scenicq.match.options import MatchOptions, parse_tolerance
from scenicq.query.execution.run import QueryOptions
from scenicq.temporal.intervals import DEFAULT_GAP_S, IntervalOptions

from .check import read_version

__all__ = ["DEFAULTS", "ONE_FRAME", "SHARED", "TOPICS", "built_ins", "query_options"]

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
        "limit", "every", "all_matches", "near", "format_", "output", "report", "sensors", "export", "explain",
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


def _names(text: str | None) -> list[str]:
    return [name.strip() for name in (text or "").split(",") if name.strip()]


def built_ins(text: str | None, *others: str) -> frozenset[BuiltIn]:
    """The built-in requirements of a list.

    Args:
        text: Names, separated by commas.
        others: Names that may stand among them.

    Raises:
        DataError: option-invalid.
    """
    known = [*BuiltIn, *others]
    for name in _names(text):
        if name not in known:
            hint = f"known are {', '.join(known)}, separated by commas"
            raise DataError(Diagnostic("option-invalid", f"`{name}` is no built-in requirement", hints=(hint,)))
    return frozenset(BuiltIn(name) for name in _names(text) if name not in others)


def _enforced(text: str | None) -> frozenset[BuiltIn]:
    """The built-in requirements in force: visibility always, unless the list has `none`."""
    asked = built_ins(text, "none")
    return asked if "none" in _names(text) else asked | DEFAULTS.enforce


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
    tolerance = given["tolerance"]
    _check_solver(given["solver"])
    options = MatchOptions(
        tolerance=DEFAULTS.tolerance if tolerance is None else parse_tolerance(tolerance),
        classes=given["classes"],
        ego=given["ego"],
        radius=given["radius"],
        enforce=_enforced(given["enforce"]),
        exact=given["exact"],
        method=given["method"],
        timeout_s=given["timeout"],
        budget=given["budget"],
        ignore_params=DEFAULTS.ignore_params.union(_names(given["ignore_params"])),
    )
    same = ("solver", "initial", "prefilter", "jobs", "limit", "every", "all_matches", "strict")
    time = IntervalOptions(given["intervals"], given["min_duration"], given["gap"])
    named = {name: given[name] for name in same}
    behaviors: Behaviors = given["behaviors"] or "refuse"
    return QueryOptions(match=options, version=read_version(given["scenic"]), behaviors=behaviors, time=time, **named)
