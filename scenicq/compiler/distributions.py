"""Distributions (language paper, table 1, and those of later versions) and `resample`."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any, cast

from scenicq.compiler.coerce import to_scalar
from scenicq.compiler.random_values import make_choice, nothing_to_choose
from scenicq.compiler.values import Choice, ModelValue, describe, fail, is_node
from scenicq.errors import Span
from scenicq.forest.nodes import (
    Constant,
    DiscreteRange,
    Identity,
    Index,
    Node,
    Normal,
    PointIn,
    Range,
    Select,
    TruncatedNormal,
)
from scenicq.limits import LIMITS

__all__ = ["DISTRIBUTIONS", "interval", "uniform"]


def interval(low: ModelValue, high: ModelValue, span: Span) -> ModelValue:
    """`Range(low, high)`; a single value where both ends are the same known one."""
    ends = to_scalar(low, span), to_scalar(high, span)
    values = [_number(end) for end in ends]
    return ends[0] if values[0] is not None and values[0] == values[1] else Range(*ends, span=span)


def _number(node: Node) -> float | None:
    return node.value if isinstance(node, Constant) and isinstance(node.value, float) else None


def uniform(options: list[ModelValue], weights: list[float] | None, span: Span) -> ModelValue:
    """`Uniform(a, b, ...)` and `Discrete({a: weight, ...})`: options of positive weight.

    Raises:
        ScenarioError: map-lacks for no options at all, wrong-value for weights that are not.
    """
    if not options:
        raise nothing_to_choose(span)
    weights = weights or [1.0] * len(options)
    if len(weights) != len(options):
        raise fail("wrong-value", f"{len(options)} options need as many weights, not {len(weights)}", span)
    if any(not math.isfinite(weight) or weight < 0 for weight in weights):
        raise fail("wrong-value", "a weight must be a number that is not negative", span)
    kept = [(option, weight) for option, weight in zip(options, weights, strict=True) if weight > 0]
    if not kept:
        raise fail("wrong-value", "there is nothing to choose from", span, "no option of positive weight")
    if len(kept) == 1:
        return kept[0][0]
    index = Index(tuple(weight for _, weight in kept), span=span)
    return make_choice(index, [option for option, _ in kept], span)


def _uniform(span: Span, *options: ModelValue) -> ModelValue:
    return uniform(list(options), None, span)


def _weights(values: list[ModelValue], span: Span) -> list[float]:
    for value in values:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise fail("wrong-type", "a weight must be a known number", span, f"one is {describe(value)}")
    return [float(value) for value in values]


def _discrete(span: Span, options: ModelValue) -> ModelValue:
    if isinstance(options, dict):
        table = cast("dict[ModelValue, ModelValue]", options)
        return uniform(list(table), _weights(list(table.values()), span), span)
    if isinstance(options, list | tuple):
        return uniform(list(cast("list[ModelValue]", options)), None, span)
    raise fail("wrong-type", "a dictionary of options and weights is needed here", span,
               f"this is {describe(options)}", ("write `Discrete({option: weight, ...})`",))  # fmt: skip


def _range(span: Span, low: ModelValue, high: ModelValue) -> ModelValue:
    return interval(low, high, span)


def _deviation(node: Node, span: Span) -> float | None:
    value = _number(node)
    if value is not None and value < 0:
        raise fail("wrong-value", "a standard deviation cannot be negative", span)
    return value


def _normal(span: Span, mean: ModelValue, stdDev: ModelValue) -> ModelValue:  # noqa: N803 - Scenic's name
    middle, deviation = to_scalar(mean, span), to_scalar(stdDev, span)
    return middle if _deviation(deviation, span) == 0 else Normal(middle, deviation, span=span)


def _truncated_normal(
    span: Span,
    mean: ModelValue,
    stdDev: ModelValue,  # noqa: N803 - Scenic's name
    low: ModelValue,
    high: ModelValue,
) -> ModelValue:
    parts = tuple(to_scalar(value, span) for value in (mean, stdDev, low, high))
    ends = [_number(part) for part in parts[2:]]
    if ends[0] is not None and ends[1] is not None and ends[0] > ends[1]:
        raise fail(
            "wrong-value", "the interval of `TruncatedNormal` is empty", span, "the lower end is above the upper"
        )
    if _deviation(parts[1], span) == 0:
        raise fail("wrong-value", "`TruncatedNormal` needs a positive standard deviation", span)
    return TruncatedNormal(*parts, span=span)


def _discrete_range(
    span: Span,
    low: ModelValue,
    high: ModelValue,
    weights: ModelValue = None,
    emptyMessage: ModelValue = None,  # noqa: N803 - Scenic's name
) -> ModelValue:
    ends = [to_scalar(end, span) for end in (low, high)]
    values = [_number(end) for end in ends]
    if any(value is not None and value != math.floor(value) for value in values):
        raise fail("wrong-type", "`DiscreteRange` needs whole numbers", span)
    known = [int(value) for value in values if value is not None]
    if len(known) == 2 and known[0] > known[1]:
        raise fail("wrong-value", "this range of whole numbers is empty", span, "the lower end is above the upper")
    if weights is None:
        return ends[0] if values[0] is not None and values[0] == values[1] else DiscreteRange(*ends, span=span)
    if len(known) < 2 or not isinstance(weights, list | tuple) or known[1] - known[0] > LIMITS.value_items:
        raise fail("wrong-type", "`DiscreteRange` with weights needs known whole numbers and a list", span)
    numbers: list[ModelValue] = [float(n) for n in range(known[0], known[1] + 1)]
    return uniform(numbers, _weights(list(cast("list[ModelValue]", weights)), span), span)


def _resample(span: Span, value: ModelValue) -> ModelValue:
    """An independent sample of the same distribution; its parameters stay what they are."""
    match value:
        case Range() | Normal() | TruncatedNormal() | DiscreteRange() | PointIn():
            return replace(value, identity=Identity(), span=span)
        case Choice(index=Index() as index):
            return Choice(replace(index, identity=Identity(), span=span), value.options, value.size)
        case Select(index=Index() as index):
            return Select(replace(index, identity=Identity(), span=span), value.options, span=span)
        case _ if isinstance(value, Choice) or (is_node(value) and not isinstance(value, Constant)):
            raise fail("wrong-type", "`resample` needs a distribution, not what is computed from one", span,
                       "computed", ("resample the distributions that it is computed from",))  # fmt: skip
        case _:
            return value


DISTRIBUTIONS: dict[str, Callable[..., Any]] = {
    "Range": _range,
    "Normal": _normal,
    "TruncatedNormal": _truncated_normal,
    "DiscreteRange": _discrete_range,
    "Uniform": _uniform,
    "Discrete": _discrete,
    "Options": _discrete,
    "VerifaiRange": _range,
    "VerifaiDiscreteRange": _discrete_range,
    "VerifaiOptions": _discrete,
    "resample": _resample,
}
"""What programs call the distributions: takes the place of the call and its arguments."""
