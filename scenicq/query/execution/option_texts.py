"""The options of a query, each declared once: what people write, as `position=0.25,heading=5deg`, becomes values."""

from __future__ import annotations

import shlex
import shutil
from collections.abc import Mapping
from typing import Annotated, Any, Literal, TypedDict, Unpack, get_args

from scenicq.compiler.element_lookups import LaneRule
from scenicq.compiler.temporal import Behaviors
from scenicq.errors import DataError, Diagnostic, SolverError
from scenicq.forest.scenario import BuiltIn
from scenicq.match.options import MatchOptions, Method
from scenicq.match.tolerance import Tolerance, parse_tolerance
from scenicq.option_values import (
    FURTHEST_M,
    Amount,
    Count,
    Flag,
    OneOf,
    Option,
    Parameters,
    Text,
    declared_options,
    read_values,
)
from scenicq.query.execution.run import QueryOptions
from scenicq.store.classes import Granularity
from scenicq.temporal.interval_options import IntervalOptions, Intervals

__all__ = ["DRIVING", "QUERY_OPTIONS", "OptionTexts", "read_built_ins", "read_options"]

_DEFAULTS = MatchOptions()

DRIVING = "scenic.domains.driving.model"
"""The world model of a program that is given as text and names none."""

_VERSIONS: dict[str, Literal[1, 2, 3]] = {"1": 1, "2": 2, "3": 3}


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


def _tolerance(text: str | None) -> Tolerance:
    return _DEFAULTS.tolerance if text is None else parse_tolerance(text)


def _exempt(text: str | None) -> frozenset[str]:
    return _DEFAULTS.ignore_params.union(_names(text))


def _version(text: str | None) -> Literal[1, 2, 3] | None:
    return None if text is None else _VERSIONS[text]


def _pairs(values: tuple[tuple[str, float | str], ...] | None) -> tuple[tuple[str, float | str], ...]:
    return values or ()


_SOLVERS = ("auto", "dreal", "portable")


def _solver(name: str) -> str:
    """Refuse a name that nothing answers to at once, rather than at the first frame that needs the solver."""
    try:
        words = shlex.split(name)
    except ValueError:
        words = []
    if name not in _SOLVERS and (not words or shutil.which(words[0]) is None):
        hint = f"known are {', '.join(_SOLVERS)}, or a command that reads SMT-LIB 2, such as 'z3 -in'"
        raise SolverError(Diagnostic("solver-missing", f"`{name}` is no solver, and no command here", hints=(hint,)))
    return name


_MATCH, _TIME, _HOW, _OUT = "What counts as a match", "Over time", "How it is decided", "What comes out"
_MESSAGES = "Messages and exit code"


