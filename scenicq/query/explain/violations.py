"""What a constraint allows, in a person's units: for the explanation of what a label breaks."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from scenicq.errors import CannotEvaluate, Span
from scenicq.forest.bounds import scalar_bounds
from scenicq.forest.condition import condition
from scenicq.forest.groups import Comparison, Condition, Group
from scenicq.forest.nodes import Constant, Encloses, Index, Node, PointIn, Undefined, Value
from scenicq.forest.walk import leaves
from scenicq.geometry.angles import normalize
from scenicq.limits import LIMITS
from scenicq.match.explanation import (
    Item,
    LabelSearch,
    Refuted,
    Satisfied,
    decide_decomposed,
    describe_constraint,
    show_value,
)
from scenicq.match.matcher import Matcher
from scenicq.match.tolerance import Tolerance
from scenicq.query.explain.changes import find_least
from scenicq.query.explain.sides import sides

__all__ = ["Violation", "allowed_values", "choices", "distance_off", "violations"]

_PLACED = re.compile(r"(?:on|in) (.+)")
_LONGEST_NAME = 60
_FAR_M = 1000.0
_FINEST = 1e-4


@dataclass(frozen=True, slots=True)
class Violation:
    """A constraint that a correspondence breaks, or of which it is not known whether it does.

    Attributes:
        what: The feature or requirement, in the words of the program.
        value: What the label has, such as "is 137.2 deg".
        allowed: What was allowed, and how far off the value is; of what is not decided, what is missing.
        span: Where the program says it.
        reason: Why it is not decided, as `Unknown.reason`; empty where it is broken.
    """

    what: str
    value: str
    allowed: str
    span: Span | None
    reason: str = ""


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
        alone = [item for item in items if isinstance(decide_decomposed([item], matcher.options.tolerance), Refuted)]
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
    """What keeps a requirement from holding, where the label determines it."""
    constraint, node, _ = item
    assert isinstance(constraint, Condition)
    if isinstance(node, Constant) and isinstance(node.value, Undefined):
        return node.value.reason
    failing = (each for each in sides(attempt, constraint, assignment, {}) if not each.true)
    told = [f"{each.values} is {'true' if each.negated else 'false'}" for each in failing]
    if isinstance(constraint.expression, Encloses):
        told.append("the whole box must lie inside; `.position in` asks of the centre alone")
    return "; ".join(told)


def _allowed(constraint: Comparison, node: Node, observed: Value) -> str:
    """What was allowed, and how far off the value is."""
    if isinstance(node, Constant) and isinstance(node.value, Undefined):
        return node.value.reason
    shown = allowed_values(constraint, node, observed)
    off = distance_off(constraint, node, observed)
    if off is None:
        return shown
    unit = " m" if isinstance(observed, tuple) else ""
    told = f"{math.degrees(off):.1f} deg off" if constraint.property == "heading" else f"{off:.2f}{unit} off"
    return f"{shown}{'; ' if shown else ''}{told}"


def allowed_values(constraint: Comparison, node: Node, observed: Value) -> str:
    """The values that the program allows for a feature, where they can be said in a few words.

    Args:
        constraint: The feature.
        node: What conditioning left of its expression.
        observed: The label's value.
    """
    if isinstance(node, Constant):
        return f"allowed: {show_value(constraint.property, node.value)}"
    if isinstance(observed, tuple):
        return _place(node)
    if isinstance(observed, float):
        return _interval(constraint.property, node)
    return "another value is needed"


def _place(node: Node) -> str:
    """The region that a position must be in, where there is one with a name."""
    names = _region_names(node)
    return f"allowed: from `{'`, `'.join(names)}`" if names else ""


def _region_names(node: Node) -> list[str]:
    names = (_region_name(leaf) for leaf in leaves(node) if isinstance(leaf, PointIn))
    return list(dict.fromkeys(name for name in names if name))


def _region_name(leaf: PointIn) -> str:
    """What the program calls the region of a random point; what the map calls it, where that is no short name."""
    text = " ".join(leaf.span.text.split()) if leaf.span is not None else ""
    placed = _PLACED.fullmatch(text)
    if placed and len(placed[1]) <= _LONGEST_NAME:
        return placed[1]
    return getattr(leaf.region.value, "name", "") if isinstance(leaf.region, Constant) else ""


def choices(root: Node) -> Iterator[Node]:
    """The expression for each way to choose among options; nothing if there are too many."""
    indices = [leaf for leaf in leaves(root) if isinstance(leaf, Index)]
    if math.prod(len(leaf.weights) for leaf in indices) > LIMITS.told_choices:
        return
    for picked in itertools.product(*(range(len(leaf.weights)) for leaf in indices)):
        chosen = {leaf.identity: float(number) for leaf, number in zip(indices, picked, strict=True)}
        yield condition(root, {}, chosen)


def _interval(property_: str, node: Node) -> str:
    """The interval of each way to choose among options, or what holds them all."""
    bounds = sorted({scalar_bounds(option) for option in choices(node)}) or [scalar_bounds(node)]
    if len(bounds) > LIMITS.told_intervals:
        bounds = [scalar_bounds(node)]
    shown: list[str] = []
    for low, high in bounds:
        if (property_ == "heading" and not high - low < math.tau) or not (math.isfinite(low) or math.isfinite(high)):
            return ""
        turn = normalize(low) - low if property_ == "heading" else 0.0
        shown.append(f"{show_value(property_, low + turn)} to {show_value(property_, high + turn)}")
    return f"allowed: {' or '.join(shown)}"


def distance_off(constraint: Comparison, node: Node, observed: Value) -> float | None:
    """How far a value is from what is allowed, found by widening the one tolerance that matters.

    Args:
        constraint: The feature.
        node: What conditioning left of its expression.
        observed: The label's value.

    Returns:
        Metres, radians or the property's own unit; 0 where the value is allowed, None where no widening helps.
    """
    if not isinstance(observed, float | tuple):
        return None
    high = math.pi if constraint.property == "heading" else _FAR_M

    def reached(size: float) -> bool:
        wide = Tolerance(position=size, heading=size, other=size)
        return isinstance(decide_decomposed([(constraint, node, observed)], wide), Satisfied)

    return 0.0 if reached(0.0) else find_least(reached, [high], finest=_FINEST)
