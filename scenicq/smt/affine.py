"""Affine atoms: recognising them, and contracting boxes with them.

A box is two lists of floats, the lower and the upper ends. Contraction is sound in every rounding mode: each bound is
widened by more than all rounding errors, those made while the coefficients were gathered included. Part of the portable
solver.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from scenicq.smt.formula import Num, Operator, Relation, Term, TermComparison, Var

__all__ = ["EMPTY", "ENTAILED", "MAYBE", "AffineAtom", "Forms", "affine_atoms", "contract_affine"]

EMPTY, MAYBE, ENTAILED = 0, 1, 2
"""What a constraint says of a box: no point satisfies it, some may, all do."""

ULP = 2.0**-52
UNDERFLOW = 1e-200
"""Products below this are left to the general contractor: their rounding error is not relative."""
WIDEST = 32
"""An atom over more variables than this is left to the general contractor."""


@dataclass(frozen=True, slots=True)
class AffineAtom:
    """The constraint that a weighted sum is at most a bound.

    Attributes:
        terms: (variable's index, coefficient, magnitude of what the coefficient was computed from), each variable once.
        vague: (variable's index, greatest absolute coefficient), where rounding hides the coefficient's sign.
        bound: Right side.
        magnitude: Magnitude of what the bound was computed from.
        strict: Whether the sum must be less than the bound.
        error: Relative rounding error of gathering the coefficients and of summing up.
    """

    terms: tuple[tuple[int, float, float], ...]
    vague: tuple[tuple[int, float], ...]
    bound: float
    magnitude: float
    strict: bool
    error: float


@dataclass(frozen=True, slots=True)
class _Form:
    """A sum of multiples of variables, the key None being the constant; values are (coefficient, magnitude)."""

    parts: dict[str | None, tuple[float, float]]
    steps: int


Forms = dict[int, "_Form | None"]
"""What is known of terms, by identity; shared by all atoms of a problem."""


def affine_atoms(atom: TermComparison, index: Mapping[str, int], forms: Forms) -> tuple[AffineAtom, ...] | None:
    """The one (or, for an equality, two) affine constraints that an atom stands for; None if it is not affine.

    Args:
        atom: The atom.
        index: The number of each variable in a box.
        forms: Filled with what is learnt of the atom's terms.
    """
    left, right = _form(atom.left, forms), _form(atom.right, forms)
    if left is None or right is None:
        return None
    form = _sum([left, _scaled(right, -1.0)])
    constant, magnitude = form.parts.get(None, (0.0, 0.0))
    terms = tuple(
        (index[name], coefficient, size)
        for name, (coefficient, size) in form.parts.items()
        if name is not None and size > 0.0
    )
    if len(terms) > WIDEST or not all(math.isfinite(size) for _, _, size in (*terms, (0, 0.0, magnitude))):
        return None
    error = (form.steps + len(terms) + 8) * 2 * ULP
    certain = tuple(term for term in terms if abs(term[1]) > 4 * error * term[2])
    vague = tuple(
        (variable, abs(value) + error * size) for variable, value, size in terms if abs(value) <= 4 * error * size
    )
    first = AffineAtom(certain, vague, -constant, magnitude, atom.relation is Relation.LT, error)
    if atom.relation is not Relation.EQ:
        return (first,)
    opposite = tuple((variable, -coefficient, size) for variable, coefficient, size in certain)
    return first, AffineAtom(opposite, vague, constant, magnitude, strict=False, error=error)


def _form(root: Term, forms: Forms) -> _Form | None:
    stack = [root]
    while stack:
        node = stack[-1]
        if id(node) in forms:
            stack.pop()
        elif isinstance(node, Var):
            forms[id(node)] = _Form({node.name: (1.0, 1.0)}, 0)
        elif isinstance(node, Num):
            forms[id(node)] = _Form({None: (node.value, abs(node.value))}, 0)
        elif node.op not in _AFFINE:
            forms[id(node)] = None
        elif missing := [arg for arg in node.args if id(arg) not in forms]:
            stack.extend(missing)
        else:
            args = [form for arg in node.args if (form := forms[id(arg)]) is not None]
            forms[id(node)] = _combined(node.op, args) if len(args) == len(node.args) else None
    return forms[id(root)]


_AFFINE = frozenset((Operator.ADD, Operator.SUB, Operator.NEG, Operator.MUL, Operator.DIV))


def _combined(operator: Operator, args: Sequence[_Form]) -> _Form | None:
    if any(len(form.parts) > WIDEST + 1 for form in args):
        return None
    match operator:
        case Operator.ADD:
            return _sum(args)
        case Operator.SUB:
            return _sum([args[0], _scaled(args[1], -1.0)])
        case Operator.NEG:
            return _scaled(args[0], -1.0)
        case Operator.MUL:
            return _product(args)
        case Operator.DIV if set(args[1].parts) == {None} and args[1].steps == 0 and args[1].parts[None][0] != 0:
            divisor = args[1].parts[None][0]
            parts = {name: (value / divisor, size / abs(divisor)) for name, (value, size) in args[0].parts.items()}
            return _Form(parts, args[0].steps + 1)
        case _:
            return None


def _scaled(form: _Form, factor: float) -> _Form:
    parts = {name: (value * factor, size * abs(factor)) for name, (value, size) in form.parts.items()}
    return _Form(parts, form.steps)


def _sum(forms: Sequence[_Form]) -> _Form:
    parts: dict[str | None, tuple[float, float]] = {}
    for form in forms:
        for name, (value, size) in form.parts.items():
            old_value, old_size = parts.get(name, (0.0, 0.0))
            parts[name] = (old_value + value, old_size + size)
    return _Form(parts, sum(form.steps for form in forms) + len(forms))


def _product(forms: Sequence[_Form]) -> _Form | None:
    result = forms[0]
    for form in forms[1:]:
        if set(result.parts) == {None}:
            result, form = form, result  # noqa: PLW2901
        factor, size = form.parts.get(None, (0.0, 0.0))
        parts = {name: (value * factor, old_size * size) for name, (value, old_size) in result.parts.items()}
        if set(form.parts) != {None} or any(0.0 < size < UNDERFLOW for _, size in parts.values()):
            return None
        result = _Form(parts, result.steps + form.steps + 1)
    return result


def contract_affine(atom: AffineAtom, low: list[float], high: list[float]) -> int:
    """Narrow a box in place to where the atom can hold.

    Returns:
        `EMPTY`, `MAYBE` or `ENTAILED`; after `EMPTY` the box is unspecified.
    """
    bound, error = atom.bound, atom.error
    slop = atom.magnitude * error
    for variable, coefficient in atom.vague:
        slop += coefficient * max(abs(low[variable]), abs(high[variable]))
    least = most = 0.0
    least_slop = most_slop = slop
    unbounded, free = 0, -1
    for variable, coefficient, magnitude in atom.terms:
        near, far = low[variable], high[variable]
        if coefficient < 0.0:
            near, far = far, near
        most += coefficient * far
        most_slop += magnitude * abs(far) * error
        if near in _INFINITIES:
            unbounded += 1
            free = variable
        else:
            least += coefficient * near
            least_slop += magnitude * abs(near) * error
    if not unbounded and (least - least_slop > bound or (atom.strict and least - least_slop >= bound)):
        return EMPTY
    if most + most_slop < bound or (not atom.strict and most + most_slop <= bound):
        return ENTAILED
    if unbounded > 1:
        return MAYBE
    for variable, coefficient, magnitude in atom.terms:
        if unbounded and variable != free:
            continue
        near = low[variable] if coefficient > 0.0 else high[variable]
        rest = least if unbounded else least - coefficient * near
        limit = (bound - rest + least_slop) / coefficient
        limit += math.copysign(
            abs(limit) * (2.0 * error * magnitude / abs(coefficient) + 4.0 * ULP) + 1e-300, coefficient
        )
        if coefficient > 0.0:
            high[variable] = min(high[variable], limit)
        else:
            low[variable] = max(low[variable], limit)
        if low[variable] > high[variable]:
            return EMPTY
    return MAYBE


_INFINITIES = (math.inf, -math.inf)
