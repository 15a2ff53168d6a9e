"""What keeps nearly all frames from matching, and how many there would be with one change, or with two.

A change drops one requirement or the comparison of one feature, widens one part of the tolerance, or takes a wider
class. The prefilter of the changed program counts what it leaves, over a sample where the dataset is large; the matcher
then decides these, as long as there is time, so that the number is one of matches and not only a bound. The sample is
read into memory once, for all changes. Where no change leaves a frame, pairs of those that drop something are tried.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterator, Mapping, Sequence, Set
from contextlib import ExitStack, closing
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice
from typing import TYPE_CHECKING

import numpy as np

from scenicq.budget import limited, time_is_up, time_left_s
from scenicq.forest.kinds import kind_of
from scenicq.forest.scenario import Scenario
from scenicq.limits import LIMITS
from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import Tolerance
from scenicq.match.verdict import Match, Unknown
from scenicq.query.execution.block_matcher import CompiledMap
from scenicq.query.execution.lazy_solver import LazySolver
from scenicq.query.execution.run import MAP_LACKS, Query, QueryOptions
from scenicq.query.explain.changes import (
    Change,
    change_class,
    change_tolerance,
    combine,
    drop_requirement,
    ignore_param,
    show_tolerance,
    skip_property,
)
from scenicq.query.explain.prefilter_counts import spots
from scenicq.query.prefilter.executor import hold, run_plan
from scenicq.query.prefilter.survivors import candidates
from scenicq.store.classes import ancestors, is_class
from scenicq.store.recorded_tracks import RecordedTracks

if TYPE_CHECKING:
    import duckdb

__all__ = ["Advice", "ChangeForecast", "advice"]

_ANYWHERE = {"position": 1e5, "heading": math.pi}
"""Sizes of a tolerance by which a feature is as good as not compared."""
_WRITTEN = {"position": "in everywhere", "heading": "facing Range(0, 360) deg"}
"""What the program says where a property may have any value, in place of a class's default."""
_AT_A_SIDE = re.compile(r"(ahead of|behind|left of|right of) (\w+) by (?!.*@)")
_ATTRIBUTE = re.compile(r"\w+(?:\.\w+)+")
_AREAS = {
    "ahead of": "Range(-2, 2) @ Range(3, 30)", "behind": "Range(-2, 2) @ Range(-30, -3)",
    "left of": "Range(-6, -1) @ Range(-5, 5)", "right of": "Range(1, 6) @ Range(-5, 5)",
}  # fmt: skip
"""Areas at a side of an object, from centre to centre."""
_WIDER = (("position", 1.0), ("position", 4.0), ("heading", math.radians(20)), ("heading", math.radians(45)))
"""Parts of the tolerance that are tried, in metres and radians."""
_WIDER_NUMBER = 0.5
"""Tolerance of speeds, sizes and other numbers that is tried."""


@dataclass(frozen=True, slots=True)
class ChangeForecast:
    """How many frames there would be with a change.

    Attributes:
        change: The change.
        least: How many match as far as they were decided.
        most: How many may match: with those that the prefilter leaves and nobody decided.
        sampled: Whether the numbers were projected from a sample.
    """

    change: Change
    least: int
    most: int
    sampled: bool

    @property
    def certain(self) -> bool:
        """Whether the number is known."""
        return self.least == self.most


@dataclass(frozen=True, slots=True)
class Advice:
    """What keeps frames from matching, and what would help.

    Attributes:
        first: The conditions that exclude most frames, with how many.
        without_map: Frames on maps that lack what the program needs.
        outlooks: The changes that may leave frames, those that are known to leave most first; pairs of changes only
            where no single one does.
        complete: Whether all single changes were looked at within the time.
        hints: What the program may mean instead.
    """

    first: tuple[tuple[str, int], ...]
    outlooks: tuple[ChangeForecast, ...]
    complete: bool
    hints: tuple[str, ...] = ()
    without_map: int = 0


@dataclass(frozen=True, slots=True)
class _Sample:
    """The frames that changes are tried on.

    Attributes:
        worlds: The scenario over their maps, by the name of the map.
        held: What holds the frames of each.
        frames: How many there are.
        total: How many the query has on all maps that the program fits: no change is about others.
        recorded: The tracks of their recordings.
    """

    worlds: Mapping[str, CompiledMap]
    held: Mapping[str, duckdb.DuckDBPyConnection]
    frames: int
    total: int
    recorded: RecordedTracks


