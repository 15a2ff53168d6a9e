"""Walking the forest: children, rebuilding, order. Iterative throughout: depth is no limit."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Container, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import assert_never, cast

from scenicq.forest.nodes import (
    Arithmetic,
    Bearing,
    Compare,
    Constant,
    Contains,
    Coordinate,
    DirectionAt,
    DiscAt,
    DiscreteRange,
    Distance,
    Encloses,
    Feature,
    Index,
    Intersects,
    Leaf,
    Logic,
    LogicOp,
    Node,
    Norm,
    Normal,
    PointIn,
    Range,
    RectangleAt,
    RegionDifference,
    RegionIntersection,
    RegionUnion,
    Rotate,
    Scale,
    SectorAt,
    Select,
    TruncatedNormal,
    VectorOf,
    VectorSum,
)

__all__ = [
    "children",
    "conjuncts",
    "deciding_first",
    "features",
    "is_leaf",
    "leaves",
    "postorder",
    "rebuild",
    "transform",
]


def is_leaf(node: Node) -> bool:
    """Whether a node is a random variable."""
    return isinstance(node, Range | Normal | TruncatedNormal | DiscreteRange | Index | PointIn)


def children(node: Node) -> tuple[Node, ...]:
    """The nodes that a node's value depends on; for a random variable the parameters of its distribution."""
    match node:
        case Constant() | Feature() | Index():
            return ()
        case Range() | DiscreteRange():
            return (node.low, node.high)
        case Normal():
            return (node.mean, node.deviation)
        case TruncatedNormal():
            return (node.mean, node.deviation, node.low, node.high)
        case PointIn():
            return (node.region,)
        case Select():
            return (node.index, *node.options)
        case Arithmetic() | Logic():
            return node.args
        case Coordinate() | Norm() | Bearing():
            return (node.vector,)
        case Distance() | Contains():
            return (node.region, node.point)
        case DirectionAt():
            return (node.field, node.point)
        case VectorOf():
            return (node.x, node.y)
        case VectorSum() | Compare() | Intersects():
            return (node.left, node.right)
        case Scale():
            return (node.vector, node.factor)
        case Rotate():
            return (node.vector, node.angle)
        case DiscAt():
            return (node.center, node.radius)
        case SectorAt():
            return (node.center, node.radius, node.heading, node.angle)
        case RectangleAt():
            return (node.center, node.heading, node.width, node.length)
        case RegionUnion() | RegionIntersection():
            return node.parts
        case RegionDifference():
            return (node.base, node.removed)
        case Encloses():
            return (node.outer, node.inner)
        case _:
            assert_never(node)


def rebuild(node: Node, parts: tuple[Node, ...]) -> Node:
    """The same node over other children; the very node if none differs."""
    if all(new is old for new, old in zip(parts, children(node), strict=True)):
        return node
    match node:
        case Constant() | Feature() | Index():
            return node
        case Range() | DiscreteRange():
            return replace(node, low=parts[0], high=parts[1])
        case Normal():
            return replace(node, mean=parts[0], deviation=parts[1])
        case TruncatedNormal():
            return replace(node, mean=parts[0], deviation=parts[1], low=parts[2], high=parts[3])
        case PointIn():
            return replace(node, region=parts[0])
        case Select():
            return replace(node, index=parts[0], options=parts[1:])
        case Arithmetic() | Logic():
            return replace(node, args=parts)
        case Coordinate() | Norm() | Bearing():
            return replace(node, vector=parts[0])
        case Distance() | Contains():
            return replace(node, region=parts[0], point=parts[1])
        case DirectionAt():
            return replace(node, field=parts[0], point=parts[1])
        case VectorOf():
            return replace(node, x=parts[0], y=parts[1])
        case VectorSum() | Compare() | Intersects():
            return replace(node, left=parts[0], right=parts[1])
        case Scale():
            return replace(node, vector=parts[0], factor=parts[1])
        case Rotate():
            return replace(node, vector=parts[0], angle=parts[1])
        case DiscAt():
            return replace(node, center=parts[0], radius=parts[1])
        case SectorAt():
            return replace(node, center=parts[0], radius=parts[1], heading=parts[2], angle=parts[3])
        case RectangleAt():
            return replace(node, center=parts[0], heading=parts[1], width=parts[2], length=parts[3])
        case RegionUnion() | RegionIntersection():
            return replace(node, parts=parts)
        case RegionDifference():
            return replace(node, base=parts[0], removed=parts[1])
        case Encloses():
            return replace(node, outer=parts[0], inner=parts[1])
        case _:
            assert_never(node)


