"""Atoms over the samples of a binding: the value of a boolean expression at each sample, all at once.

The one interface is `AtomColumns.truth`. What NumPy can do is done for all samples together; any other node is computed
sample by sample by its own meaning (`forest.compute`). A sample at which something that is read is not observed makes
what hangs on it unknown, and nothing else. Where a field allows several directions, any of them will do.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias, cast

import numpy as np
from numpy.typing import NDArray

from scenicq.forest.compute import CannotEvaluate, compute
from scenicq.forest.condition import expand
from scenicq.forest.nodes import (
    Arithmetic,
    ArithmeticOp,
    Bearing,
    Compare,
    CompareOp,
    Constant,
    Contains,
    Coordinate,
    DirectionAt,
    Feature,
    Identity,
    Leaf,
    Logic,
    LogicOp,
    Node,
    Norm,
    Rotate,
    Scale,
    Undefined,
    Value,
    VectorOf,
    VectorSum,
)
from scenicq.forest.scenario import Scenario
from scenicq.forest.walk import children, is_leaf, postorder
from scenicq.geometry.angles import heading_of_array, normalize_array
from scenicq.geometry.membership import contains_many
from scenicq.geometry.regions import Region
from scenicq.geometry.road_direction import RoadDirection
from scenicq.temporal.samples import FIXED, MOVING, Observed
from scenicq.temporal.truth import FALSE, TRUE, UNKNOWN, Truth

__all__ = ["AtomColumns", "HiddenVariable", "reads_start"]

_DEFINED, _UNDEFINED, _UNKNOWN = np.int8(0), np.int8(1), np.int8(2)
_MOST_CHOICES = 64
"""Combinations of directions that are tried where a field allows several."""

Numbers: TypeAlias = NDArray[np.float64]
_Data: TypeAlias = "Numbers | NDArray[np.bool_] | tuple[Numbers, Numbers] | list[Value]"


def reads_start(condition: Node) -> bool:
    """Whether an expanded condition over time hangs on what was observed at the first sample."""
    nodes = postorder((condition,))
    return any(isinstance(node, Feature) and not node.current and node.property not in FIXED for node in nodes)


class HiddenVariable(Exception):
    """An atom hangs on a random variable that has no value here."""

    def __init__(self, leaf: Leaf) -> None:
        """Take the variable."""
        super().__init__()
        self.leaf = leaf


@dataclass(slots=True)
class _Column:
    """The values of a node: one at each sample.

    Attributes:
        data: Numbers, truth values, the two coordinates of vectors, or other values; of no meaning where not defined.
        status: Whether it is defined, undefined or unknown, shape (n,).
    """

    data: _Data
    status: NDArray[np.int8]

    def at(self, sample: int) -> Value:
        """The value at a sample at which it is defined."""
        data = self.data
        if isinstance(data, tuple):
            return float(data[0][sample]), float(data[1][sample])
        if isinstance(data, list):
            return data[sample]
        return bool(data[sample]) if data.dtype == np.bool_ else float(data[sample])


@dataclass(eq=False)
class AtomColumns:
    """The conditions of a scenario over the samples of a binding.

    Attributes:
        scenario: The scenario.
        samples: The samples.
        assignment: Values of random variables.
        start: For each sample the first one of its run, at which what is not current is read; None where each is one.
    """

    scenario: Scenario
    samples: Observed
    assignment: Mapping[Identity, Value] = field(default_factory=dict["Identity", "Value"])
    start: NDArray[np.int64] | None = None
    _features: dict[tuple[int, str], _Column | None] = field(default_factory=dict["tuple[int, str]", "_Column | None"])

    def assigned(self, assignment: Mapping[Identity, Value]) -> AtomColumns:
        """The same with values of random variables; what is observed is shared."""
        return AtomColumns(self.scenario, self.samples, assignment, self.start, self._features)

    def expanded(self, condition: Node) -> Node:
        """A condition with the program's own value of what no label observes and what does not change."""
        return expand(condition, self._definition)

    def unknown(self) -> Truth:
        """Unknown at each sample, shape (n,)."""
        return np.full(len(self.samples), UNKNOWN)

    def truth(self, condition: Node) -> Truth:
        """The value of a condition at each sample, shape (n,).

        Raises:
            HiddenVariable: It hangs on a random variable without a value.
        """
        return self.truth_of(self.expanded(condition))

    def truth_of(self, condition: Node) -> Truth:
        """As `truth`, of an expanded condition."""
        fields = [node for node in postorder((condition,)) if isinstance(node, DirectionAt)]
        chosen = dict.fromkeys(map(id, fields), 0)
        values: dict[int, _Column] = {}
        found = self._truth(condition, chosen, values)
        if not fields:
            return found
        counts = [self._most_directions(node, values) for node in fields]
        for picks in itertools.islice(itertools.product(*map(range, counts)), 1, _MOST_CHOICES):
            chosen = dict(zip(map(id, fields), picks, strict=True))
            found = np.maximum(found, self._truth(condition, chosen, {}))
        return found

    def number(self, node: Node) -> Numbers | None:
        """The values of an expanded scalar expression, nan where it has none; None if it is no number."""
        found = self.scalar(node)
        return None if found is None else found[0]

    def scalar(self, node: Node) -> tuple[Numbers, NDArray[np.bool_]] | None:
        """As `number`, with where the value is not known."""
        chosen = {id(each): 0 for each in postorder((node,)) if isinstance(each, DirectionAt)}
        column = self._evaluate(node, chosen, {})
        if not isinstance(column.data, np.ndarray) or column.data.dtype == np.bool_:
            return None
        return np.where(column.status == _DEFINED, column.data, np.nan), column.status == _UNKNOWN

    def _definition(self, feature: Feature) -> Node | None:
        if feature.property in MOVING or self._feature(feature) is not None:
            return None
        return self.scenario.objects[feature.object].properties[feature.property].value

    def _truth(self, condition: Node, chosen: Mapping[int, int], values: dict[int, _Column]) -> Truth:
        column = self._evaluate(condition, chosen, values)
        if isinstance(column.data, np.ndarray):
            held = column.data != 0
        else:
            # the truth of other values is Python's
            held = np.array([bool(column.at(sample)) for sample in range(len(self.samples))], dtype=np.bool_)
        found = np.where(held, TRUE, FALSE)
        return np.where(column.status == _DEFINED, found, np.where(column.status == _UNDEFINED, FALSE, UNKNOWN))

    def _evaluate(self, root: Node, chosen: Mapping[int, int], values: dict[int, _Column]) -> _Column:
        with np.errstate(all="ignore"):
            for node in postorder((root,)):
                values[id(node)] = self._value(node, [values[id(child)] for child in children(node)], chosen)
        return values[id(root)]

    def _value(self, node: Node, args: Sequence[_Column], chosen: Mapping[int, int]) -> _Column:
        if is_leaf(node):
            leaf = cast(Leaf, node)
            if leaf.identity not in self.assignment:
                raise HiddenVariable(leaf)
            return self._constant(self.assignment[leaf.identity])
        match node:
            case Constant():
                return self._constant(node.value)
            case Feature():
                found = self._feature(node)
                n = len(self.samples)
                if found is None:
                    return _Column(np.full(n, np.nan), np.full(n, _UNKNOWN))
                return found if node.current or self.start is None else self._as_at(self.start, found)
            case DirectionAt():
                return self._direction(node, args, chosen[id(node)])
            case Logic():
                return _logic(node.op, args)
            case _:
                made = _vectorised(node, [arg.data for arg in args])
                status = np.maximum.reduce([arg.status for arg in args])
                if made is None:
                    return self._one_by_one(node, args, status)
                if isinstance(node, Arithmetic):
                    status = np.maximum(status, np.where(np.isfinite(cast(Numbers, made)), _DEFINED, _UNDEFINED))
                return _Column(made, status)

    def _constant(self, value: Value) -> _Column:
        n = len(self.samples)
        status = np.full(n, _UNDEFINED if isinstance(value, Undefined) else _DEFINED)
        if isinstance(value, bool):
            return _Column(np.full(n, value), status)
        if isinstance(value, float):
            return _Column(np.full(n, value), status)
        if isinstance(value, tuple):
            return _Column((np.full(n, value[0]), np.full(n, value[1])), status)
        values: list[Value] = [value] * n
        return _Column(values, status)

    def _as_at(self, start: NDArray[np.int64], column: _Column) -> _Column:
        """The values at some samples."""
        data = column.data
        if isinstance(data, tuple):
            return _Column((data[0][start], data[1][start]), column.status[start])
        if isinstance(data, list):
            return _Column([data[sample] for sample in start.tolist()], column.status[start])
        return _Column(data[start], column.status[start])

    def _feature(self, node: Feature) -> _Column | None:
        """What is observed of a feature; None if no sample has it."""
        key = node.object, node.property
        if key not in self._features:
            seen = self.samples.observed(*key)
            if seen is None:
                self._features[key] = None
            elif isinstance(seen, list):
                status = np.array([_UNKNOWN if value is None else _DEFINED for value in seen], dtype=np.int8)
                self._features[key] = _Column(seen, status)
            else:
                status = np.where(np.isnan(seen[0]), _UNKNOWN, _DEFINED)
                self._features[key] = _Column((seen[0], seen[1]) if len(seen) == 2 else seen[0], status)
        return self._features[key]

    def _direction(self, node: DirectionAt, args: Sequence[_Column], pick: int) -> _Column:
        headings = np.full(len(self.samples), np.nan)
        status = np.maximum(args[0].status, args[1].status)
        for sample, allowed in zip(
            np.flatnonzero(status == _DEFINED).tolist(), self._allowed(args, status), strict=True
        ):
            if allowed:
                headings[sample] = allowed[min(pick, len(allowed) - 1)]
            else:
                status[sample] = _UNDEFINED
        return _Column(headings, status)

    def _allowed(self, args: Sequence[_Column], status: NDArray[np.int8]) -> list[tuple[float, ...]]:
        """The directions at each sample at which field and point are defined."""
        samples = np.flatnonzero(status == _DEFINED)
        fields, points = args
        x, y = cast("tuple[Numbers, Numbers]", points.data)
        first = fields.at(int(samples[0])) if len(samples) else None
        if isinstance(first, RoadDirection) and all(fields.at(int(sample)) is first for sample in samples):
            return [*first.values_many(np.column_stack((x[samples], y[samples])))]
        return [tuple(cast(RoadDirection, fields.at(k)).values(float(x[k]), float(y[k]))) for k in samples.tolist()]

    def _most_directions(self, node: DirectionAt, values: Mapping[int, _Column]) -> int:
        args = [values[id(child)] for child in children(node)]
        status = np.maximum(args[0].status, args[1].status)
        return max(map(len, self._allowed(args, status)), default=1) or 1

    def _one_by_one(self, node: Node, args: Sequence[_Column], status: NDArray[np.int8]) -> _Column:
        """A node computed sample by sample; its arguments' status matters only as far as its meaning says."""
        status = status.copy()
        values: list[Value] = [None] * len(status)
        reason = Undefined("")
        for sample in range(len(status)):
            if any(arg.status[sample] == _UNKNOWN for arg in args):
                continue
            given = tuple(arg.at(sample) if arg.status[sample] == _DEFINED else reason for arg in args)
            try:
                values[sample] = compute(node, given)
            except CannotEvaluate:
                status[sample] = _UNKNOWN
                continue
            status[sample] = _UNDEFINED if isinstance(values[sample], Undefined) else _DEFINED
        return _packed(values, status)


