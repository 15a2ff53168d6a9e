"""Random variables of the scene that conditions over time hang on: cells of values within which no condition changes.

A variable is drawn once, so all samples see one value of it. A comparison that is affine in it changes its outcome at
one value for each sample; between two neighbours of all these values every condition is constant. So a value of each
cell (and each boundary) stands for all of it, and a run is decided for each by plain evaluation.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenicq.forest.nodes import (
    Arithmetic,
    ArithmeticOp,
    Compare,
    Constant,
    Coordinate,
    DiscreteRange,
    Identity,
    Index,
    Leaf,
    Logic,
    Node,
    Normal,
    Range,
    Scale,
    Select,
    TruncatedNormal,
    Value,
    VectorOf,
    VectorSum,
)
from scenicq.forest.walk import children, leaves, postorder
from scenicq.temporal.atoms import AtomColumns

__all__ = ["Cell", "UnclearVariable", "affine_sides", "cells", "has_cells", "inside", "random_variables", "support"]

_MOST_CELLS = 3000
"""Combinations of values that are tried for one binding."""


class UnclearVariable(Exception):
    """Values of a random variable cannot be cut into cells; the message says why."""


@dataclass(frozen=True, slots=True)
class Cell:
    """Values of random variables that stand for a box of them.

    Attributes:
        values: The value of each variable.
        ranges: Between which values nothing changes, by variable; equal ends for a single value.
    """

    values: Mapping[Identity, Value]
    ranges: Mapping[Identity, tuple[float, float]]


def random_variables(conditions: Iterable[Node]) -> list[Leaf]:
    """The random variables of conditions, each once."""
    found: dict[Identity, Leaf] = {}
    for leaf in leaves(*conditions):
        found.setdefault(leaf.identity, leaf)
    return list(found.values())


def cells(columns: AtomColumns, conditions: Sequence[Node]) -> Iterator[Cell]:
    """Cells that cover all values of the random variables of conditions.

    Args:
        columns: What is observed.
        conditions: Expanded conditions.

    Raises:
        UnclearVariable: A condition is not affine in a variable or hangs on two at once, or there are too many cells.
    """
    variables = random_variables(conditions)
    cuts = [_cuts(columns, leaf, variables, conditions) for leaf in variables]
    if math.prod(map(len, cuts)) > _MOST_CELLS:
        raise UnclearVariable("too many values of random variables to tell apart")
    for parts in itertools.product(*cuts):
        ranges = {leaf.identity: part for leaf, part in zip(variables, parts, strict=True)}
        yield Cell({identity: inside(*part) for identity, part in ranges.items()}, ranges)


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


def _cuts(
    columns: AtomColumns, leaf: Leaf, variables: Sequence[Leaf], conditions: Sequence[Node]
) -> list[tuple[float, float]]:
    """The values at which some condition may change, and the open ranges between them."""
    low, high = support(leaf)
    others = {each.identity for each in variables} - {leaf.identity}
    found: set[float] = {end for end in (low, high) if math.isfinite(end)}
    for node in _comparisons(leaf, conditions):
        if any(each.identity in others for each in leaves(node)):
            raise UnclearVariable("a comparison of two hidden random variables over time")
        found.update(value for value in _changes(columns, leaf, node) if low <= value <= high)
    ordered = sorted(found)
    ends = [low, *ordered, high] if ordered else [low, high]
    between = [(one, other) for one, other in itertools.pairwise(ends) if one < other]
    return [*((value, value) for value in ordered), *between]


def _comparisons(leaf: Leaf, conditions: Sequence[Node]) -> Iterator[Compare]:
    """The comparisons that hang on a variable."""
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


def _affine(root: Node, leaf: Leaf) -> bool:
    """Whether an expression is affine in a variable by its form."""
    hangs: dict[int, bool] = {}
    for node in postorder((root,)):
        below = [hangs[id(child)] for child in children(node)]
        own = getattr(node, "identity", None) is leaf.identity
        hangs[id(node)] = own or any(below)
        if not any(below):
            continue
        match node:
            case Arithmetic(op=ArithmeticOp.ADD | ArithmeticOp.SUB | ArithmeticOp.NEG):
                pass
            case Arithmetic(op=ArithmeticOp.MUL) if sum(below) == 1:
                pass
            case Arithmetic(op=ArithmeticOp.DIV) if not below[1]:
                pass
            case Coordinate() | VectorOf() | VectorSum():
                pass
            case Scale() if sum(below) == 1:
                pass
            case Select() if not below[0]:
                pass
            case _:
                return False
    return True


def has_cells(condition: Node) -> bool:
    """Whether values of the random variables of a condition can be cut into cells, by its form."""
    try:
        found = [(leaf, list(_comparisons(leaf, [condition]))) for leaf in random_variables([condition])]
    except UnclearVariable:
        return False
    return all(
        len(leaves(each)) == 1 and all(_affine(side, leaf) for side in children(each))
        for leaf, comparisons in found
        for each in comparisons
    )


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
    if not all(_affine(child, leaf) for child in children(node)):
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


def _changes(columns: AtomColumns, leaf: Leaf, node: Compare) -> Iterator[float]:
    """The values of a variable at which both sides of a comparison are equal, at some sample."""
    at_0, slope, _ = affine_sides(columns, leaf, node)
    with np.errstate(all="ignore"):
        found = -at_0 / slope
    yield from set(found[np.isfinite(found)].tolist())


def inside(low: float, high: float) -> float:
    """A value between two, of which one or both may be infinite."""
    if math.isinf(low) and math.isinf(high):
        return 0.0
    if math.isinf(low):
        return high - 1.0
    return low + 1.0 if math.isinf(high) else (low + high) / 2
