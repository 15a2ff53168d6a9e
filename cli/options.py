"""What the options of the command line mean to a query."""

from __future__ import annotations

from typing import Any

from scenicq.errors import DataError, Diagnostic
from scenicq.forest.scenario import BuiltIn
from scenicq.match.options import MatchOptions, parse_tolerance
from scenicq.query.run import QueryOptions

from .check import read_version

__all__ = ["DEFAULTS", "ONE_FRAME", "SHARED", "query_options"]

DEFAULTS = MatchOptions()
"""What counts as a match unless options say otherwise."""
SHARED = frozenset({
    "tolerance", "classes", "ego", "radius", "enforce", "exact", "solver", "method", "timeout", "budget", "scenic",
    "initial", "ignore_params",
})  # fmt: skip
"""Options of `match` that say what a match is; the others say which frames and what to show of them."""
ONE_FRAME = {"prefilter": False, "jobs": 1, "limit": None, "every": True, "all_matches": False}
"""The rest of the options of a query about one frame."""


def _names(text: str | None) -> list[str]:
    return [name.strip() for name in (text or "").split(",") if name.strip()]


def _enforced(names: list[str]) -> frozenset[BuiltIn]:
    """The built-in requirements in force: visibility always, unless the list has `none`."""
    known = [*BuiltIn, "none"]
    for name in names:
        if name not in known:
            hint = f"known are {', '.join(known)}, separated by commas"
            raise DataError(Diagnostic("option-invalid", f"`{name}` is no built-in requirement", hints=(hint,)))
    always = frozenset[BuiltIn]() if "none" in names else DEFAULTS.enforce
    return always | {BuiltIn(name) for name in names if name != "none"}


def query_options(given: dict[str, Any]) -> QueryOptions:
    """The options of a query from those of the command line."""
    tolerance = given["tolerance"]
    options = MatchOptions(
        tolerance=DEFAULTS.tolerance if tolerance is None else parse_tolerance(tolerance),
        classes=given["classes"],
        ego=given["ego"],
        radius=given["radius"],
        enforce=_enforced(_names(given["enforce"])),
        exact=given["exact"],
        method=given["method"],
        timeout_s=given["timeout"],
        budget=given["budget"],
        ignore_params=DEFAULTS.ignore_params.union(_names(given["ignore_params"])),
    )
    same = ("solver", "initial", "prefilter", "jobs", "limit", "every", "all_matches")
    return QueryOptions(match=options, version=read_version(given["scenic"]), **{name: given[name] for name in same})