def _packed(values: list[Value], status: NDArray[np.int8]) -> _Column:
    """Values as arrays, if they are all numbers, truth values or vectors."""
    there = [values[sample] for sample in np.flatnonzero(status == _DEFINED).tolist()]
    if there and all(isinstance(value, bool) for value in there):
        return _Column(np.array([value is True for value in values]), status)
    if there and all(isinstance(value, float) for value in there):
        return _Column(np.array([value if isinstance(value, float) else np.nan for value in values]), status)
    if there and all(isinstance(value, tuple) for value in there):
        pairs = [value if isinstance(value, tuple) else (np.nan, np.nan) for value in values]
        return _Column((np.array([x for x, _ in pairs]), np.array([y for _, y in pairs])), status)
    return _Column(values, status)


def _logic(op: LogicOp, args: Sequence[_Column]) -> _Column:
    held = [_held(arg) for arg in args]
    if op is LogicOp.NOT:
        return _Column(~held[0], args[0].status)
    decisive = op is LogicOp.OR
    decided = np.zeros_like(held[0])
    for one, arg in zip(held, args, strict=True):
        decided |= (one == decisive) & (arg.status == _DEFINED)
    status = np.maximum.reduce([arg.status for arg in args])
    return _Column(np.where(decided, decisive, not decisive), np.where(decided, _DEFINED, status))


