"""Outcomes of random choices that no scene has, because something that the program asks for is not there.

What one option of a choice lacks excludes that option and no other: an exclusion holds under the options of other
choices for which it was found.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Generator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, TypeAlias, TypeVar

from scenicq.errors import Span
from scenicq.forest import build
from scenicq.forest.nodes import Identity, Index, LogicOp, Node, Select

__all__ = ["Exclusions", "collect_exclusions"]

if TYPE_CHECKING:
    from scenicq.compiler.interpreter import Interpreter

_Result = TypeVar("_Result")
_Key: TypeAlias = "Identity | int"
_Told: TypeAlias = "tuple[tuple[tuple[Node, int, int], ...], Node, list[int], int, Span]"
"""What is excluded: under which options of others, the choice, its options, how many it has, and the place."""
_OWNER = re.compile(r"(?<![\w.])[\w.]+\.$")
"""What stands before an attribute; looked for once in each word, however long."""


def _key(index: Node) -> _Key:
    return index.identity if isinstance(index, Index) else id(index)


@dataclass(slots=True, eq=False)
class _Choice:
    """What is known of one choice, under the options of those around it.

    Attributes:
        index: Which option it comes out as.
        count: Options.
        span: The first place that excludes something.
        excluded: Options without a scene.
        under: Choices of which something is excluded under one of the options.
    """

    index: Node
    count: int
    span: Span
    excluded: set[int] = field(default_factory=set[int])
    under: dict[int, dict[_Key, _Choice]] = field(default_factory=dict[int, "dict[_Key, _Choice]"])


class Exclusions:
    """Options of choices that are excluded, by choice."""

    def __init__(self) -> None:
        """Start with none."""
        self._found: dict[_Key, _Choice] = {}
        self._assumed: list[tuple[Node, int, int]] = []
        self._lacking: set[_Key] = set()
        self._apart: list[_Told] | None = None
        self._kept: dict[int, tuple[object, list[_Told]]] = {}

    @contextmanager
    def assuming(self, index: Node, option: int, count: int) -> Generator[None]:
        """What is excluded meanwhile is so only where a choice comes out as an option of `count`."""
        self._assumed.append((index, option, count))
        try:
            yield
        finally:
            self._assumed.pop()

    def add(self, index: Node, options: list[int], count: int, span: Span) -> None:
        """Exclude some of the `count` options of a choice."""
        if self._apart is not None:
            self._apart.append((tuple(self._assumed), index, options, count, span))
            return
        path: dict[_Key, tuple[Node, int, int]] = {}
        for step in self._assumed:
            if path.setdefault(_key(step[0]), step)[1] != step[1]:
                return  # one choice does not come out as two options
        key = _key(index)
        own = path.pop(key, None)
        if own is not None:
            options = [option for option in options if option == own[1]]
        if not options:
            return
        level = self._found
        for around, (outer, option, width) in path.items():
            level = level.setdefault(around, _Choice(outer, width, span)).under.setdefault(option, {})
        level.setdefault(key, _Choice(index, count, span)).excluded.update(options)

    @contextmanager
    def collect_separately(self) -> Generator[list[_Told]]:
        """What is excluded meanwhile is only listed."""
        before, found = self._apart, list[_Told]()
        self._apart = found
        try:
            yield found
        finally:
            self._apart = before

    def keep(self, value: object, found: list[_Told]) -> None:
        """Keep what was listed beside a value until that is read; values that are no objects of their own are read."""
        if not found:
            return
        self._kept[id(value)] = value, found
        if value is None or isinstance(value, bool | int | float | str):
            self.say(value)

    def say(self, value: object) -> None:
        """Exclude what is kept beside a value."""
        if id(value) not in self._kept:
            return
        assumed = self._assumed
        for path, index, options, count, span in self._kept[id(value)][1]:
            self._assumed = [*assumed, *path]
            self.add(index, options, count, span)
        self._assumed = assumed

    def note_lacking(self, index: Node) -> None:
        """Some option of a choice is there, but lacks a part that the program asks for."""
        self._lacking.add(_key(index))

    def may_lack(self, index: Node) -> bool:
        """Whether that was noted of a choice."""
        return _key(index) in self._lacking

    def conditions(self) -> list[tuple[Node, Span]]:
        """The conditions that choices come out as something else, each with the place in the program that needs it."""
        return [(_condition(choice), _with_owner(choice.span)) for choice in self._found.values()]


def collect_exclusions(run: Interpreter, work: Callable[[], _Result]) -> tuple[_Result, list[tuple[Node, Span]]]:
    """Work something out, and collect what it excludes, which the scene as a whole then does not exclude."""
    of_scene, run.excluded = run.excluded, Exclusions()
    try:
        return work(), run.excluded.conditions()
    finally:
        run.excluded = of_scene


def _with_owner(span: Span) -> Span:
    """The place of an attribute, with what it is one of: `ego.lane`, where the attribute alone is underlined."""
    owner = _OWNER.search(span.source.text[: span.start])
    return Span(span.source, owner.start(), span.end) if owner else span


def _condition(choice: _Choice) -> Node:
    """The condition that no excluded option comes out; choices nest as deep as those of the program."""
    yes, no = build.constant(True), build.constant(False)

    def option(number: int) -> Node:
        if number in choice.excluded:
            return no
        parts = [_condition(inner) for inner in choice.under.get(number, {}).values()]
        return build.logic(LogicOp.AND, *parts, span=choice.span) if len(parts) > 1 else parts[0] if parts else yes

    return Select(choice.index, tuple(option(number) for number in range(choice.count)), span=choice.span)
