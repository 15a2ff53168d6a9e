"""Affine forms: expressions that are sums of random variables times known numbers.

After conditioning on the label most groups are affine; then geometry or a linear program decides them exactly.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias, cast

from scenicq.forest.nodes import (
    Arithmetic,
    ArithmeticOp,
    Constant,
    Coordinate,
    Identity,
    Node,
    Normal,
    PointIn,
    Range,
    Rotate,
    Scale,
    TruncatedNormal,
    VectorOf,
    VectorSum,
)
from scenicq.forest.walk import children, postorder
from scenicq.geometry.angles import rotate

__all__ = ["Affine", "AffineVector", "Variable", "affine_scalar", "affine_vector"]

Variable: TypeAlias = tuple[Identity, int]
"""A scalar random variable (axis 0), or the x (0) or y (1) of a random point."""


@dataclass(frozen=True, slots=True)
class Affine:
    """A constant plus coefficients times variables; zero coefficients are left out."""

    constant: float
    terms: dict[Variable, float]

    def plus(self, other: Affine, factor: float = 1.0) -> Affine:
        """The sum with a multiple of another form."""
        terms = dict(self.terms)
        for variable, coefficient in other.terms.items():
            total = terms.get(variable, 0.0) + factor * coefficient
            if total == 0.0:
                terms.pop(variable, None)
            else:
                terms[variable] = total
        return Affine(self.constant + factor * other.constant, terms)

    def times(self, factor: float) -> Affine:
        """The form times a known number."""
        return Affine(self.constant * factor, {v: c * factor for v, c in self.terms.items()} if factor else {})


AffineVector: TypeAlias = tuple[Affine, Affine]
_Form: TypeAlias = Affine | AffineVector | None


def _known(form: _Form) -> float | None:
    return form.constant if isinstance(form, Affine) and not form.terms else None


def _scalar(op: ArithmeticOp, args: list[_Form]) -> Affine | None:
    forms = [arg for arg in args if isinstance(arg, Affine)]
    if len(forms) != len(args):
        return None
    match op:
        case ArithmeticOp.ADD:
            total = forms[0]
            for form in forms[1:]:
                total = total.plus(form)
            return total
        case ArithmeticOp.SUB:
            return forms[0].plus(forms[1], -1.0)
        case ArithmeticOp.NEG:
            return forms[0].times(-1.0)
        case ArithmeticOp.MUL:
            for one, other in ((forms[0], forms[1]), (forms[1], forms[0])):
                if not one.terms:
                    return other.times(one.constant)
            return None
        case ArithmeticOp.DIV if not forms[1].terms and forms[1].constant:
            return forms[0].times(1 / forms[1].constant)
        case _:
            return None


def _vector(node: Node, args: list[_Form]) -> _Form:
    first = args[0]
    if isinstance(node, VectorOf):
        second = args[1]
        return (first, second) if isinstance(first, Affine) and isinstance(second, Affine) else None
    if not isinstance(first, tuple):
        return None
    x, y = first
    match node:
        case VectorSum():
            other = args[1]
            return (x.plus(other[0]), y.plus(other[1])) if isinstance(other, tuple) else None
        case Scale():
            factor = _known(args[1])
            return None if factor is None else (x.times(factor), y.times(factor))
        case Rotate():
            angle = _known(args[1])
            if angle is None:
                return None
            c, s = rotate(1.0, 0.0, angle)
            return (x.times(c).plus(y, -s), x.times(s).plus(y, c))
        case Coordinate():
            return first[node.axis]
        case _:
            return None


def _form(root: Node) -> _Form:
    forms: dict[int, _Form] = {}
    for node in postorder((root,)):
        args = [forms[id(child)] for child in children(node)]
        match node:
            case Constant():
                value = cast(object, node.value)
                form: _Form = None
                if isinstance(value, float):
                    form = Affine(value, {})
                elif isinstance(value, tuple):
                    x, y = cast("tuple[float, float]", value)
                    form = (Affine(x, {}), Affine(y, {}))
            case Range() | Normal() | TruncatedNormal():
                form = Affine(0.0, {(node.identity, 0): 1.0})
            case PointIn():
                form = (Affine(0.0, {(node.identity, 0): 1.0}), Affine(0.0, {(node.identity, 1): 1.0}))
            case Arithmetic():
                form = _scalar(node.op, args)
            case VectorOf() | VectorSum() | Scale() | Rotate() | Coordinate():
                form = _vector(node, args)
            case _:
                form = None
        forms[id(node)] = form
    return forms[id(root)]


def affine_scalar(node: Node) -> Affine | None:
    """A scalar expression as an affine form, None if it is not one."""
    form = _form(node)
    return form if isinstance(form, Affine) else None


def affine_vector(node: Node) -> AffineVector | None:
    """A vector expression as a pair of affine forms, None if it is not one."""
    form = _form(node)
    return form if isinstance(form, tuple) else None