def _held(column: _Column) -> NDArray[np.bool_]:
    if isinstance(column.data, np.ndarray):
        return column.data != 0
    return np.array([bool(column.at(sample)) for sample in range(len(column.status))], dtype=np.bool_)


_ORDER = {
    CompareOp.LT: np.less, CompareOp.LE: np.less_equal, CompareOp.GT: np.greater, CompareOp.GE: np.greater_equal,
    CompareOp.EQ: np.equal, CompareOp.NE: np.not_equal,
}  # fmt: skip
_UNARY = {
    ArithmeticOp.NEG: np.negative, ArithmeticOp.ABS: np.abs, ArithmeticOp.SQRT: np.sqrt, ArithmeticOp.SIN: np.sin,
    ArithmeticOp.COS: np.cos, ArithmeticOp.FLOOR: np.floor, ArithmeticOp.CEIL: np.ceil,
}  # fmt: skip
_FOLDED = {
    ArithmeticOp.ADD: np.add, ArithmeticOp.MUL: np.multiply, ArithmeticOp.SUB: np.subtract,
    ArithmeticOp.DIV: np.divide, ArithmeticOp.MIN: np.minimum, ArithmeticOp.MAX: np.maximum,
}  # fmt: skip


def _vectorised(node: Node, args: Sequence[_Data]) -> _Data | None:
    """A node of all samples at once; None if it is computed one by one."""
    numbers = [arg for arg in args if isinstance(arg, np.ndarray)]
    match node:
        case Arithmetic() if len(numbers) == len(args):
            return _arithmetic(node.op, [number.astype(np.float64, copy=False) for number in numbers])
        case Compare() if len(numbers) == 2:
            return _ORDER[node.op](numbers[0], numbers[1])
        case VectorOf() if len(numbers) == 2:
            return cast(Numbers, numbers[0]), cast(Numbers, numbers[1])
        case Coordinate() if isinstance(args[0], tuple):
            return args[0][node.axis]
        case Norm() if isinstance(args[0], tuple):
            return np.hypot(*args[0])
        case Bearing() if isinstance(args[0], tuple):
            return heading_of_array(*args[0])
        case VectorSum() if isinstance(args[0], tuple) and isinstance(args[1], tuple):
            return args[0][0] + args[1][0], args[0][1] + args[1][1]
        case Scale() if isinstance(args[0], tuple) and isinstance(args[1], np.ndarray):
            return args[0][0] * args[1], args[0][1] * args[1]
        case Rotate() if isinstance(args[0], tuple) and isinstance(args[1], np.ndarray):
            (x, y), cosine, sine = args[0], np.cos(args[1]), np.sin(args[1])
            return x * cosine - y * sine, x * sine + y * cosine
        case Contains() if isinstance(node.region, Constant) and isinstance(args[1], tuple):
            return _contained(cast(Region, node.region.value), *args[1])
        case _:
            return None


def _arithmetic(op: ArithmeticOp, args: Sequence[Numbers]) -> Numbers | None:
    if op in _UNARY:
        return _UNARY[op](args[0])
    if op is ArithmeticOp.WRAP:
        return normalize_array(args[0])
    if op not in _FOLDED:
        return None
    found = args[0]
    for arg in args[1:]:
        found = _FOLDED[op](found, arg)
    return found


def _contained(region: Region, x: Numbers, y: Numbers) -> NDArray[np.bool_]:
    found = np.zeros(len(x), dtype=np.bool_)
    there = ~np.isnan(x)
    if there.any():
        found[there] = contains_many(region, np.column_stack((x[there], y[there])))
    return found
