"""A compiled scenario: its objects, requirements and parameters, all of them expressions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Literal

from scenicq.errors import Diagnostic, Source, Span
from scenicq.forest.nodes import Kind, Node
from scenicq.forest.temporal import Dynamics

__all__ = ["Arrival", "BuiltIn", "Property", "RecordedValue", "Requirement", "Scenario", "ScenarioObject"]


class BuiltIn(StrEnum):
    """The requirements that Scenic adds by itself; visibility is in force by default, the others when asked for."""

    VISIBILITY = "visibility"
    CONTAINMENT = "containment"
    COLLISION = "collision"


@dataclass(frozen=True, slots=True)
class Property:
    """A property of an object.

    Attributes:
        value: Its expression.
        explicit: Whether the program itself sets it, rather than a library's default.
        span: The specifier or default that gives it.
    """

    value: Node
    explicit: bool
    span: Span | None


@dataclass(frozen=True, slots=True)
class ScenarioObject:
    """An object of the scenario.

    Attributes:
        index: Position in `Scenario.objects`.
        name: The variable that the program gives it, else `Class#n` in program order.
        category: Its class in the class tree.
        properties: Its properties by name.
        mutated: The properties (position, heading) to which noise of unbounded support is added at the end.
        span: The expression that creates it.
        uncomparable: Properties that the program itself sets to what no label can have, such as a list, with the place.
    """

    index: int
    name: str
    category: str
    properties: Mapping[str, Property]
    mutated: frozenset[str]
    span: Span | None
    uncomparable: Mapping[str, Span | None] = field(default_factory=dict[str, "Span | None"])


@dataclass(frozen=True, slots=True)
class Requirement:
    """A condition on scenes.

    Attributes:
        condition: A boolean expression.
        span: Where the program says it.
        built_in: Which built-in requirement it is; None if the author wrote it.
        objects: Indices of the objects that a built-in requirement is about.
        probability: With which it must hold: below 1 it excludes nothing.
    """

    condition: Node
    span: Span | None
    built_in: BuiltIn | None = None
    objects: tuple[int, ...] = ()
    probability: float = 1.0


@dataclass(frozen=True, slots=True)
class RecordedValue:
    """A value that results carry.

    Attributes:
        name: What it is called.
        when: Whether an interval gives the value at each sample, or that at the first or the last.
        value: Its expression.
        kind: "scalar", "boolean", "vector", or "other" for a text.
        span: Where the program says it.
    """

    name: str
    when: Literal["always", "initial", "final"]
    value: Node
    kind: Kind
    span: Span


@dataclass(frozen=True, slots=True)
class Arrival:
    """What is asked of the sample at which a scenario begins that makes objects.

    Attributes:
        conditions: The conditions over time that stand for it, by number.
        objects: The objects that it makes.
        requirements: What it requires there.
    """

    conditions: tuple[int, ...]
    objects: tuple[ScenarioObject, ...]
    requirements: tuple[Requirement, ...] = ()


@dataclass(frozen=True, slots=True)
class Scenario:
    """A scenario compiled against one map.

    Attributes:
        source: The program.
        version: The version of Scenic it is read as: 1, 2 or 3.
        map: The name of the map.
        objects: The objects in program order.
        ego: Index of the ego.
        requirements: Hard requirements, the author's first.
        params: Global parameters with the places that set them.
        solid: Indices of the objects that do not allow collisions: no two of their boxes may overlap (requirements of
            all pairs are made only where they are enforced: there are many).
        soft: Requirements with a probability below 1, which exclude nothing.
        ignored: Dynamic parts that were left out.
        warnings: What the author should know.
        records: What results carry.
        dynamics: What it says about time; None for a static program, and where that is left out.
        variants: Where runs have other objects than others: the scenario of each case; it itself has those that are
            there in all of them.
        arrivals: Scenarios that make objects after the first sample, in the order in which these are counted, behind
            the others.
        as_written: Where expressions were rewritten to be matched, which keeps outcomes but not their probabilities:
            the scenario as the program has it, from which scenes are drawn.
    """

    source: Source
    version: int
    map: str
    objects: tuple[ScenarioObject, ...]
    ego: int
    requirements: tuple[Requirement, ...]
    params: Mapping[str, Property]
    solid: tuple[int, ...] = ()
    soft: tuple[Requirement, ...] = ()
    ignored: tuple[Diagnostic, ...] = ()
    warnings: tuple[Diagnostic, ...] = field(default=())
    dynamics: Dynamics | None = None
    records: tuple[RecordedValue, ...] = ()
    variants: tuple[Scenario, ...] = field(default=(), repr=False)
    arrivals: tuple[Arrival, ...] = ()
    as_written: Scenario | None = field(default=None, repr=False)

    @property
    def every_object(self) -> tuple[ScenarioObject, ...]:
        """Its objects, and those that are made after the first sample."""
        return (*self.objects, *(owner for each in self.arrivals for owner in each.objects))