def advice(query: Query, *, budget_s: float = math.inf, brief: bool = False) -> Advice:
    """What keeps the frames of a query from matching, and how many there would be with one change.

    Args:
        query: After its results were taken: the changes are tried in the order of what excluded most frames.
        budget_s: Seconds of work that the changes may take, the solver's included; the first is tried in any case.
        brief: Whether only a few changes are tried, and of each only a few frames decided.
    """
    excluded = [each for each in query.funnel.excluded.most_common() if not each[0].startswith(MAP_LACKS)]
    without_map = query.funnel.excluded.total() - sum(frames for _, frames in excluded)
    there = [name for name in query.fitting_maps() if query.frames(name)]
    if not there:
        return Advice(tuple(excluded[:3]), (), complete=True, without_map=without_map)
    rank = {what: place for place, (what, _) in enumerate(excluded)}
    scenario = query.planned_map(there[0]).scenario
    for what in tuple(rank):
        # a wider tolerance is tried after the first feature that it concerns
        rank.setdefault(what.rpartition(".")[2], rank[what])
    changes = sorted(
        _changes(scenario, query.options.match), key=lambda each: (rank.get(each.about, len(excluded)), each.rung)
    )
    few, decided = (
        (LIMITS.brief_changes, LIMITS.brief_decisions) if brief else (LIMITS.advice_changes, LIMITS.advice_decisions)
    )
    options = replace(query.options, prefilter=True)
    found: list[ChangeForecast] = []
    complete = True
    with ExitStack() as stack, limited(min(budget_s, time_left_s(query.options.until))):
        runs, maps = (LIMITS.brief_runs, LIMITS.brief_maps) if brief else (LIMITS.advice_runs, LIMITS.advice_maps)
        sample = _sample(query, there, stack, runs, maps)
        solver = stack.enter_context(LazySolver(query.options.solver))
        for number, change in enumerate(changes):
            if number and (time_is_up() or number >= (few if found else LIMITS.advice_changes)):
                complete = False
                break
            outlook = _outlook(options, sample, change, solver, decided)
            if outlook.most > query.funnel.matches:
                found.append(outlook)
        if not found and query.funnel.matches == 0:
            paired = _pairs(changes, LIMITS.brief_pairs if brief else LIMITS.advice_pairs)
            for change in itertools.takewhile(lambda _: not time_is_up(), paired):
                outlook = _outlook(options, sample, change, solver, decided)
                if outlook.most > 0:
                    found.append(outlook)
    found.sort(key=lambda each: (-each.least, -each.most))
    changed = {each.about for outlook in found for each in outlook.change.parts}
    doubtful = rank.keys() | changed if found else {f"{owner.name}.position" for owner in scenario.objects}
    hints = (*_lines_meant(scenario, doubtful), *_without_maps(query))
    return Advice(tuple(excluded[:3]), tuple(found), complete, hints, without_map)


def _without_maps(query: Query) -> Iterator[str]:
    """What to write so that frames of maps that lack something can match, too."""
    told = [each for each in query.funnel.warnings if each.code == "map-lacks"]
    yield from dict.fromkeys(each.hints[-1] for each in told if each.hints)


def _lines_meant(scenario: Scenario, about: Set[str]) -> Iterator[str]:
    """Hints for objects at a side of another, which leaves them a line, where their position is in doubt."""
    for owner in scenario.objects:
        given = owner.properties.get("position")
        if given is None or not given.explicit or given.span is None:
            continue
        placed = _AT_A_SIDE.match(" ".join(given.span.text.split()))
        if placed and f"{owner.name}.position" in about:
            side, other = placed.groups()
            yield (f"`{side} {other} by` a number leaves a line; "
                   f"`at {other} offset by {_AREAS[side]}` is an area")  # fmt: skip


def _pairs(changes: Sequence[Change], most: int) -> Iterator[Change]:
    """Two changes at once, of the first that drop something."""
    dropping = [each for each in changes if not each.rung]
    return itertools.starmap(combine, itertools.combinations(dropping[:most], 2))


