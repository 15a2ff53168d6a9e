"""How typical labels are of a program: the density with which it generates what they observe.

The density of a label is the product over groups of jointly dependent features (given the label's values of other
features, as in algorithm 1 of the query paper). In a group, variables in which its features are affine are solved for;
the others are drawn, alike for all labels, and the density of the solved ones is averaged over the draws:

    p(features) = E over the others of p(solved variables) / |det of the features by them| * 1[requirements hold]

Where a choice decides which variables there are, as in a mixture of distributions, the density is the sum over its
outcomes, each by its probability and solved for variables of its own.

What is left out is a constant of a program and map: the probability that its requirements hold.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from scenicq.errors import CannotEvaluate
from scenicq.evaluate.expression_arrays import evaluate_arrays
from scenicq.evaluate.observed_columns import ANGLES, ObservedColumns, ObservedValues
from scenicq.evaluate.variables import Draws, density_of, point_density
from scenicq.forest.columns import Array, Data, Vectors, constant_column
from scenicq.forest.condition import condition
from scenicq.forest.degree import NOT_AFFINE, degree
from scenicq.forest.groups import Comparison, Condition, Group
from scenicq.forest.nodes import (
    Arithmetic,
    ArithmeticOp,
    Constant,
    DiscAt,
    Identity,
    Index,
    Leaf,
    Node,
    Normal,
    PointIn,
    Range,
    RectangleAt,
    Rotate,
    SectorAt,
    Select,
    TruncatedNormal,
    Value,
)
from scenicq.forest.walk import children, leaves, postorder, rebuild

__all__ = ["GroupDensity", "GroupValues"]

Reals = NDArray[np.float64]
_CHUNK = 200
_TINY = 1e-12
"""Determinants up to this are those of features that hang together."""
_OUTCOMES = 256
"""Outcomes of choices that are counted one by one, at most."""
_Draw = Callable[[Leaf, tuple[Data, ...]], Data]


class GroupValues(NamedTuple):
    """The densities of labels in a group.

    Attributes:
        log, error: Logarithms of the densities of the features and their standard errors, shape (labels,); -inf outside
            of the support.
        solved: Values of the solved variables, in the mean over the draws, shape (labels, variables); of the features
            themselves where outcomes of a choice are solved for different variables.
        log_size: Logarithm of the density of those values over that of the features, shape (labels,).
    """

    log: Reals
    error: Reals
    solved: Reals
    log_size: Reals


@dataclass(eq=False)
class GroupDensity:
    """One group, ready for labels.

    Attributes:
        group: The group, over the scenario as it is written.
        draws: The draws of hidden variables.
        fixed: Features without any random variable.
        reason: What could not be computed last.
    """

    group: Group
    draws: Draws
    fixed: tuple[Comparison, ...] = ()
    reason: str = ""
    _continuous: tuple[Comparison, ...] = ()
    _finite: tuple[Comparison, ...] = ()
    _conditions: tuple[Condition, ...] = ()
    _pivots: tuple[Leaf, ...] = ()
    _roots: dict[int, Node] = field(default_factory=dict[int, Node])

    def __post_init__(self) -> None:
        """Sort the group's constraints by what their expressions depend on."""
        compared = [each for each in self.group.constraints if isinstance(each, Comparison)]
        self._roots = {
            id(each): _turned(each.expression) if each.property in ANGLES else each.expression for each in compared
        }
        self.fixed = tuple(each for each in compared if not leaves(each.expression))
        self._continuous = tuple(each for each in compared if any(map(_is_continuous, leaves(each.expression))))
        known = {id(each) for each in (*self.fixed, *self._continuous)}
        self._finite = tuple(each for each in compared if id(each) not in known)
        conditions = [each for each in self.group.constraints if isinstance(each, Condition)]
        self._conditions = tuple(each for each in conditions if leaves(each.expression))

    @property
    def trivial(self) -> bool:
        """Whether the group has no features to compare: its density is 1."""
        return not self._continuous and not self._finite

    def finite_values(self, label: ObservedValues) -> Iterator[Value]:
        """The label's values of the features that depend on finite choices alone."""
        return (label[each.object, each.property] for each in self._finite)

    def values(self, labels: Sequence[ObservedValues]) -> GroupValues:
        """Work out the densities of some labels, at least one.

        Raises:
            CannotEvaluate: There is no density, or it cannot be computed.
        """
        outcomes = self._outcomes()
        if outcomes is not None:
            return self._of_outcomes(labels, outcomes)
        parts = [self._of_some(labels[start : start + _CHUNK]) for start in range(0, len(labels), _CHUNK)]
        return GroupValues(*map(np.concatenate, zip(*parts, strict=True)))

    def _outcomes(self) -> Sequence[tuple[float, GroupDensity]] | None:
        """Split the group by the choices that decide which variables there are: each outcome with its probability.

        Raises:
            CannotEvaluate: There are too many, or under one of them a feature has no density.
        """
        expressions = [each.expression for each in self.group.constraints]
        choices: dict[Identity, Index] = {}
        for node in postorder(expressions):
            if not isinstance(node, Select) or not isinstance(node.index, Index):
                continue
            if any(map(_is_continuous, leaves(*node.options))):
                choices[node.index.identity] = node.index
        if not choices:
            return None
        if math.prod(len(each.weights) for each in choices.values()) > _OUTCOMES:
            raise CannotEvaluate(f"choices with more than {_OUTCOMES} outcomes have variables of their own")
        found: list[tuple[float, GroupDensity]] = []
        for chosen in itertools.product(*(range(len(each.weights)) for each in choices.values())):
            weight = math.prod(
                each.weights[number] / sum(each.weights) for each, number in zip(choices.values(), chosen, strict=True)
            )
            given = dict(zip(choices, map(float, chosen), strict=True))
            found.append((weight, self._given(given)))
        return found

    def _given(self, given: Mapping[Identity, Value]) -> GroupDensity:
        """The group under one outcome of these choices; features of finite choices are still compared."""
        memo: dict[int, Node] = {}
        put = {
            id(each): replace(each, expression=condition(each.expression, {}, given, memo))
            for each in self.group.constraints
        }
        found = GroupDensity(replace(self.group, constraints=tuple(put.values())), self.draws)
        for each in self._continuous:
            if not any(map(_is_continuous, leaves(put[id(each)].expression))):
                raise CannotEvaluate(f"`{each.property}` has a single value under an outcome of a choice")
        found._finite = tuple(cast(Comparison, put[id(each)]) for each in self._finite)
        conditions = [put[id(each)] for each in self._conditions]
        found._conditions = tuple(cast(Condition, each) for each in conditions)
        return found

    def _of_outcomes(
        self, labels: Sequence[ObservedValues], outcomes: Sequence[tuple[float, GroupDensity]]
    ) -> GroupValues:
        total, square = np.zeros(len(labels)), np.zeros(len(labels))
        for weight, each in outcomes:
            values = each.values(labels)
            mine = weight * np.exp(values.log)
            total += mine
            square += np.square(mine * values.error)
        columns = ObservedColumns(labels)
        features = [target for target, _ in columns.targets(self._continuous)]
        with np.errstate(divide="ignore", invalid="ignore"):
            errors = np.where(total > 0, np.sqrt(square) / total, 0.0)
            return GroupValues(np.log(total), errors, np.column_stack(features), np.zeros(len(labels)))

    def _of_some(self, labels: Sequence[ObservedValues]) -> GroupValues:
        columns = ObservedColumns(labels)
        if not self._pivots and self._continuous:
            self._pivots = self._choose(columns)
        dimension = sum(2 if isinstance(leaf, PointIn) else 1 for leaf in self._pivots)
        total, size_sum, sums = np.zeros((1, 1)), np.zeros(len(labels)), np.zeros((len(labels), dimension))
        for turns in itertools.product((-math.tau, 0.0, math.tau), repeat=self._angles()):
            weight, values, size = self._weights(columns, dimension, turns)
            total = total + weight
            size_sum += _row_means(np.where(weight > 0, weight * size, 0.0), len(labels))
            for place, value in enumerate(values):
                sums[:, place] += _row_means(np.where(weight > 0, weight * value, 0.0), len(labels))
        total = np.broadcast_to(total, (len(labels), total.shape[1]))
        means = total.mean(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            errors = total.std(axis=1) / math.sqrt(total.shape[1]) / means
            log = np.log(means)
            return GroupValues(log, np.where(means > 0, errors, 0.0), sums / means[:, None], np.log(size_sum) - log)

    def _angles(self) -> int:
        return sum(each.property in ANGLES for each in self._continuous)

    def _weights(
        self, columns: ObservedColumns, dimension: int, turns: tuple[float, ...]
    ) -> tuple[Array, Sequence[Array], Array]:
        """The terms of the mean, with headings off by whole turns; the solved variables; their determinant.

        Shapes are broadcastable to (labels, draws).
        """
        solved: dict[Identity, Data] = {}
        values: Sequence[Array] = ()
        density, size = np.ones((1, 1)), np.ones((1, 1))
        if self._continuous:
            base, matrix = self._affine(columns, dimension)
            off = columns.targets(self._continuous)
            angle = iter(turns)
            rows: list[Array] = []
            for number, (target, is_angle) in enumerate(off):
                rest = target - base[number]
                if is_angle:
                    rest = np.mod(rest + math.pi, math.tau) - math.pi + next(angle)
                rows.append(rest)
            values, size = _solve(matrix, rows)
            if np.any(size == 0):
                names = ", ".join(f"`{each.property}`" for each in self._continuous)
                raise CannotEvaluate(f"{names} of a group are not spread over an area under some hidden values")
            solved = self._assign(values)
            with np.errstate(all="ignore"):
                density = np.where(size > 0, 1 / size, 0.0)
        return density * self._chances(columns, solved), values, size

    def _assign(self, values: Sequence[Array]) -> dict[Identity, Data]:
        found: dict[Identity, Data] = {}
        left = iter(values)
        for leaf in self._pivots:
            found[leaf.identity] = (next(left), next(left)) if isinstance(leaf, PointIn) else next(left)
        return found

    def _chances(self, columns: ObservedColumns, solved: Mapping[Identity, Data]) -> Array:
        """The density of the solved variables at their values; 0 where a requirement fails."""
        density: list[Array] = [np.ones((1, 1))]
        whole = {leaf.identity: self._whole(leaf) for leaf in self._pivots}

        def draw(leaf: Leaf, args: tuple[Data, ...]) -> Data:
            if leaf.identity not in solved:
                return self.draws.draw(leaf, args)
            value = solved[leaf.identity]
            choices = whole[leaf.identity]
            if choices is not None:
                density.append(_mixture(choices, cast(Vectors, value)))
            elif isinstance(leaf, PointIn):
                density.append(point_density(args[0], cast(Vectors, value)))
            else:
                density.append(density_of(leaf, args, cast(Array, value)))
            return value

        # all variables are met, also those that only distributions of others depend on
        plain = (*(self._roots[id(each)] for each in self._finite), *(each.expression for each in self._conditions))
        pivots: tuple[Node, ...] = tuple(leaf for leaf in self._pivots if whole[leaf.identity] is None)
        mixed = [leaf for leaf in self._pivots if whole[leaf.identity] is not None]
        for leaf in mixed:
            draw(leaf, ())
        roots = _without_regions(plain, {leaf.identity: solved[leaf.identity] for leaf in mixed})
        found = evaluate_arrays((*roots, *pivots), _once(draw, mixed, solved), columns.values, self.draws.count)
        weight = density[0]
        for each in density[1:]:
            weight = weight * each
        for each, value in zip(self._finite, found, strict=False):
            weight = weight * columns.holds(each, value)
        for value in found[len(self._finite) : len(roots)]:
            weight = weight * cast(Array, value).astype(bool)
        return weight

    def _whole(self, leaf: Leaf) -> tuple[tuple[float, Node], ...] | None:
        """The regions that a point is drawn from, with their probabilities, if nothing else depends on the choice."""
        if not isinstance(leaf, PointIn) or not isinstance(leaf.region, Select):
            return None
        choice, index = leaf.region, leaf.region.index
        if not isinstance(index, Index) or not all(isinstance(each, Constant) for each in choice.options):
            return None
        every = [self._roots.get(id(each), each.expression) for each in self.group.constraints]
        parents = [node for node in postorder(every) if any(child is index for child in children(node))]
        if parents != [choice] or [n for n in postorder(every) if choice in children(n)] != [leaf]:
            raise CannotEvaluate("a region on which other features depend, too")
        total = sum(index.weights)
        return tuple((weight / total, option) for weight, option in zip(index.weights, choice.options, strict=True))

    def _affine(self, columns: ObservedColumns, dimension: int) -> tuple[list[Array], list[list[Array]]]:
        """The features as affine functions: their values where all solved variables are 0, and the change with each."""
        base = self._at(columns, [np.zeros((1, 1))] * dimension)
        matrix: list[list[Array]] = []
        for place in range(dimension):
            unit = [np.full((1, 1), float(place == other)) for other in range(dimension)]
            moved = self._at(columns, unit)
            matrix.append([high - low for high, low in zip(moved, base, strict=True)])
        return base, matrix

    def _at(
        self, columns: ObservedColumns, values: Sequence[Array], pivots: Sequence[Leaf] | None = None
    ) -> list[Array]:
        """The coordinates of the features at some values of the solved variables."""
        known = self._assign(values) if pivots is None else _assigned(pivots, values)

        def draw(leaf: Leaf, args: tuple[Data, ...]) -> Data:
            return known[leaf.identity] if leaf.identity in known else self.draws.draw(leaf, args)

        roots = tuple(self._roots[id(each)] for each in self._continuous)
        return _coordinates(evaluate_arrays(_without_regions(roots, known), draw, columns.values, self.draws.count))

    def _choose(self, columns: ObservedColumns) -> tuple[Leaf, ...]:
        """Choose variables to solve for, one for each coordinate of the features, which are affine in them."""
        sizes = [2 if columns.is_pair(each) else 1 for each in self._continuous]
        wanted = sum(sizes)
        candidates = [leaf for leaf in leaves(*self._roots_of_continuous()) if _is_continuous(leaf)]
        for count in range(1, min(len(candidates), wanted) + 1):
            for chosen in itertools.islice(itertools.combinations(candidates, count), 400):
                if sum(2 if isinstance(leaf, PointIn) else 1 for leaf in chosen) == wanted:
                    try:
                        if self._is_affine(columns.first(8), chosen, wanted):
                            return chosen
                    except CannotEvaluate as error:
                        self.reason = str(error)
        names = ", ".join(f"`{each.property}`" for each in self._continuous)
        more = f" ({self.reason})" if self.reason else ""
        raise CannotEvaluate(f"{names} of a group cannot be solved for its variables{more}")

    def _roots_of_continuous(self) -> tuple[Node, ...]:
        return tuple(self._roots[id(each)] for each in self._continuous)

    def _is_affine(self, columns: ObservedColumns, chosen: Sequence[Leaf], wanted: int) -> bool:
        """Whether the features are affine in some variables and determine them."""
        if degree(self._roots_of_continuous(), {leaf.identity for leaf in chosen}, _of_draw) > 1:
            return False
        base = self._at(columns, [np.zeros((1, 1))] * wanted, chosen)
        columns_: list[list[Array]] = []
        for place in range(wanted):
            unit = [np.full((1, 1), float(place == number)) for number in range(wanted)]
            columns_.append([x - y for x, y in zip(self._at(columns, unit, chosen), base, strict=True)])
        _, size = _solve(columns_, [np.zeros((1, 1))] * wanted)
        return bool(np.any(size > _TINY))


def _of_draw(node: Node, own: Sequence[int]) -> int:
    """The degree of a draw: other parameters move and stretch it, or its region."""
    match node:
        case Range() | Normal():
            return max(own)
        case PointIn() if isinstance(node.region, DiscAt | SectorAt | RectangleAt):
            return max(own)
        case Rotate() | DiscAt() | SectorAt() | RectangleAt():
            return own[0] if not any(own[1:]) else NOT_AFFINE
        case _:
            return NOT_AFFINE


def _row_means(values: Array, rows: int) -> Reals:
    return np.broadcast_to(values, (rows, values.shape[1])).mean(axis=1)


def _is_continuous(leaf: Leaf) -> bool:
    return isinstance(leaf, Range | Normal | TruncatedNormal | PointIn)


def _assigned(pivots: Sequence[Leaf], values: Sequence[Array]) -> dict[Identity, Data]:
    left = iter(values)
    return {leaf.identity: (next(left), next(left)) if isinstance(leaf, PointIn) else next(left) for leaf in pivots}


def _turned(node: Node) -> Node:
    """Leave out the wrapping of a heading into one turn, as headings are compared modulo a turn."""
    if isinstance(node, Arithmetic):
        if node.op is ArithmeticOp.WRAP:
            return _turned(node.args[0])
        if node.op in (ArithmeticOp.ADD, ArithmeticOp.SUB, ArithmeticOp.NEG):
            return rebuild(node, tuple(map(_turned, node.args)))
    return node


def _without_regions(roots: tuple[Node, ...], known: Mapping[Identity, Data]) -> tuple[Node, ...]:
    """Cut the regions off points whose value is known, so that the regions need not be computed."""
    memo: dict[int, Node] = {}
    for node in postorder(roots):
        if isinstance(node, PointIn) and node.identity in known:
            memo[id(node)] = PointIn(Constant(None), identity=node.identity, span=node.span)
        else:
            parts = tuple(memo[id(child)] for child in children(node))
            memo[id(node)] = rebuild(node, parts)
    return tuple(memo[id(root)] for root in roots)


def _once(draw: _Draw, mixed: Sequence[Leaf], solved: Mapping[Identity, Data]) -> _Draw:
    """Draw as `draw` does, but give points of `mixed` their solved values: their density is counted already."""
    done = {leaf.identity for leaf in mixed}

    def drawn(leaf: Leaf, args: tuple[Data, ...]) -> Data:
        return solved[leaf.identity] if leaf.identity in done else draw(leaf, args)

    return drawn


def _mixture(choices: Sequence[tuple[float, Node]], point: Vectors) -> Array:
    total: Array = np.zeros((1, 1))
    for weight, option in choices:
        total = total + weight * point_density(constant_column(cast(Constant, option).value).data, point)
    return total


def _coordinates(values: Sequence[Data]) -> list[Array]:
    found: list[Array] = []
    for value in values:
        if isinstance(value, tuple):
            found += value
        elif isinstance(value, np.ndarray):
            found.append(value)
        else:
            raise CannotEvaluate("a feature that is no number")
    return found


def _solve(matrix: Sequence[Sequence[Array]], rest: Sequence[Array]) -> tuple[list[Array], Array]:
    """Solve linear equations, element by element: the solutions, and the absolute determinants.

    Args:
        matrix: For each variable the coefficient in each equation.
        rest: The right-hand sides.
    """
    count = len(rest)
    shape = np.broadcast_shapes(*(each.shape for column in matrix for each in column), *(each.shape for each in rest))
    if count == 1:
        only = matrix[0][0]
        with np.errstate(all="ignore"):
            return [np.where(np.abs(only) > 0, rest[0] / only, np.nan)], np.abs(only)
    full = np.empty((*shape, count, count))
    right = np.empty((*shape, count, 1))
    for number in range(count):
        right[..., number, 0] = rest[number]
        for place in range(count):
            full[..., number, place] = matrix[place][number]
    sound = np.isfinite(full).all(axis=(-1, -2))
    full[~sound] = 0.0
    size = np.abs(np.linalg.det(full))
    full[size <= _TINY] = np.eye(count)
    found = np.linalg.solve(full, np.nan_to_num(right))[..., 0]
    # what is undefined has no determinant, what hangs together one of nothing
    sizes = np.where(sound, np.where(size > _TINY, size, 0.0), np.nan)
    return [found[..., number] for number in range(count)], sizes