# fmt: off
class OptionTexts(TypedDict, total=False):
    """The options of `scenicq match` that say what a match is and how it is found, in the order of its help.

    None stands for the default where the type has it. Numbers may be texts, such as `timeout="5min"`.
    """

    run_scenario: Annotated[str | None, Option(
        Text("the name of a scenario"), "NAME",
        "Which scenario runs, of a program with several.  [default: Main, or the only one]",
        _MATCH, ("--scenario",), "label")]
    params: Annotated[Mapping[str, float | str] | None, Option(
        Parameters(), "NAME VALUE",
        "Set a global parameter to a number or a text, whatever the program says. Can be given several times.",
        _MATCH, ("-p", "--param"), "label", meaning=_pairs)]
    tolerance: Annotated[str | float | None, Option(
        Text("sizes such as position=0.25,heading=5deg, or one for all", numeric=True), "LIST",
        "How far labels may be off, in metres, deg or rad: position=, heading=, speed= and so on; for some objects "
        "ego.heading=15deg, Pedestrian.position=0.5; a bare size for all; or `exact`, 1e-3.  "
        "[default: position=0.25,heading=5deg]",
        _MATCH, about="label", field="match.tolerance", meaning=_tolerance)]
    classes: Annotated[Granularity, Option(
        OneOf(get_args(Granularity)), None,
        "coarse folds all vehicles into Car and all people into Pedestrian.",
        _MATCH, about="label", field="match.classes")]
    ego: Annotated[Literal["label", "any"], Option(
        OneOf(("label", "any")), None,
        "Whether the scenario's ego is the recording vehicle, or any object of its class.",
        _MATCH, about="label", field="match.ego")]
    radius: Annotated[float | str | None, Option(
        Amount("m", most=FURTHEST_M, above=True), "M",
        "Ignore objects and map farther than this from the ego, in metres.",
        _MATCH, about="label", field="match.radius")]
    enforce: Annotated[str | None, Option(
        Text("names of built-in requirements, separated by commas"), "LIST",
        "Built-in requirements to enforce besides visibility: containment, collision; `none` switches visibility off.",
        _MATCH, about="label", field="match.enforce", meaning=_enforced)]
    exact: Annotated[bool, Option(
        Flag(), None, "Every object of the frame must have a role.",
        _MATCH, about="label", field="match.exact")]
    solver: Annotated[str, Option(
        Text("the name of a solver"), "NAME",
        "auto, dreal, portable, or a command that reads SMT-LIB 2, such as 'z3 -in'.",
        _HOW, about="label", meaning=_solver)]
    method: Annotated[Method, Option(
        OneOf(get_args(Method)), None,
        "smt sends everything to the solver; monolithic as one formula. The verdicts are the same.",
        _HOW, about="label", field="match.method")]
    prefilter: Annotated[bool, Option(
        Flag(), None, "Whether SQL narrows the frames first. The matches are the same.", _HOW)]
    jobs: Annotated[int | str | None, Option(
        Count(most=4096), "N",
        "Number of processes that match.  [default: 1, and once it is clear that it takes long, one for each "
        "processor up to 8; with --shard 1]", _HOW)]
    timeout: Annotated[float | str, Option(
        Amount("s", above=True), "S", "Seconds for one frame, the solver's included; then it is unknown.",
        _HOW, about="label", field="match.timeout_s")]
    budget: Annotated[int | str, Option(
        Count(), "N", "Steps of the search for a correspondence in one frame; then the frame is unknown.",
        _HOW, about="label", field="match.budget")]
    limit: Annotated[int | str | None, Option(Count(), "N", "Stop after N matches.", _OUT)]
    every: Annotated[bool, Option(
        Flag(), None, "Also show the frames that do not match, each with its cause.", _OUT, ("--all",))]
    all_matches: Annotated[bool, Option(
        Flag(), None,
        "One line for each correspondence by which a frame matches; interchangeable objects in one order only.", _OUT)]
    where: Annotated[str | None, Option(
        Text("a condition on what the program records"), "CONDITION",
        "Show only matches that meet a condition on what the program records (`record (distance to lead) as gap`): "
        "'gap < 5', over time 'gap.minimum < 5'; also `and`, `or`, `not`. Matches of which it is not known, because a "
        "value is null, are left out and counted.", _OUT)]
    sort: Annotated[str | None, Option(
        Text("the name of what the program records, with `:desc` from the greatest"), "NAME[:desc]",
        "Order matches by a value that the program records, the least first. Matches without the value come last. With "
        "--limit N, only N are kept in memory.", _OUT)]
    scenic: Annotated[str | None, Option(
        OneOf(tuple(_VERSIONS)), None, "Version of Scenic.  [default: inferred]",
        _MATCH, about="label", field="version", meaning=_version)]
    map_defaults: Annotated[bool, Option(
        Flag(), None,
        "Whether the world model gives objects a place and a direction where the program does not: a car is on the "
        "road, along it. Without a map it never does.", _MATCH, about="label")]
    lanes: Annotated[LaneRule, Option(
        OneOf(get_args(LaneRule)), None,
        "Which lanes are an object's own, as in `ego.lane`, where several overlap. along: those within 60 degrees of "
        "its heading and those that continue the last lane of its track, or all if there are none or it has no "
        "heading. any: all of them.", _MATCH, about="label")]
    initial: Annotated[bool, Option(
        Flag(), None, "Ignore behaviors and other dynamic parts: match the initial scene.", _MATCH, about="label")]
    behaviors: Annotated[Behaviors, Option(
        OneOf(get_args(Behaviors)), None,
        "What becomes of behaviors. motion: they run, and what they do is compared with what is seen. guards: they "
        "run, and every action passes. ignore: they are left out.", _TIME, about="label")]
    reaction: Annotated[float | str, Option(
        Amount("s"), "S", "Seconds that an object has to do what its behavior says, at each change.",
        _TIME, about="label", field="reaction_s")]
    min_duration: Annotated[float | str | None, Option(
        Amount("s"), "S",
        "Find intervals of at least S seconds. For a program about one instant, these are the intervals in which every "
        "frame matches with the same objects.", _TIME, about="interval", field="time.min_duration_s")]
    intervals: Annotated[Intervals, Option(
        OneOf(get_args(Intervals)), None, "Report the longest of overlapping intervals, or all of them.",
        _TIME, field="time.intervals")]
    gap: Annotated[float | str, Option(
        Amount("s", above=True), "S", "An object that has no label for S seconds counts as another one afterwards.",
        _TIME, about="interval", field="time.gap_s")]
    ignore_params: Annotated[str | None, Option(
        Text("names of parameters, separated by commas"), "LIST", "Global parameters that are not compared.",
        _MATCH, about="label", field="match.ignore_params", meaning=_exempt)]
    strict: Annotated[bool, Option(
        Flag(), None,
        "Make errors of warnings: of all that `scenicq check` warns of, and of what the program sets and no label has.",
        _MESSAGES, about="label")]
    model: Annotated[str | None, Option(Text("the name of a world model"))]
# fmt: on


QUERY_OPTIONS = declared_options(OptionTexts, QueryOptions())
"""The options of a query by name, for the command, for Python and for reports."""


def read_options(**given: Unpack[OptionTexts]) -> QueryOptions:
    """The options of a query.

    Args:
        given: What somebody wrote; the rest is as on the command line.

    Raises:
        DataError: option-invalid.
        SolverError: solver-missing.
    """
    parts: dict[str, dict[str, Any]] = {"": {}, "match": {}, "time": {}}
    for name, value in read_values(QUERY_OPTIONS, given).items():
        part, _, field = QUERY_OPTIONS[name].field.rpartition(".")
        parts[part][field] = value
    return QueryOptions(match=MatchOptions(**parts["match"]), time=IntervalOptions(**parts["time"]), **parts[""])
