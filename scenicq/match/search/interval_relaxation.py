"""Necessary conditions of groups, for many pairs of label objects at once: interval analysis over arrays.

What a group demands is relaxed to intervals, exact in what the label observes and generous in everything random, and
evaluated for all candidates of its roles together. A pair that fails is out before anything expensive looks at it; one
that passes has proven nothing. In the frame of an observed heading, "ahead of it by 3 to 6 m" stays a narrow strip.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import cast

import numpy as np

from scenicq.forest.groups import Comparison, Group
from scenicq.forest.interpret import Steps, interpret, steps_of
from scenicq.forest.interval_ends import ARRAYS
from scenicq.forest.interval_values import FloatOrArray, Interval, IntervalValue, IntervalVector, can_hold
from scenicq.forest.intervals import IntervalDomain
from scenicq.forest.nodes import Feature, Node, Rotate, Select, VectorSum
from scenicq.match.tolerance import SLACK, Margin, Tolerance

__all__ = ["ObservedLookup", "Relaxation", "within_margin"]

ObservedLookup = Callable[[int, str], FloatOrArray | tuple[FloatOrArray, FloatOrArray] | None]
"""What is observed of an object: numbers or a pair of them for all its candidates; None where it is no number."""


@dataclass(frozen=True, slots=True, eq=False)
class Relaxation:
    """A group as bounds of what it compares.

    Attributes:
        group: The group.
        steps: In which its constraints are evaluated.
        given: The bounds of what no label tells anything of, by the ids of nodes: they are found once.
    """

    group: Group
    steps: Steps
    given: Mapping[int, IntervalValue[FloatOrArray]]

    @classmethod
    def of(cls, group: Group) -> Relaxation:
        """The relaxation of a group."""
        roots = [item.expression for item in group.constraints]
        domain: IntervalDomain[FloatOrArray] = IntervalDomain(ARRAYS, slack=SLACK, boxed=False)
        given: dict[int, IntervalValue[FloatOrArray]] = {}
        for step in steps_of(*roots):
            node, below = step
            # the bounds of all options do not depend on which of them is meant
            needed = below[1:] if isinstance(node, Select) else below
            if not isinstance(node, Feature) and all(id(each) in given for each in needed):
                known = {id(each): given.get(id(each)) for each in below}
                given[id(node)] = interpret((step,), domain, known)[id(node)]
        return cls(group, steps_of(*roots, known=given), given)

    def possible(self, observed: ObservedLookup, tolerance: Tolerance) -> FloatOrArray:
        """For which candidates of its roles the group may be satisfiable.

        Args:
            observed: Values of features, as arrays that broadcast against each other.
            tolerance: Per feature.

        Returns:
            A boolean or a boolean array of the broadcast shape; False only where no solution exists.
        """

        def seen(node: Feature) -> IntervalValue[FloatOrArray]:
            return _bounds(observed(node.object, node.property))

        with np.errstate(all="ignore"):
            known = interpret(self.steps, IntervalDomain(ARRAYS, seen, slack=SLACK, boxed=False), self.given)
            result: FloatOrArray = True
            for item in self.group.constraints:
                if isinstance(item, Comparison):
                    answer = _reachable(item, observed(item.object, item.property), known, tolerance)
                else:
                    answer = can_hold(known[id(item.expression)])
                result = answer if result is True else np.logical_and(result, answer)
        return result


def _bounds(seen: FloatOrArray | tuple[FloatOrArray, FloatOrArray] | None) -> IntervalValue[FloatOrArray]:
    if seen is None:
        return None
    if isinstance(seen, tuple):
        x, y = cast("tuple[FloatOrArray, FloatOrArray]", seen)
        return IntervalVector(Interval(x, x, True), Interval(y, y, True))
    return Interval(seen, seen, True)


def _reachable(
    item: Comparison,
    seen: FloatOrArray | tuple[FloatOrArray, FloatOrArray] | None,
    known: dict[int, IntervalValue[FloatOrArray]],
    tolerance: Tolerance,
) -> FloatOrArray:
    value, margin = known[id(item.expression)], tolerance.of(item.object, item.property)
    if isinstance(seen, tuple) and isinstance(value, IntervalVector):
        if item.property != "position":
            return True
        return _meets(item.expression, cast("tuple[FloatOrArray, FloatOrArray]", seen), margin.reach + SLACK, known)
    return within_margin(value, cast(FloatOrArray, seen), margin)


def within_margin(
    value: IntervalValue[FloatOrArray], seen: FloatOrArray | tuple[FloatOrArray, FloatOrArray] | None, margin: Margin
) -> FloatOrArray:
    """Whether a value between bounds can be within tolerance of what a label observes.

    Args:
        value: The bounds.
        seen: A number or a vector; arrays that broadcast with the bounds.
        margin: The tolerance.
    """
    if isinstance(seen, tuple) and isinstance(value, IntervalVector):
        return _in_box(cast("tuple[FloatOrArray, FloatOrArray]", seen), value, margin.reach + SLACK)
    if seen is None or isinstance(seen, tuple) or not isinstance(value, Interval):
        return True
    low, high = value.low, value.high
    allowed = margin.size + SLACK
    if margin.kind != "arc":
        return (low - allowed <= seen) & (seen <= high + allowed)
    width = high - low + 2 * allowed
    return ~np.isfinite(width) | (np.mod(seen - low + allowed, math.tau) <= width)


def _in_box(target: tuple[FloatOrArray, FloatOrArray], box: IntervalVector[FloatOrArray], reach: float) -> FloatOrArray:
    """Whether a point is in a box or within a reach of it."""
    x, y = target
    across = (box.x.low - reach <= x) & (x <= box.x.high + reach)
    return across & (box.y.low - reach <= y) & (y <= box.y.high + reach)


def _meets(
    root: Node, target: tuple[FloatOrArray, FloatOrArray], radius: float, known: dict[int, IntervalValue[FloatOrArray]]
) -> FloatOrArray:
    """Whether a vector can come within a radius of a target, in the frames that the expression goes through."""
    node = root
    x, y = target
    while True:
        match node:
            case VectorSum():
                sides = ((node.left, node.right), (node.right, node.left))
                exact = next(((one, other) for one, other in sides if _is_point(known[id(one)])), None)
                if exact is None:
                    break
                at = cast("IntervalVector[FloatOrArray]", known[id(exact[0])])
                x, y, node = x - at.x.low, y - at.y.low, exact[1]
            case Rotate() if isinstance(angle := known[id(node.angle)], Interval) and angle.exact:
                c, s = np.cos(angle.low), np.sin(angle.low)
                x, y, node = x * c + y * s, y * c - x * s, node.vector
            case _:
                break
    box = known[id(node)]
    return _in_box((x, y), box, radius) if isinstance(box, IntervalVector) else True


def _is_point(value: IntervalValue[FloatOrArray]) -> bool:
    """Whether a vector is known for each candidate."""
    return isinstance(value, IntervalVector) and value.x.exact and value.y.exact