def _sample(query: Query, there: Sequence[str], stack: ExitStack, runs: int, maps: int) -> _Sample:
    """Read the frames that changes are tried on."""
    total = sum(map(query.frames, there))
    step = max(1, -(-len(there) // maps))
    chosen = {name: query.compiled_map(name) for name in there[::step]}
    held: dict[str, duckdb.DuckDBPyConnection] = {}
    frames = 0
    for name in chosen:
        connection = stack.enter_context(closing(query.dataset.connect(threads=1, views=False)))
        blocks = query.blocks(name)
        frames += hold(query.dataset, connection, list(spots(blocks, runs)) if total > LIMITS.advice_frames else blocks)
        held[name] = connection
    return _Sample(chosen, held, frames, total, query.dataset.recorded)


def _changes(scenario: Scenario, options: MatchOptions) -> Iterator[Change]:
    """The changes that a program and its options can make, those of its features and requirements in its order."""
    dropped: dict[str, Change] = {}
    for requirement in scenario.requirements:
        if requirement.built_in is None or requirement.built_in in options.enforce:
            text = " ".join(requirement.span.text.split()) if requirement.span is not None else "a requirement"
            if requirement.built_in is not None:
                names = " and ".join(scenario.objects[index].name for index in requirement.objects)
                text = f"{requirement.built_in.value} of {names}"
            elif _ATTRIBUTE.fullmatch(text):
                continue  # no statement says that `ego.lane` must be there, so that none can be dropped
            dropped.setdefault(f"{text} {requirement.span and requirement.span.start}",
                               drop_requirement(requirement, text))  # fmt: skip
    yield from dropped.values()
    for name, given in scenario.params.items():
        if given.explicit and name not in options.ignore_params:
            yield ignore_param(name, given.span)
    numbers: dict[str, None] = {}
    for owner in scenario.objects:
        for name, given in owner.properties.items():
            if name in _ANYWHERE and name not in owner.mutated:
                what = f"{owner.name}.{name}"
                span, written = (given.span, "") if given.explicit else (owner.span, _WRITTEN[name])
                wide = partial(_ruled, owner.name, name, _ANYWHERE[name])
                yield change_tolerance(f"`{what}` not compared", wide, about=what, span=span, written=written)
            elif given.explicit and name not in _ANYWHERE:
                yield skip_property(scenario, owner.index, name)
                if kind_of(given.value) == "scalar":
                    numbers[name] = None
        wider = ancestors(owner.category)[1:2] if is_class(owner.category) else ()
        yield from (change_class(scenario, owner.index, category) for category in wider)
    wider_parts = [(name, partial(_ruled, "", name, _WIDER_NUMBER), 1) for name in numbers
                   if options.tolerance.of(0, name).size < _WIDER_NUMBER]  # fmt: skip
    for number, (name, size) in enumerate(_WIDER, 1):
        disc = name != "position" or options.tolerance.x is None
        if disc and getattr(options.tolerance, name) < size:
            wider_parts.append((name, partial(_sized, name, size), number))
    for name, wide, rung in wider_parts:
        yield change_tolerance(f"--tolerance {show_tolerance(wide(options.tolerance))}", wide, about=name, rung=rung)


def _ruled(scope: str, name: str, size: float, tolerance: Tolerance) -> Tolerance:
    return replace(tolerance, rules=(*tolerance.rules, (scope, name, size)))


def _sized(name: str, size: float, tolerance: Tolerance) -> Tolerance:
    return replace(tolerance, position=size) if name == "position" else replace(tolerance, heading=size)


def _outlook(options: QueryOptions, sample: _Sample, change: Change, solver: LazySolver, most: int) -> ChangeForecast:
    """Count the frames that a change leaves, and decide at most so many of them while there is time."""
    left = matched = decided = looked_at = 0
    for name, connection in sample.held.items():
        world, changed = change.compiled(sample.worlds[name], options)
        missed = run_plan(connection, world.plan)
        count = int(np.count_nonzero(missed < 0))
        left += count
        if not count or looked_at >= most or time_is_up():
            continue
        matcher = Matcher(world.scenario, changed.match, solver)
        left_over = candidates(
            connection, world.plan, motion=world.motion, recorded=sample.recorded, whole=world.whole,
            on_course=world.on_course,
        )  # fmt: skip
        labels = islice(left_over, most - looked_at)
        for verdict in matcher.match_all([(each.label, each.among) for each in labels]):
            looked_at += 1
            matched += isinstance(verdict, Match)
            decided += not isinstance(verdict, Unknown)
            if time_is_up():
                break
    sampled = sample.frames < sample.total
    scale = sample.total / sample.frames if sampled and sample.frames else 1.0
    return ChangeForecast(change, round(scale * matched), round(scale * (matched + left - decided)), sampled)
