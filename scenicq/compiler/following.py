"""`follow F from V for D`: where one gets along a vector field (language paper, appendix B).

Forward Euler: four steps in the paper, and in later versions as many more as keep a step at most 5 m long. How many
that are depends on the distance of the scene, so that where the distance is random the end of the way is a choice
between ways of different numbers of steps, each for the distances that have it.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from scenicq.compiler.coerce import to_scalar, to_vector
from scenicq.compiler.operators import direction_at, make_oriented_point
from scenicq.compiler.values import Instance, ModelValue, fail
from scenicq.errors import Span
from scenicq.forest import build
from scenicq.forest.bounds import likely_bounds, scalar_bounds
from scenicq.forest.nodes import ArithmeticOp, Constant, Node, Select
from scenicq.forest.step_counts import FEWEST, LONGEST, StepCount
from scenicq.limits import LIMITS

if TYPE_CHECKING:
    from scenicq.compiler.interpreter import Interpreter
    from scenicq.compiler.specifier_meanings import SpecifierContext

__all__ = ["follow"]


def follow(
    run: Interpreter | SpecifierContext, field: ModelValue, start: ModelValue, distance: ModelValue, span: Span
) -> Instance:
    """The oriented point at the end of the way, with the field's direction there.

    Args:
        run: The interpreter, or what specifiers know of it.
        field: A vector field, or anything with a heading.
        start: Where to start.
        distance: Metres along the field, backwards where negative.
        span: The construct.

    Raises:
        ScenarioError: wrong-type; budget-exceeded, where the way may be too long.
    """
    point, length = to_vector(start, span), to_scalar(distance, span)
    fewest, most = _steps(length, run.version, span)
    run.budget.step(span, sum(range(fewest, most + 1)) // 4)
    position, heading = _ways(field, _later(run, field), point, length, fewest, most, span)
    return make_oriented_point(position, heading)


def _later(run: Interpreter | SpecifierContext, field: ModelValue) -> ModelValue:
    """The field as it counts after the first step: steps along the road may leave it."""
    along_road = isinstance(field, Constant) and field.value is run.network.roadDirection
    return build.constant(run.network.followedDirection, field.span) if along_road else field


def _steps(length: Node, version: int, span: Span) -> tuple[int, int]:
    """The fewest and the most steps that a distance may have."""
    if version == 1:
        return FEWEST, FEWEST
    shortest, longest = scalar_bounds(length)
    limit = LONGEST * (LIMITS.known_way_steps if shortest == longest else LIMITS.random_way_steps)
    _, likely = likely_bounds(length)
    if math.isfinite(likely) and likely > limit:
        raise fail("budget-exceeded", f"a field is followed for at most {limit:,.0f} m here", span,
                   f"up to {likely:,.0f} m")  # fmt: skip
    # what is hardly ever longer, such as a normal distribution, is followed as far as the limit
    return _count(shortest), _count(min(longest, limit))


def _count(length: float) -> int:
    return max(FEWEST, math.ceil(length / LONGEST)) if math.isfinite(length) else FEWEST


def _ways(
    field: ModelValue, later: ModelValue, start: Node, length: Node, fewest: int, most: int, span: Span
) -> tuple[Node, Node]:
    """Position and heading at the end, by the number of steps that the distance has."""
    ways = [_way(field, later, start, length, count, span) for count in range(fewest, most + 1)]
    if len(ways) == 1:
        return ways[0]
    index = StepCount(length, fewest, most).index(span)
    return (
        Select(index, tuple(position for position, _ in ways), span=span),
        Select(index, tuple(heading for _, heading in ways), span=span),
    )


def _way(field: ModelValue, later: ModelValue, start: Node, length: Node, count: int, span: Span) -> tuple[Node, Node]:
    """Position and heading after a number of steps of equal length."""
    step = build.arithmetic(ArithmeticOp.DIV, length, build.constant(float(count)), span=span)
    ahead = build.vector(build.constant(0.0), step, span)
    point = start
    for number in range(count):
        heading = direction_at(field if number == 0 else later, point, span)
        point = build.vector_sum(point, build.rotate(ahead, heading, span), span)
    return point, direction_at(field, point, span)
