"""Judge a model's detections on the frames of a scenario, from files to figures.

The query paper's figure 1: a model failed on a scenario in simulation; does it fail on the real frames that match?
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path
from typing import Any, TypeAlias, Unpack, cast

import msgspec
import numpy as np
from numpy.typing import NDArray

from scenicq.errors import DataError, Diagnostic
from scenicq.evaluate.balance import Balance, balance
from scenicq.evaluate.benchmark import BenchmarkFigures, benchmark_figures
from scenicq.evaluate.classes import ClassFigures, class_figures
from scenicq.evaluate.clusters import find_clusters, parameters_of
from scenicq.evaluate.comparison import ObjectComparison, ShareComparison, compare
from scenicq.evaluate.controls import Likeness, number_of
from scenicq.evaluate.detection import Detection, DetectionDistances, detect
from scenicq.evaluate.evaluation_options import EvaluationOptions, EvaluationTexts, read_evaluation_options
from scenicq.evaluate.frame_split import FrameSplit, split_frames
from scenicq.evaluate.paired_models import PairedComparison, compare_pair
from scenicq.evaluate.paired_runs import pair_runs
from scenicq.evaluate.resampling import holm, resamples
from scenicq.evaluate.simulation import SimulatedRuns, SimulationComparison, read_simulated, verdict
from scenicq.evaluate.slices import Slice, slices
from scenicq.evaluate.weighting import WeightedShare, weigh
from scenicq.importers.prediction_checks import find_doubts
from scenicq.importers.prediction_files import read_predictions
from scenicq.importers.predictions import Predictions
from scenicq.query.execution.records import FrameRecord, IntervalRecord, Record, SummaryRecord, record, record_of
from scenicq.query.execution.result_files import RecordStream, read_records
from scenicq.query.execution.result_origin import check_origins, name_origin
from scenicq.query.execution.result_summary import Completeness, ResultCount
from scenicq.query.execution.results import Result
from scenicq.query.execution.run import Query
from scenicq.query.execution.skipped_frames import summarize
from scenicq.store.dataset import Dataset
from scenicq.store.remote_path import AnyPath, RemotePath, any_path

__all__ = [
    "Evaluation",
    "ModelsEvaluation",
    "ScenarioEvaluation",
    "WorstFrame",
    "evaluate",
    "evaluate_models",
    "name_models",
]

Bools = NDArray[np.bool_]
Reals = NDArray[np.float64]

Results: TypeAlias = Query | AnyPath | str | Iterable[Result | Record | Mapping[str, Any]]
"""A query, of which every correspondence is found; a file of results; results as a query gives them; or records of
them, which may be plain values."""

_WORST = 50
_ALONE = 0.2
"""Share of objects in question without others from which it is told."""


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
        name: The scenario's name.
        matching, other, undecided: Numbers of frames: of the last nobody knows whether they match.
        roles: How often the objects of each role are missed, against others of their classes that are alike in
            distance and visibility.
        all_objects: The same of all objects of frames that match, against those of the other frames.
        weighted: How often the objects of each role (all objects without roles) are missed where frames are spread as
            the program spreads its scenes; empty where the results are not ranked.
        classes: Figures of each class, on frames that match and on the others.
        slices: Shares missed by what objects and frames are like.
        balances: How alike those who are compared are, for each of `headline` in which anybody is.
        worst: Frames that match, the worst first.
        simulated: The scenario in simulation; None without.
        missed: Whether each label object was missed, for pictures.
        mine: The objects in question.
        coincident: Parameters of which frames that match have values that no other frame has.
        one_each: Whether the results say one correspondence of each frame, and others may play a role, too.
    """

    name: str
    matching: int
    other: int
    undecided: int
    roles: tuple[ObjectComparison, ...]
    all_objects: ObjectComparison
    weighted: tuple[WeightedShare, ...]
    classes: tuple[ClassFigures, ...]
    slices: tuple[Slice, ...]
    balances: tuple[Balance, ...]
    worst: tuple[WorstFrame, ...]
    simulated: SimulationComparison | None
    missed: Bools
    mine: Bools
    coincident: tuple[str, ...] = ()
    one_each: bool = False

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
        within: Centre distances within which objects count as found.
        least_score: Score from which a prediction counts, but for average precision; 0, or that of the least, where
            all count.
        scenarios: One for each file of results.
        warnings: What the user should know.
        detection: Labels and predictions, for pictures.
        benchmark: What the benchmark of the file's kind says of all frames; None for kinds that have none.
    """

    dataset: str
    predictions: str
    within: DetectionDistances
    least_score: float
    scenarios: tuple[ScenarioEvaluation, ...]
    warnings: tuple[Diagnostic, ...]
    detection: Detection
    benchmark: BenchmarkFigures | None


@dataclass(frozen=True, slots=True, eq=False)
class ModelsEvaluation:
    """Several models judged on the same frames.

    Attributes:
        models: The evaluation of each model, by its name.
        pairs: Each model beside each that comes before it, on the objects that count for both: those of each role, all
            of the frames that match, and all of the other frames.
        warnings: What the user should know.
    """

    models: Mapping[str, Evaluation]
    pairs: tuple[PairedComparison, ...]
    warnings: tuple[Diagnostic, ...]

    @property
    def only(self) -> Evaluation | None:
        """The evaluation where there is one model; None where there are several."""
        return next(iter(self.models.values())) if len(self.models) == 1 else None


def evaluate(
    results: Results | Mapping[str, Results],
    dataset: Dataset,
    predictions: Predictions | Path | str,
    **options: Unpack[EvaluationTexts],
) -> Evaluation:
    """Judge a model's detections on the frames that match, against the other frames.

    Args:
        results: Those of one scenario, or of several by their names.
        dataset: The dataset that the results are of.
        predictions: What the model has detected, or a file of it.
        options: As `EvaluationTexts` has them: `distance_m` (also "2,pedestrian=0.5" or {"": 2, "pedestrian": 0.5}),
            `least_score`, `missing` ("error", "empty" or "skip"), `simulated` (see `read_simulated`), `cluster` (by
            default the first of `CLUSTER_KEYS` that the dataset has), `margin` and `seed`, as of `scenicq evaluate`.
            The same figures come from the same seed.

    Raises:
        DataError: A file cannot be read or does not fit the others; option-invalid for another distance, or a score
            that is no number.
    """
    return next(iter(evaluate_models(results, dataset, {"the model": predictions}, **options).models.values()))


def evaluate_models(
    results: Results | Mapping[str, Results],
    dataset: Dataset,
    predictions: Mapping[str, Predictions | Path | str],
    **options: Unpack[EvaluationTexts],
) -> ModelsEvaluation:
    """Judge several models on the same frames, each by itself and each beside those before it.

    Args and errors are those of `evaluate`, but for `predictions`, which are by the names of the models, and
    `simulated`, which is of one model. All tests are corrected together.
    """
    asked = read_evaluation_options(**options)
    simulated = asked.simulated
    if simulated is not None and len(predictions) > 1:
        message = "simulated runs are those of one model, and there are several"
        raise DataError(Diagnostic("option-invalid", message, hints=("evaluate that model by itself",)))
    runs = None if simulated is None else read_simulated(simulated)
    named: Mapping[str, Results] = (
        cast("Mapping[str, Results]", results) if isinstance(results, Mapping) else {_name_of(results): results}
    )
    doubts: list[Diagnostic] = []
    judges = {name: _Judge(_detect(each, dataset, asked, doubts), asked) for name, each in predictions.items()}
    any_judge = next(iter(judges.values()))
    matched: list[FrameSplit] = []
    for name, each in named.items():
        records = RecordStream(_records(each, doubts))
        own = _own(name, records, dataset, doubts)
        labels = any_judge.detection
        matched.append(
            split_frames(name, own, labels.frames, labels.objects, lambda records=records: records.completeness)
        )
        doubts += _doubt(name, each, records.completeness)
    found = [each.scenario(one) for each in judges.values() for one in matched]
    pairs = list(_pairs(judges, matched))
    found, pairs = _corrected(found, pairs)
    if runs is not None:
        missing_runs = [each.name for each in found if each.name not in runs]
        if missing_runs:
            message = f"{simulated} has no run of {', '.join(missing_runs)}"
            hint = f"it has {', '.join(sorted(runs))}; a scenario is called after its file of results"
            raise DataError(Diagnostic("file-invalid", message, hints=(hint,)))
        found = [any_judge.beside_runs(each, runs[each.name], str(simulated)) for each in found]
    models: dict[str, Evaluation] = {}
    warnings = list(doubts)
    for number, (name, judge) in enumerate(judges.items()):
        own = tuple(found[number * len(matched) : (number + 1) * len(matched)])
        told = [*_warnings(own, judge.detection)]
        if len(judges) > 1:
            told = [replace(each, message=f"{name}: {each.message}") for each in told]
        warnings += told
        models[name] = Evaluation(
            name_origin(dataset), judge.detection.predictions.name, asked.distance_m, judge.least, own,
            (*doubts, *told), judge.detection, benchmark_figures(judge.detection),
        )  # fmt: skip
    return ModelsEvaluation(models, tuple(pairs), tuple(warnings))


def name_models(paths: Sequence[Path]) -> tuple[str, ...]:
    """Name models after the files of their predictions, with as many folders as it takes to tell them apart.

    Raises:
        DataError: option-invalid: no file is named, or one twice.
    """
    if not paths:
        raise DataError(Diagnostic("option-invalid", "no predictions are named"))
    for parts in range(1, max(len(each.parts) for each in paths) + 1):
        names = tuple("/".join(each.parts[-parts:]) for each in paths)
        if len(set(names)) == len(names):
            return names
    raise DataError(Diagnostic("option-invalid", "the predictions of two models are the same file"))


def _detect(
    predictions: Predictions | Path | str, dataset: Dataset, asked: EvaluationOptions, doubts: list[Diagnostic]
) -> Detection:  # fmt: skip
    """What a model has detected; a file's predictions are not kept beside it."""
    detected = predictions if isinstance(predictions, Predictions) else read_predictions(Path(predictions))
    doubts += [
        Diagnostic("predictions-doubtful", f"{detected.name}: {each}", severity="warning")
        for each in find_doubts(detected)
    ]
    detection = detect(dataset, detected, asked.missing)
    if strange := [name for name in asked.distance_m.of_class if name not in detection.classes]:
        hint = f"there are {', '.join(detection.classes)}"
        raise DataError(
            Diagnostic("option-invalid", f"a distance of `{strange[0]}`, which is no class here", hints=(hint,))
        )
    return detection


