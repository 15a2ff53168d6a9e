"""Sums of a known part and ranges, as functions of what one label observes or of columns of many."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import TypeAlias, cast

import numpy as np
from numpy.typing import NDArray

from scenicq.forest.nodes import DirectionAt, Identity, Value
from scenicq.limits import LIMITS

__all__ = [
    "Columns",
    "CompiledVector",
    "Exact",
    "FloatColumn",
    "Form",
    "Lookup",
    "Scalar",
    "by_option",
    "clip",
    "cos_sin",
    "spread",
]

Lookup: TypeAlias = Callable[[int, str], Value]
"""The observed value of an object's property."""
FloatColumn: TypeAlias = NDArray[np.float64]
"""A number of each of many labels; a vector is a pair of columns."""
Exact: TypeAlias = Callable[[Lookup], "float | tuple[float, float]"]
Scalar: TypeAlias = Callable[[Lookup], float]
CompiledVector: TypeAlias = Callable[[Lookup], "tuple[float, float]"]


class Columns:
    """The observed values of many labels at once, in place of a `Lookup`: formulas of it give columns.

    Every step is what it is for one label, bit by bit: NumPy adds, subtracts, multiplies and divides; the functions
    that it computes in a way of its own are applied one by one.
    """

    def __init__(self, size: int, column: Callable[[int, str], FloatColumn | tuple[FloatColumn, FloatColumn]]) -> None:
        """Take what makes the columns.

        Args:
            size: Labels.
            column: The values of an object's property; `CannotEvaluate` where they are neither numbers nor vectors.
        """
        self.size = size
        self._column = functools.cache(column)

    def __call__(self, index: int, name: str) -> Value:
        """The column, passed off as a value."""
        return cast(Value, self._column(index, name))

    def some(self, which: NDArray[np.intp]) -> Columns:
        """Select some of the labels, by their numbers."""

        def column(index: int, name: str) -> FloatColumn | tuple[FloatColumn, FloatColumn]:
            found = self._column(index, name)
            return (found[0][which], found[1][which]) if isinstance(found, tuple) else found[which]

        return Columns(len(which), column)


def by_option(number: Scalar, get: Lookup, size: int) -> Iterator[tuple[int, NDArray[np.intp]]]:
    """The options that a number picks for labels, each with the numbers of those labels.

    Args:
        number: The number of an option.
        get: What is observed.
        size: Labels.
    """
    meant = np.rint(np.broadcast_to(np.asarray(number(get)), size)).astype(np.intp)
    for option in cast("list[int]", np.unique(meant).tolist()):
        yield option, np.flatnonzero(meant == option)


def cos_sin(angle: float) -> tuple[float, float]:
    """Cosine and sine; of a column, columns."""
    if isinstance(angle, np.ndarray):
        angles: list[float] = angle.tolist()
        return cast("tuple[float, float]", (np.array([*map(math.cos, angles)]), np.array([*map(math.sin, angles)])))
    return math.cos(angle), math.sin(angle)


def clip(value: float, low: float, high: float) -> float:
    """The value, or the end that it is beyond; of columns, a column."""
    if isinstance(value, np.ndarray):
        raised = np.where(np.greater(low, value), low, value)
        return cast(float, np.where(np.less(high, raised), high, raised))
    raised = low if low > value else value
    return high if high < raised else raised


@dataclass(frozen=True, slots=True, eq=False)
class Form:
    """A scalar: a known part, plus directions of fields, plus ranges times known factors.

    Attributes:
        parts: Functions with factors, and a constant; their sum is the known part.
        constant: See there.
        terms: For each random variable its factor and its ends; one of them may be unbounded.
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

    def known(self, get: Lookup) -> float:
        """The known part."""
        total = self.constant
        for factor, part in self.parts:
            total += factor * part(get)
        return total

    def plus(self, other: Form) -> Form | None:
        """The sum; None if a variable occurs in both, or both are unbounded."""
        if self.terms.keys() & other.terms.keys() or (self.unbounded and other.unbounded):
            return None
        if len(self.parts) + len(other.parts) > LIMITS.closed_form_terms:
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
    def unbounded(self) -> bool:
        """Whether one of its variables is."""
        return math.isinf(self.high - self.low)

    @property
    def number(self) -> float | None:
        """Its value, if it is a number."""
        return None if self.parts or self.terms or self.fields else self.constant


def spread(form: Form, value: float) -> dict[Identity, Value]:
    """Values of a form's variables for which its random part has a value between its ends; of a column, columns."""
    if not form.terms:
        return {}
    if len(form.terms) == 1:
        ((identity, (factor, low, high)),) = form.terms.items()
        return {identity: clip(value / factor, low, high)}
    if form.unbounded:
        # the unbounded one takes what the middles of the others leave
        return _with_rest(form, value)
    share = 0.5 if form.high == form.low else clip((value - form.low) / (form.high - form.low), 0.0, 1.0)
    return {
        identity: low + share * (high - low) if factor > 0 else high - share * (high - low)
        for identity, (factor, low, high) in form.terms.items()
    }


def _with_rest(form: Form, value: float) -> dict[Identity, Value]:
    middles = {
        identity: (low + high) / 2 for identity, (_, low, high) in form.terms.items() if math.isfinite(high - low)
    }
    rest = value - math.fsum(form.terms[identity][0] * middle for identity, middle in middles.items())
    return {
        identity: middles[identity] if identity in middles else rest / factor
        for identity, (factor, _, _) in form.terms.items()
    }
