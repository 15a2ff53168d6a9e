"""Where a model fails: shares missed by distance, class, visibility, parameters, and values of random variables."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from scenicq.evaluate.comparison import DISTANCES_M, Share, distance_names, share_of
from scenicq.evaluate.detection import Detection
from scenicq.evaluate.frame_split import FrameSplit
from scenicq.evaluate.resampling import LEVEL

__all__ = ["Slice", "slices"]

Bools = NDArray[np.bool_]
Numbers = NDArray[np.int64]
_Pair = Sequence[Any]

_PARTS = 5
"""Numbers are cut into so many parts, each with about as many frames."""
_LONGEST = 40
"""Characters of source text that are shown."""
_NAMES = 12
"""A parameter with more distinct texts than this makes no slices."""


@dataclass(frozen=True, slots=True)
class Slice:
    """A part of the objects in question.

    Attributes:
        by: What divides them.
        part: Which part.
        share: The share of the part's objects that was missed.
        other: The same among the other objects; None where that makes no sense.
        source: The program's text at the place `by` of a random variable; "" for anything else.
    """

    by: str
    part: str
    share: Share
    other: Share | None
    source: str = ""

    @property
    def title(self) -> str:
        """`by` for people: a random variable is shown as its source text with line and column."""
        place = _place(self.by)
        coordinate = self.by.removeprefix(place).strip()
        if not self.source:
            return self.by
        text = self.source if len(self.source) <= _LONGEST else f"{self.source[: _LONGEST - 3]}..."
        return f"{f'{coordinate} of ' if coordinate else ''}{text} ({':'.join(place.split(':')[-2:])})"


def slices(
    detection: Detection, matched: FrameSplit, missed: Bools, mine: Bools, others: Bools, cluster: Numbers
) -> tuple[Slice, ...]:
    """Make all slices with at least two parts; their intervals hold all together in 95 % (Bonferroni).

    Args:
        detection: Labels and predictions.
        matched: What the query found.
        missed: Whether each label object was missed, shape (objects,).
        mine: The objects in question.
        others: Those that they are compared with.
        cluster: Number of each object's cluster.
    """
    parts = list(_parts_of(detection, matched, mine))
    places = {by for by, _, _, others_too in parts if not others_too}
    level = 1 - (1 - LEVEL) / max(len(parts), 1)
    return tuple(
        Slice(
            by,
            name,
            share_of(missed, mine & of, cluster, level),
            share_of(missed, others & of, cluster, level) if others_too else None,
            matched.variables.get(_place(by).partition("#")[0], "") if by in places else "",
        )
        for by, name, of, others_too in parts
    )


def _parts_of(detection: Detection, matched: FrameSplit, mine: Bools) -> Iterator[tuple[str, str, Bools, bool]]:
    """Divide the objects in each way: what divides, a part's name, which objects are in it, and if others can be."""
    objects, frames = detection.objects, detection.frames
    recording = frames.recording[objects.frame].astype(np.int64)

    def told(
        by: str, names: Sequence[str], part: Numbers, *, others_too: bool = True
    ) -> Iterator[tuple[str, str, Bools, bool]]:
        """Make slices by the number of each object's part, -1 for none."""
        there = [number for number in range(len(names)) if (mine & (part == number)).any()]
        # a division that only tells recordings apart, as their names do, says nothing
        shared = any(len(np.unique(recording[mine & (part == number)])) > 1 for number in there)
        if len(there) > 1 and shared:
            for number in there:
                yield by, names[number], part == number, others_too

    distance = np.searchsorted(DISTANCES_M, detection.distance, side="right")
    yield from told("distance", distance_names(), distance)
    yield from told("class", detection.classes, detection.object_class.astype(np.int64))
    yield from told("visibility", objects.visibility, objects.visible.astype(np.int64))
    in_question = np.unique(objects.frame[mine])
    for name in sorted({name for params in frames.params for name in params}):
        values = [params.get(name) for params in frames.params]
        names, part = _parts(values, in_question)
        yield from told(f"param {name}", names, part[objects.frame])
    keys = {key for frame in in_question.tolist() for key in matched.witness.get(frame, {})}
    for key in sorted(keys):
        if key.startswith("<"):
            continue  # a variable of a library, which the author has not named
        for suffix, take in (("", _itself), (" x", _first), (" y", _second)):
            drawn = [None] * len(frames.names)
            for frame in in_question.tolist():
                drawn[frame] = take(matched.witness.get(frame, {}).get(key))
            names, part = _parts(drawn, in_question)
            yield from told(f"{key}{suffix}", names, part[objects.frame], others_too=False)


def _place(by: str) -> str:
    """The place of a random variable, without the coordinate that divides."""
    return by[:-2] if by.endswith((" x", " y")) else by


def _is_pair(value: Any) -> bool:
    return isinstance(value, list | tuple) and len(cast(_Pair, value)) == 2


def _itself(value: Any) -> Any:
    return None if isinstance(value, list | tuple) else value


def _first(value: Any) -> Any:
    return cast(_Pair, value)[0] if _is_pair(value) else None


def _second(value: Any) -> Any:
    return cast(_Pair, value)[1] if _is_pair(value) else None


def _parts(values: Sequence[Any], of: NDArray[np.int32]) -> tuple[list[str], Numbers]:
    """Divide values into parts: the parts' names, and the number of each value's part, -1 for none.

    Args:
        values: One a frame, None where there is none.
        of: The frames whose values are cut into parts of like size.
    """
    none = np.full(len(values), -1, dtype=np.int64)
    known = [values[number] for number in of.tolist() if values[number] is not None]
    if len(known) < 2:
        return [], none
    if all(isinstance(value, int | float) and not isinstance(value, bool) for value in known):
        return _cut(values, known, none)
    names = sorted({str(value) for value in known})
    if len(names) > _NAMES:
        return [], none
    numbers = {name: number for number, name in enumerate(names)}
    return names, np.array([numbers.get(str(value), -1) if value is not None else -1 for value in values])


def _cut(values: Sequence[Any], known: Sequence[float], none: Numbers) -> tuple[list[str], Numbers]:
    numbers = np.array(known, dtype=np.float64)
    ends = np.unique(np.quantile(numbers, np.linspace(0, 1, _PARTS + 1)))
    if len(ends) < 2:
        return [], none
    if len(np.unique(numbers)) <= _PARTS:
        ends = np.append(np.unique(numbers), math.inf)
        names = [f"{end:.4g}" for end in ends[:-1]]
    else:
        names = [f"{low:.4g} to {high:.4g}" for low, high in pairwise(ends.tolist())]
    part = none.copy()
    for place, value in enumerate(values):
        if isinstance(value, int | float) and ends[0] <= value <= ends[-1]:
            part[place] = min(int(np.searchsorted(ends, value, side="right")) - 1, len(names) - 1)
    return names, part