def _name_of(results: Results) -> str:
    if isinstance(results, Query):
        return Path(results.source.name.strip("<>")).stem
    return any_path(results).stem if isinstance(results, Path | RemotePath | str) else "results"


def _doubt(name: str, results: Results, said: Completeness) -> Iterator[Diagnostic]:
    """Warn where results do not say of every frame whether it matches."""
    if said.summary is None and not isinstance(results, Path | RemotePath | str):
        return  # who hands them over knows
    told = "other frames count as those that do not match"
    if said.summary is not None:
        told = "frames of which it does not say whether they match are left out"
    hint = f"{told}: `match` without --limit, --sample and --deadline writes complete results"
    if (doubt := said.doubt(f"{name} (results)", hint)) is not None:
        yield doubt


def _records(results: Results, doubts: list[Diagnostic]) -> Iterator[Record | SummaryRecord]:
    if isinstance(results, Query):
        options = replace(results.options, all_matches=True, proofs=True, every=False, limit=None)
        query = Query(results.dataset, results.source, options, files=results.files)
        counted = ResultCount()
        yield from counted.counted(record(each, every=True) for each in query.results())
        doubts += query.funnel.warnings
        yield SummaryRecord(summarize(query, counted))
        return
    if isinstance(results, Path | RemotePath | str):
        yield from read_records(any_path(results)).records
        return
    for number, each in enumerate(results, 1):
        if isinstance(each, Result):
            yield record(each)
        elif isinstance(each, FrameRecord | IntervalRecord | SummaryRecord):
            yield each
        else:
            try:
                yield record_of(each)
            except msgspec.ValidationError as error:
                raise DataError(Diagnostic("file-invalid", f"result {number} is no result: {error}")) from None