def postorder(roots: Iterable[Node], *, beyond: Container[int] = ()) -> Iterator[Node]:
    """Every node under the roots once, children before parents, in the order of the roots.

    Args:
        roots: The roots.
        beyond: The ids of nodes that are left out, with what is only under them.
    """
    done: set[int] = set()
    for root in roots:
        stack: list[tuple[Node, bool]] = [(root, False)]
        while stack:
            node, expanded = stack.pop()
            if id(node) in done or id(node) in beyond:
                continue
            below = () if expanded else children(node)
            if below:
                stack.append((node, True))
                stack.extend([(child, False) for child in reversed(below)])
            else:
                done.add(id(node))
                yield node


def transform(root: Node, step: Callable[[Node], Node], memo: dict[int, Node] | None = None) -> Node:
    """Rebuild an expression bottom-up, applying `step` to each node over its transformed children.

    Of a choice whose index has become known, or one of a few known numbers, only the options in question are visited.

    Args:
        root: The expression.
        step: Called once a node, with children already transformed.
        memo: Results by the id of the original node; share it between calls to keep shared nodes shared. The caller
            keeps the original nodes alive as long as the memo.
    """
    memo = {} if memo is None else memo
    stack: list[tuple[Node, bool]] = [(root, False)]
    while stack:
        node, expanded = stack.pop()
        if id(node) in memo:
            continue
        if isinstance(node, Select):
            if id(node.index) not in memo:
                stack += [(node, True), (node.index, False)]
                continue
            index = memo[id(node.index)]
            numbers = _known_numbers(index)
            wanted = node.options if numbers is None else tuple(node.options[number] for number in numbers)
            missing = [(option, False) for option in wanted if id(option) not in memo]
            if missing:
                stack += [(node, True), *missing]
                continue
            chosen = tuple(memo[id(option)] for option in wanted)
            if numbers is None:
                memo[id(node)] = step(rebuild(node, (index, *chosen)))
            elif isinstance(index, Select):
                memo[id(node)] = step(Select(index.index, chosen, span=node.span))
            else:
                memo[id(node)] = chosen[0]
            continue
        below = children(node)
        if not expanded and below:
            stack.append((node, True))
            stack.extend((child, False) for child in below if id(child) not in memo)
        else:
            memo[id(node)] = step(rebuild(node, tuple(memo[id(child)] for child in below)))
    return memo[id(root)]


def _known_numbers(index: Node) -> list[int] | None:
    """The numbers that the index of a choice may have, where these are all known and one variable says which."""
    options = index.options if isinstance(index, Select) else (index,)
    numbers = [option.value for option in options if isinstance(option, Constant)]
    if len(numbers) < len(options) or not all(isinstance(number, float) for number in numbers):
        return None
    return [int(number) for number in numbers if isinstance(number, float)]


def conjuncts(root: Node) -> Iterator[Node]:
    """The parts of a conjunction in their order; of anything else, it alone."""
    todo = [root]
    while todo:
        part = todo.pop()
        if isinstance(part, Logic) and part.op is LogicOp.AND:
            todo += reversed(part.args)
        else:
            yield part


def leaves(*roots: Node) -> tuple[Leaf, ...]:
    """The random variables under the roots, each once, in order of first use."""
    return tuple(node for node in postorder(roots) if is_leaf(node))  # type: ignore[misc]


def deciding_first(roots: Sequence[Node]) -> Iterator[Leaf]:
    """The random variables under the roots; those that decide which others matter before these."""
    seen: set[int] = set()
    todo: deque[Node] = deque(roots)
    while todo:
        node = todo.popleft()
        if id(node) in seen:
            continue
        seen.add(id(node))
        if is_leaf(node):
            yield cast(Leaf, node)
        below = list(children(node))
        if isinstance(node, Select):
            todo.appendleft(below[0])
            todo.extend(below[1:])
        else:
            todo.extendleft(reversed(below))


def features(*roots: Node) -> frozenset[tuple[int, str]]:
    """The (object, property) pairs that expressions refer to."""
    return frozenset((node.object, node.property) for node in postorder(roots) if isinstance(node, Feature))
