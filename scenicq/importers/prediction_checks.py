"""What predictions must be, whatever file they come from: numbers that make sense, and nothing twice."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenicq.errors import DataError, Diagnostic
from scenicq.importers.predictions import Predictions

__all__ = ["NEEDED", "check_predictions", "duplicate_error"]

NEEDED = ("x", "y", "heading", "width", "length", "score")
"""Numbers that each box must have."""


def duplicate_error(name: str, what: str) -> DataError:
    """What is said where something is there more than once."""
    return DataError(Diagnostic("predictions-duplicate", f"{name}: {what}"))


def check_predictions(found: Predictions) -> None:
    """Refuse what is there twice or makes no sense.

    Raises:
        DataError: predictions-invalid; predictions-duplicate.
    """
    if len(set(found.frames)) < len(found.frames):
        seen: set[str] = set()
        twice = next(name for name in found.frames if name in seen or seen.add(name))
        raise duplicate_error(found.name, f"frame {twice} is there more than once")
    for name in NEEDED:
        values: NDArray[np.float64] = getattr(found, name)
        wrong = ~np.isfinite(values)
        if name in ("width", "length"):
            wrong |= values <= 0
        if wrong.any():
            first = int(np.argmax(wrong))
            count = int(wrong.sum())
            told = "a box" if count == 1 else f"{count} boxes"
            where = f"{'in' if count == 1 else 'the first in'} frame {found.frames[found.frame[first]]}"
            message = f"{found.name}: {told} whose `{name}` makes no sense, {where}: {values[first]:g}"
            raise DataError(Diagnostic("predictions-invalid", message))
    # equal boxes lie together when sorted by all that tells them apart
    order = np.lexsort((found.y, found.x, found.category, found.frame))
    same = np.ones(max(len(order) - 1, 0), dtype=np.bool_)
    compared: tuple[NDArray[Any], ...] = (
        found.frame,
        found.category,
        found.x,
        found.y,
        found.heading,
        found.width,
        found.score,
    )
    for each in compared:
        ordered = each[order]
        same &= ordered[1:] == ordered[:-1]
    if same.any():
        box = int(order[int(np.argmax(same))])
        where = f"the first a {found.classes[found.category[box]]} in frame {found.frames[found.frame[box]]}"
        raise duplicate_error(found.name, f"boxes are there more than once: {int(same.sum())}, {where}")
