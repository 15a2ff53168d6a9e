"""Reference semantics: the value of an expression, given what its random variables and features are.

Used to replay witnesses and to sample scenes. `admits` says whether a value lies in a random variable's support.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import cast

from scenicq.errors import CannotEvaluate
from scenicq.forest.compute import compute, directions
from scenicq.forest.kinds import as_kind
from scenicq.forest.nodes import (
    DirectionAt,
    DiscreteRange,
    Feature,
    Identity,
    Index,
    Leaf,
    Node,
    Normal,
    PointIn,
    Range,
    TruncatedNormal,
    Undefined,
    Value,
    Vector,
)
from scenicq.forest.walk import children, is_leaf, postorder
from scenicq.geometry.membership import contains, distance
from scenicq.geometry.regions import Region

__all__ = ["Observation", "admits", "evaluate", "evaluate_all"]

Observation = Mapping[tuple[int, str], Value]
"""The value of each observed feature, by (object, property)."""


def evaluate_all(
    roots: tuple[Node, ...],
    assignment: Mapping[Identity, Value] | Callable[[Leaf, tuple[Value, ...]], Value],
    observed: Observation | None = None,
    choose: Callable[[DirectionAt, tuple[float, ...]], float] | None = None,
) -> dict[int, Value]:
    """The values of all nodes under the roots.

    Args:
        roots: Expressions.
        assignment: The value of each random variable by its identity, or a function from the variable and the values
            of its distribution's parameters to its value (for sampling).
        observed: The values of features referred to.
        choose: Picks among several directions of a field; the first if not given.

    Returns:
        Values by `id` of the node.

    Raises:
        CannotEvaluate: If geometry cannot decide, or a variable or feature has no value.
    """
    values: dict[int, Value] = {}
    for node in postorder(roots):
        args = tuple(values[id(child)] for child in children(node))
        if is_leaf(node):
            leaf = cast(Leaf, node)
            if isinstance(assignment, Mapping):
                if leaf.identity not in assignment:
                    raise CannotEvaluate("a random variable has no value")
                values[id(node)] = assignment[leaf.identity]
            else:
                values[id(node)] = assignment(leaf, args)
        elif isinstance(node, Feature):
            key = (node.object, node.property)
            if observed is None or key not in observed:
                raise CannotEvaluate(f"`{node.property}` of an object has no value")
            values[id(node)] = as_kind(node, observed[key])
        elif isinstance(node, DirectionAt):
            values[id(node)] = _direction(node, args, choose)
        else:
            values[id(node)] = compute(node, args)
    return values


def _direction(
    node: DirectionAt, args: tuple[Value, ...], choose: Callable[[DirectionAt, tuple[float, ...]], float] | None
) -> Value:
    allowed = directions(*args)
    if isinstance(allowed, Undefined):
        return allowed
    first, *others = allowed
    return choose(node, allowed) if choose and others else first


def evaluate(
    root: Node,
    assignment: Mapping[Identity, Value] | Callable[[Leaf, tuple[Value, ...]], Value],
    observed: Observation | None = None,
    choose: Callable[[DirectionAt, tuple[float, ...]], float] | None = None,
) -> Value:
    """The value of one expression; arguments and errors as of `evaluate_all`."""
    return evaluate_all((root,), assignment, observed, choose)[id(root)]


def admits(leaf: Leaf, args: tuple[Value, ...], value: Value, slack: float) -> bool:
    """Whether a value lies in the support of a random variable, or within `slack` of it.

    Args:
        leaf: The random variable.
        args: The values of its distribution's parameters, in the order of `children`.
        value: The value to test.
        slack: Metres or radians.
    """
    if any(isinstance(arg, Undefined) for arg in args):
        return False
    match leaf:
        case Range():
            ends = cast("tuple[float, float]", args)
            return min(ends) - slack <= cast(float, value) <= max(ends) + slack
        case TruncatedNormal():
            _, _, low, high = cast("tuple[float, float, float, float]", args)
            return low - slack <= cast(float, value) <= high + slack
        case Normal():
            return math.isfinite(cast(float, value))
        case DiscreteRange():
            low, high = cast("tuple[float, float]", args)
            number = cast(float, value)
            return number == math.floor(number) and low <= number <= high
        case Index():
            return cast(float, value) in range(len(leaf.weights))
        case PointIn():
            region = cast(Region, args[0])
            x, y = cast(Vector, value)
            return contains(region, x, y) or (slack > 0 and distance(region, x, y) <= slack)
