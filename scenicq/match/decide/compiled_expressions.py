"""Expressions made into functions of what a label observes: exact ones, and sums of a known part and random ranges."""

from __future__ import annotations

import functools
import math
import operator
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias, cast

import numpy as np
from numpy.typing import NDArray

from scenicq.forest.compute import compute
from scenicq.forest.groups import PARAMS
from scenicq.forest.kinds import as_kind
from scenicq.forest.nodes import (
    Arithmetic,
    ArithmeticOp,
    Bearing,
    Constant,
    Coordinate,
    DirectionAt,
    Feature,
    Identity,
    Index,
    Node,
    Norm,
    Normal,
    Range,
    Rotate,
    Scale,
    Select,
    TruncatedNormal,
    Undefined,
    Value,
    VectorOf,
    VectorSum,
)
from scenicq.forest.walk import children, is_leaf, postorder
from scenicq.match.linear.affine_reach import ends

__all__ = [
    "VECTORS",
    "Columns",
    "CompiledExpressions",
    "Exact",
    "FloatColumn",
    "Form",
    "Get",
    "UnclearError",
    "clipped",
    "spread",
    "truth",
    "turned",
]

Get: TypeAlias = Callable[[int, str], Value]
"""The observed value of an object's property."""
FloatColumn: TypeAlias = NDArray[np.float64]
"""A number of each of many labels; a vector is a pair of columns."""
Exact: TypeAlias = Callable[[Get], "float | tuple[float, float]"]
Scalar: TypeAlias = Callable[[Get], float]
CompiledVector: TypeAlias = Callable[[Get], "tuple[float, float]"]

_MOST_STEPS = 400
"""Operations that a formula may take: what is shared in an expression is worked out anew for each use of it."""

_NUMBERS = frozenset({"heading", "width", "length", "height", "speed"})
VECTORS = frozenset({"position", "velocity"})
"""Properties that are numbers and pairs wherever they are observed."""


class UnclearError(Exception):
    """A closed form does not say."""


class Columns:
    """The observed values of many labels at once, in place of a `Get`: formulas of it give columns.

    Every step is what it is for one label, bit by bit: NumPy adds, subtracts, multiplies and divides; the functions
    that it computes in a way of its own are applied one by one.
    """

    def __init__(self, size: int, column: Callable[[int, str], FloatColumn | tuple[FloatColumn, FloatColumn]]) -> None:
        """Take what makes the columns.

        Args:
            size: Labels.
            column: The values of an object's property; `UnclearError` where they are neither numbers nor vectors.
        """
        self.size = size
        self._column = functools.cache(column)

    def __call__(self, index: int, name: str) -> Value:
        """The column, passed off as a value."""
        return cast(Value, self._column(index, name))


def turned(angle: float) -> tuple[float, float]:
    """Cosine and sine; of a column, columns."""
    if isinstance(angle, np.ndarray):
        angles: list[float] = angle.tolist()
        return cast("tuple[float, float]", (np.array([*map(math.cos, angles)]), np.array([*map(math.sin, angles)])))
    return math.cos(angle), math.sin(angle)


def clipped(value: float, low: float, high: float) -> float:
    """The value, or the end that it is beyond; of columns, a column."""
    if isinstance(value, np.ndarray):
        raised = np.where(np.greater(low, value), low, value)
        return cast(float, np.where(np.less(high, raised), high, raised))
    raised = low if low > value else value
    return high if high < raised else raised


@dataclass(frozen=True, slots=True, eq=False)
class Form:
    """A scalar: a known part, plus directions of fields, plus ranges times known factors.

    Attributes:
        parts: Functions with factors, and a constant; their sum is the known part.
        constant: See there.
        terms: For each random variable its factor and its ends; one of them may be unbounded.
        fields: Directions that are added.
    """

    parts: tuple[tuple[float, Scalar], ...] = ()
    constant: float = 0.0
    terms: Mapping[Identity, tuple[float, float, float]] = field(
        default_factory=dict["Identity", "tuple[float, float, float]"]
    )
    fields: tuple[DirectionAt, ...] = ()
    low: float = field(init=False)
    high: float = field(init=False)

    def __post_init__(self) -> None:
        """Add up the ranges."""
        products = [sorted((factor * low, factor * high)) for factor, low, high in self.terms.values()]
        object.__setattr__(self, "low", math.fsum(low for low, _ in products))
        object.__setattr__(self, "high", math.fsum(high for _, high in products))

    def known(self, get: Get) -> float:
        """The known part."""
        total = self.constant
        for factor, part in self.parts:
            total += factor * part(get)
        return total

    def plus(self, other: Form) -> Form | None:
        """The sum; None if a variable occurs in both, or both are unbounded."""
        if self.terms.keys() & other.terms.keys() or (self.unbounded and other.unbounded):
            return None
        if len(self.parts) + len(other.parts) > _MOST_STEPS:
            return None
        return Form(
            self.parts + other.parts,
            self.constant + other.constant,
            {**self.terms, **other.terms},
            self.fields + other.fields,
        )

    def times(self, factor: float) -> Form | None:
        """A multiple; None for a direction."""
        if factor == 1.0:
            return self
        if self.fields or factor == 0.0:
            return None
        terms = {identity: (factor * c, low, high) for identity, (c, low, high) in self.terms.items()}
        return Form(tuple((factor * c, part) for c, part in self.parts), factor * self.constant, terms)

    @property
    def unbounded(self) -> bool:
        """Whether one of its variables is."""
        return math.isinf(self.high - self.low)

    @property
    def number(self) -> float | None:
        """Its value, if it is a number."""
        return None if self.parts or self.terms or self.fields else self.constant


