"""Columns out of parsed JSON that nobody has checked: fast, and only where everything is sound.

Whatever is unsound, or unusual enough that a reader of single records might see it differently, is `UnusualError`; the
caller then reads record by record, which tells what is wrong. Sound numbers become what `float` makes of them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import chain, repeat
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from scenicq.store.wkb import FARTHEST_M

__all__ = ["UNUSUAL", "UnusualError", "are", "column", "demand", "reals", "vectors"]

_GET = cast("Callable[[dict[str, Any], str], Any]", dict[str, Any].get)


class UnusualError(Exception):
    """The columns cannot be made here."""


UNUSUAL = (UnusualError, OverflowError, TypeError, ValueError)
"""What making columns of unsound records raises."""


def demand(sound: bool) -> None:
    """Go on only with what is sound.

    Raises:
        UnusualError: It is not.
    """
    if not sound:
        raise UnusualError


def column(entries: Sequence[dict[str, Any]], key: str) -> list[Any]:
    """The values of a key, None where an entry lacks it; not as a comprehension, which takes twice as long.

    Raises:
        TypeError: An entry is no object.
    """
    return list(map(_GET, entries, repeat(key)))


def are(values: Sequence[Any], *types: type) -> bool:
    """Whether the values are exactly of some types."""
    return set(map(type, values)).issubset(types)


def reals(values: list[Any]) -> NDArray[np.float64]:
    """Finite numbers, shape (n,).

    Raises:
        UnusualError: A value is none.
        OverflowError: A value is too large.
    """
    demand(are(values, float, int))
    found = np.array(values, dtype=np.float64)
    demand(bool(np.isfinite(found).all()))
    return found


def vectors(values: Sequence[Any], size: int) -> NDArray[np.float64]:
    """Lists of `size` finite numbers, shape (n, size).

    Raises:
        UnusualError: A value is none.
        OverflowError: A number is too large.
    """
    demand(are(values, list) and set(map(len, values)) <= {size})
    found = reals(list(chain.from_iterable(values))).reshape(-1, size)
    demand(bool((np.abs(found) <= FARTHEST_M).all()))
    return found
