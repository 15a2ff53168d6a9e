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
from scenicq.evaluate.paired_runs import PairedRuns
from scenicq.evaluate.resampling import ratio_interval

__all__ = ["SimulatedRuns", "SimulationComparison", "read_simulated", "verdict"]

_WORDS = {"1": 1.0, "0": 0.0, "true": 1.0, "false": 0.0, "yes": 1.0, "no": 0.0}
_SAYS: Mapping[Says, str] = {"worse": "for", "better": "against", "no worse": "against", "too little": "too little"}


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedRuns:
    """The simulated runs of one scenario.

    Attributes:
        failed: Whether each run failed, or the share missed in it; 0 to 1, shape (n,).
        rebuilt: The recording or frame that each run rebuilds; "" where it says none.
    """

    failed: NDArray[np.float64]
    rebuilt: tuple[str, ...]

    @property
    def share(self) -> Share:
        """How many failed."""
        number = float(len(self.failed))
        interval = ratio_interval(self.failed, np.ones(len(self.failed)))
        return Share(float(self.failed.sum()), number, float(self.failed.mean()), interval, number)


@dataclass(frozen=True, slots=True)
class SimulationComparison:
    """A scenario in simulation and on recordings.

    Attributes:
        share: The share of the simulated runs that failed.
        about: What it was compared with on recordings, such as "role parkedCar".
        says: "for" the failure in reality, "against" it, or "too little".
        sentence: The same in words.
        paired: The runs beside the recordings that they rebuild; None where none says which.
    """

    share: Share
    about: str
    says: str
    sentence: str
    paired: PairedRuns | None = None


def read_simulated(path: Path) -> Mapping[str, SimulatedRuns]:
    """Read the runs of each scenario from a CSV file.

    Args:
        path: With the columns `scenario`, and `failed` (1 or 0, true or false) or `score` (the share missed in that
            run, from 0 to 1); perhaps `recording` or `frame`, which a run rebuilds.

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
    scene = next((name for name in ("recording", "frame") if name in names), None)
    runs: dict[str, list[tuple[float, str]]] = {}
    try:
        for row in rows:
            value = _value((row[column] or "").strip().lower(), column)
            if value is None or not row["scenario"]:
                wrong = "scenario" if value is not None else column
                raise _invalid(path, f"line {rows.line_num}: `{wrong}` is `{row[wrong]}`")
            rebuilt = (row[scene] or "").strip() if scene is not None else ""
            runs.setdefault(row["scenario"], []).append((value, rebuilt))
    except csv.Error as error:
        raise _invalid(path, f"line {rows.line_num}: {error}") from None
    return {
        name: SimulatedRuns(np.array([value for value, _ in some]), tuple(rebuilt for _, rebuilt in some))
        for name, some in runs.items()
    }


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


def verdict(runs: SimulatedRuns, real: ObjectComparison, paired: PairedRuns | None) -> SimulationComparison:
    """Say whether recordings bear out what was simulated.

    They speak for it where objects in question are missed more often than others that are alike (p < 0.05), against it
    where they are not missed more often by the margin: a low rate alone is no evidence.

    Args:
        runs: The simulated runs.
        real: The comparison on recordings.
        paired: Runs beside the recordings that they rebuild.
    """
    says = _SAYS[real.says]
    words = {
        "for": "the recordings speak for the failure",
        "against": "the recordings speak against the failure",
        "too little": "the recordings say too little",
    }[says]
    share = runs.share
    failed = f"failed in {percent(share)} of {share.of:g} simulated runs; "
    beside = "" if paired is None else f"; {paired.sentence}"
    return SimulationComparison(share, real.about, says, f"{failed}{real.sentence}: {words}{beside}", paired)
