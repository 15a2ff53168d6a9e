"""How often two models miss the same objects: a paired comparison, with what chance can do over clusters.

Both are judged on the same objects, so that only those tell that one of the two finds and the other does not.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenicq.evaluate.comparison import (
    MARGIN,
    MISSES,
    ShareComparison,
    clusters_to_tell,
    few_clusters,
    format_points,
    percent,
    share_of,
)
from scenicq.evaluate.resampling import (
    CLUSTERS,
    LEVEL,
    difference_interval,
    discordance_test,
    effective_number,
    sign_flip_test,
    student,
    sums_by,
)

__all__ = ["PairedComparison", "compare_pair"]

Bools = NDArray[np.bool_]
Numbers = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class PairedComparison(ShareComparison):
    """What one model misses of some objects, beside what another misses of the same ones.

    Attributes:
        scenario: Whose objects these are.
        model: The model in question.
        baseline: The other one.
        only_model: How many objects the model alone misses.
        only_baseline: How many the other alone misses.
    """

    scenario: str = ""
    model: str = ""
    baseline: str = ""
    only_model: int = 0
    only_baseline: int = 0

    @property
    def sentence(self) -> str:
        """All of it in one line."""
        if math.isnan(self.share.rate):
            return f"{self.about}: {self.model} and {self.baseline} have no object in common"
        told = format_points(self.difference, self.interval, " points")
        apart = "" if math.isnan(self.interval[0]) else f" ({told})"
        missed = f"{self.model} missed {percent(self.share)} of {self.about}, {self.baseline} {percent(self.other)}"
        return f"{missed}{apart}{self.conclude(self.baseline)}"


def compare_pair(
    about: str,
    missed: Bools,
    baseline: Bools,
    mine: Bools,
    cluster: Numbers,
    rng: np.random.Generator,
    *,
    margin: float = MARGIN,
    unit: str = "recording",
) -> PairedComparison:
    """Compare what two models miss of the same objects.

    Args:
        about: What the objects are.
        missed: Whether the model misses each object, shape (n,).
        baseline: Whether the other one does, shape (n,).
        mine: The objects in question, shape (n,).
        cluster: The cluster of each, shape (n,).
        rng: Source of randomness of the test.
        margin: What is missed more often by less than this counts as no worse.
        unit: What clusters are.
    """
    share, other = share_of(missed, mine, cluster), share_of(baseline, mine, cluster)
    of = sums_by(cluster, mine)
    number, clusters, effective = float(of.sum()), int((of > 0).sum()), effective_number(of)
    if not number:
        nothing = (math.nan, math.nan)
        missing = ("no object is in question",)
        return PairedComparison(
            about, share, other, math.nan, nothing, math.nan, 0, 0.0, missing, margin, unit
        )  # fmt: skip
    apart = sums_by(cluster, mine & missed) - sums_by(cluster, mine & baseline)
    difference = float(apart.sum()) / number
    only = int((mine & missed & ~baseline).sum()), int((mine & baseline & ~missed).sum())
    independent = (sum(only) / number - difference**2) / number
    spread = float(np.square(apart - difference * of).sum()) / number**2 * effective / max(effective - 1, 0.5)
    # clusters cannot show less than objects by themselves do, and few objects do not show how clusters differ
    design = max(1.0, spread / independent if independent > 0 else 1.0)
    if sum(only) / design < MISSES:
        design = max(design, number / effective)
    discordant = only[0] / design, only[1] / design
    missing = tuple(few_clusters(effective, unit))
    p_value = math.nan
    if not missing and sum(discordant) >= MISSES:
        p_value = max(discordance_test(*discordant), sign_flip_test(apart, rng))
    interval = (math.nan, math.nan)
    if effective >= CLUSTERS:
        numbers = (number / design, number / design)
        correlation = _correlation(mine, missed, baseline, design)
        interval = difference_interval(share.rate, other.rate, numbers, student(LEVEL, effective), correlation)
    needed = MISSES / sum(discordant) * effective if sum(only) else 0.0
    return PairedComparison(
        about=about,
        share=share,
        other=other,
        difference=difference,
        interval=interval,
        p_value=p_value,
        recordings=clusters,
        effective=effective,
        missing=missing,
        margin=margin,
        unit=unit,
        more=clusters_to_tell(design * independent, effective, clusters, needed) if sum(only) else None,
        only_model=only[0],
        only_baseline=only[1],
    )


def _correlation(mine: Bools, missed: Bools, baseline: Bools, design: float) -> float:
    """The correlation of the two shares, at effective numbers, with Newcombe's correction for few objects."""
    both, neither, first, second = (
        float(cell.sum()) / design
        for cell in (
            mine & missed & baseline,
            mine & ~missed & ~baseline,
            mine & missed & ~baseline,
            mine & baseline & ~missed,
        )
    )
    rows = (both + first) * (second + neither) * (both + second) * (first + neither)
    if not rows:
        return 0.0
    product = both * neither - first * second
    if product > 0:
        product = max(0.0, product - (both + neither + first + second) / 2)
    return product / math.sqrt(rows)