def _own(name: str, records: Iterable[Record], dataset: Dataset, doubts: list[Diagnostic]) -> Iterator[Record]:
    """Read the records, and refuse those of another dataset; another version of the dataset is a warning."""
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


def _pairs(judges: Mapping[str, _Judge], matched: Iterable[FrameSplit]) -> Iterator[PairedComparison]:
    """Each model beside each that comes before it."""
    for one in matched:
        for (baseline, before), (model, judge) in combinations(judges.items(), 2):
            for each in judge.beside(before, one):
                yield replace(each, scenario=one.name, model=model, baseline=baseline)


def _corrected(
    found: list[ScenarioEvaluation], pairs: list[PairedComparison]
) -> tuple[list[ScenarioEvaluation], list[PairedComparison]]:
    """Correct the p-values of all rows of all scenarios and models together."""
    rows = [[*one.roles, one.all_objects] for one in found]
    tested: list[ShareComparison] = [*(each for some in rows for each in some), *pairs]
    corrected = iter(holm(np.array([each.p_value for each in tested])).tolist())
    done: list[ScenarioEvaluation] = []
    for one, some in zip(found, rows, strict=True):
        *roles, of_all = (replace(each, p_corrected=next(corrected)) for each in some)
        done.append(replace(one, roles=tuple(roles), all_objects=of_all))
    return done, [replace(each, p_corrected=next(corrected)) for each in pairs]


