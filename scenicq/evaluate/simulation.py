"""Compare simulated runs of a scenario with recordings."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scenicq.errors import DataError, Diagnostic
from scenicq.evaluate.comparison import ObjectComparison, Says, Share, percent
from scenicq.evaluate.resampling import ratio_interval

__all__ = ["Simulated", "read_simulated", "verdict"]

_WORDS = {"1": 1.0, "0": 0.0, "true": 1.0, "false": 0.0, "yes": 1.0, "no": 0.0}
_SAYS: Mapping[Says, str] = {"worse": "for", "better": "against", "no worse": "against", "too little": "too little"}


@dataclass(frozen=True, slots=True)
class Simulated:
    """A scenario in simulation and on recordings.

    Attributes:
        share: The share of the simulated runs that failed.
        about: What it was compared with on recordings, such as "role parkedCar".
        says: "for" the failure in reality, "against" it, or "too little".
        sentence: The same in words.
    """

    share: Share
    about: str
    says: str
    sentence: str


def read_simulated(path: Path) -> Mapping[str, Share]:
    """Read the failure rate of each scenario from a CSV file of runs.

    Args:
        path: With the columns `scenario`, and `failed` (1 or 0, true or false) or `score` (the share missed in that
            run, from 0 to 1).

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
    return {name: _share(np.array(values)) for name, values in runs.items()}


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


def _share(values: NDArray[np.float64]) -> Share:
    number, rate = float(len(values)), float(values.mean())
    return Share(float(values.sum()), number, rate, ratio_interval(values, np.ones(len(values))), number)


def verdict(share: Share, real: ObjectComparison) -> Simulated:
    """Say whether recordings bear out what was simulated.

    They speak for it where objects in question are missed more often than others that are alike (p < 0.05), against it
    where they are not missed more often by the margin: a low rate alone is no evidence.

    Args:
        share: The share of the simulated runs that failed.
        real: The comparison on recordings.
    """
    says = _SAYS[real.says]
    words = {
        "for": "the recordings speak for the failure",
        "against": "the recordings speak against the failure",
        "too little": "the recordings say too little",
    }[says]
    failed = f"failed in {percent(share)} of {share.of:g} simulated runs; "
    return Simulated(share, real.about, says, failed + f"{real.sentence}: {words}")
