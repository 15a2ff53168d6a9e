"""Options as people write them, such as `position=0.25,heading=5deg`, become the values that a query takes."""

from __future__ import annotations

from typing import Any, Literal, TypedDict, Unpack

from scenicq.compiler.temporal import Behaviors
from scenicq.errors import DataError, Diagnostic
from scenicq.forest.scenario import BuiltIn
from scenicq.match.options import MatchOptions, Method
from scenicq.match.tolerance import parse_tolerance
from scenicq.query.execution.run import QueryOptions
from scenicq.store.classes import Granularity
from scenicq.temporal.interval_options import DEFAULT_GAP_S, IntervalOptions, Intervals

__all__ = ["DRIVING", "VERSIONS", "OptionTexts", "read_built_ins", "read_options"]

_DEFAULTS = MatchOptions()

DRIVING = "scenic.domains.driving.model"
"""The world model of a program that is given as text and names none."""

VERSIONS: dict[str, Literal[1, 2, 3]] = {"1": 1, "2": 2, "3": 3}
"""The versions of Scenic by what names them."""


class OptionTexts(TypedDict, total=False):
    """The options of `scenicq match` that say what a match is and how it is found, by the names of the command line.

    None stands for the default everywhere.
    """

    tolerance: str | None
    classes: Granularity
    ego: Literal["label", "any"]
    radius: float | None
    enforce: str | None
    exact: bool
    solver: str
    method: Method
    prefilter: bool
    jobs: int | None
    timeout: float
    budget: int
    limit: int | None
    every: bool
    all_matches: bool
    strict: bool
    scenic: str | None
    initial: bool
    ignore_params: str | None
    behaviors: Behaviors | None
    min_duration: float | None
    intervals: Intervals
    gap: float
    model: str | None


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


def read_options(**given: Unpack[OptionTexts]) -> QueryOptions:
    """The options of a query.

    Args:
        given: What somebody wrote; the rest is as on the command line.

    Raises:
        DataError: option-invalid.
    """
    tolerance, scenic = given.get("tolerance"), given.get("scenic")
    if scenic is not None and scenic not in VERSIONS:
        hint = f"known are {', '.join(VERSIONS)}"
        raise DataError(Diagnostic("option-invalid", f"there is no Scenic `{scenic}`", hints=(hint,)))
    options = MatchOptions(
        tolerance=_DEFAULTS.tolerance if tolerance is None else parse_tolerance(tolerance),
        classes=given.get("classes", _DEFAULTS.classes),
        ego=given.get("ego", _DEFAULTS.ego),
        radius=given.get("radius"),
        enforce=_enforced(given.get("enforce")),
        exact=given.get("exact", _DEFAULTS.exact),
        method=given.get("method", _DEFAULTS.method),
        timeout_s=given.get("timeout", _DEFAULTS.timeout_s),
        budget=given.get("budget", _DEFAULTS.budget),
        ignore_params=_DEFAULTS.ignore_params.union(_names(given.get("ignore_params"))),
    )
    time = IntervalOptions(
        given.get("intervals", "longest"), given.get("min_duration"), given.get("gap", DEFAULT_GAP_S)
    )
    same = ("solver", "initial", "prefilter", "jobs", "limit", "every", "all_matches", "strict", "model")
    values: dict[str, Any] = {name: value for name, value in given.items() if name in same}
    version = None if scenic is None else VERSIONS[scenic]
    behaviors: Behaviors = given.get("behaviors") or "refuse"
    return QueryOptions(match=options, version=version, behaviors=behaviors, time=time, **values)