def _warnings(found: Iterable[ScenarioEvaluation], detection: Detection) -> Iterator[Diagnostic]:
    if detection.flat:
        message = (
            "the benchmark takes distances in space, and the dataset does not know all heights: the plane is taken"
        )
        hint = "a dataset that was made before heights were kept gets them when its source is ingested again"
        yield Diagnostic("heights-unknown", message, severity="warning", hints=(hint,))
    for one in found:
        if one.one_each and one.roles:
            message = f"{one.name}: results say one correspondence of each frame; others of it may play a role, too"
            hint = (
                "with the program in place of results, or results of `match --all-matches`, who plays none is compared"
            )
            yield Diagnostic("one-correspondence", message, severity="warning", hints=(hint,))
        for name in one.coincident:
            message = (
                f"{one.name}: frames that match have values of `{name}` that no other frame has: what is said of all "
                "objects may be said of that"
            )
            yield Diagnostic("parameter-coincides", message, severity="warning")
        for each in one.headline:
            if each.uncounted:
                whole = each.uncounted + each.asked
                message = (
                    f"{one.name}: {each.uncounted} of {whole} objects of {each.about} do not count by the rules of "
                    f"{detection.predictions.protocol.name} predictions: too far away, without points in the box, of "
                    "another class, or not where the benchmark looks"
                )
                yield Diagnostic("objects-uncounted", message, severity="warning")
            if each.share.of and each.missing:
                message = f"{one.name}: no verdict on {each.about}: {each.because}"
                yield Diagnostic("no-verdict", message, severity="warning")
            elif each.alone > _ALONE:
                message = f"{one.name}: {100 * each.alone:.0f} % of {each.about} have no other object that is alike"
                yield Diagnostic("no-verdict", message, severity="warning")


