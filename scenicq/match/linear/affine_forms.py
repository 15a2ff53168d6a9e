"""Affine forms: expressions that are sums of random variables times known numbers.

After conditioning on the label most groups are affine; then geometry or a linear program decides them exactly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

from scenicq.forest.interpret import OnMap, RegionNode, interpret, steps_of
from scenicq.forest.nodes import (
    Among,
    ArithmeticOp,
    CompareOp,
    Feature,
    Identity,
    Leaf,
    LogicOp,
    Node,
    Normal,
    PointIn,
    Range,
    TruncatedNormal,
    Value,
)
from scenicq.geometry.angles import rotate

__all__ = ["Affine", "AffineVector", "VariableAxis", "affine_scalar", "affine_vector"]

VariableAxis: TypeAlias = tuple[Identity, int]
"""A scalar random variable (axis 0), or the x (0) or y (1) of a random point."""


@dataclass(frozen=True, slots=True)
class Affine:
    """A constant plus coefficients times variables.

    Attributes:
        constant: In the unit of the expression: metres, radians or a property's own.
        terms: The coefficient of each scalar variable, and of each coordinate of a random point (axis 0 or 1); zeros
            are left out.
    """

    constant: float
    terms: dict[VariableAxis, float]

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


class _AffineDomain:
    """The domain of affine forms: a number, a vector, or None where an expression is neither or not affine."""

    def constant(self, value: Value) -> _Form:
        if isinstance(value, float):
            return Affine(value, {})
        return (Affine(value[0], {}), Affine(value[1], {})) if isinstance(value, tuple) else None

    def among(self, node: Among, args: Sequence[_Form]) -> _Form:
        return None

    def feature(self, node: Feature) -> _Form:
        return None

    def variable(self, node: Leaf, args: Sequence[_Form]) -> _Form:
        match node:
            case Range() | Normal() | TruncatedNormal():
                return Affine(0.0, {(node.identity, 0): 1.0})
            case PointIn():
                return (Affine(0.0, {(node.identity, 0): 1.0}), Affine(0.0, {(node.identity, 1): 1.0}))
            case _:
                return None

    def arithmetic(self, op: ArithmeticOp, args: Sequence[_Form]) -> _Form:
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

    def vector(self, x: _Form, y: _Form) -> _Form:
        return (x, y) if isinstance(x, Affine) and isinstance(y, Affine) else None

    def sum(self, left: _Form, right: _Form) -> _Form:
        if not isinstance(left, tuple) or not isinstance(right, tuple):
            return None
        return (left[0].plus(right[0]), left[1].plus(right[1]))

    def scale(self, vector: _Form, factor: _Form) -> _Form:
        by = _known(factor)
        return (vector[0].times(by), vector[1].times(by)) if isinstance(vector, tuple) and by is not None else None

    def rotate(self, vector: _Form, angle: _Form) -> _Form:
        by = _known(angle)
        if not isinstance(vector, tuple) or by is None:
            return None
        (x, y), (c, s) = vector, rotate(1.0, 0.0, by)
        return (x.times(c).plus(y, -s), x.times(s).plus(y, c))

    def coordinate(self, vector: _Form, axis: int) -> _Form:
        return vector[axis] if isinstance(vector, tuple) else None

    def norm(self, vector: _Form) -> _Form:
        return None

    def bearing(self, vector: _Form) -> _Form:
        return None

    def compare(self, op: CompareOp, left: _Form, right: _Form) -> _Form:
        return None

    def logic(self, op: LogicOp, args: Sequence[_Form]) -> _Form:
        return None

    def select(self, index: _Form, options: Sequence[_Form]) -> _Form:
        return None

    def on_map(self, node: OnMap, args: Sequence[_Form]) -> _Form:
        return None

    def region(self, node: RegionNode, args: Sequence[_Form]) -> _Form:
        return None


_DOMAIN = _AffineDomain()


def _form(root: Node) -> _Form:
    return interpret(steps_of(root), _DOMAIN)[id(root)]


def affine_scalar(node: Node) -> Affine | None:
    """A scalar expression as an affine form, None if it is not one."""
    form = _form(node)
    return form if isinstance(form, Affine) else None


def affine_vector(node: Node) -> AffineVector | None:
    """A vector expression as a pair of affine forms, None if it is not one."""
    form = _form(node)
    return form if isinstance(form, tuple) else None
