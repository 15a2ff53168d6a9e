"""An evaluation as plain values: nested for JSON, one flat table for CSV and Parquet, aligned text for people."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

from scenicq.evaluate.balance import Balance
from scenicq.evaluate.benchmark import BenchmarkFigures
from scenicq.evaluate.classes import ClassFigures
from scenicq.evaluate.comparison import ObjectComparison, Share, ShareComparison, in_points, p_text
from scenicq.evaluate.controls import PLACES
from scenicq.evaluate.detection import FoundWithin
from scenicq.evaluate.evaluation import Evaluation, ModelsEvaluation, ScenarioEvaluation
from scenicq.evaluate.paired_models import PairedComparison
from scenicq.evaluate.paired_runs import PairedRuns
from scenicq.evaluate.precision import ERRORS
from scenicq.evaluate.slices import Slice
from scenicq.evaluate.weighting import Weighted

__all__ = [
    "COLUMNS",
    "Table",
    "balance_table",
    "evaluation_record",
    "flat_rows",
    "models_record",
    "models_rows",
    "models_table",
    "overview",
    "tables",
]

Table = tuple[str, tuple[str, ...], list[tuple[str, ...]]]
"""Title, names of the columns, and rows of texts."""

COLUMNS: dict[str, type] = {
    "scenario": str,
    "table": str,
    "about": str,
    "part": str,
    "group": str,
    "distance_m": float,
    "measure": str,
    "value": float,
    "low": float,
    "high": float,
    "objects": float,
    "other_value": float,
    "other_low": float,
    "other_high": float,
    "other_objects": float,
    "p_value": float,
    "p_corrected": float,
    "recordings": float,
    "difference": float,
    "difference_low": float,
    "difference_high": float,
    "alone": float,
    "says": str,
    "because": str,
    "model": str,
}
"""Columns of the flat table: one row a figure with its interval."""


def _number(value: float) -> float | None:
    return None if math.isnan(value) else value


def _share(share: Share) -> dict[str, Any]:
    low, high = map(_number, share.interval)
    told = {"missed": share.missed, "of": share.of, "rate": _number(share.rate), "low": low, "high": high}
    return told if math.isnan(share.recordings) else told | {"effective_recordings": round(share.recordings, 2)}


def _difference(each: ShareComparison) -> dict[str, Any]:
    return {
        "difference": _number(each.difference),
        "difference_low": _number(each.interval[0]),
        "difference_high": _number(each.interval[1]),
        "p_value": _number(each.p_value),
        "p_corrected": _number(each.p_corrected),
        "recordings": each.recordings,
        "effective_recordings": round(each.effective, 2),
        "unit": each.unit,
    }


def _conclusion(each: ShareComparison, sentence: str) -> dict[str, Any]:
    return {
        "margin": each.margin,
        "says": each.says,
        "missing": list(each.missing),
        "because": each.because,
        "more_recordings": each.more,
        "sentence": sentence,
    }


def _comparison(each: ObjectComparison) -> dict[str, Any]:
    return {
        "about": each.about,
        "missed": _share(each.share),
        "others": _share(each.other),
        **_difference(each),
        "asked": each.asked,
        "alone": each.alone,
        "uncounted": each.uncounted,
        "controls": dict(zip(PLACES, each.places, strict=True)),
        **_conclusion(each, each.sentence),
    }


def _pair(each: PairedComparison) -> dict[str, Any]:
    return {
        "scenario": each.scenario,
        "about": each.about,
        "model": each.model,
        "baseline": each.baseline,
        "missed": _share(each.share),
        "missed_by_baseline": _share(each.other),
        "missed_by_model_alone": each.only_model,
        "missed_by_baseline_alone": each.only_baseline,
        **_difference(each),
        **_conclusion(each, each.sentence),
    }


def _weighted(each: Weighted) -> dict[str, Any]:
    return {
        "about": each.about,
        "missed": _share(each.share),
        "objects": each.objects,
        "left_out": each.left_out,
        "equal_objects": round(each.equal, 2),
        "effective_recordings": round(each.recordings, 2),
        "sentence": each.sentence,
    }


def _figures(each: ClassFigures) -> dict[str, Any]:
    measures = {"recall": each.recall, "precision": each.precision, "average_precision": each.average_precision}
    return {
        "class": each.category,
        "group": each.group,
        "distance_m": each.distance_m,
        "objects": each.objects,
        "predictions": each.predictions,
        "effective_recordings": round(each.recordings, 2),
        **{
            name: {"value": _number(value), "low": _number(low), "high": _number(high)}
            for name, (value, (low, high)) in {**measures, **each.errors}.items()
        },
    }


def _benchmark(each: BenchmarkFigures) -> dict[str, Any]:
    return {
        "name": each.name,
        "frames": each.frames,
        each.measure: _number(each.score),
        "mean_average_precision": _number(each.average_precision),
        "mean_errors": {name: _number(value) for name, value in each.errors.items()},
        "classes": each.classes,
        "classes_without_labels": list(each.without_labels),
        "sentence": each.sentence,
    }


def _paired(each: PairedRuns) -> dict[str, Any]:
    rate, (low, high) = each.adjusted
    return {
        "pairs": each.pairs,
        "without_runs": each.without,
        "unit": each.unit,
        "missed": _share(each.real),
        "failed": each.simulated,
        "difference": each.difference,
        "difference_low": _number(each.interval[0]),
        "difference_high": _number(each.interval[1]),
        "explained": _number(each.explained),
        "with_control_variate": {"rate": _number(rate), "low": _number(low), "high": _number(high)},
        "sentence": each.sentence,
    }


def _balance(each: Balance) -> dict[str, Any]:
    return {
        "about": each.about,
        "covariates": [
            {
                "by": one.by,
                "mean": _number(one.means[0]),
                "mean_of_others": _number(one.means[1]),
                "standardized_difference": _number(one.apart),
                "in_common": one.common,
                "parts": [{"part": name, "share": own, "share_of_others": others} for name, own, others in one.parts],
            }
            for one in each.covariates
        ],
    }


def _slice(each: Slice) -> dict[str, Any]:
    others = None if each.other is None else _share(each.other)
    source = {"source": each.source} if each.source else {}
    return {"by": each.by, **source, "part": each.part, "missed": _share(each.share), "others": others}


def evaluation_record(evaluation: Evaluation) -> dict[str, Any]:
    """All figures as nested values, ready for JSON."""
    return {
        "dataset": evaluation.dataset,
        "predictions": evaluation.predictions,
        "found_within_m": evaluation.within.usual,
        "found_within_m_of_class": dict(evaluation.within.of_class),
        "least_score": evaluation.least_score,
        "benchmark": None if evaluation.benchmark is None else _benchmark(evaluation.benchmark),
        "scenarios": [_scenario(each) for each in evaluation.scenarios],
        "warnings": [each.message for each in evaluation.warnings],
    }


def models_record(found: ModelsEvaluation) -> dict[str, Any]:
    """All figures of several models as nested values, ready for JSON."""
    return {
        "models": {name: evaluation_record(each) for name, each in found.models.items()},
        "pairs": [_pair(each) for each in found.pairs],
        "warnings": [each.message for each in found.warnings],
    }


def _scenario(each: ScenarioEvaluation) -> dict[str, Any]:
    found: dict[str, Any] = {
        "scenario": each.name,
        "matching_frames": each.matching,
        "other_frames": each.other,
        "undecided_frames": each.undecided,
        "findings": [one.finding(each.undecided) for one in each.headline],
        "roles": [_comparison(role) for role in each.roles],
        "all_objects": _comparison(each.all_objects),
        "weighted": [_weighted(one) for one in each.weighted],
        "classes": [_figures(figures) for figures in each.classes],
        "slices": [_slice(part) for part in each.slices],
        "balance": [_balance(one) for one in each.balances],
        "worst_frames": [
            {"frame": one.frame, "recording": one.recording, "missed": one.missed, "of": one.of, "false": one.false}
            for one in each.worst
        ],
    }
    if each.simulated is not None:
        simulated = each.simulated
        found["simulated"] = {
            "failed": _share(simulated.share), "says": simulated.says, "sentence": simulated.sentence,
            "paired": None if simulated.paired is None else _paired(simulated.paired),
        }  # fmt: skip
    return found


def flat_rows(evaluation: Evaluation) -> Iterator[dict[str, Any]]:
    """One row a figure, with the keys of `COLUMNS`; those of the benchmark are of no scenario."""
    if evaluation.benchmark is not None:
        whole = evaluation.benchmark
        measures = {whole.measure: whole.score, "average_precision": whole.average_precision, **whole.errors}
        for name, value in measures.items():
            yield _row("", "benchmark", whole.name, measure=name, value=value)
    for one in evaluation.scenarios:
        for table, each in (*(("roles", role) for role in one.roles), ("all", one.all_objects)):
            yield _row(one.name, table, each.about, measure="missed", **_compared_figures(each), alone=each.alone)
        for part in one.weighted:
            yield _row(
                one.name, "weighted", part.about, measure="missed", **{**_of(part.share), "objects": part.equal},
                recordings=part.recordings,
            )  # fmt: skip
        for figures in one.classes:
            measures = {
                "recall": figures.recall,
                "precision": figures.precision,
                "average_precision": figures.average_precision,
                **figures.errors,
            }
            for name, (value, (low, high)) in measures.items():
                yield _row(
                    one.name, "classes", figures.category, group=figures.group, distance_m=figures.distance_m,
                    measure=name, value=value, low=low, high=high, objects=float(figures.objects),
                    recordings=figures.recordings,
                )  # fmt: skip
        for part in one.slices:
            others: Mapping[str, float] = {} if part.other is None else _of_others(part.other)
            yield _row(
                one.name, "slices", part.by, part=part.part, measure="missed", **_of(part.share), **others,
                recordings=part.share.recordings,
            )  # fmt: skip
        if one.simulated is not None:
            yield _row(one.name, "simulated", one.simulated.says, measure="failed", **_of(one.simulated.share))
        for worst in one.worst:
            share = worst.missed / worst.of if worst.of else math.nan
            yield _row(one.name, "frames", worst.frame, measure="missed", value=share, objects=float(worst.of))


def models_rows(found: ModelsEvaluation) -> Iterator[dict[str, Any]]:
    """One row a figure of each model, and one a pair, with the keys of `COLUMNS`.

    A pair's others are the same objects, as the baseline has missed them.
    """
    for name, each in found.models.items():
        model = None if found.only is not None else name
        yield from ({**row, "model": model} for row in flat_rows(each))
    for pair in found.pairs:
        yield _row(
            pair.scenario, "pairs", pair.about, group=pair.baseline, measure="missed", **_compared_figures(pair),
            model=pair.model,
        )  # fmt: skip


def _compared_figures(each: ShareComparison) -> dict[str, Any]:
    low, high = each.interval
    return {
        **_of(each.share), **_of_others(each.other), "p_value": each.p_value, "p_corrected": each.p_corrected,
        "recordings": each.effective, "difference": each.difference, "difference_low": low, "difference_high": high,
        "says": each.says, "because": each.because,
    }  # fmt: skip


def _row(scenario: str, table: str, about: str, **given: Any) -> dict[str, Any]:
    row: dict[str, Any] = {**dict.fromkeys(COLUMNS), "scenario": scenario, "table": table, "about": about, **given}
    return {name: None if isinstance(value, float) and math.isnan(value) else value for name, value in row.items()}


def _of(share: Share) -> Mapping[str, float]:
    return {"value": share.rate, "low": share.interval[0], "high": share.interval[1], "objects": share.of}


def _of_others(share: Share) -> Mapping[str, float]:
    return {f"other_{name}": value for name, value in _of(share).items()}


def _percent(value: float, interval: tuple[float, float] | None = None) -> str:
    if math.isnan(value):
        return "-"
    text = f"{100 * value:.0f} %"
    if interval is not None and not math.isnan(interval[0]):
        text += f" [{100 * interval[0]:.0f}, {100 * interval[1]:.0f}]"
    return text


_UNITS = {"translation": "m", "scale": "1 - IoU", "orientation": "rad", "velocity": "m/s", "attribute": "share wrong"}
"""Units of the errors of boxes that were found."""


def overview(evaluation: Evaluation) -> Table:
    """The answers of all scenarios in one table."""
    simulated = any(each.simulated is not None for each in evaluation.scenarios)
    rows: list[tuple[str, ...]] = []
    for one in evaluation.scenarios:
        for each in one.headline:
            row = (one.name, *_compared(each))
            if simulated:
                told = one.simulated if one.simulated is not None and one.simulated.about == each.about else None
                share = ("", "") if told is None else (_percent(told.share.rate, told.share.interval), told.says)
                row = (*row, *share)
            rows.append(row)
    more = ("SIMULATED", "RECORDINGS SAY") if simulated else ()
    return "scenarios", ("SCENARIO", *_COMPARED, *more), rows


def models_table(found: ModelsEvaluation) -> Table:
    """Each model beside each that comes before it."""
    several = len({each.scenario for each in found.pairs}) > 1
    head = ("MODEL", "BESIDE", "WHAT", "OBJECTS", "MISSED", "BY THE OTHER", "POINTS", "P", "CORRECTED", "RECORDINGS",
            "SAYS")  # fmt: skip
    rows: list[tuple[str, ...]] = []
    for each in found.pairs:
        missed, other, chance, corrected, recordings, says = _said(each)
        cells = (each.model, each.baseline, each.about, f"{each.share.of:g}", missed, other, _points(each), chance,
                 corrected, recordings, says)  # fmt: skip
        rows.append((each.scenario, *cells) if several else cells)
    return "models, each beside those before it", ("SCENARIO", *head) if several else head, rows


def balance_table(each: Balance) -> Table:
    """How alike the objects in question and those beside them are."""
    rows: list[tuple[str, ...]] = []
    for one in each.covariates:
        spread = f"{one.by}: {100 * one.common:.0f} % in common"
        if not math.isnan(one.means[0]):
            spread += f", means {one.means[0]:.1f} and {one.means[1]:.1f} m"
        if not math.isnan(one.apart):
            spread += f", {abs(one.apart):.2f} standard deviations apart"
        for number, (name, own, others) in enumerate(one.parts):
            rows.append((spread if number == 0 else "", name, _percent(own), _percent(others)))
    return f"{each.about} and those beside it: how alike they are", ("WHAT", "PART", "IN QUESTION", "OTHERS"), rows


def _points(each: ShareComparison) -> str:
    """The difference in points, with its interval."""
    return "-" if math.isnan(each.difference) else in_points(each.difference, each.interval)


def frame_counts(scenario: ScenarioEvaluation) -> str:
    """How many frames match, do not, and are undecided, in words."""
    told = f"{scenario.matching:,} frames match, {scenario.other:,} do not"
    undecided = scenario.undecided
    return f"{told}, {undecided:,} {'is' if undecided == 1 else 'are'} undecided" if undecided else told


def tables(scenario: ScenarioEvaluation, within: FoundWithin) -> list[Table]:
    """The tables for people: roles, each class at its centre distance, slices."""
    found: list[Table] = [
        (
            "missed",
            _COMPARED,
            [_compared(each) for each in (*scenario.roles, scenario.all_objects)],
        )
    ]
    classes = [each for each in scenario.classes if each.distance_m == within.metres(each.category)]
    errors = {(each.category, each.group): each.errors for each in scenario.classes if each.errors}
    told = [name for name in ERRORS if any(name in each for each in errors.values())]
    heads = (
        "CLASS",
        "FRAMES",
        "OBJECTS",
        "RECALL",
        "PRECISION",
        "AP",
        *(f"{name.upper()} ({_UNITS[name]})" for name in told),
    )
    rows = [
        (
            each.category,
            each.group,
            f"{each.objects}",
            _percent(*each.recall),
            _percent(*each.precision),
            _percent(*each.average_precision),
            *(_error(errors.get((each.category, each.group), {}).get(name)) for name in told),
        )
        for each in sorted(classes, key=lambda each: each.category)
    ]
    found.append((f"classes, found within {within}, errors within 2 m", heads, rows))
    cut = [
        (
            each.title,
            each.part,
            f"{each.share.of:g}",
            f"{each.share.recordings:.1f}",
            _percent(each.share.rate, each.share.interval),
            "-" if each.other is None else _percent(each.other.rate, each.other.interval),
        )
        for each in scenario.slices
    ]
    found.append(("slices", ("BY", "PART", "OBJECTS", "RECORDINGS", "MISSED", "OTHERS"), cut))
    return [table for table in found if table[2]]


_COMPARED = ("WHAT", "OBJECTS", "MISSED", "OTHERS ALIKE", "P", "CORRECTED", "RECORDINGS", "SAYS")


def _compared(each: ObjectComparison) -> tuple[str, ...]:
    objects = f"{each.share.of:g}" + (f" of {each.asked}" if each.asked > each.share.of else "")
    return (each.about, objects, *_said(each))


def _said(each: ShareComparison) -> tuple[str, str, str, str, str, str]:
    """Both shares, the p-value, the corrected one, recordings, and what they say."""

    def shown(value: float) -> str:
        return "-" if math.isnan(value) else p_text(value).removeprefix("p ").removeprefix("= ")

    equal = f" (as {each.effective:.1f} equal ones)" if each.effective < each.recordings - 0.05 else ""
    return (
        _percent(each.share.rate, each.share.interval),
        _percent(each.other.rate, each.other.interval),
        shown(each.p_value),
        shown(each.p_corrected),
        f"{each.recordings}{equal}",
        each.says,
    )


def _error(figure: tuple[float, tuple[float, float]] | None) -> str:
    if figure is None or math.isnan(figure[0]):
        return "-"
    value, (low, high) = figure
    return f"{value:.2f}" if math.isnan(low) else f"{value:.2f} [{low:.2f}, {high:.2f}]"
