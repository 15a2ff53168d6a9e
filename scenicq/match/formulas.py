"""Expressions made into functions of what a label observes: exact ones, and sums of a known part and random ranges."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TypeAlias, cast

from scenicq.forest.nodes import (
    Arithmetic,
    ArithmeticOp,
    Constant,
    Coordinate,
    DirectionAt,
    Feature,
    Identity,
    Index,
    Node,
    Range,
    Rotate,
    Scale,
    Select,
    TruncatedNormal,
    Value,
    VectorOf,
    VectorSum,
)
from scenicq.forest.walk import children, postorder
from scenicq.match.interval import ends

__all__ = ["Exact", "Form", "Formulas", "Get", "spread"]

Get: TypeAlias = Callable[[int, str], Value]
"""The observed value of an object's property."""
Exact: TypeAlias = Callable[[Get], "float | tuple[float, float]"]
Scalar: TypeAlias = Callable[[Get], float]
Vector: TypeAlias = Callable[[Get], "tuple[float, float]"]

_NUMBERS = frozenset({"heading", "width", "length", "height", "speed"})
_VECTORS = frozenset({"position", "velocity"})
"""Properties that are numbers and pairs wherever they are observed."""


@dataclass(frozen=True, slots=True, eq=False)
class Form:
    """A scalar: a known part, plus directions of fields, plus ranges times known factors.

    Attributes:
        parts: Functions with factors, and a constant; their sum is the known part.
        constant: See there.
        terms: For each random variable its factor and its ends.
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
        """The sum; None if a variable occurs in both."""
        if self.terms.keys() & other.terms.keys():
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
    def number(self) -> float | None:
        """Its value, if it is a number."""
        return None if self.parts or self.terms or self.fields else self.constant


def spread(form: Form, value: float) -> dict[Identity, Value]:
    """Values of a form's variables for which its random part has a value between its ends."""
    if len(form.terms) == 1:
        ((identity, (factor, low, high)),) = form.terms.items()
        return {identity: min(max(value / factor, low), high)}
    share = 0.5 if form.high == form.low else min(1.0, max(0.0, (value - form.low) / (form.high - form.low)))
    return {
        identity: low + share * (high - low) if factor > 0 else high - share * (high - low)
        for identity, (factor, low, high) in form.terms.items()
    }


class Formulas:
    """Formulas of expressions, given the options of discrete choices."""

    def __init__(self, chosen: Mapping[Identity, float]) -> None:
        """Take the number of the option of each choice."""
        self._chosen = chosen
        self._exact: dict[int, Exact | None] = {}
        self._forms: dict[int, Form | None] = {}

    def exact(self, root: Node) -> Exact | None:
        """A scalar or vector as a function of what is observed; None if it is not one alone."""
        for node in postorder((root,)):
            if id(node) not in self._exact:
                self._exact[id(node)] = _exact(node, [self._exact[id(child)] for child in children(node)])
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
                if limits is None or not all(map(math.isfinite, limits)) or limits[0] > limits[1]:
                    return None
                return Form(terms={node.identity: (1.0, *limits)})
            case DirectionAt():
                return Form(fields=(node,))
            case Arithmetic() if all(arg is not None for arg in args):
                found = _combined(node.op, cast("list[Form]", args))
                if found is not None:
                    return found
            case _:
                pass
        exact = self._exact[id(node)]
        is_scalar = isinstance(node, Arithmetic | Coordinate) or (isinstance(node, Feature) and node.kind == "scalar")
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
            fits = name in (_VECTORS if node.kind == "vector" else _NUMBERS)
            return (lambda get: cast(float, get(index, name))) if fits else None
        case _ if any(arg is None for arg in args):
            return None
        case Arithmetic():
            return _scalar(node.op, cast("list[Scalar]", args))
        case VectorOf():
            x, y = cast("list[Scalar]", args)
            return lambda get: (x(get), y(get))
        case VectorSum():
            one, other = cast("list[Vector]", args)

            def added(get: Get) -> tuple[float, float]:
                (a, b), (c, d) = one(get), other(get)
                return (a + c, b + d)

            return added
        case Scale():
            vector, by = cast(Vector, args[0]), cast(Scalar, args[1])

            def scaled(get: Get) -> tuple[float, float]:
                (a, b), factor = vector(get), by(get)
                return (a * factor, b * factor)

            return scaled
        case Rotate():
            turned, angle = cast(Vector, args[0]), cast(Scalar, args[1])

            def rotated(get: Get) -> tuple[float, float]:
                (a, b), turn = turned(get), angle(get)
                c, s = math.cos(turn), math.sin(turn)
                return (a * c - b * s, a * s + b * c)

            return rotated
        case Coordinate():
            whole, axis = cast(Vector, args[0]), node.axis
            return lambda get: whole(get)[axis]
        case _:
            return None


def _scalar(op: ArithmeticOp, args: list[Scalar]) -> Scalar | None:
    match op:
        case ArithmeticOp.ADD:
            return lambda get: sum([arg(get) for arg in args])
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
