"""Constraints of a group laid out for passes over all of their nodes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from scenicq.forest.groups import Comparison
from scenicq.forest.nodes import Constant, DirectionAt, Identity, Index, Leaf, Logic, Node, Select
from scenicq.forest.walk import children, conjuncts, is_leaf, postorder
from scenicq.geometry.fields import FieldCell
from scenicq.geometry.shapes import Bounds
from scenicq.match.fields.interval_domain import Enclosure
from scenicq.match.problem.conditioned import Item
from scenicq.match.tolerance import SLACK, Tolerance

__all__ = ["ConstraintNetwork"]


@dataclass(frozen=True, eq=False)
class ConstraintNetwork:
    """Constraints that are narrowed together.

    Attributes:
        items: The constraints, conditioned; what they share is shared.
        tolerance: Per feature.
    """

    items: Sequence[Item]
    tolerance: Tolerance

    @cached_property
    def nodes(self) -> list[Node]:
        """All nodes, children first."""
        return list(postorder([node for _, node, _ in self.items]))

    @cached_property
    def leaves(self) -> dict[Identity, Leaf]:
        """The random variables."""
        return {node.identity: node for node in self.nodes if is_leaf(node)}  # type: ignore[union-attr]

    @cached_property
    def headings(self) -> dict[int, Enclosure]:
        """Where headings are that the label observes, up to whole turns; by the id of the node."""
        found: dict[int, Enclosure] = {}
        for constraint, node, seen in self.items:
            if isinstance(constraint, Comparison) and constraint.property == "heading" and isinstance(seen, float):
                allowed = self.tolerance.of(constraint.object, "heading").size + SLACK
                found[id(node)] = np.array([[seen - allowed], [seen + allowed]])
        return found

    @cached_property
    def required(self) -> frozenset[int]:
        """The ids of the nodes that have a value wherever all constraints hold: not so options, and alternatives."""
        found: set[int] = set()
        todo = [part for _, node, _ in self.items for part in conjuncts(node)]
        while todo:
            node = todo.pop()
            if id(node) not in found and not isinstance(node, Logic):
                found.add(id(node))
                todo += (node.index,) if isinstance(node, Select) else children(node)
        return frozenset(found)

    @cached_property
    def cells(self) -> dict[tuple[int, float, Bounds], list[FieldCell]]:
        """Cells found so far, by the id of the use of a field, its heading in radians and the box of its point."""
        return {}

    @cached_property
    def choices(self) -> list[Index | DirectionAt]:
        """What has to be chosen before the rest is a matter of numbers."""
        return [
            node
            for node in self.nodes
            if isinstance(node, Index) or (isinstance(node, DirectionAt) and isinstance(node.field, Constant))
        ]
