"""Outcomes of random choices that no scene has, because something that the program asks for is not there."""

from __future__ import annotations

from scenicq.errors import Span
from scenicq.forest import build
from scenicq.forest.nodes import Identity, Index, Node, Select

__all__ = ["Exclusions"]


class Exclusions:
    """Options of choices that are excluded, by choice."""

    def __init__(self) -> None:
        """Start with none."""
        self._found: dict[Identity | int, tuple[Node, set[int], int, Span]] = {}

    def add(self, index: Node, options: list[int], count: int, span: Span) -> None:
        """Exclude some of the `count` options of a choice."""
        if options:
            key = index.identity if isinstance(index, Index) else id(index)
            self._found.setdefault(key, (index, set(), count, span))[1].update(options)

    def conditions(self) -> list[tuple[Node, Span]]:
        """That the choices come out as something else, each with the place that needs it."""
        yes, no = build.constant(True), build.constant(False)
        return [
            (Select(index, tuple(no if n in options else yes for n in range(count)), span=span), span)
            for index, options, count, span in self._found.values()
        ]
