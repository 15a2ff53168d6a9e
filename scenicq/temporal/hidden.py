"""Random variables of the scene that conditions over time depend on, and comparisons that are affine in them.

A variable is drawn once, so all samples see one value of it. A comparison that is affine in it changes its outcome at
one value for each sample, its cut (`hidden_conditions`).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from scenicq.forest.degree import degree
from scenicq.forest.nodes import (
    Arithmetic,
    Compare,
    CompareOp,
    Constant,
    Coordinate,
    DiscreteRange,
    Identity,
    Index,
    Leaf,
    Logic,
    LogicOp,
    Node,
    Normal,
    Range,
    Scale,
    Select,
    TruncatedNormal,
    VectorOf,
    VectorSum,
)
from scenicq.forest.walk import children, leaves, postorder, transform
from scenicq.temporal.atoms import AtomColumns, UnclearVariable

__all__ = [
    "affine_sides",
    "comparisons_of",
    "has_cuts",
    "necessary_condition",
    "random_variables",
    "support",
    "value_between",
]


def random_variables(conditions: Iterable[Node]) -> list[Leaf]:
    """The random variables of conditions, each once."""
    found: dict[Identity, Leaf] = {}
    for leaf in leaves(*conditions):
        found.setdefault(leaf.identity, leaf)
    return list(found.values())


def _known(node: Node) -> float:
    if not (isinstance(node, Constant) and isinstance(node.value, float)):
        raise UnclearVariable("a random variable whose distribution is random itself")
    return node.value


def support(leaf: Leaf) -> tuple[float, float]:
    """The least and the greatest value of a continuous variable.

    Raises:
        UnclearVariable: It is no number, or its ends are random.
    """
    match leaf:
        case Range():
            low, high = _known(leaf.low), _known(leaf.high)
            return min(low, high), max(low, high)
        case TruncatedNormal():
            return _known(leaf.low), _known(leaf.high)
        case Normal():
            return -math.inf, math.inf
        case Index() | DiscreteRange():
            raise UnclearVariable("too many outcomes of random choices to tell apart")
        case _:
            raise UnclearVariable("a hidden random point in a condition over time")


def comparisons_of(leaf: Leaf, conditions: Sequence[Node]) -> Iterator[Compare]:
    """The comparisons that depend on a variable."""
    for node in postorder(tuple(conditions)):
        if not any(_hangs_on(child, leaf) for child in children(node)):
            continue
        match node:
            case Compare():
                yield node
            case Logic():
                pass
            case _ if not _inner(node):
                raise UnclearVariable("a condition over time on a hidden random variable that is no comparison")
            case _:
                pass


def _hangs_on(node: Node, leaf: Leaf) -> bool:
    return any(each.identity is leaf.identity for each in leaves(node))


def _inner(node: Node) -> bool:
    return isinstance(node, Arithmetic | Coordinate | Scale | VectorOf | VectorSum | Select)


def has_cuts(condition: Node) -> bool:
    """Whether the comparisons of a condition with random variables have cuts, by its form."""
    try:
        found = [(leaf, list(comparisons_of(leaf, [condition]))) for leaf in random_variables([condition])]
    except UnclearVariable:
        return False
    return all(
        len(leaves(each)) == 1 and degree(children(each), {leaf.identity}) <= 1
        for leaf, comparisons in found
        for each in comparisons
    )


def necessary_condition(condition: Node) -> Node | None:
    """What holds wherever a condition does for some values of random variables; None if that is not known.

    A comparison that is affine in a bounded number holds for some value of it if it does for the least or the greatest.
    """
    known: dict[int, Node] = {}
    for node in postorder((condition,)):
        own = leaves(node)
        if not own:
            continue
        match node:
            case Logic(op=LogicOp.AND | LogicOp.OR as op, args=args):
                parts = [known.get(id(each), None if leaves(each) else each) for each in args]
                some = tuple(each for each in parts if each is not None)
                if some and (op is LogicOp.AND or len(some) == len(parts)):
                    known[id(node)] = replace(node, args=some)
            case Compare(op=CompareOp.LT | CompareOp.LE | CompareOp.GT | CompareOp.GE) if has_cuts(node):
                with suppress(UnclearVariable):
                    ends = support(own[0])
                    if all(map(math.isfinite, ends)):
                        known[id(node)] = Logic(LogicOp.OR, tuple(_with(node, own[0], end) for end in ends))
            case _:
                pass
    return known.get(id(condition), None if leaves(condition) else condition)


def _with(node: Node, leaf: Leaf, value: float) -> Node:
    """An expression with a value of a random variable."""

    def valued(each: Node) -> Node:
        return Constant(value) if getattr(each, "identity", None) is leaf.identity else each

    return transform(node, valued)


def affine_sides(
    columns: AtomColumns, leaf: Leaf, node: Compare
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    """The left side of a comparison minus the right one as a function of a variable, at each sample.

    Args:
        columns: What is observed, and values of the other variables.
        leaf: The variable.
        node: An expanded comparison; affine in the variable.

    Returns:
        The difference where the variable is 0, by how much it grows with it, and where it is not known.

    Raises:
        UnclearVariable: The comparison is not affine in the variable, or not of numbers.
    """
    if not degree(children(node), {leaf.identity}) <= 1:
        raise UnclearVariable("a comparison that is not affine in a hidden random variable")
    sides: list[NDArray[np.float64]] = []
    unknown: NDArray[np.bool_] | None = None
    for value in (0.0, 1.0):
        assigned = columns.assigned({**columns.assignment, leaf.identity: value})
        left, right = (assigned.scalar(side) for side in (node.left, node.right))
        if left is None or right is None:
            raise UnclearVariable("a comparison of what is not one number with a hidden random variable")
        sides.append(left[0] - right[0])
        unknown = left[1] | right[1]
    assert unknown is not None
    return sides[0], sides[1] - sides[0], unknown


def value_between(low: float, high: float) -> float:
    """A value between two, of which one or both may be infinite."""
    if math.isinf(low) and math.isinf(high):
        return 0.0
    if math.isinf(low):
        return high - 1.0
    return low + 1.0 if math.isinf(high) else (low + high) / 2
