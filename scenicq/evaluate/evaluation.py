"""A model's detections judged on the frames of a scenario: the whole of it, from files to figures.

The query paper's figure 1: a model failed on a scenario in simulation; does it fail on the real frames that match?
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeAlias, cast, get_args

import msgspec
import numpy as np
from numpy.typing import NDArray

from scenicq.errors import DataError, Diagnostic
from scenicq.evaluate.classes import ClassFigures, class_figures
from scenicq.evaluate.comparison import DISTANCES_M, ObjectComparison, compare, strata_of
from scenicq.evaluate.detection import Detection, Missing, detect
from scenicq.evaluate.matched import Matched, read_matched
from scenicq.evaluate.resampling import holm, resamples
from scenicq.evaluate.simulation import Simulated, read_simulated, verdict
from scenicq.evaluate.slices import Slice, slices
from scenicq.evaluate.weighting import Weighted, weighted
from scenicq.importers.prediction_files import read_predictions
from scenicq.importers.predictions import THRESHOLDS_M, Predictions
from scenicq.option_values import SCORE, SEED, OneOf, read_option
from scenicq.query.execution.records import FrameRecord, IntervalRecord, Record, record, record_of
from scenicq.query.execution.result_files import read_records
from scenicq.query.execution.result_origin import check_origins, name_origin
from scenicq.query.execution.results import Result
from scenicq.store.dataset import Dataset

__all__ = ["Evaluation", "ScenarioEvaluation", "WorstFrame", "evaluate"]

Bools = NDArray[np.bool_]
Reals = NDArray[np.float64]

Results: TypeAlias = Path | str | Iterable[Result | Record | Mapping[str, Any]]
"""A file of results, results as a query gives them, or records of them, which may be plain values."""

_WORST = 50


@dataclass(frozen=True, slots=True)
class WorstFrame:
    """A frame that matches, with what the model did there.

    Attributes:
        frame, recording: Which frame.
        missed, of: Objects in question that were missed, and all of them.
        false: Predictions of the least score that are no label object.
    """

    frame: str
    recording: str
    missed: int
    of: int
    false: int


@dataclass(frozen=True, slots=True, eq=False)
class ScenarioEvaluation:
    """The figures of one scenario.

    Attributes:
        name: Of the scenario.
        matching, other: Numbers of frames.
        roles: How often the objects of each role are missed, against others of their classes that are alike in
            distance and visibility.
        all_objects: The same of all objects of frames that match, against those of the other frames.
        weighted: How often the objects of each role (all objects without roles) are missed where frames are spread as
            the program spreads its scenes; empty where the results are not ranked.
        classes: Figures of each class, on frames that match and on the others.
        slices: Shares missed by what objects and frames are like.
        worst: Frames that match, the worst first.
        simulated: The scenario in simulation; None without.
        missed: Whether each label object was missed, for pictures.
        mine: The objects in question.
    """

    name: str
    matching: int
    other: int
    roles: tuple[ObjectComparison, ...]
    all_objects: ObjectComparison
    weighted: tuple[Weighted, ...]
    classes: tuple[ClassFigures, ...]
    slices: tuple[Slice, ...]
    worst: tuple[WorstFrame, ...]
    simulated: Simulated | None
    missed: Bools
    mine: Bools

    @property
    def headline(self) -> tuple[ObjectComparison, ...]:
        """What answers the question: the roles, or all objects where the ego is the only role."""
        return self.roles or (self.all_objects,)


@dataclass(frozen=True, slots=True, eq=False)
class Evaluation:
    """A model judged on the frames of scenarios.

    Attributes:
        dataset: The dataset and its version, as `name_origin` says it.
        predictions: Name of the file.
        distance_m: Centre distance within which an object counts as found.
        least_score: Score from which a prediction counts, but for average precision; 0, or that of the least, where
            all count.
        scenarios: One for each file of results.
        warnings: What the user should know.
        detection: Labels and predictions, for pictures.
    """

    dataset: str
    predictions: str
    distance_m: float
    least_score: float
    scenarios: tuple[ScenarioEvaluation, ...]
    warnings: tuple[Diagnostic, ...]
    detection: Detection


def evaluate(
    results: Results | Mapping[str, Results],
    dataset: Dataset,
    predictions: Predictions | Path | str,
    *,
    distance_m: float = 2.0,
    least_score: float | None = None,
    missing: Missing = "error",
    simulated: Path | str | None = None,
    seed: int = 0,
) -> Evaluation:
    """Judge a model's detections on the frames that match, against the other frames.

    Args:
        results: Of one scenario, or of several by their names.
        dataset: The dataset that the results are of.
        predictions: What the model has detected, or a file of it.
        distance_m: Centre distance within which an object counts as found: 0.5, 1, 2 or 4.
        least_score: Score from which a prediction counts, but for average precision; all by default.
        missing: What a frame without predictions is: an error, a frame in which nothing was found, or left out.
        simulated: A CSV file of simulated runs; see `read_simulated`.
        seed: Seed of the resamples: the same figures come from the same seed.

    Raises:
        DataError: A file cannot be read or does not fit the others; option-invalid for another distance, or a score
            that is no number.
    """
    if distance_m not in THRESHOLDS_M:
        hint = f"known are {', '.join(f'{known:g}' for known in THRESHOLDS_M)}"
        raise DataError(Diagnostic("option-invalid", f"no centre distance of {distance_m:g} m", hints=(hint,)))
    seed, missing = read_option("seed", SEED, seed), read_option("missing", OneOf(get_args(Missing)), missing)
    least_score = None if least_score is None else read_option("least_score", SCORE, least_score)
    runs = None if simulated is None else read_simulated(Path(simulated), seed)
    named: Mapping[str, Results] = (
        cast("Mapping[str, Results]", results) if isinstance(results, Mapping) else {_name_of(results): results}
    )
    # a file's predictions are not kept here: what is evaluated of them is a copy
    detection = detect(
        dataset, predictions if isinstance(predictions, Predictions) else read_predictions(Path(predictions)), missing
    )
    if least_score is None:
        least_score = float(detection.predictions.score.min(initial=0.0))
    rng = np.random.default_rng(seed)
    judge = _Judge(detection, distance_m, least_score, rng)
    doubts: list[Diagnostic] = []
    found = [judge.scenario(read_matched(name, _own(name, _records(each), dataset, doubts), detection.frames,
                                         detection.objects)) for name, each in named.items()]  # fmt: skip
    found = _corrected(found)
    if runs is not None:
        missing_runs = [each.name for each in found if each.name not in runs]
        if missing_runs:
            message = f"{simulated} has no run of {', '.join(missing_runs)}"
            hint = f"it has {', '.join(sorted(runs))}; a scenario is called after its file of results"
            raise DataError(Diagnostic("file-invalid", message, hints=(hint,)))
        found = [replace(each, simulated=verdict(runs[each.name], _decisive(each))) for each in found]
    return Evaluation(
        name_origin(dataset),
        detection.predictions.name,
        distance_m,
        least_score,
        tuple(found),
        (*doubts, *_warnings(found, detection)),
        detection,
    )


def _name_of(results: Results) -> str:
    return Path(results).stem if isinstance(results, Path | str) else "results"


def _records(results: Results) -> Iterator[Record]:
    if isinstance(results, Path | str):
        yield from read_records(Path(results))
        return
    for number, each in enumerate(results, 1):
        if isinstance(each, Result):
            yield record(each)
        elif isinstance(each, FrameRecord | IntervalRecord):
            yield each
        else:
            try:
                yield record_of(each)
            except msgspec.ValidationError as error:
                raise DataError(Diagnostic("file-invalid", f"result {number} is no result: {error}")) from None


def _own(name: str, records: Iterable[Record], dataset: Dataset, doubts: list[Diagnostic]) -> Iterator[Record]:
    """The records, once it is sure that they do not name another dataset; another version of it is a doubt."""
    mine = name_origin(dataset)
    seen: set[str] = set()
    for each in records:
        origin = each.dataset or ""
        if origin not in seen:
            seen.add(origin)
            doubt = check_origins((f"{name} (results)", [origin]), (dataset.name, [mine]))
            doubts += [] if doubt is None else [doubt]
        yield each


def _decisive(scenario: ScenarioEvaluation) -> ObjectComparison:
    """The comparison that is set against simulation: the role that is missed most."""
    return max(scenario.headline, key=lambda each: -1.0 if math.isnan(each.difference) else each.difference)


def _corrected(found: list[ScenarioEvaluation]) -> list[ScenarioEvaluation]:
    """With the p-values of all roles of all scenarios corrected together."""
    corrected = iter(holm(np.array([each.p_value for one in found for each in one.headline])).tolist())
    done: list[ScenarioEvaluation] = []
    for one in found:
        headline = tuple(replace(each, p_corrected=next(corrected)) for each in one.headline)
        done.append(replace(one, roles=headline) if one.roles else replace(one, all_objects=headline[0]))
    return done


def _warnings(found: Iterable[ScenarioEvaluation], detection: Detection) -> Iterator[Diagnostic]:
    if detection.flat:
        message = (
            "the benchmark takes distances in space, and the dataset does not know all heights: the plane is taken"
        )
        hint = "a dataset that was made before heights were kept gets them when its source is ingested again"
        yield Diagnostic("heights-unknown", message, severity="warning", hints=(hint,))
    for one in found:
        for each in one.headline:
            if each.uncounted:
                whole = each.uncounted + int(each.share.of)
                message = (
                    f"{one.name}: {each.uncounted} of {whole} objects of {each.about} do not count by the rules of "
                    f"{detection.predictions.protocol.name} predictions: too far away, without points in the box, of "
                    "another class, or not where the benchmark looks"
                )
                yield Diagnostic("objects-uncounted", message, severity="warning")
            if each.share.of and each.few:
                message = (
                    f"{one.name}: {each.about} tells as much as {each.effective:.1f} equally large recordings would: "
                    "intervals and tests are rough, and no verdict"
                )
                yield Diagnostic("few-recordings", message, severity="warning")
            if each.alone > 0.2:
                message = f"{one.name}: {100 * each.alone:.0f} % of {each.about} have no other object that is alike"
                yield Diagnostic("few-recordings", message, severity="warning")


class _Judge:
    """Labels and predictions, ready to be divided by scenarios."""

    def __init__(self, detection: Detection, distance_m: float, least: float, rng: np.random.Generator) -> None:
        self._detection, self._distance, self._least, self._rng = detection, distance_m, least, rng
        objects = detection.objects
        self._recording = detection.frames.recording[objects.frame].astype(np.int64)
        self._counted = detection.object_class >= 0
        score = detection.score[distance_m]
        self._missed = self._counted & ((score < least) | np.isneginf(score))
        self._weights = resamples(len(detection.frames.recordings), rng)
        away = np.searchsorted(DISTANCES_M, detection.distance, side="right").astype(np.int64)
        category = detection.object_class.astype(np.int64)
        self._class = np.maximum(category, 0)
        self._alike = strata_of((self._class, away, objects.visible.astype(np.int64)))

    def scenario(self, matched: Matched) -> ScenarioEvaluation:
        """The figures of one scenario."""
        detection = self._detection
        matching = matched.matching & detection.covered
        other = matched.decided & ~matched.matching & detection.covered
        frame = detection.objects.frame
        here, there = self._counted & matching[frame], self._counted & other[frame]
        in_roles = np.zeros(len(frame), dtype=np.bool_)
        roles: list[ObjectComparison] = []
        asked: list[tuple[str, Bools]] = []
        for role in matched.roles:
            mine = np.zeros(len(frame), dtype=np.bool_)
            mine[role.objects] = True
            uncounted = int((mine & matching[frame] & ~self._counted).sum())
            mine &= here
            in_roles |= mine
            asked.append((f"role {role.name}", mine))
            others = (here | there) & ~mine & self._of_classes(mine)
            found = self._compare(f"role {role.name}", mine, others, self._alike)
            roles.append(replace(found, uncounted=uncounted))
        of_all = self._compare("all objects", here, there, self._class)
        mine = in_roles if matched.roles else here
        others = (here | there) & ~mine & self._of_classes(mine)
        return ScenarioEvaluation(
            name=matched.name,
            matching=int(matching.sum()),
            other=int(other.sum()),
            roles=tuple(roles),
            all_objects=of_all,
            weighted=tuple(self._weighted(matched.log_weight, asked or [("all objects", here)])),
            classes=tuple(
                figures
                for group, frames in (("matching", matching), ("other", other))
                for figures in class_figures(detection, group, frames, self._weights, self._least)
            ),
            slices=tuple(slices(detection, matched, self._missed, mine, others, self._weights)),
            worst=tuple(self._worst(matching, mine)),
            simulated=None,
            missed=self._missed,
            mine=mine,
        )

    def _weighted(self, log_weight: Reals | None, asked: Iterable[tuple[str, Bools]]) -> Iterator[Weighted]:
        if log_weight is not None:
            for about, mine in asked:
                numbers = np.flatnonzero(mine)
                of_frame = log_weight[self._detection.objects.frame[numbers]]
                yield weighted(about, self._missed[numbers], of_frame, self._recording[numbers], self._weights)

    def _of_classes(self, mine: Bools) -> Bools:
        return np.isin(self._class, np.unique(self._class[mine]))

    def _compare(self, about: str, mine: Bools, others: Bools, stratum: NDArray[np.int64]) -> ObjectComparison:
        used = np.flatnonzero(mine | others)
        _, strata = np.unique(stratum[used], return_inverse=True)
        return compare(
            about, self._missed[used], mine[used], others[used], self._recording[used], strata, self._weights, self._rng
        )

    def _worst(self, matching: Bools, mine: Bools) -> Iterator[WorstFrame]:
        detection = self._detection
        count = len(matching)
        lost = np.bincount(detection.objects.frame[mine & self._missed], minlength=count)
        of = np.bincount(detection.objects.frame[mine], minlength=count)
        wrong = (detection.owner[self._distance] < 0) & (detection.predictions.score >= self._least)
        false = np.bincount(detection.frame[wrong], minlength=count)
        numbers = np.flatnonzero(matching)
        with np.errstate(invalid="ignore", divide="ignore"):
            share = np.nan_to_num(lost[numbers] / of[numbers])
        frames = detection.frames
        order = np.lexsort((numbers, -false[numbers], -lost[numbers], -share))[:_WORST]
        worst: list[int] = numbers[order].tolist()
        for number in worst:
            recording = frames.recordings[int(frames.recording[number])]
            yield WorstFrame(frames.names[number], recording, int(lost[number]), int(of[number]), int(false[number]))
