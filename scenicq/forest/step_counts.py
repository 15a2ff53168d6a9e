"""How many steps it takes to follow a field over a distance, as a choice of its own where the distance is random.

The number of steps is a function of the distance, a whole number that picks one of several ways. For matching it
becomes a choice between them, each of which requires the distance to be in its range: the same outcomes, and nothing is
left that is not affine in the distance. Scenes are drawn by the function.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import cast

from scenicq.errors import Span
from scenicq.forest import build
from scenicq.forest.nodes import (
    Arithmetic,
    ArithmeticOp,
    CompareOp,
    Constant,
    DiscreteRange,
    Index,
    LogicOp,
    Node,
    Select,
)
from scenicq.forest.scenario import Requirement, Scenario
from scenicq.forest.simplify import rebuilt
from scenicq.forest.walk import leaves, transform

__all__ = ["FEWEST", "LONGEST", "StepCount", "choose_steps"]

FEWEST = 4
"""Steps along a field in the language paper, and the fewest in later versions."""
LONGEST = 5.0
"""Metres of the longest step in later versions."""


@dataclass(frozen=True, slots=True)
class StepCount:
    """The number of steps for a random distance.

    Attributes:
        length: The distance in metres.
        fewest, most: Bounds of the number.
    """

    length: Node
    fewest: int
    most: int

    def index(self, span: Span) -> Node:
        """How many steps more than the fewest."""
        exact = build.arithmetic(ArithmeticOp.DIV, self.length, build.constant(LONGEST), span=span)
        more = build.arithmetic(ArithmeticOp.CEIL, exact, span=span)
        beyond = build.arithmetic(ArithmeticOp.SUB, more, build.constant(float(self.fewest)), span=span)
        low, high = build.constant(0.0), build.constant(float(self.most - self.fewest))
        return build.arithmetic(
            ArithmeticOp.MIN, build.arithmetic(ArithmeticOp.MAX, beyond, low, span=span), high, span=span
        )

    def ranges(self, span: Span) -> tuple[Node, ...]:
        """For each number of steps that the distance is in its range."""
        return tuple(self._range(count, span) for count in range(self.fewest, self.most + 1))

    def _range(self, count: int, span: Span) -> Node:
        ends = ((CompareOp.GT, count - 1, self.fewest), (CompareOp.LE, count, self.most))
        found = [
            build.compare(op, self.length, build.constant(end * LONGEST, span), span)
            for op, end, last in ends
            if count != last
        ]
        return found[0] if len(found) == 1 else build.logic(LogicOp.AND, *found, span=span)


def _read(index: Node) -> StepCount | None:
    """The number of steps that an index is; None for any other index."""
    match index:
        case Arithmetic(
            ArithmeticOp.MIN,
            (
                Arithmetic(
                    ArithmeticOp.MAX,
                    (
                        Arithmetic(
                            ArithmeticOp.SUB,
                            (
                                Arithmetic(
                                    ArithmeticOp.CEIL, (Arithmetic(ArithmeticOp.DIV, (length, Constant(longest))),)
                                ),
                                Constant(fewest),
                            ),
                        ),
                        Constant(),
                    ),
                ),
                Constant(more),
            ),
        ) if longest == LONGEST:
            return StepCount(length, round(cast(float, fewest)), round(cast(float, fewest) + cast(float, more)))
        case _:
            return None


def _is_finite(length: Node) -> bool:
    """Whether a distance depends on finite choices alone: they make it known, and so its number of steps."""
    return all(isinstance(leaf, Index | DiscreteRange) for leaf in leaves(length))


def choose_steps(scenario: Scenario) -> Scenario:
    """The scenario with choices in place of numbers of steps, and with what each of them requires of its distance."""
    picks: dict[int, tuple[Node, Index]] = {}
    needs: list[Requirement] = []

    def step(node: Node) -> Node:
        if not isinstance(node, Select) or isinstance(node.index, Index):
            return node
        index = node.index
        if id(index) not in picks:
            count = _read(index)
            if count is None or index.span is None or _is_finite(count.length):
                return node
            pick = Index((1.0,) * len(node.options), span=index.span)
            picks[id(index)] = index, pick
            needs.append(Requirement(Select(pick, count.ranges(index.span), span=index.span), index.span))
        return replace(node, index=picks[id(index)][1])

    memo: dict[int, Node] = {}
    found = rebuilt(scenario, lambda node: transform(node, step, memo))
    return replace(found, requirements=(*found.requirements, *needs)) if needs else scenario