def spread(form: Form, value: float) -> dict[Identity, Value]:
    """Values of a form's variables for which its random part has a value between its ends; of a column, columns."""
    if len(form.terms) == 1:
        ((identity, (factor, low, high)),) = form.terms.items()
        return {identity: clipped(value / factor, low, high)}
    if form.unbounded:
        # the unbounded one takes what the middles of the others leave
        return _with_rest(form, value)
    share = 0.5 if form.high == form.low else clipped((value - form.low) / (form.high - form.low), 0.0, 1.0)
    return {
        identity: low + share * (high - low) if factor > 0 else high - share * (high - low)
        for identity, (factor, low, high) in form.terms.items()
    }


def _with_rest(form: Form, value: float) -> dict[Identity, Value]:
    middles = {
        identity: (low + high) / 2 for identity, (_, low, high) in form.terms.items() if math.isfinite(high - low)
    }
    rest = value - math.fsum(form.terms[identity][0] * middle for identity, middle in middles.items())
    return {
        identity: middles[identity] if identity in middles else rest / factor
        for identity, (factor, _, _) in form.terms.items()
    }


def truth(root: Node) -> Callable[[Get], bool] | None:
    """A condition on what is observed alone as a function of it, which raises `UnclearError` where it has no value.

    None if anything about it is random or it takes too many steps.
    """
    made: dict[int, Callable[[Get], Value]] = {}
    steps: dict[int, int] = {}
    for node in postorder((root,)):
        below = children(node)
        steps[id(node)] = 1 + sum([steps[id(child)] for child in below])
        if is_leaf(node) or isinstance(node, DirectionAt) or steps[id(node)] > _MOST_STEPS:
            return None
        if isinstance(node, Feature) and node.object == PARAMS:
            return None
        made[id(node)] = _computed(node, [made[id(child)] for child in below])
    whole = made[id(root)]
    return lambda get: bool(whole(get))


def _computed(node: Node, args: Sequence[Callable[[Get], Value]]) -> Callable[[Get], Value]:
    """A node's own meaning as a function of what is observed."""
    match node:
        case Constant():
            value = node.value
            return lambda _: value
        case Feature(object=index, property=name) if name in VECTORS | _NUMBERS:
            return lambda get: get(index, name)
        case Feature(object=index, property=name):

            def observed(get: Get) -> Value:
                found = as_kind(node, get(index, name))
                if isinstance(found, Undefined):
                    raise UnclearError
                return found

            return observed
        case _:

            def computed(get: Get) -> Value:
                if isinstance(get, Columns):
                    raise UnclearError
                found = compute(node, tuple([arg(get) for arg in args]))
                if isinstance(found, Undefined):
                    raise UnclearError
                return found

            return computed


