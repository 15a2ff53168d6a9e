"""How often objects are missed: those in question against others that are alike, with what chance can do."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from statistics import NormalDist
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from scenicq.evaluate.controls import PLACES, Controls, Likeness, find_controls, number_of
from scenicq.evaluate.resampling import (
    CLUSTERS,
    LEVEL,
    Interval,
    count_test,
    difference_interval,
    effective_number,
    means_by,
    ratio_interval,
    sign_flip_test,
    student,
    sums_by,
)

__all__ = [
    "DISTANCES_M",
    "MARGIN",
    "MISSES",
    "Groups",
    "ObjectComparison",
    "Says",
    "Share",
    "ShareComparison",
    "clusters_to_tell",
    "compare",
    "distance_names",
    "few_clusters",
    "format_points",
    "p_text",
    "percent",
    "plural",
    "share_of",
]

Reals = NDArray[np.float64]
Numbers = NDArray[np.int64]
Bools = NDArray[np.bool_]
Says = Literal["worse", "better", "no worse", "too little"]

DISTANCES_M = (10.0, 20.0, 30.0, 50.0)
"""Ends of the classes of distance from the ego, for slices."""
MARGIN = 0.05
"""What is missed more often by less than this counts as no worse."""
_ALPHA = 0.05
_VERDICT = 6.0
"""Effective number of clusters below which no difference can be told: the flips of five have no p-value under 0.05."""
_OTHERS = 10.0
"""Effective number of others below which there is no verdict."""
MISSES = 5.0
"""Misses of both groups, at their effective numbers, below which there is no verdict."""
_ALONE = 0.5
"""Share of objects in question without others above which the rest does not speak for them."""
_PARTS = 5
_TOLD = 0.1
"""The difference for which it is said how many recordings would tell it."""
_POWER = 0.8


@dataclass(frozen=True, slots=True)
class Share:
    """A share of objects that were missed.

    Attributes:
        missed, of: How many; weighted, where the others are spread as the group is.
        rate: The share; nan without objects.
        interval: 95 % of such intervals hold the truth; nan where there are too few recordings for one.
        recordings: How many equally large clusters would tell as much.
    """

    missed: float
    of: float
    rate: float
    interval: Interval
    recordings: float = math.nan


@dataclass(frozen=True, slots=True)
class ShareComparison:
    """Two shares of objects that were missed, and what can be said of their difference.

    Attributes:
        about: What is compared, such as "role parkedCar".
        share: What is missed of the objects in question.
        other: The share that it is set beside.
        difference: The first rate less the second.
        interval: That of the difference.
        p_value: How probable as much is by chance, were both missed alike; nan where it cannot be tested.
        recordings: Clusters with an object in question that is compared.
        effective: Number of equally large clusters that would tell as much, of the group that has fewer.
        missing: What is missing for a verdict, in words; empty where there is one.
        margin: What is missed more often by less than this counts as no worse.
        unit: What clusters are, such as "recording".
        more: How many clusters more of this kind would tell a difference of ten points with 80 % power; None where
            nothing says how they differ.
        p_corrected: The same p-value, corrected for all tests of the evaluation.
    """

    about: str
    share: Share
    other: Share
    difference: float
    interval: Interval
    p_value: float
    recordings: int
    effective: float
    missing: tuple[str, ...] = ()
    margin: float = MARGIN
    unit: str = "recording"
    more: int | None = None
    p_corrected: float = math.nan

    @property
    def says(self) -> Says:
        """The verdict of the recordings on the objects in question."""
        if self.missing:
            return "too little"
        if self._chance < _ALPHA:
            return "worse" if self.difference > 0 else "better"
        return "no worse" if self.interval[1] < self.margin else "too little"

    @property
    def _chance(self) -> float:
        """The p-value that counts."""
        return self.p_value if math.isnan(self.p_corrected) else self.p_corrected

    @property
    def _range(self) -> str:
        """The interval of the difference in points, in words."""
        low, high = (100 * end for end in self.interval)
        return f"{low:+.0f} to {high:+.0f} points"

    @property
    def because(self) -> str:
        """Why there is no verdict; "" where there is one."""
        if self.says != "too little":
            return ""
        told = "; ".join(self.missing) or f"the difference may be anything from {self._range}"
        if not self.more:
            return told
        units = f"{self.more:,} more {plural(self.unit, self.more)} of this kind"
        return f"{told}; about {units} would tell a difference of {100 * _TOLD:g} points ({100 * _POWER:g} % power)"

    def conclude(self, whom: str) -> str:
        """The end of a sentence: what chance can do, and what is said.

        Args:
            whom: Whom the objects in question are set beside.
        """
        text = ""
        if not math.isnan(self.p_value):
            text += f"; {p_text(self.p_value)}"
            if not math.isnan(self.p_corrected) and self.p_corrected != self.p_value:
                text += f" (corrected {p_text(self.p_corrected)})"
        text += f" over {self.recordings} {plural(self.unit, self.recordings)}"
        told = {
            "worse": f"worse than {whom}",
            "better": f"better than {whom}",
            "no worse": f"no worse than {whom}, to {100 * self.margin:g} points",
            "too little": f"too little to tell: {self.because}",
        }
        return f"{text}: {told[self.says]}"


@dataclass(frozen=True, slots=True, eq=False)
class Groups:
    """Which objects are compared with which, by their numbers.

    Attributes:
        own: Objects in question that are compared, shape (n,).
        others: Those that they are set beside, shape (m,).
        weight: How much each other counts, 1 in all, shape (m,).
    """

    own: Numbers
    others: Numbers
    weight: Reals


@dataclass(frozen=True, slots=True)
class ObjectComparison(ShareComparison):
    """Objects in question against others.

    `share` is what is missed of the objects in question to which others are alike, or of all of them where none is;
    `other` what is missed of those others, spread as the objects in question are, and corrected for what distances
    still differ.

    Attributes:
        asked: How many objects are in question.
        alone: Share of them to which no other is alike.
        places: How many of the objects in question are set beside others of each of `PLACES`.
        uncounted: How many more objects would be in question, but for the rules of the benchmark.
        groups: Who is set beside whom; None where nobody is.
    """

    asked: int = 0
    alone: float = 0.0
    places: tuple[int, ...] = (0,) * len(PLACES)
    uncounted: int = 0
    groups: Groups | None = field(default=None, compare=False, repr=False)

    @property
    def beside(self) -> str:
        """Where the compared objects were found, in words."""
        without = [f"{self._without:,} without others"] if self._without else []
        return f"{self.about}: {', '.join([*self._places(), *without])}"

    @property
    def _without(self) -> int:
        """How many objects in question have no others beside them."""
        return self.asked - sum(self.places)

    def _places(self) -> list[str]:
        places = ("of the same frame", "of the same recording", f"of the same {self.unit}", "elsewhere")
        return [
            f"{number:,} beside others {place}" for number, place in zip(self.places, places, strict=True) if number
        ]

    def finding(self, undecided: int) -> str:
        """What was found, with what certainty, against which controls, and what was not looked at, in one sentence.

        Args:
            undecided: Frames of which nobody knows whether they match.
        """
        if math.isnan(self.share.rate):
            return self.sentence
        whom = "others that are alike"
        points = f"{100 * abs(self.difference):.0f} points"
        told = {
            "worse": f"missed {points} more often than {whom}",
            "better": f"missed {points} less often than {whom}",
            "no worse": f"missed no more often than {whom}, to {100 * self.margin:g} points",
            "too little": f"whether they are missed more often than {whom} cannot be told: {self.because}",
        }[self.says]
        certainty: list[str] = []
        if not math.isnan(self.interval[0]):
            certainty.append(f"95 % interval {self._range}")
        if not math.isnan(self.p_value):
            certainty.append(p_text(self._chance))
        certainty.append(f"{self.recordings} {plural(self.unit, self.recordings)}")
        left = [
            *([f"{self._without:,} of {self.asked:,} objects, to which no other is alike"] if self._without else []),
            *([f"{self.uncounted:,} that do not count by the rules of the benchmark"] if self.uncounted else []),
            *([f"{undecided:,} undecided frames"] if undecided else []),
        ]
        controls = f"; {', '.join(self._places())}" if sum(self.places) else ""
        rest = f"not looked at: {', '.join(left)}" if left else "nothing was left out"
        return f"{self.about}: {told} ({', '.join(certainty)}){controls}; {rest}"

    @property
    def sentence(self) -> str:
        """All of it in one line."""
        if math.isnan(self.share.rate):
            without = f"none of {self.uncounted} objects counts" if self.uncounted else "no object to be found"
            return f"{self.about}: {without}"
        text = f"missed {percent(self.share)} of {self.about}"
        if not math.isnan(self.other.rate):
            text += f" against {percent(self.other)}"
        return text + self.conclude("others that are alike")


def plural(what: str, number: int) -> str:
    """What so many things are called."""
    return what if number == 1 else f"{what}s"


def format_points(difference: float, interval: Interval, unit: str = "") -> str:
    """A difference of shares in points with its interval, if it has one."""
    low, high = (100 * end for end in interval)
    return f"{100 * difference:+.0f}{unit}" + ("" if math.isnan(low) else f" [{low:+.0f}, {high:+.0f}]")


def p_text(value: float) -> str:
    """A p-value as it stands in a sentence."""
    return "p < 0.001" if value < 0.001 else f"p = {value:.3f}"


def percent(share: Share) -> str:
    """A share with its interval, as it stands in a sentence."""
    if math.isnan(share.interval[0]):
        return f"{100 * share.rate:.0f} %"
    low, high = share.interval
    return f"{100 * share.rate:.0f} % [{100 * low:.0f}, {100 * high:.0f}]"


def distance_names() -> tuple[str, ...]:
    """Names of the classes of distance."""
    ends = [f"{end:g}" for end in DISTANCES_M]
    return (
        f"up to {ends[0]} m",
        *(f"{low} to {high} m" for low, high in pairwise(ends)),
        f"over {ends[-1]} m",
    )


def compare(
    about: str,
    missed: Bools,
    mine: Bools,
    others: Bools,
    like: Likeness,
    rng: np.random.Generator,
    *,
    margin: float = MARGIN,
    unit: str = "recording",
) -> ObjectComparison:
    """Compare two groups of objects.

    Args:
        about: What is compared.
        missed: Whether each object was missed, shape (n,).
        mine: The objects in question, shape (n,).
        others: Those that they are compared with, shape (n,).
        like: What makes objects alike.
        rng: Source of randomness of the test.
        margin: What is missed more often by less than this counts as no worse.
        unit: What clusters are.
    """
    found = find_controls(mine, others, like)
    if not found.compared.any():
        share = share_of(missed, mine, like.cluster)
        nothing = Share(0.0, 0.0, math.nan, (math.nan, math.nan))
        missing = ("no other object is alike",) if mine.any() else ("no object is in question",)
        recordings = len(np.unique(like.cluster[mine]))
        asked = int(mine.sum())
        return ObjectComparison(
            about, share, nothing, math.nan, (math.nan, math.nan), math.nan, recordings, 0.0, missing, margin, unit,
            asked=asked, alone=float(asked > 0), places=found.places,
        )  # fmt: skip
    return _compared(about, missed, found, int(mine.sum()), like, rng, margin, unit)


def _compared(
    about: str, missed: Bools, found: Controls, asked: int, like: Likeness, rng: np.random.Generator, margin: float,
    unit: str,
) -> ObjectComparison:  # fmt: skip
    lost = missed.astype(np.float64)
    count = int(like.cluster.max()) + 1

    def by_cluster(values: Reals | Bools) -> Reals:
        return sums_by(like.cluster, values, count)

    number, others = int(found.compared.sum()), np.flatnonzero(found.weight > 0)
    own = found.compared / number
    of, of_others = by_cluster(own), by_cluster(found.weight)
    first, difference = float(own @ lost), float(found.difference @ lost)
    second = min(max(first - difference, 0.0), 1.0)
    effective = min(effective_number(of), effective_number(of_others))
    parts = by_cluster(own * lost), by_cluster((own - found.difference) * lost)
    scale = effective / max(effective - 1, 0.5)
    spread = float(np.square(parts[0] - first * of - parts[1] + (first - difference) * of_others).sum()) * scale
    # as many objects of each group as would vary as much, were they independent
    numbers = tuple(1 / float(np.square(found.difference[which]).sum()) for which in (found.compared, ~found.compared))
    independent = first * (1 - first) / numbers[0] + second * (1 - second) / numbers[1]
    least = _spread_within(lost, found, like)
    design = max(least, spread) / independent if independent > 0 else max(1.0, number / effective)
    first_number, second_number = (each / design for each in numbers)
    misses = first * first_number + second * second_number
    needed = (_OTHERS / second_number * effective, MISSES / misses * effective if misses else 0.0)
    clusters = int((of > 0).sum())
    missing = tuple(_missing(1 - number / asked, effective, second_number, misses, unit))
    p_value = math.nan
    if not missing:
        # where others are of the same cluster, what is expected of both cancels
        expected = means_by(_alike(found, like), lost, np.abs(found.difference)) if found.elsewhere.any() else 0.0
        scores = by_cluster(found.difference * (lost - expected))
        counted = count_test(first, second, (first_number, second_number))
        p_value = max(counted, sign_flip_test(scores, rng))
    interval = (math.nan, math.nan)
    if effective >= CLUSTERS:
        interval = difference_interval(first, second, (first_number, second_number), student(LEVEL, effective))
    return ObjectComparison(
        about=about,
        share=Share(
            float(lost[found.compared].sum()),
            float(number),
            first,
            ratio_interval(by_cluster(found.compared * lost), by_cluster(found.compared), float(number)),
            effective_number(of),
        ),
        other=Share(
            float(lost[found.weight > 0].sum()),
            float((found.weight > 0).sum()),
            second,
            ratio_interval(np.clip(parts[1], 0.0, of_others), of_others, numbers[1]),
            effective_number(of_others),
        ),
        difference=difference,
        interval=interval,
        p_value=p_value,
        recordings=clusters,
        effective=effective,
        asked=asked,
        alone=1 - number / asked,
        missing=missing,
        places=found.places,
        groups=Groups(np.flatnonzero(found.compared), others, found.weight[others]),
        margin=margin,
        unit=unit,
        more=clusters_to_tell(design * independent, effective, clusters, *needed) if misses else None,
    )


def clusters_to_tell(variance: float, effective: float, clusters: int, *needed: float) -> int:
    """How many clusters more of this kind would tell a difference of ten points with 80 % power.

    Args:
        variance: That of the difference as it is.
        effective: The effective number of clusters.
        clusters: How many there are.
        needed: Effective numbers that other reasons ask for.
    """
    reach = sum(map(NormalDist().inv_cdf, ((1 + LEVEL) / 2, _POWER)))
    most = max(reach**2 * variance / _TOLD**2 * effective, _VERDICT, *needed)
    return max(0, math.ceil((most / effective - 1) * clusters))


def few_clusters(effective: float, unit: str) -> Iterator[str]:
    """What is missing for a verdict where clusters are too few."""
    if effective < _VERDICT:
        yield f"it is as much as {effective:.1f} equally large {unit}s would tell, and {_VERDICT:g} are needed"


def _missing(alone: float, effective: float, others: float, misses: float, unit: str) -> Iterator[str]:
    """What is missing for a verdict."""
    if alone > _ALONE:
        yield f"{100 * alone:.0f} % have no other object that is alike"
    yield from few_clusters(effective, unit)
    if others < _OTHERS:
        yield f"the others tell as much as {others:.1f} independent ones would, and {_OTHERS:g} are needed"
    elif misses < MISSES:
        yield f"{misses:.1f} independent misses, and {MISSES:g} are needed"


def _alike(found: Controls, like: Likeness) -> Numbers:
    """The number of a group of objects that are alike, those of both groups together, shape (n,)."""
    ends = np.unique(np.quantile(like.distance[found.compared], np.linspace(0, 1, _PARTS + 1)[1:-1]))
    return number_of((like.kind, like.params, np.searchsorted(ends, like.distance).astype(np.int64)))


def _spread_within(lost: Reals, found: Controls, like: Likeness) -> float:
    """The variance of the difference if each object were missed by itself, at the rate of those that are alike.

    Clusters cannot show less: what they show of few misses is chance.
    """
    group = number_of((_alike(found, like), found.compared.astype(np.int64)))
    weight = np.square(found.difference)
    rate = means_by(group, lost, weight)
    used = (weight > 0).astype(np.float64)
    count = sums_by(group, used)[group]
    return float(weight @ (rate * (1 - rate) * count / np.maximum(count - 1, 1)))


def share_of(missed: Bools, mine: Bools, cluster: Numbers, level: float = LEVEL) -> Share:
    """The share missed of one group; arguments as of `compare`."""
    of, lost = sums_by(cluster, mine), sums_by(cluster, missed & mine)
    total = float(of.sum())
    rate = float(lost.sum()) / total if total else math.nan
    return Share(float(lost.sum()), total, rate, ratio_interval(lost, of, total, level), effective_number(of))
