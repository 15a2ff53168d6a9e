"""Temporal formulas on finite traces, for every first and many last samples at once.

The value of a formula at sample k of a trace that ends with sample j hangs on k and j alone, so it is one number of an
array with a row for each k and a column for each j. Operators of time are running minima and maxima along the rows,
from the last to the first. Values are three (`truth`): what is missing of an atom makes unknown only what hangs on it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import assert_never

import numpy as np
from numpy.typing import NDArray

from scenicq.forest.temporal import Always, And, Atom, Eventually, Formula, Next, Not, Or, Until, operands
from scenicq.temporal.folding import folded
from scenicq.temporal.truth import FALSE, TRUE, Truth, negated

__all__ = ["evaluate"]


def evaluate(formula: Formula, atom: Callable[[Atom], Truth], ends: NDArray[np.intp]) -> Truth:
    """The value of a formula on the traces from each sample to each of some last samples.

    Args:
        formula: The formula.
        atom: The value of an atom at each sample, shape (n,).
        ends: Numbers of last samples, shape (m,).

    Returns:
        Shape (n, m): row k, column c for the trace of the samples k to ends[c]; where that is empty, of no meaning.
    """
    return folded(formula, operands, lambda node, parts: _value(node, parts, atom, ends))


def _value(node: Formula, parts: list[Truth], atom: Callable[[Atom], Truth], ends: NDArray[np.intp]) -> Truth:
    match node:
        case Atom():
            return np.repeat(atom(node)[:, None], len(ends), axis=1)
        case Not():
            return negated(parts[0])
        case And():
            return np.minimum.reduce(parts)
        case Or():
            return np.maximum.reduce(parts)
        case Always():
            return _onwards(np.minimum, np.where(_beyond(parts[0], ends), TRUE, parts[0]))
        case Eventually():
            return _onwards(np.maximum, np.where(_beyond(parts[0], ends), FALSE, parts[0]))
        case Next():
            following = np.full_like(parts[0], FALSE)
            following[:-1] = np.where(_beyond(parts[0], ends)[1:], FALSE, parts[0][1:])
            return following
        case Until():
            left, right = parts
            right = np.where(_beyond(right, ends), FALSE, right)
            found = np.empty_like(right)
            later = np.zeros_like(right[0])
            for k in range(len(right) - 1, -1, -1):
                later = np.maximum(right[k], np.minimum(left[k], later))
                found[k] = later
            return found
        case _:
            assert_never(node)


def _beyond(values: Truth, ends: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Which samples lie behind the end of the trace."""
    return np.arange(len(values))[:, None] > ends


def _onwards(combine: np.ufunc, values: Truth) -> Truth:
    """What each value makes together with all later ones."""
    return combine.accumulate(values[::-1], axis=0)[::-1]
