"""From the forest to a formula (query paper, appendix A.2, figures 17-19).

Every random variable becomes a real variable (a random point two; `unknowns`), every node a term over them
(`expressions`), and every constraint of a group compares a term with what the label observes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, cast

from scenicq.forest.bounds import Box, leaf_boxes, scalar_bounds
from scenicq.forest.nodes import (
    ArithmeticOp,
    Identity,
    Node,
    Undefined,
    Value,
)
from scenicq.smt.expressions import Expressions
from scenicq.smt.problem import Formula, Problem, Term, Variable, is_term
from scenicq.smt.region_membership import TermVector, disc
from scenicq.smt.terms import FALSE, apply, compare, conjunction, disjunction
from scenicq.smt.unknowns import Unknowns
from scenicq.smt.value_codes import (
    equals_observed,
    in_interval,
    truth,
)

__all__ = ["Encoding", "Item", "Target", "encode"]


@dataclass(frozen=True, slots=True)
class Target:
    """How the value of an expression is compared with the label's: None for a requirement.

    Attributes:
        shape: "box" with half extents `a` and `b`, "disc" or interval of radius `a`, "angle" of half width `a`.
    """

    shape: Literal["box", "disc", "angle"] | None
    a: float = 0.0
    b: float = 0.0


Item = tuple[Target, Node, Value]
"""What an expression must equal: its target, the expression after conditioning, the label's value."""


@dataclass(frozen=True, slots=True)
class Encoding:
    """A problem for a solver, and how to read its witness.

    Attributes:
        problem: The problem.
        made: The variables of each random variable: one, or two for a point.
        whole: The random variables that are whole numbers.
    """

    problem: Problem
    made: Mapping[Identity, tuple[Variable, ...]]
    whole: frozenset[Identity] = frozenset()

    def values(self, witness: Mapping[str, float]) -> dict[Identity, Value]:
        """The values of the random variables in a witness."""
        found: dict[Identity, Value] = {}
        for identity, variables in self.made.items():
            numbers = [float(witness[variable.name]) for variable in variables]
            if identity in self.whole:
                numbers = [float(round(number)) for number in numbers]
            found[identity] = (numbers[0], numbers[1]) if len(numbers) == 2 else numbers[0]
        return found


def encode(groups: Sequence[Sequence[Item]], *, borders: bool = True) -> Encoding:
    """Encode groups of constraints as one problem.

    Args:
        groups: Per group, the constraints that are left after conditioning. Random variables are shared between
            groups by identity; what a group shares otherwise (the direction at one point) it shares alone.
        borders: Whether curved borders between the directions of a field are encoded, too. Without them the problem
            is smaller and has more solutions: if it has none, there is none, but a solution may be none.

    Raises:
        CannotEvaluate: A construct has no formula.
    """
    unknowns = Unknowns()
    parts = [_group(items, unknowns, borders=borders) for items in groups]
    constraint = conjunction([*parts, *unknowns.side])
    return Encoding(Problem(tuple(unknowns.variables), constraint), unknowns.made, frozenset(unknowns.whole))


def _group(items: Sequence[Item], unknowns: Unknowns, *, borders: bool) -> Formula:
    """The formula of one group."""
    targets: list[tuple[Node, Box]] = []
    for target, node, observed in items:
        if target.shape in ("box", "disc") and isinstance(observed, tuple):
            rx, ry = (target.a, target.b) if target.shape == "box" else (target.a, target.a)
            x, y = observed
            targets.append((node, ((x - rx, x + rx), (y - ry, y + ry))))
    boxes = leaf_boxes(targets)
    expressions = Expressions(unknowns, boxes, borders=borders)
    return conjunction([_item(item, expressions, boxes) for item in items])


def _item(item: Item, expressions: Expressions, boxes: Mapping[Identity, Box]) -> Formula:
    target, node, observed = item
    code = expressions.code(node)
    if isinstance(code, Undefined):
        return FALSE
    if target.shape is None:
        return truth(code)
    if isinstance(observed, tuple):
        x, y = cast(TermVector, code)
        dx, dy = apply(ArithmeticOp.SUB, x, observed[0]), apply(ArithmeticOp.SUB, y, observed[1])
        if target.shape == "box":
            return conjunction([*in_interval(dx, -target.a, target.a), *in_interval(dy, -target.b, target.b)])
        return disc(dx, dy, target.a)
    if not isinstance(observed, float):
        return equals_observed(code, observed)
    if not is_term(code):
        return FALSE
    off = apply(ArithmeticOp.SUB, code, observed)
    if target.shape == "angle":
        return _near_angle(off, scalar_bounds(node, boxes), observed, target.a)
    return conjunction(in_interval(off, -target.a, target.a))


def _near_angle(off: Term, limits: tuple[float, float], observed: float, width: float) -> Formula:
    """An angle within `width` of a multiple of 2 pi: one case per turn, or by sine where it is unbounded."""
    low, high = limits[0] - observed, limits[1] - observed
    if math.isfinite(low) and math.isfinite(high):
        turns = range(math.ceil((low - width) / math.tau), math.floor((high + width) / math.tau) + 1)
        return disjunction(conjunction(in_interval(off, math.tau * k - width, math.tau * k + width)) for k in turns)
    if width >= math.pi / 2:
        return compare(">=", apply(ArithmeticOp.COS, off), math.cos(min(width, math.pi)))
    sine = apply(ArithmeticOp.SIN, off)
    return conjunction(
        [*in_interval(sine, -math.sin(width), math.sin(width)), compare(">", apply(ArithmeticOp.COS, off), 0.0)]
    )
