"""Changes of a program or of a query's options: what may be advised, and the least of a kind that is enough.

`explain`, `--near` and `--advise` tell of changes alone, over frames and over time. Each is made and tried before it is
told, on a frame, a recording or a sample of the dataset.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from scenicq.errors import Span
from scenicq.forest.scenario import Requirement, Scenario
from scenicq.match.tolerance import Tolerance
from scenicq.match.verdict import Match
from scenicq.query.execution.block_matcher import CompiledMap

if TYPE_CHECKING:
    from scenicq.query.execution.results import Result
    from scenicq.query.execution.run import Query, QueryOptions
    from scenicq.query.explain.interval_changes import Shift

__all__ = [
    "FINEST_M",
    "LADDER_M",
    "MOST_M",
    "Change",
    "change_class",
    "change_duration",
    "change_tolerance",
    "combine",
    "drop_requirement",
    "find_least",
    "ignore_param",
    "interval_length",
    "longest_interval",
    "shift_comparison",
    "show_tolerance",
    "skip_property",
]

MOST_M = 100.0
"""Metres beyond which a tolerance is not widened."""
FINEST_M = 1e-3
"""Metres to which the least tolerance is found."""
LADDER_M = (0.01, 0.1, 1.0, 4.0, 16.0, MOST_M)
"""Metres by which tolerances are widened on the way to the least."""

_Made = Callable[[Scenario, "QueryOptions"], "tuple[Scenario, QueryOptions]"]


@dataclass(frozen=True, slots=True, eq=False)
class Change:
    """A change of the program or of the options.

    Attributes:
        text: The change, in the words of the program and of the options.
        made: Gives the changed scenario and options.
        size: How far it leads away from the program: metres, or the unit of the number that it changes.
        about: What it changes, as the funnel names what excludes frames; a property where it concerns many objects.
        span: The place in the program.
        written: What to write for it, where the change is one of words.
        both: The two changes that this one is, if it is two.
        rung: Place among the sizes that are tried one after the other for the same property; 0 for what drops one.
    """

    text: str
    made: _Made
    size: float = math.nan
    about: str = ""
    span: Span | None = None
    written: str = ""
    both: tuple[Change, ...] = ()
    rung: int = 0

    @property
    def parts(self) -> tuple[Change, ...]:
        """The changes that it is made of."""
        return self.both or (self,)

    def compiled(self, world: CompiledMap, options: QueryOptions) -> tuple[CompiledMap, QueryOptions]:
        """The changed program over a map, and the changed options.

        Args:
            world: The program over the map.
            options: The options.
        """
        scenario, changed = self.made(world.scenario, options)
        return CompiledMap.of(scenario, world.network, changed.match, prefilter=changed.prefilter), changed


def find_least(
    holds: Callable[[float], bool], ladder: Sequence[float], *, low: float = 0.0, finest: float = FINEST_M,
    relative: float = 0.0,
) -> float | None:  # fmt: skip
    """The least number for which something holds that holds for all larger ones, too.

    Args:
        holds: Says whether it does.
        ladder: Numbers to be tried first, ascending, to the largest that matters: small ones are decided fastest.
        low: A number for which it does not hold.
        finest: How near the least is to be found.
        relative: As a share of the number; the coarser of both counts.

    Returns:
        None where it holds for none of the ladder.
    """
    for high in ladder:
        if holds(high):
            break
        low = high
    else:
        return None
    while high - low > max(finest, relative * high):
        middle = (low + high) / 2
        low, high = (low, middle) if holds(middle) else (middle, high)
    return high


def longest_interval(query: Query, recording: str, map_name: str, change: Change) -> Result | None:
    """The longest interval of a recording that matches with a change, given its map; None where none does."""
    compiled, options = change.compiled(query.compiled_map(map_name), query.options)
    results = query.alone(recording, map_name, compiled, options).results()
    return max((each for each in results if isinstance(each.verdict, Match)), key=interval_length, default=None)


def interval_length(result: Result) -> int:
    """How many samples the interval of a result has; 0 where it is one of a frame."""
    return 0 if result.interval is None else result.interval.count


def show_tolerance(tolerance: Tolerance) -> str:
    """A tolerance as the option takes it, without what has its default."""
    items = str(tolerance).split(",")
    usual = str(Tolerance()).split(",")
    told = [item for item in items if item not in usual]
    return ",".join(told if told and "=" in items[0] else items)


def combine(one: Change, other: Change) -> Change:
    """Two changes at once."""

    def made(scenario: Scenario, options: QueryOptions) -> tuple[Scenario, QueryOptions]:
        return other.made(*one.made(scenario, options))

    return Change(f"{one.text}, and {other.text}", made, about=one.about, both=(one, other))


def change_tolerance(
    text: str, made: Callable[[Tolerance], Tolerance], *, size: float = math.nan, about: str = "",
    span: Span | None = None, written: str = "", rung: int = 0,
) -> Change:  # fmt: skip
    """Another tolerance, made of that of the options."""

    def with_it(scenario: Scenario, options: QueryOptions) -> tuple[Scenario, QueryOptions]:
        match = replace(options.match, tolerance=made(options.match.tolerance))
        return scenario, replace(options, match=match)

    return Change(text, with_it, size, about, span, written, rung=rung)


def drop_requirement(dropped: Requirement, text: str) -> Change:
    """A requirement dropped, with all that one statement makes of it in the rounds of a loop."""

    def made(scenario: Scenario) -> Scenario:
        left = tuple(each for each in scenario.requirements if not _is_said_alike(each, dropped))
        return replace(scenario, requirements=left)

    return Change(f"without `{text}`", _of_scenario(made), about=text, span=dropped.span)


def _is_said_alike(one: Requirement, other: Requirement) -> bool:
    """Whether two requirements, maybe of one program over two maps, are of one statement, or of one built-in."""
    if one.built_in is not None or other.built_in is not None:
        return one.built_in is other.built_in and one.objects == other.objects
    return one.span == other.span


def skip_property(scenario: Scenario, index: int, name: str) -> Change:
    """A property of an object that is not compared."""
    owner = scenario.objects[index]
    what = f"{owner.name}.{name}"

    def made(other: Scenario) -> Scenario:
        objects = list(other.objects)
        given = objects[index].properties[name]
        objects[index] = replace(
            objects[index], properties={**objects[index].properties, name: replace(given, explicit=False)}
        )
        return replace(other, objects=tuple(objects))

    return Change(f"`{what}` not compared", _of_scenario(made), about=what, span=owner.properties[name].span)


def change_class(scenario: Scenario, index: int, category: str) -> Change:
    """An object with another class."""
    owner = scenario.objects[index]

    def made(other: Scenario) -> Scenario:
        objects = list(other.objects)
        objects[index] = replace(objects[index], category=category)
        return replace(other, objects=tuple(objects))

    return Change(f"`{owner.name}` as `{category}`", _of_scenario(made), about=f"{owner.name}.class", span=owner.span)


def ignore_param(name: str, span: Span | None) -> Change:
    """A parameter that is not compared."""

    def made(scenario: Scenario, options: QueryOptions) -> tuple[Scenario, QueryOptions]:
        match = replace(options.match, ignore_params=options.match.ignore_params | {name})
        return scenario, replace(options, match=match)

    return Change(f"--ignore-params {name}", made, about=f"param {name}", span=span)


def change_duration(seconds: float, size: float) -> Change:
    """Another least duration."""

    def made(scenario: Scenario, options: QueryOptions) -> tuple[Scenario, QueryOptions]:
        return scenario, replace(options, time=replace(options.time, min_duration_s=seconds))

    return Change(f"would match with --min-duration {seconds:g}", made, size, about="--min-duration")


def shift_comparison(shift: Shift, span: Span | None) -> Change:
    """A comparison over time that lets more or less through."""

    def made(scenario: Scenario) -> Scenario:
        dynamics = scenario.dynamics
        assert dynamics is not None
        return replace(scenario, dynamics=replace(dynamics, conditions=shift.made(dynamics.conditions)))

    return Change(shift.text(), _of_scenario(made), abs(shift.amount), about="program", span=span)


def _of_scenario(made: Callable[[Scenario], Scenario]) -> _Made:
    return lambda scenario, options: (made(scenario), options)