class CompiledExpressions:
    """Formulas of expressions, given the options of discrete choices."""

    def __init__(self, chosen: Mapping[Identity, float]) -> None:
        """Take the number of the option of each choice."""
        self._chosen = chosen
        self._exact: dict[int, Exact | None] = {}
        self._steps: dict[int, int] = {}
        self._forms: dict[int, Form | None] = {}

    def exact(self, root: Node) -> Exact | None:
        """A scalar or vector as a function of what is observed; None if it is not one alone."""
        for node in postorder((root,)):
            if id(node) not in self._exact:
                below = children(node)
                steps = self._steps[id(node)] = 1 + sum([self._steps[id(child)] for child in below])
                args = [self._exact[id(child)] for child in below]
                self._exact[id(node)] = _exact(node, args) if steps <= _MOST_STEPS else None
        return self._exact[id(root)]

    def form(self, root: Node) -> Form | None:
        """A scalar as a form; None if it is none."""
        self.exact(root)
        for node in postorder((root,)):
            if id(node) not in self._forms:
                self._forms[id(node)] = self._form(node, [self._forms[id(child)] for child in children(node)])
        return self._forms[id(root)]

    def _form(self, node: Node, args: list[Form | None]) -> Form | None:
        match node:
            case Constant():
                return Form(constant=node.value) if isinstance(node.value, float) else None
            case Index():
                return Form(constant=self._chosen[node.identity]) if node.identity in self._chosen else None
            case Select():
                index = self._chosen.get(node.index.identity) if isinstance(node.index, Index) else None
                return None if index is None else args[1 + int(index)]
            case Range() | TruncatedNormal():
                limits = ends(node)
                known = all(isinstance(part, Constant) for part in children(node))
                if limits is None or not known or not all(map(math.isfinite, limits)) or limits[0] > limits[1]:
                    return None
                return Form(terms={node.identity: (1.0, *limits)})
            case Normal():
                fixed = isinstance(node.mean, Constant) and isinstance(node.deviation, Constant)
                return Form(terms={node.identity: (1.0, -math.inf, math.inf)}) if fixed else None
            case DirectionAt():
                return Form(fields=(node,))
            case Arithmetic() if all(arg is not None for arg in args):
                found = _combined(node.op, cast("list[Form]", args))
                if found is not None:
                    return found
            case _:
                pass
        exact = self._exact[id(node)]
        is_scalar = isinstance(node, Arithmetic | Coordinate | Norm | Bearing) or (
            isinstance(node, Feature) and node.kind == "scalar"
        )
        return Form(parts=((1.0, cast(Scalar, exact)),)) if exact is not None and is_scalar else None


def _combined(op: ArithmeticOp, args: list[Form]) -> Form | None:
    match op:
        case ArithmeticOp.ADD:
            total: Form | None = args[0]
            for other in args[1:]:
                total = None if total is None else total.plus(other)
            return total
        case ArithmeticOp.SUB:
            minus = args[1].times(-1.0)
            return None if minus is None else args[0].plus(minus)
        case ArithmeticOp.NEG:
            return args[0].times(-1.0)
        case ArithmeticOp.MUL:
            for one, other in ((args[0], args[1]), (args[1], args[0])):
                if one.number is not None:
                    return other.times(one.number)
            return None
        case ArithmeticOp.DIV if args[1].number:
            return args[0].times(1 / args[1].number)
        case _:
            return None


def _exact(node: Node, args: list[Exact | None]) -> Exact | None:
    match node:
        case Constant():
            value = node.value
            return (lambda _: value) if isinstance(value, float | tuple) else None
        case Feature():
            index, name = node.object, node.property
            fits = name in (VECTORS if node.kind == "vector" else _NUMBERS)

            def observed(get: Get) -> Value:
                return get(index, name)

            return cast(Exact, observed) if fits else None
        case _ if any(arg is None for arg in args):
            return None
        case Arithmetic():
            own = _scalar(node.op, cast("list[Scalar]", args))
            return own or cast(Exact, _computed(node, cast("list[Callable[[Get], Value]]", args)))
        case VectorOf():
            x, y = cast("list[Scalar]", args)
            return lambda get: (x(get), y(get))
        case VectorSum():
            one, other = cast("list[CompiledVector]", args)

            def added(get: Get) -> tuple[float, float]:
                (a, b), (c, d) = one(get), other(get)
                return (a + c, b + d)

            return added
        case Scale():
            vector, by = cast(CompiledVector, args[0]), cast(Scalar, args[1])

            def scaled(get: Get) -> tuple[float, float]:
                (a, b), factor = vector(get), by(get)
                return (a * factor, b * factor)

            return scaled
        case Rotate():
            whole, angle = cast(CompiledVector, args[0]), cast(Scalar, args[1])

            def rotated(get: Get) -> tuple[float, float]:
                (a, b), (c, s) = whole(get), turned(angle(get))
                return (a * c - b * s, a * s + b * c)

            return rotated
        case Coordinate():
            vector, axis = cast(CompiledVector, args[0]), node.axis
            return lambda get: vector(get)[axis]
        case Norm() | Bearing():
            return cast(Exact, _computed(node, cast("list[Callable[[Get], Value]]", args)))
        case _:
            return None


def _scalar(op: ArithmeticOp, args: list[Scalar]) -> Scalar | None:
    match op:
        case ArithmeticOp.ADD:
            # `sum` of floats is not plain addition in every Python
            return lambda get: functools.reduce(operator.add, [arg(get) for arg in args])
        case ArithmeticOp.SUB:
            one, other = args
            return lambda get: one(get) - other(get)
        case ArithmeticOp.MUL:
            left, right = args
            return lambda get: left(get) * right(get)
        case ArithmeticOp.NEG:
            (only,) = args
            return lambda get: -only(get)
        case _:
            return None
