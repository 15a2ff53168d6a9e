"""A benchmark's own figures for a model as a whole: means over its classes, and its score.

nuScenes' NDS is that of Caesar et al., *nuScenes: a multimodal dataset for autonomous driving*, 2020, section 3.1;
Argoverse's CDS that of Wilson et al., *Argoverse 2*, 2021. Both are over all frames, whatever a scenario matches, so
that they compare with published figures.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenicq.evaluate.classes import ClassFigures, class_figures
from scenicq.evaluate.detection import Detection
from scenicq.importers.predictions import Protocol

__all__ = ["BenchmarkFigures", "benchmark_figures"]

_OF_NDS = 5
"""How often the average precision counts in NDS, beside each of the errors."""


@dataclass(frozen=True, slots=True)
class BenchmarkFigures:
    """The figures of all frames that predictions speak of.

    Attributes:
        name: The benchmark, such as "nuscenes".
        frames: How many frames these are.
        all_frames: How many the dataset has.
        average_precision: Mean over the classes and the four centre distances.
        errors: Means over the classes for which they mean something, by name; units of `ERRORS`. Where nothing was
            found a class has the largest error.
        measure: What the score is called, "NDS" or "CDS".
        score: The score, 0 to 1.
        classes: How many classes there are.
        without_labels: Classes of which no label object counts; they have an average precision of 0, as there.
    """

    name: str
    frames: int
    all_frames: int
    average_precision: float
    errors: Mapping[str, float]
    measure: str
    score: float
    classes: int
    without_labels: tuple[str, ...]

    @property
    def sentence(self) -> str:
        """All of it in words."""
        where = f"all {self.frames:,} frames"
        if self.frames < self.all_frames:
            where = f"{self.frames:,} of {self.all_frames:,} frames"
        errors = ", ".join(f"{name} {value:.3f}" for name, value in self.errors.items())
        told = f"{self.name} benchmark, {where}: {self.measure} {self.score:.4f}, mAP {self.average_precision:.4f}"
        if self.without_labels:
            absent = ", ".join(self.without_labels)
            absent = (
                f"; {len(self.without_labels)} of {self.classes} classes have no label and count as missed: {absent}"
            )
        else:
            absent = ""
        return f"{told}, mean errors: {errors}{absent}"


def benchmark_figures(detection: Detection) -> BenchmarkFigures | None:
    """Work out a benchmark's figures; None for files of no benchmark.

    Args:
        detection: Labels and predictions.
    """
    protocol = detection.predictions.protocol
    if not protocol.scored:
        return None
    recordings: NDArray[np.int64] = detection.frames.recording.astype(np.int64)
    weights = np.ones((2, int(recordings.max(initial=0)) + 1))
    found = class_figures(detection, "all", detection.covered, recordings, weights, -math.inf)
    by_class: dict[str, list[ClassFigures]] = {}
    for each in found:
        by_class.setdefault(each.category, []).append(each)
    precisions = [_average_precision(by_class.get(name, ())) for name in protocol.scored]
    errors = [_errors(name, by_class.get(name, ()), protocol) for name in protocol.scored]
    means = {name: float(np.mean([each[name] for each in errors if name in each])) for name in protocol.largest_errors}
    precision = float(np.mean(precisions))
    if protocol.measure == "NDS":
        kept = sum(max(0.0, 1 - value) for value in means.values())
        score = (_OF_NDS * precision + kept) / (_OF_NDS + len(means))
    else:
        share = [float(np.mean([1 - each[name] / most for name, most in protocol.largest_errors.items()]))
                 for each in errors]  # fmt: skip
        score = float(np.mean(np.array(precisions) * np.array(share)))
    return BenchmarkFigures(
        name=protocol.name,
        frames=int(detection.covered.sum()),
        all_frames=len(detection.covered),
        average_precision=precision,
        errors=means,
        measure=protocol.measure,
        score=score,
        classes=len(protocol.scored),
        without_labels=tuple(name for name in protocol.scored if name not in by_class),
    )


def _average_precision(figures: Iterable[ClassFigures]) -> float:
    values = [each.average_precision[0] for each in figures]
    return float(np.mean(values)) if values else 0.0


def _errors(category: str, figures: Iterable[ClassFigures], protocol: Protocol) -> dict[str, float]:
    """The errors of a class that mean something for it; the largest where nothing was found."""
    told = {name: value for each in figures for name, (value, _) in each.errors.items()}
    return {
        name: told.get(name, most)
        for name, most in protocol.largest_errors.items()
        if protocol.has_error(name, category)
    }
