"""Terms and comparisons to decide, built by hand."""

from __future__ import annotations

from scenicq.forest import build
from scenicq.forest.groups import Comparison
from scenicq.forest.nodes import Range
from scenicq.match.tolerance import EXACT


def c(value):
    return build.constant(value)


def between(low, high):
    return Range(c(low), c(high))


def compared(property_, node, observed):
    return (Comparison(1, property_, node, None), node, observed)


DEFAULT = EXACT
