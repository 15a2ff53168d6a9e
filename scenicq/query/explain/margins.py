"""What a matching label shows of each feature and requirement, and how much is left until it would not match.

Every feature is told with the label's value, what the program allows and the way to the nearer end of it; every
requirement with the values of its sides, in the words of the program.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from scenicq.errors import CannotEvaluate, Span
from scenicq.forest.bounds import scalar_bounds
from scenicq.forest.groups import Comparison, Condition
from scenicq.forest.nodes import Constant, Identity, Node, Value
from scenicq.geometry.angles import normalize
from scenicq.limits import LIMITS
from scenicq.match.explanation import Item, LabelSearch, MatchPlan, Satisfied, describe_constraint, show_value
from scenicq.match.matcher import Matcher
from scenicq.query.explain.sides import amount, sides
from scenicq.query.explain.violations import allowed_values, choices, distance_off

__all__ = ["SatisfiedConstraint", "margins"]

_ROUNDING = 1e-3


@dataclass(frozen=True, slots=True)
class SatisfiedConstraint:
    """A feature or requirement that a label satisfies.

    Attributes:
        what: The feature or requirement, in the words of the program.
        value: What the label shows.
        allowed: What the program allows; empty where that cannot be said in a few words.
        spare: In words: how far inside the value is ("to spare"), or how far outside; may be empty.
        span: Where the program says it.
    """

    what: str
    value: str
    allowed: str
    spare: str
    span: Span | None


def margins(
    matcher: Matcher, attempt: LabelSearch, plan: MatchPlan, assignment: Mapping[int, int]
) -> tuple[SatisfiedConstraint, ...]:
    """What a label shows of each feature and requirement under a correspondence by which it matches.

    Args:
        matcher: The matcher.
        attempt: The label.
        plan: The scenario's groups.
        assignment: The correspondence.
    """
    found: list[SatisfiedConstraint] = []
    for each in plan.groups:
        outcome = attempt.decide(each, assignment)
        if not isinstance(outcome, Satisfied) or len(found) >= LIMITS.told_margins:
            continue
        try:
            items = attempt.items(each.group, assignment)
        except CannotEvaluate:
            continue
        for item in items:
            if isinstance(item[0], Comparison):
                found.append(_of_feature(matcher, item))
            elif item[0].requirement.built_in is None:
                found += _of_requirement(matcher, attempt, item[0], assignment, outcome.values)
    return tuple(sorted(found, key=lambda margin: margin.span.start if margin.span is not None else -1))


def _of_feature(matcher: Matcher, item: Item) -> SatisfiedConstraint:
    constraint, node, observed = item
    assert isinstance(constraint, Comparison)
    what, shown = describe_constraint(matcher.scenario, constraint), show_value(constraint.property, observed)
    allowed = allowed_values(constraint, node, observed)
    off = distance_off(constraint, node, observed)
    if off is not None and off > _ROUNDING:
        unit = _unit(constraint.property, observed)
        return SatisfiedConstraint(what, shown, allowed, f"{amount(off, unit)} off, within tolerance", constraint.span)
    spare = None
    if isinstance(observed, float) and not isinstance(node, Constant):
        spare = _inside(constraint.property, node, observed)
    unit = _unit(constraint.property, observed)
    return SatisfiedConstraint(
        what, shown, allowed, "" if spare is None else f"{amount(spare, unit)} to spare", constraint.span
    )


def _unit(property_: str, value: Value) -> str:
    return "deg" if property_ in ("heading", "viewAngle") else "m" if isinstance(value, tuple) else ""


def _inside(property_: str, node: Node, observed: float) -> float | None:
    """The way to the nearer end of the interval that the value lies in; None where it has no end."""
    found: list[float] = []
    for option in list(choices(node)) or [node]:
        low, high = scalar_bounds(option)
        value = observed
        if property_ == "heading":
            if high - low >= math.tau:
                continue
            middle = (low + high) / 2
            value = middle + normalize(observed - middle)
        if low <= value <= high:
            found.append(min(value - low, high - value))
    best = max(found, default=None)
    return None if best is None or math.isinf(best) else best


def _of_requirement(
    matcher: Matcher,
    attempt: LabelSearch,
    constraint: Condition,
    assignment: Mapping[int, int],
    values: Mapping[Identity, Value],
) -> Iterator[SatisfiedConstraint]:
    what = describe_constraint(matcher.scenario, constraint)
    told = list(sides(attempt, constraint, assignment, values))
    true = [each for each in told if each.true]
    if not true:
        yield SatisfiedConstraint(what, "holds", "", "", constraint.span)
    for each in true:
        part = what if len(true) == 1 and len(told) == 1 else each.text
        yield SatisfiedConstraint(part, each.values, "", f"{amount(each.apart, each.unit)} to spare", constraint.span)
