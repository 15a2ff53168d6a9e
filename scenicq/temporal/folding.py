"""Values of nested things from the inside out, however deep they are nested."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from typing import TypeVar

__all__ = ["fold_value"]

K = TypeVar("K", bound=Hashable)
V = TypeVar("V")


def fold_value(root: K, below: Callable[[K], Sequence[K]], combine: Callable[[K, list[V]], V]) -> V:
    """The value of something that is made of others.

    Args:
        root: The whole.
        below: What something is made of.
        combine: The value of something, given the values of what it is made of.
    """
    values: dict[K, V] = {}
    stack = [root]
    while stack:
        each = stack[-1]
        waiting = [part for part in below(each) if part not in values]
        if waiting and each not in values:
            stack += waiting
        else:
            stack.pop()
            if each not in values:
                values[each] = combine(each, [values[part] for part in below(each)])
    return values[root]
