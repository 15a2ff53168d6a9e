"""What predictions must be, whatever file they come from: numbers that make sense, and nothing twice."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenicq.errors import DataError, Diagnostic
from scenicq.importers.predictions import Predictions

__all__ = ["NEEDED", "check_predictions", "duplicate_error", "find_doubts"]

NEEDED = ("x", "y", "heading", "width", "length", "score")
"""Numbers that each box must have."""

_ALIKE_FRAMES = 3
"""So many frames with the very same boxes are no detector's."""
_NAMED = 3


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


def find_doubts(found: Predictions) -> Iterator[str]:
    """What makes a file look like a placeholder, and what the benchmark's own evaluation would refuse.

    Args:
        found: What has been read.
    """
    protocol = found.protocol
    if not len(found.frame):
        yield "there is no box at all: everything counts as missed"
        return
    if len(found.frame) > 1 and (found.score == found.score[0]).all():
        yield "all scores are the same: average precision says nothing"
    counts = np.bincount(found.frame, minlength=len(found.frames))
    filled = counts[counts > 0]
    if len(filled) >= _ALIKE_FRAMES and (filled == filled[0]).all():
        order = np.argsort(found.frame, kind="stable")
        columns = (found.x, found.y, found.heading, found.width, found.length, found.category)
        tables = [each[order].reshape(len(filled), -1) for each in columns]
        if all((table == table[0]).all() for table in tables):
            yield f"the same boxes are in all {len(filled)} frames that have any: this looks like a placeholder"
    if protocol.most and not protocol.most_of_class and (many := int((counts > protocol.most).sum())):
        yield (
            f"{many} samples have more than {protocol.most} boxes, which the benchmark refuses; those with the highest "
            "scores count here"
        )
    unknown = sorted(set(found.attributes) - protocol.attribute_names) if protocol.attribute_names else []
    if unknown:
        told = ", ".join(unknown[:_NAMED]) + (", ..." if len(unknown) > _NAMED else "")
        yield f"the benchmark knows no attributes called {told}, and refuses the file"
    if not found.has_meta:
        yield "`meta`, which says what the model uses, is missing: the benchmark refuses the file"
