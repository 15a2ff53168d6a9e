"""Conditions and requirements over the samples of an interval, as bands of truth values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from scenicq.errors import Span
from scenicq.forest.nodes import Compare, Node
from scenicq.forest.scenario import Scenario
from scenicq.forest.temporal import Atom, Formula, Process, Test, operands
from scenicq.store.tracks import RecordingTracks
from scenicq.temporal.atoms import AtomColumns, UnclearVariable
from scenicq.temporal.formula_values import FormulaValues
from scenicq.temporal.intervals import IntervalVerdict
from scenicq.temporal.samples import Samples
from scenicq.temporal.truth import Truth

__all__ = [
    "Band",
    "KnownConditions",
    "bands_of",
    "columns_of",
    "conditions_over",
    "shorten",
    "show_bands",
    "sides_over",
]

_WIDTH = 60
"""Characters of a band, at most."""


@dataclass(frozen=True, slots=True)
class Band:
    """A condition or requirement over the samples of an interval.

    Attributes:
        what: In the words of the program.
        span: Where it says so.
        values: The truth value at each sample: of a condition there, of a requirement from there to the end.
        is_requirement: Whether it is a requirement.
        sides: Both sides, at each sample, of a condition that compares numbers; nan where there is none.
    """

    what: str
    span: Span | None
    values: tuple[int, ...]
    is_requirement: bool = False
    sides: tuple[tuple[float, float], ...] = ()


def columns_of(scenario: Scenario, tracks: RecordingTracks, interval: IntervalVerdict) -> AtomColumns:
    """The samples of an interval, from its start as time zero."""
    samples = Samples(tracks, dict(interval.binding), interval.start, interval.end + 1)
    return AtomColumns(scenario, samples, start=np.zeros(len(samples), np.int64))


@dataclass(frozen=True, slots=True, eq=False)
class KnownConditions:
    """The conditions of a program over the samples of an interval.

    Attributes:
        columns: The samples.
        truths: What each condition is there, by its number; those on hidden random variables are left out.
    """

    columns: AtomColumns
    truths: Mapping[int, Truth]


def conditions_over(scenario: Scenario, tracks: RecordingTracks, interval: IntervalVerdict) -> KnownConditions:
    """The conditions of a program over an interval; there are none in a program about one instant."""
    columns = columns_of(scenario, tracks, interval)
    truths: dict[int, Truth] = {}
    for number, condition in enumerate(() if scenario.dynamics is None else scenario.dynamics.conditions):
        with suppress(UnclearVariable):
            truths[number] = columns.truth(condition)
    return KnownConditions(columns, truths)


def bands_of(scenario: Scenario, over: KnownConditions) -> tuple[Band, ...]:
    """The conditions and requirements of a program over an interval."""
    dynamics = scenario.dynamics
    if dynamics is None:
        return ()
    columns, known = over.columns, over.truths
    found: list[Band] = []

    arrivals = {number for each in scenario.arrivals for number in each.conditions}

    def add(number: int, what: str = "") -> None:
        condition = dynamics.conditions[number]
        # no label says where objects come
        if number in known and number not in arrivals:
            values = tuple(known[number].tolist())
            told = what or _named(condition, number)
            found.append(Band(told, condition.span, values, sides=sides_over(columns, condition)))

    for requirement in dynamics.requirements:
        numbers = _atoms(requirement.formula)
        for number in numbers:
            add(number)
        if all(number in known for number in numbers):
            formula = FormulaValues(requirement.formula, dynamics.conditions)
            values = formula.to_the_end(lambda atom: known[atom.number], len(columns.samples))
            text = " ".join(requirement.span.text.split())
            found.append(Band(text, requirement.span, tuple(values.tolist()), is_requirement=True))
    for termination in dynamics.terminations:
        if termination.condition is not None:
            add(termination.condition.number, " ".join(termination.span.text.split()))
    for process in dynamics.processes:
        who = "" if process.object is None else scenario.every_object[process.object].name
        for number, what in _asked(process, dynamics.conditions, who).items():
            add(number, what)
    return tuple(found)


def _asked(process: Process, conditions: Sequence[Node], who: str) -> dict[int, str]:
    """The conditions that a process asks, by number, in words: what an object must show, and when that is over."""
    tests = [step for step in process.steps if isinstance(step, Test)]
    # whoever shows what it must has time again
    shown = {each.condition.number for each in tests if getattr(process.steps[each.then], "extends", False)}
    texts = {each.condition.number: _named(conditions[each.condition.number], each.condition.number) for each in tests}
    done = {texts[number] for number in shown}
    return {
        number: f"{who} shows {text}" if number in shown else f"{who} is through with {text}" if text in done else text
        for number, text in texts.items()
    }


def _atoms(formula: Formula) -> list[int]:
    stack: list[Formula] = [formula]
    found: list[int] = []
    while stack:
        node = stack.pop()
        if isinstance(node, Atom):
            found.append(node.number)
        stack.extend(reversed(operands(node)))
    return found


def _named(condition: Node, number: int) -> str:
    return f"condition {number + 1}" if condition.span is None else " ".join(condition.span.text.split())


def sides_over(columns: AtomColumns, condition: Node) -> tuple[tuple[float, float], ...]:
    """Both sides of a comparison of numbers at each sample."""
    if not isinstance(condition, Compare):
        return ()
    left, right = (columns.number(columns.expanded(side)) for side in (condition.left, condition.right))
    return () if left is None or right is None else tuple(zip(left.tolist(), right.tolist(), strict=True))


def show_bands(bands: Sequence[Band]) -> list[str]:
    """Bands as text: `#` true, `.` false, `?` unknown; of many samples, each character stands for several."""
    if not bands:
        return []
    width = max(len(shorten(band.what)) for band in bands)
    return [f"{shorten(band.what).ljust(width)}  {_drawn(band.values)}" for band in bands]


def shorten(text: str, letters: int = 48) -> str:
    """Cut a text to a number of letters; by default, to those that a line has room for."""
    return text if len(text) <= letters else f"{text[: letters - 1]}\N{HORIZONTAL ELLIPSIS}"


def _drawn(values: Sequence[int]) -> str:
    size = min(len(values), _WIDTH)
    edges = [round(place * len(values) / size) for place in range(size + 1)]
    signs: list[str] = []
    for first, end in pairwise(edges):
        some = set(values[first:end])
        signs.append("#" if some == {2} else "." if some == {0} else "?" if 1 in some else "+")
    return "".join(signs)
