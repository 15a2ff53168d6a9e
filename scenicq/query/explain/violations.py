"""What a constraint allows, in a person's units: for the explanation of what a label breaks."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from scenicq.errors import Span
from scenicq.forest.bounds import scalar_bounds
from scenicq.forest.compute import CannotEvaluate
from scenicq.forest.condition import condition
from scenicq.forest.groups import PARAMS, Comparison, Condition, Group
from scenicq.forest.nodes import Compare, Constant, Index, Node, PointIn, Undefined, Value
from scenicq.forest.walk import features, leaves
from scenicq.geometry.angles import normalize
from scenicq.match.decide.cascade import decide
from scenicq.match.matcher import Matcher
from scenicq.match.options import Tolerance
from scenicq.match.problem.conditioned import Item
from scenicq.match.problem.constraints import describe_constraint
from scenicq.match.problem.evaluation import show_value
from scenicq.match.problem.outcome import Refuted, Satisfied
from scenicq.match.search.label_search import LabelSearch

__all__ = ["Violation", "choices", "violations"]

_FAR_M = 1000.0
_STEPS = 40
_MOST_CHOICES = 16
_MOST_INTERVALS = 4


@dataclass(frozen=True, slots=True)
class Violation:
    """A constraint that a correspondence breaks.

    Attributes:
        what: The feature or requirement, in the words of the program.
        value: What the label has, such as "is 137.2 deg".
        allowed: What was allowed, and how far off the value is.
        span: Where the program says it.
    """

    what: str
    value: str
    allowed: str
    span: Span | None


def violations(
    matcher: Matcher, attempt: LabelSearch, group: Group, assignment: Mapping[int, int]
) -> tuple[Violation, ...]:
    """What a group breaks under a correspondence: each constraint that fails by itself, else all of them together.

    Args:
        matcher: The matcher.
        attempt: The label.
        group: A group that fails.
        assignment: The correspondence, with all objects of the group.
    """
    if not all(index in assignment for index in group.objects):
        return ()
    try:
        items = attempt.items(group, assignment)
        alone = [item for item in items if isinstance(decide([item], matcher.options.tolerance), Refuted)]
        return tuple(_violation(matcher, attempt, item, assignment) for item in alone or items)
    except CannotEvaluate:
        return ()


def _violation(matcher: Matcher, attempt: LabelSearch, item: Item, assignment: Mapping[int, int]) -> Violation:
    constraint, node, observed = item
    what = describe_constraint(matcher.scenario, constraint)
    if isinstance(constraint, Comparison):
        value = f"is {show_value(constraint.property, observed)}"
        return Violation(what, value, _allowed(constraint, node, observed), constraint.span)
    return Violation(what, "does not hold", _sides(attempt, item, assignment), constraint.span)


def _sides(attempt: LabelSearch, item: Item, assignment: Mapping[int, int]) -> str:
    """The two sides of a comparison that does not hold, where the label determines them."""
    constraint, node, _ = item
    assert isinstance(constraint, Condition)
    if isinstance(node, Constant) and isinstance(node.value, Undefined):
        return node.value.reason
    expression = constraint.expression
    if not isinstance(expression, Compare):
        return ""
    sides: list[str] = []
    for side in (expression.left, expression.right):
        objects = tuple(sorted({index for index, _ in features(side)} - {PARAMS}))
        alone = Group((Condition(constraint.requirement, side),), leaves(side), objects)
        part = attempt.items(alone, assignment)[0][1]
        if not isinstance(part, Constant) or not isinstance(part.value, float):
            return ""
        sides.append(f"{part.value:.4g}")
    return f"{sides[0]} {expression.op.value} {sides[1]} is false"


def _allowed(constraint: Comparison, node: Node, observed: Value) -> str:
    if isinstance(node, Constant):
        if isinstance(node.value, Undefined):
            return node.value.reason
        shown = f"allowed: {show_value(constraint.property, node.value)}"
    elif isinstance(observed, tuple):
        shown = _place(node)
    elif isinstance(observed, float):
        shown = _interval(constraint.property, node)
    else:
        shown = "another value is needed"
    off = _off(constraint, node, observed)
    return f"{shown}{'; ' if shown and off else ''}{off}"


def _place(node: Node) -> str:
    """The region that a position must be in, where there is one with a name."""
    names = _region_names(node)
    return f"allowed: from `{'`, `'.join(names)}`" if names else ""


def _region_names(node: Node) -> list[str]:
    found = (leaf.region for leaf in leaves(node) if isinstance(leaf, PointIn))
    values = (region.value for region in found if isinstance(region, Constant))
    names = (getattr(value, "name", "") for value in values)
    return list(dict.fromkeys(name for name in names if name))


def choices(root: Node) -> Iterator[Node]:
    """The expression for each way to choose among options; nothing if there are too many."""
    indices = [leaf for leaf in leaves(root) if isinstance(leaf, Index)]
    if math.prod(len(leaf.weights) for leaf in indices) > _MOST_CHOICES:
        return
    for picked in itertools.product(*(range(len(leaf.weights)) for leaf in indices)):
        chosen = {leaf.identity: float(number) for leaf, number in zip(indices, picked, strict=True)}
        yield condition(root, {}, chosen)


def _interval(property_: str, node: Node) -> str:
    """The interval of each way to choose among options, or what holds them all."""
    bounds = sorted({scalar_bounds(option) for option in choices(node)}) or [scalar_bounds(node)]
    if len(bounds) > _MOST_INTERVALS:
        bounds = [scalar_bounds(node)]
    shown: list[str] = []
    for low, high in bounds:
        if (property_ == "heading" and not high - low < math.tau) or not (math.isfinite(low) or math.isfinite(high)):
            return ""
        turn = normalize(low) - low if property_ == "heading" else 0.0
        shown.append(f"{show_value(property_, low + turn)} to {show_value(property_, high + turn)}")
    return f"allowed: {' or '.join(shown)}"


def _off(constraint: Comparison, node: Node, observed: Value) -> str:
    """How far the value is from what is allowed, found by widening the one tolerance that matters."""
    if not isinstance(observed, float | tuple):
        return ""
    heading = constraint.property == "heading"
    high = math.pi if heading else _FAR_M

    def reached(size: float) -> bool:
        wide = Tolerance(None, None, size, size, size)
        return isinstance(decide([(constraint, node, observed)], wide), Satisfied)

    if not reached(high):
        return ""
    low = 0.0
    for _ in range(_STEPS):
        middle = (low + high) / 2
        low, high = (low, middle) if reached(middle) else (middle, high)
        if high - low < 1e-4:
            break
    unit = " m" if isinstance(observed, tuple) else ""
    return f"{math.degrees(high):.1f} deg off" if heading else f"{high:.2f}{unit} off"
