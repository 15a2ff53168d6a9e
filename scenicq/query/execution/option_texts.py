"""Options as people write them, such as `position=0.25,heading=5deg`, become the values that a query takes."""

from __future__ import annotations

import shlex
import shutil
from collections.abc import Mapping
from typing import Any, Literal, TypedDict, Unpack, get_args

from scenicq.compiler.element_lookups import LaneRule
from scenicq.compiler.temporal import REACTION_S, Behaviors
from scenicq.errors import DataError, Diagnostic, SolverError
from scenicq.forest.scenario import BuiltIn
from scenicq.match.options import MatchOptions, Method
from scenicq.match.tolerance import parse_tolerance
from scenicq.option_values import (
    FURTHEST_M,
    Amount,
    Count,
    Flag,
    OneOf,
    OptionKind,
    Parameters,
    Text,
    read_options_of,
)
from scenicq.query.execution.run import QueryOptions
from scenicq.store.classes import Granularity
from scenicq.temporal.interval_options import DEFAULT_GAP_S, IntervalOptions, Intervals

__all__ = ["DRIVING", "KINDS", "VERSIONS", "OptionTexts", "read_built_ins", "read_options"]

_DEFAULTS = MatchOptions()

DRIVING = "scenic.domains.driving.model"
"""The world model of a program that is given as text and names none."""

VERSIONS: dict[str, Literal[1, 2, 3]] = {"1": 1, "2": 2, "3": 3}
"""The versions of Scenic by what names them."""


class OptionTexts(TypedDict, total=False):
    """The options of `scenicq match` that say what a match is and how it is found, by the names of the command line.

    None stands for the default where the type has it. Numbers may be texts, such as `timeout="5min"`.
    """

    tolerance: str | float | None
    classes: Granularity
    ego: Literal["label", "any"]
    radius: float | str | None
    enforce: str | None
    exact: bool
    solver: str
    method: Method
    prefilter: bool
    jobs: int | str | None
    timeout: float | str
    budget: int | str
    limit: int | str | None
    where: str | None
    sort: str | None
    every: bool
    all_matches: bool
    strict: bool
    scenic: str | None
    initial: bool
    map_defaults: bool
    lanes: LaneRule
    ignore_params: str | None
    behaviors: Behaviors
    reaction: float | str
    min_duration: float | str | None
    intervals: Intervals
    gap: float | str
    model: str | None
    run_scenario: str | None
    params: Mapping[str, float | str] | None


_SOLVERS = ("auto", "dreal", "portable")

KINDS: Mapping[str, OptionKind] = {
    "tolerance": Text("sizes such as position=0.25,heading=5deg, or one for all", numeric=True),
    "classes": OneOf(get_args(Granularity)),
    "ego": OneOf(("label", "any")),
    "radius": Amount("m", most=FURTHEST_M, above=True),
    "enforce": Text("names of built-in requirements, separated by commas"),
    "exact": Flag(),
    "solver": Text("the name of a solver"),
    "method": OneOf(get_args(Method)),
    "prefilter": Flag(),
    "jobs": Count(most=4096),
    "timeout": Amount("s", above=True),
    "budget": Count(),
    "limit": Count(),
    "where": Text("a condition on what the program records"),
    "sort": Text("the name of what the program records, with `:desc` from the greatest"),
    "every": Flag(),
    "all_matches": Flag(),
    "strict": Flag(),
    "scenic": OneOf(tuple(VERSIONS)),
    "initial": Flag(),
    "map_defaults": Flag(),
    "lanes": OneOf(get_args(LaneRule)),
    "ignore_params": Text("names of parameters, separated by commas"),
    "behaviors": OneOf(get_args(Behaviors)),
    "reaction": Amount("s"),
    "min_duration": Amount("s"),
    "intervals": OneOf(get_args(Intervals)),
    "gap": Amount("s", above=True),
    "model": Text("the name of a world model"),
    "run_scenario": Text("the name of a scenario"),
    "params": Parameters(),
}
"""What values the options have, by the names of the command line, for the command and for Python."""
_OPTIONAL = frozenset({
    "tolerance", "radius", "enforce", "jobs", "limit", "where", "sort", "scenic", "ignore_params", "min_duration",
    "model", "run_scenario", "params",
})  # fmt: skip


def _names(text: str | None) -> list[str]:
    return [name.strip() for name in (text or "").split(",") if name.strip()]


def read_built_ins(text: str | None, *others: str) -> frozenset[BuiltIn]:
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
    asked = read_built_ins(text, "none")
    return asked if "none" in _names(text) else asked | _DEFAULTS.enforce


def _check_solver(name: str) -> None:
    """Refuse a name that nothing answers to at once, rather than at the first frame that needs the solver."""
    try:
        words = shlex.split(name)
    except ValueError:
        words = []
    if name not in _SOLVERS and (not words or shutil.which(words[0]) is None):
        hint = f"known are {', '.join(_SOLVERS)}, or a command that reads SMT-LIB 2, such as 'z3 -in'"
        raise SolverError(Diagnostic("solver-missing", f"`{name}` is no solver, and no command here", hints=(hint,)))


def read_options(**given: Unpack[OptionTexts]) -> QueryOptions:
    """The options of a query.

    Args:
        given: What somebody wrote; the rest is as on the command line.

    Raises:
        DataError: option-invalid.
        SolverError: solver-missing.
    """
    read = read_options_of(KINDS, given, _OPTIONAL)
    tolerance, scenic = read.get("tolerance"), read.get("scenic")
    _check_solver(read.get("solver", "auto"))
    options = MatchOptions(
        tolerance=_DEFAULTS.tolerance if tolerance is None else parse_tolerance(tolerance),
        classes=read.get("classes", _DEFAULTS.classes),
        ego=read.get("ego", _DEFAULTS.ego),
        radius=read.get("radius"),
        enforce=_enforced(read.get("enforce")),
        exact=read.get("exact", _DEFAULTS.exact),
        method=read.get("method", _DEFAULTS.method),
        timeout_s=read.get("timeout", _DEFAULTS.timeout_s),
        budget=read.get("budget", _DEFAULTS.budget),
        ignore_params=_DEFAULTS.ignore_params.union(_names(read.get("ignore_params"))),
    )
    time = IntervalOptions(read.get("intervals", "longest"), read.get("min_duration"), read.get("gap", DEFAULT_GAP_S))
    same = (
        "solver", "initial", "map_defaults", "lanes", "prefilter", "jobs", "limit", "where", "sort", "every",
        "all_matches", "strict", "model", "run_scenario",
    )  # fmt: skip
    values: dict[str, Any] = {name: value for name, value in read.items() if name in same}
    version = None if scenic is None else VERSIONS[scenic]
    return QueryOptions(
        match=options, version=version, behaviors=read.get("behaviors", "motion"),
        reaction_s=read.get("reaction", REACTION_S), time=time, params=read.get("params") or (), **values,
    )  # fmt: skip
