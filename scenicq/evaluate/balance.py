"""How similar two compared groups are: their shares by distance and the like, and how far their means are apart.

What objects are matched by is alike by construction; what they are not matched by may differ, and a reader has to see
it (Austin 2009, "Balance diagnostics for comparing the distribution of baseline covariates between treatment groups
in propensity-score matched samples").
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenicq.evaluate.comparison import ObjectComparison
from scenicq.evaluate.detection import Detection

__all__ = ["Balance", "Covariate", "balance"]

Reals = NDArray[np.float64]
Numbers = NDArray[np.int64]

_STEP_M = 5.0
"""Width of the classes of distance, or a multiple of it where they would be too many."""
_PARTS = 12
"""More parts than this are not shown one by one."""
_REST = "all others"


@dataclass(frozen=True, slots=True)
class Covariate:
    """What objects may differ in.

    Attributes:
        by: Its name.
        parts: Each value, or class of values, with the share of the objects in question and that of the others.
        common: How much of either group the other has, too: 1 where both are spread alike.
        means: The means of both groups; nan where it is no number.
        apart: The difference of the means in standard deviations; nan of what is no number, or does not vary.
    """

    by: str
    parts: tuple[tuple[str, float, float], ...]
    common: float
    means: tuple[float, float] = (math.nan, math.nan)
    apart: float = math.nan


@dataclass(frozen=True, slots=True)
class Balance:
    """How alike the objects in question and those beside them are.

    Attributes:
        about: What is compared, such as "role parkedCar".
        covariates: The distance, the recordings, and the parameters that tell kinds of frames apart.
    """

    about: str
    covariates: tuple[Covariate, ...]


def balance(
    compared: ObjectComparison, detection: Detection, parameters: Mapping[str, tuple[Sequence[str], Numbers]]
) -> Balance | None:
    """How similar the two groups are; None where nothing is compared.

    Args:
        compared: The comparison, whose groups are numbers of label objects.
        detection: The label objects.
        parameters: Those that tell kinds of frames apart; see `parameters_of`.
    """
    groups = compared.groups
    if groups is None:
        return None
    frames, objects = detection.frames, detection.objects

    def shares(part: Numbers, count: int) -> tuple[Reals, Reals]:
        own = np.bincount(part[groups.own], minlength=count) / len(groups.own)
        return own, np.bincount(part[groups.others], groups.weight, minlength=count) / groups.weight.sum()

    def told() -> Iterator[Covariate]:
        distance = detection.distance
        names, part = _distances(distance, float(distance[np.concatenate((groups.own, groups.others))].max()))
        means, apart = _means(distance[groups.own], distance[groups.others], groups.weight)
        yield _covariate("distance", names, shares(part, len(names)), means, apart)
        recording = frames.recording[objects.frame].astype(np.int64)
        yield _covariate("recording", frames.recordings, shares(recording, len(frames.recordings)))
        for name, (values, number) in parameters.items():
            yield _covariate(f"param {name}", values, shares(number[objects.frame], len(values)))

    return Balance(compared.about, tuple(told()))


def _distances(distance: Reals, farthest: float) -> tuple[list[str], Numbers]:
    """Classes of distances up to the farthest, with the class of each."""
    step = _STEP_M * max(1, math.ceil(farthest / (_STEP_M * _PARTS)))
    count = math.floor(farthest / step) + 1
    names = [f"{step * number:g} to {step * (number + 1):g} m" for number in range(count)]
    return names, np.minimum(distance // step, count - 1).astype(np.int64)


def _means(own: Reals, others: Reals, weight: Reals) -> tuple[tuple[float, float], float]:
    """The means of both groups, and how many standard deviations lie between them."""
    first, second = float(own.mean()), float(np.average(others, weights=weight))
    spread = (float(own.var()) + float(np.average(np.square(others - second), weights=weight))) / 2
    return (first, second), (first - second) / math.sqrt(spread) if spread > 0 else math.nan


def _covariate(
    by: str, names: Sequence[str], shares: tuple[Reals, Reals], means: tuple[float, float] = (math.nan, math.nan),
    apart: float = math.nan,
) -> Covariate:  # fmt: skip
    own, others = shares
    there = np.flatnonzero((own > 0) | (others > 0))
    shown, rest = there, there[:0]
    if len(there) > _PARTS:
        # the parts with the most objects in question, in their order
        order = there[np.lexsort((there, -own[there]))]
        shown, rest = np.sort(order[: _PARTS - 1]), order[_PARTS - 1 :]
    parts = [(names[number], float(own[number]), float(others[number])) for number in shown.tolist()]
    if len(rest):
        parts.append((_REST, float(own[rest].sum()), float(others[rest].sum())))
    return Covariate(by, tuple(parts), float(np.minimum(own, others).sum()), means, apart)
