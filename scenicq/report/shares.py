"""The program line by line, with what each line excluded."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from scenicq.errors import Span
from scenicq.forest.scenario import Scenario

__all__ = ["Line", "program_lines", "spans_of"]


@dataclass(frozen=True, slots=True)
class Line:
    """A line of the program.

    Attributes:
        number: From 1.
        text: The line.
        excluded: Frames that failed first at something that this line says.
        what: What that was.
    """

    number: int
    text: str
    excluded: int = 0
    what: tuple[str, ...] = ()


def spans_of(scenario: Scenario) -> dict[str, Span]:
    """Where in the program each cause of exclusion stands, by the name that causes have."""
    found: dict[str, Span] = {}
    for requirement in scenario.requirements:
        if requirement.span is not None:
            names = " and ".join(scenario.objects[index].name for index in requirement.objects)
            text = " ".join(requirement.span.text.split())
            found[text if requirement.built_in is None else f"{requirement.built_in.value} of {names}"] = (
                requirement.span
            )
    for name, given in scenario.params.items():
        if given.span is not None:
            found[f"param {name}"] = given.span
    for owner in scenario.objects:
        if owner.span is not None:
            found[f"{owner.name}.class"] = owner.span
        for name, given in owner.properties.items():
            span = given.span or owner.span
            if span is not None and span.source is scenario.source:
                found[f"{owner.name}.{name}"] = span
            elif owner.span is not None:
                # a library's default is the line's that makes the object
                found[f"{owner.name}.{name}"] = owner.span
    return found


def program_lines(scenario: Scenario, excluded: Mapping[str, int]) -> tuple[list[Line], dict[str, int]]:
    """Share out the excluded frames among the program's lines; the rest is what no line says.

    Args:
        scenario: The scenario.
        excluded: Frames by what they failed at first, as a `Funnel` has them.
    """
    spans = spans_of(scenario)
    counts: dict[int, int] = {}
    whats: dict[int, list[str]] = {}
    rest: dict[str, int] = {}
    for what, count in sorted(excluded.items(), key=lambda item: (-item[1], item[0])):
        span = spans.get(what)
        if span is None or span.source is not scenario.source:
            rest[what] = count
            continue
        number, _ = span.source.position(span.start)
        counts[number] = counts.get(number, 0) + count
        whats.setdefault(number, []).append(f"{what}: {count:,}")
    lines = [
        Line(number, scenario.source.line(number), counts.get(number, 0), tuple(whats.get(number, ())))
        for number in range(1, len(scenario.source.line_starts) + 1)
    ]
    while lines and not lines[-1].text.strip():
        lines.pop()
    return lines, rest