class _Judge:
    """Labels and predictions, ready to be divided by scenarios."""

    def __init__(self, detection: Detection, asked: EvaluationOptions) -> None:
        self.detection, self._asked = detection, asked
        least = asked.least_score
        self.least = float(detection.predictions.score.min(initial=0.0)) if least is None else least
        # each model's figures are those that it has by itself
        self._rng = np.random.default_rng(asked.seed)
        self._clusters = clusters = find_clusters(detection.frames, asked.cluster)
        objects = detection.objects
        self.counted = detection.object_class >= 0
        score = detection.found_score(asked.distance_m)
        self.missed = self.counted & ((score < self.least) | np.isneginf(score))
        self._weights = resamples(clusters.count, self._rng)
        self._parameters = parameters_of(detection.frames, clusters)
        category = np.maximum(detection.object_class, 0).astype(np.int64)
        frame = objects.frame.astype(np.int64)
        self._like = Likeness(
            kind=number_of((category, objects.visible.astype(np.int64))),
            category=category,
            distance=detection.distance,
            frame=frame,
            recording=detection.frames.recording[frame].astype(np.int64),
            cluster=clusters.number[frame],
            params=self._combined(self._parameters)[frame],
        )

    def _combined(self, names: Iterable[str]) -> NDArray[np.int64]:
        """The number of each frame's combination of parameters."""
        whole = np.zeros(len(self.detection.frames.names), dtype=np.int64)
        return number_of((whole, *(self._parameters[name][1] for name in names)))

    def scenario(self, matched: FrameSplit) -> ScenarioEvaluation:
        """The figures of one scenario."""
        detection = self.detection
        frame = detection.objects.frame
        matching, other = self.frames(matched)
        here, there = self.counted & matching[frame], self.counted & other[frame]
        asked = [
            (about, mine & here, int((mine & matching[frame] & ~self.counted).sum()))
            for about, mine in self._roles(matched)
        ]
        in_roles = np.logical_or.reduce([mine for _, mine, _ in asked]) if asked else here
        # who plays any role is no control of another
        free = there | (here & matched.free[frame] & ~in_roles) if asked else there
        roles = tuple(
            replace(self._of_role(about, mine, free), uncounted=uncounted) for about, mine, uncounted in asked
        )
        of_all, coincident = self._of_all(here, there)
        others = free & self._of_classes(in_roles)
        balances = (balance(each, detection, self._parameters) for each in roles or (of_all,))
        return ScenarioEvaluation(
            name=matched.name,
            matching=int(matching.sum()),
            other=int(other.sum()),
            undecided=int((detection.covered & ~matched.decided).sum()),
            roles=roles,
            all_objects=of_all,
            weighted=tuple(self._weighted(matched.log_weight, [each[:2] for each in asked] or [("all objects", here)])),
            classes=tuple(
                figures
                for group, frames in (("matching", matching), ("other", other))
                for figures in class_figures(detection, group, frames, self._clusters.number, self._weights, self.least)
            ),
            slices=slices(detection, matched, self.missed, in_roles, others, self._like.cluster),
            balances=tuple(each for each in balances if each is not None),
            worst=tuple(self._worst(matching, in_roles)),
            simulated=None,
            missed=self.missed,
            mine=in_roles,
            coincident=coincident,
            one_each=not matched.every,
        )

    def beside(self, before: _Judge, matched: FrameSplit) -> Iterator[PairedComparison]:
        """What this model misses beside another one, of the objects that count for both."""
        frame = self.detection.objects.frame
        (here, there), (here_too, there_too) = self.frames(matched), before.frames(matched)
        matching, other = (here & here_too)[frame], (there & there_too)[frame]
        roles = [(about, mine & matching) for about, mine in self._roles(matched)]
        groups = [*roles, ("all objects", matching), ("objects of the other frames", other)]
        for about, mine in groups:
            both = mine & self.counted & before.counted
            yield compare_pair(
                about, self.missed, before.missed, both, self._like.cluster, self._rng, margin=self._asked.margin,
                unit=self._clusters.unit,
            )  # fmt: skip

    def beside_runs(self, scenario: ScenarioEvaluation, runs: SimulatedRuns, name: str) -> ScenarioEvaluation:
        """A scenario beside its simulated runs, pair by pair where they name recordings.

        Raises:
            DataError: file-invalid: a run rebuilds what the dataset does not have.
        """
        real = _decisive(scenario)
        frames, clusters = self.detection.frames, self._clusters.number
        of_scene = {name: int(clusters[number]) for name, number in frames.numbers.items()}
        for number, recording in zip(clusters.tolist(), frames.recording.tolist(), strict=True):
            of_scene[frames.recordings[recording]] = number
        if strange := [each for each in runs.rebuilt if each and each not in of_scene]:
            message = f"{name}: a run rebuilds `{strange[0]}`, which is no recording and no frame of the dataset"
            raise DataError(Diagnostic("file-invalid", message))
        paired = None
        if real.groups is not None and any(runs.rebuilt):
            # a run that rebuilds nothing is of a scene of its own
            scenes = [each or f"\0{number}" for number, each in enumerate(runs.rebuilt)]
            paired = pair_runs(
                runs.failed,
                np.array([of_scene.get(each, -1) for each in runs.rebuilt], dtype=np.int64),
                np.unique(scenes, return_inverse=True)[1].astype(np.int64),
                self.missed[real.groups.own],
                self._like.cluster[real.groups.own],
                self._clusters.unit,
            )
        return replace(scenario, simulated=verdict(runs, real, paired))

    def frames(self, matched: FrameSplit) -> tuple[Bools, Bools]:
        """The frames that match, and those that do not, of those that predictions speak of."""
        covered = self.detection.covered
        return matched.matching & covered, matched.decided & ~matched.matching & covered

    def _roles(self, matched: FrameSplit) -> Iterator[tuple[str, Bools]]:
        """The label object of each role."""
        for role in matched.roles:
            mine = np.zeros(len(self.detection.objects.frame), dtype=np.bool_)
            mine[role.objects] = True
            yield f"role {role.name}", mine

    def _of_role(self, about: str, mine: Bools, free: Bools) -> ObjectComparison:
        others = free & self._of_classes(mine)
        found = self._compare(about, mine, others, self._like)
        if not found.missing or not found.alone:
            return found
        only = [name for name in self._parameters if self._coincides(name, mine, others)]
        told = tuple(f"no other is under the same `{name}`" for name in only)
        return replace(found, missing=(*found.missing, *told))

    def _of_all(self, here: Bools, there: Bools) -> tuple[ObjectComparison, tuple[str, ...]]:
        """The comparison of frames, and the parameters that all frames that match have for themselves."""
        only = tuple(name for name in self._parameters if self._coincides(name, here, there))
        like = self._like
        if only:
            kept = [name for name in self._parameters if name not in only]
            like = replace(like, params=self._combined(kept)[like.frame])
        return self._compare("all objects", here, there, like), only

    def _coincides(self, name: str, mine: Bools, others: Bools) -> bool:
        """Whether objects in question and others have no value of a parameter in common."""
        value = self._parameters[name][1][self._like.frame]
        one, other = np.unique(value[mine]), np.unique(value[others])
        return bool(len(one) and len(other)) and not np.isin(one, other).any()

    def _weighted(self, log_weight: Reals | None, asked: Iterable[tuple[str, Bools]]) -> Iterator[WeightedShare]:
        if log_weight is not None:
            for about, mine in asked:
                numbers = np.flatnonzero(mine)
                of_frame = log_weight[self.detection.objects.frame[numbers]]
                yield weigh(about, self.missed[numbers], of_frame, self._like.cluster[numbers])

    def _of_classes(self, mine: Bools) -> Bools:
        return np.isin(self._like.category, np.unique(self._like.category[mine]))

    def _compare(self, about: str, mine: Bools, others: Bools, like: Likeness) -> ObjectComparison:
        used = np.flatnonzero(mine | others)
        found = compare(
            about, self.missed[used], mine[used], others[used], like.taken(used), self._rng,
            margin=self._asked.margin, unit=self._clusters.unit,
        )  # fmt: skip
        if found.groups is None:
            return found
        own, beside = used[found.groups.own], used[found.groups.others]
        return replace(found, groups=replace(found.groups, own=own, others=beside))

    def _worst(self, matching: Bools, mine: Bools) -> Iterator[WorstFrame]:
        detection = self.detection
        count = len(matching)
        lost = np.bincount(detection.objects.frame[mine & self.missed], minlength=count)
        of = np.bincount(detection.objects.frame[mine], minlength=count)
        wrong = detection.is_false(self._asked.distance_m) & (detection.predictions.score >= self.least)
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
