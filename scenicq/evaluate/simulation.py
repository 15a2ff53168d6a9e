"""What a simulator has said of a scenario, beside what recordings say."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from scenicq.errors import DataError, Diagnostic
from scenicq.evaluate.comparison import ObjectComparison, Share
from scenicq.evaluate.resampling import rate_interval, resamples

__all__ = ["Simulated", "read_simulated", "verdict"]

_WORDS = {"1": 1.0, "0": 0.0, "true": 1.0, "false": 0.0, "yes": 1.0, "no": 0.0}
_RUNS = 100_000
"""Runs of a scenario that are resampled, at most; the mean of more is as good as normally distributed."""


@dataclass(frozen=True, slots=True)
class Simulated:
    """A scenario in simulation and on recordings.

    Attributes:
        share: Of the simulated runs that failed.
        about: What it was compared with on recordings, such as "role parkedCar".
        says: "for" the failure in reality, "against" it, or "too little".
        sentence: The same in words.
    """

    share: Share
    about: str
    says: str
    sentence: str


def read_simulated(path: Path, seed: int = 0) -> Mapping[str, Share]:
    """The failure rate of each scenario in a CSV file of runs.

    Args:
        path: With the columns `scenario`, and `failed` (1 or 0, true or false) or `score` (the share missed in that
            run, from 0 to 1).
        seed: Seed of the resamples.

    Raises:
        DataError: file-missing or file-invalid.
    """
    try:
        text = path.read_bytes().decode("utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise DataError(Diagnostic("file-missing", f"{path} cannot be read: {error}")) from None
    rows = csv.DictReader(io.StringIO(text, newline=""))
    names = rows.fieldnames or ()
    column = next((name for name in ("failed", "score") if name in names), None)
    if column is None or "scenario" not in names:
        raise _invalid(path, "it lacks the columns `scenario` and `failed` or `score`")
    runs: dict[str, list[float]] = {}
    try:
        for row in rows:
            value = _value((row[column] or "").strip().lower(), column)
            if value is None or not row["scenario"]:
                wrong = "scenario" if value is not None else column
                raise _invalid(path, f"line {rows.line_num}: `{wrong}` is `{row[wrong]}`")
            runs.setdefault(row["scenario"], []).append(value)
    except csv.Error as error:
        raise _invalid(path, f"line {rows.line_num}: {error}") from None
    return {name: _share(np.array(values), seed) for name, values in runs.items()}


def _invalid(path: Path, why: str) -> DataError:
    return DataError(Diagnostic("file-invalid", f"{path} holds no simulated runs: {why}"))


def _value(text: str, column: str) -> float | None:
    if column == "failed":
        return _WORDS.get(text)
    try:
        value = float(text)
    except ValueError:
        return None
    return value if 0 <= value <= 1 else None


def _share(values: NDArray[np.float64], seed: int) -> Share:
    number, rate = float(len(values)), float(values.mean())
    if number > _RUNS:
        reach = NormalDist().inv_cdf(0.975) * float(values.std()) / math.sqrt(number)
        return Share(float(values.sum()), number, rate, (max(0.0, rate - reach), min(1.0, rate + reach)))
    count = max(1, min(2000, 20_000_000 // len(values)))
    drawn = resamples(len(values), np.random.default_rng(seed), count) @ values / number
    return Share(float(values.sum()), number, rate, rate_interval(drawn, rate, number))


def verdict(share: Share, real: ObjectComparison) -> Simulated:
    """Whether recordings bear out what was simulated.

    They speak for it where objects in question are missed more often than others that are alike (p < 0.05), against it
    where they are not and are missed clearly less often than in simulation.

    Args:
        share: Of the simulated runs that failed.
        real: The comparison on recordings.
    """
    p_value = real.p_value if math.isnan(real.p_corrected) else real.p_corrected
    more = p_value < 0.05 and real.difference > 0
    less = real.share.interval[1] < share.interval[0]
    if real.few or math.isnan(real.difference) or not (more or less):
        says = "too little"
    else:
        says = "for" if more else "against"
    words = {
        "for": "the recordings speak for the failure",
        "against": "the recordings speak against the failure",
        "too little": "the recordings say too little",
    }[says]
    low, high = share.interval
    text = f"failed in {100 * share.rate:.0f} % [{100 * low:.0f}, {100 * high:.0f}] of {share.of:g} simulated runs; "
    return Simulated(share, real.about, says, text + f"{real.sentence}: {words}")
