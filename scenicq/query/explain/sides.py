"""The comparisons that a requirement is made of, with their values, in the words of the program."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from scenicq.errors import CannotEvaluate
from scenicq.forest.groups import PARAMS, Condition, Group
from scenicq.forest.nodes import Compare, Constant, Distance, Identity, Logic, LogicOp, Node, Norm, Value
from scenicq.forest.walk import features, leaves
from scenicq.match.explanation import LabelSearch, condition_items

__all__ = ["Side", "amount", "sides"]

_OF_ANGLES = re.compile(r"\b(deg|heading|angle|azimuth)\b")


def amount(value: float, unit: str) -> str:
    """A number in a person's units: "deg" for radians, "m", or none."""
    return f"{math.degrees(value):z.1f} deg" if unit == "deg" else f"{value:z.3g} {unit}".rstrip()


@dataclass(frozen=True, slots=True)
class Side:
    """One comparison of a requirement with its values.

    Attributes:
        text: The comparison in the words of the program.
        values: Its two values with the operator between them.
        negated: Whether it stands under a `not`, and so must be false.
        true: Whether it is as it must be.
        apart: How far the values are apart.
        unit: Unit of the values: "deg", "m" or empty.
    """

    text: str
    values: str
    negated: bool
    true: bool
    apart: float
    unit: str


def sides(
    attempt: LabelSearch,
    constraint: Condition,
    assignment: Mapping[int, int],
    values: Mapping[Identity, Value],
) -> Iterator[Side]:
    """The comparisons that a requirement is made of, with the values of their sides where these are known.

    Args:
        attempt: The label.
        constraint: The requirement.
        assignment: The correspondence.
        values: Values of the random variables.
    """
    stack: list[tuple[Node, bool]] = [(constraint.expression, True)]
    while stack:
        node, plain = stack.pop()
        if isinstance(node, Logic):
            stack += [(part, plain != (node.op is LogicOp.NOT)) for part in reversed(node.args)]
        if not isinstance(node, Compare):
            continue
        left, right = (_known(attempt, constraint, side, assignment, values) for side in (node.left, node.right))
        if left is None or right is None:
            continue
        text = " ".join(node.span.text.split()) if node.span is not None else ""
        unit = "deg" if _OF_ANGLES.search(text) else "m" if isinstance(node.left, Norm | Distance) else ""
        shown = f"{amount(left, unit)} {node.op.value} {amount(right, unit)}"
        holds = _holds(node.op.value, left, right) == plain
        yield Side(text if plain else f"not ({text})", shown, not plain, holds, abs(left - right), unit)


def _holds(op: str, left: float, right: float) -> bool:
    match op:
        case "<":
            return left < right
        case "<=":
            return left <= right
        case ">":
            return left > right
        case ">=":
            return left >= right
        case "==":
            return left == right
        case _:
            return left != right


def _known(
    attempt: LabelSearch,
    constraint: Condition,
    side: Node,
    assignment: Mapping[int, int],
    values: Mapping[Identity, Value],
) -> float | None:
    objects = tuple(sorted({index for index, _ in features(side)} - {PARAMS}))
    if any(index not in assignment for index in objects):
        return None
    alone = Group((Condition(constraint.requirement, side),), leaves(side), objects)
    try:
        items = attempt.items(alone, assignment)
    except CannotEvaluate:
        return None
    part = condition_items(items, values)[0][1]
    known = part.value if isinstance(part, Constant) else None
    return known if isinstance(known, float) else None
