"""The figures of an evaluation, each declared once with where it goes: JSON, the flat table, tables for people."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import Any

from scenicq.evaluate.balance import Balance
from scenicq.evaluate.benchmark import BenchmarkFigures
from scenicq.evaluate.classes import ClassFigures
from scenicq.evaluate.comparison import ShareComparison, format_points, p_text
from scenicq.evaluate.controls import PLACES
from scenicq.evaluate.detection import DetectionDistances
from scenicq.evaluate.evaluation import Evaluation, ModelsEvaluation, ScenarioEvaluation
from scenicq.evaluate.precision import ERRORS

__all__ = [
    "COLUMNS",
    "Table",
    "balance_table",
    "evaluation_record",
    "flat_rows",
    "frame_counts",
    "models_record",
    "models_rows",
    "models_table",
    "overview",
    "tables",
    "worst_table",
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

_ABSENT = object()
"""What is not said at all."""


@dataclass(frozen=True, slots=True)
class _Figure:
    """A figure of something that was judged, and where it goes.

    Attributes:
        name: Its name in JSON; "" where it is not there.
        value: Makes it of what was judged.
        column: Its column of the flat table; "" where it has none.
        head: The heading of its column in tables for people; "" where it has none.
        cell: Makes its text there, of what was judged.
        parts: The figures of the value, where it has some itself.
        prefix: What the columns of the parts begin with; None where they are in JSON alone.
    """

    name: str
    value: Callable[[Any], Any]
    column: str = ""
    head: str = ""
    cell: Callable[[Any], str] = str
    parts: tuple[_Figure, ...] = ()
    prefix: str | None = None


def _figure(
    name: str, of: str | Callable[[Any], Any] = "", column: str = "", head: str = "",
    cell: Callable[[Any], str] | None = None,
) -> _Figure:  # fmt: skip
    """A figure that is an attribute, by default the one of its name."""
    value: Callable[[Any], Any] = attrgetter(of or name) if isinstance(of, str) else of
    return _Figure(name, value, column, head, cell or (lambda each: str(value(each))))


def _cell(head: str, cell: Callable[[Any], str]) -> _Figure:
    """What tables for people alone have."""
    return _Figure("", str, head=head, cell=cell)


def _column(column: str, of: str | Callable[[Any], Any]) -> _Figure:
    """What the flat table alone has."""
    return _figure("", of, column=column)


def _interval(attribute: str = "interval", before: str = "", column: bool = True) -> Iterator[_Figure]:
    """Both ends of an interval."""
    for number, end in enumerate(("low", "high")):
        get = attrgetter(attribute)
        yield _figure(
            f"{before}{end}", lambda each, get=get, at=number: get(each)[at], column=f"{before}{end}" if column else ""
        )


def _rounded(attribute: str) -> Callable[[Any], float]:
    get = attrgetter(attribute)
    return lambda each: round(get(each), 2)


def _percent(value: float, interval: tuple[float, float] | None = None) -> str:
    if math.isnan(value):
        return "-"
    text = f"{100 * value:.0f} %"
    if interval is not None and not math.isnan(interval[0]):
        text += f" [{100 * interval[0]:.0f}, {100 * interval[1]:.0f}]"
    return text


def _error(figure: tuple[float, tuple[float, float]] | None) -> str:
    if figure is None or math.isnan(figure[0]):
        return "-"
    value, (low, high) = figure
    return f"{value:.2f}" if math.isnan(low) else f"{value:.2f} [{low:.2f}, {high:.2f}]"


def _chance(value: float) -> str:
    return "-" if math.isnan(value) else p_text(value).removeprefix("p ").removeprefix("= ")


def _points(each: ShareComparison) -> str:
    """The difference in points, with its interval."""
    return "-" if math.isnan(each.difference) else format_points(each.difference, each.interval)


def _recordings(each: ShareComparison) -> str:
    equal = f" (as {each.effective:.1f} equal ones)" if each.effective < each.recordings - 0.05 else ""
    return f"{each.recordings}{equal}"


_SHARE = (
    _figure("missed"),
    _figure("of", column="objects"),
    _figure("rate", column="value"),
    *_interval(),
    _figure("effective_recordings", lambda each: _ABSENT if math.isnan(each.recordings) else round(each.recordings, 2)),
)


def _share(name: str, attribute: str, head: str = "", prefix: str | None = "") -> _Figure:
    """A share, which may be None."""
    get = attrgetter(attribute)

    def cell(each: Any) -> str:
        share = get(each)
        return "-" if share is None else _percent(share.rate, share.interval)

    return _Figure(name, get, head=head, cell=cell, parts=_SHARE, prefix=prefix)


_TESTED = (
    _figure("difference", column="difference"),
    *_interval("interval", "difference_"),
    _figure("p_value", column="p_value", head="P", cell=lambda each: _chance(each.p_value)),
    _figure("p_corrected", column="p_corrected", head="CORRECTED", cell=lambda each: _chance(each.p_corrected)),
    _figure("recordings", head="RECORDINGS", cell=_recordings),
    _figure("effective_recordings", _rounded("effective")),
    _column("recordings", "effective"),
    _figure("unit"),
)
_CONCLUSION = (
    _figure("margin"),
    _figure("says", column="says", head="SAYS"),
    _figure("missing", lambda each: list(each.missing)),
    _figure("because", column="because"),
    _figure("more_recordings", "more"),
    _figure("sentence"),
)
_COMPARISON = (
    _figure("about", column="about", head="WHAT"),
    _cell("OBJECTS", lambda e: f"{e.share.of:g}" + (f" of {e.asked}" if e.asked > e.share.of else "")),
    _share("missed", "share", "MISSED"),
    _share("others", "other", "OTHERS ALIKE", "other_"),
    *_TESTED,
    _figure("asked"),
    _figure("alone", column="alone"),
    _figure("uncounted"),
    _figure("controls", lambda each: dict(zip(PLACES, each.places, strict=True))),
    *_CONCLUSION,
)
"""Objects in question against others."""
_PAIR = (
    _figure("scenario", column="scenario"),
    _figure("about", column="about"),
    _figure("model", column="model", head="MODEL"),
    _figure("baseline", column="group", head="BESIDE"),
    _cell("WHAT", lambda each: each.about),
    _cell("OBJECTS", lambda each: f"{each.share.of:g}"),
    _share("missed", "share", "MISSED"),
    _share("missed_by_baseline", "other", "BY THE OTHER", "other_"),
    _figure("missed_by_model_alone", "only_model"),
    _figure("missed_by_baseline_alone", "only_baseline"),
    _cell("POINTS", _points),
    *_TESTED,
    *_CONCLUSION,
)
"""Two models beside each other; the others are the same objects, as the baseline has missed them."""
_WEIGHTED = (
    _figure("about", column="about"),
    _share("missed", "share"),
    _figure("objects"),
    _figure("left_out"),
    _figure("equal_objects", _rounded("equal")),
    _column("objects", "equal"),
    _figure("effective_recordings", _rounded("recordings")),
    _column("recordings", "recordings"),
    _figure("sentence"),
)
_CLASS = (
    _figure("class", "category", column="about", head="CLASS"),
    _figure("group", column="group", head="FRAMES"),
    _figure("distance_m", column="distance_m"),
    _figure("objects", column="objects", head="OBJECTS"),
    _figure("predictions"),
    _figure("effective_recordings", _rounded("recordings")),
    _column("recordings", "recordings"),
    _cell("RECALL", lambda each: _percent(*each.recall)),
    _cell("PRECISION", lambda each: _percent(*each.precision)),
    _cell("AP", lambda each: _percent(*each.average_precision)),
)
"""One class; its measures follow, each with `_MEASURE`."""
_MEASURE = (
    _figure("value", lambda each: each[0], column="value"),
    _figure("low", lambda each: each[1][0], column="low"),
    _figure("high", lambda each: each[1][1], column="high"),
)
_SLICE = (
    _figure("by", column="about", head="BY", cell=lambda each: each.title),
    _figure("source", lambda each: each.source or _ABSENT),
    _figure("part", column="part", head="PART"),
    _cell("OBJECTS", lambda each: f"{each.share.of:g}"),
    _cell("RECORDINGS", lambda each: f"{each.share.recordings:.1f}"),
    _share("missed", "share", "MISSED"),
    _share("others", "other", "OTHERS", "other_"),
    _column("recordings", "share.recordings"),
)
_COVARIATE = (
    _figure("by"),
    _figure("mean", lambda each: each.means[0]),
    _figure("mean_of_others", lambda each: each.means[1]),
    _figure("standardized_difference", "apart"),
    _figure("in_common", "common"),
    _figure(
        "parts",
        lambda each: [{"part": name, "share": own, "share_of_others": others} for name, own, others in each.parts],
    ),
)
_BALANCE = (
    _figure("about"),
    _figure("covariates", lambda each: [_nested(_COVARIATE, one) for one in each.covariates]),
)
_WORST = (
    _figure("frame", column="about", head="FRAME"),
    _figure("recording", head="RECORDING"),
    _figure("missed", head="MISSED", cell=lambda each: f"{each.missed} of {each.of}"),
    _figure("of", column="objects"),
    _column("value", lambda each: each.missed / each.of if each.of else math.nan),
    _figure("false", head="FALSE BOXES"),
)
_PAIRED_RUNS = (
    _figure("pairs"),
    _figure("without_runs", "without"),
    _figure("unit"),
    _share("missed", "real", prefix=None),
    _figure("failed", "simulated"),
    _figure("difference"),
    *_interval("interval", "difference_", column=False),
    _figure("explained"),
    _Figure(
        "with_control_variate",
        lambda each: each.adjusted,
        parts=(_figure("rate", lambda each: each[0]), *_MEASURE[1:]),
    ),
    _figure("sentence"),
)
_SIMULATED = (
    _share("failed", "share"),
    _figure("says", column="about"),
    _figure("sentence"),
    _Figure("paired", lambda each: each.paired, parts=_PAIRED_RUNS),
)


def _plain(value: Any) -> Any:
    return None if isinstance(value, float) and math.isnan(value) else value


def _nested(figures: Iterable[_Figure], each: Any) -> dict[str, Any]:
    """What was judged as nested values, ready for JSON."""
    found: dict[str, Any] = {}
    for figure in figures:
        value = figure.value(each) if figure.name else _ABSENT
        if value is not _ABSENT:
            found[figure.name] = _nested(figure.parts, value) if figure.parts and value is not None else _plain(value)
    return found


def _flat(figures: Iterable[_Figure], each: Any, prefix: str = "") -> dict[str, Any]:
    """What was judged as values of the flat table's columns."""
    found: dict[str, Any] = {}
    for figure in figures:
        if figure.prefix is not None and (value := figure.value(each)) is not None:
            found |= _flat(figure.parts, value, figure.prefix)
        elif figure.column:
            found[f"{prefix}{figure.column}"] = figure.value(each)
    return found


def _row(table: str, *parts: Mapping[str, Any], **given: Any) -> dict[str, Any]:
    """A row of the flat table."""
    row: dict[str, Any] = {**dict.fromkeys(COLUMNS), "scenario": "", "table": table}
    for part in (*parts, given):
        row |= part
    known = {name: _plain(value) for name, value in row.items()}
    return {name: float(v) if COLUMNS[name] is float and v is not None else v for name, v in known.items()}


def _table(title: str, figures: Sequence[_Figure], of: Iterable[Any]) -> Table:
    """What was judged as a table for people."""
    shown = [figure for figure in figures if figure.head]
    return title, tuple(each.head for each in shown), [tuple(f.cell(each) for f in shown) for each in of]


def _measures(each: ClassFigures) -> dict[str, tuple[float, tuple[float, float]]]:
    whole = {"recall": each.recall, "precision": each.precision, "average_precision": each.average_precision}
    return {**whole, **each.errors}


def _benchmark(each: BenchmarkFigures) -> dict[str, Any]:
    return {
        "name": each.name,
        "frames": each.frames,
        each.measure: _plain(each.score),
        "mean_average_precision": _plain(each.average_precision),
        "mean_errors": {name: _plain(value) for name, value in each.errors.items()},
        "classes": each.classes,
        "classes_without_labels": list(each.without_labels),
        "sentence": each.sentence,
    }


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
        "pairs": [_nested(_PAIR, each) for each in found.pairs],
        "warnings": [each.message for each in found.warnings],
    }


def _scenario(each: ScenarioEvaluation) -> dict[str, Any]:
    found: dict[str, Any] = {
        "scenario": each.name,
        "matching_frames": each.matching,
        "other_frames": each.other,
        "undecided_frames": each.undecided,
        "findings": [one.finding(each.undecided) for one in each.headline],
        "roles": [_nested(_COMPARISON, role) for role in each.roles],
        "all_objects": _nested(_COMPARISON, each.all_objects),
        "weighted": [_nested(_WEIGHTED, one) for one in each.weighted],
        "classes": [
            {**_nested(_CLASS, one), **{name: _nested(_MEASURE, figure) for name, figure in _measures(one).items()}}
            for one in each.classes
        ],
        "slices": [_nested(_SLICE, part) for part in each.slices],
        "balance": [_nested(_BALANCE, one) for one in each.balances],
        "worst_frames": [_nested(_WORST, one) for one in each.worst],
    }
    if each.simulated is not None:
        found["simulated"] = _nested(_SIMULATED, each.simulated)
    return found


def flat_rows(evaluation: Evaluation) -> Iterator[dict[str, Any]]:
    """One row a figure, with the keys of `COLUMNS`; those of the benchmark are of no scenario."""
    if (whole := evaluation.benchmark) is not None:
        measures = {whole.measure: whole.score, "average_precision": whole.average_precision, **whole.errors}
        for name, value in measures.items():
            yield _row("benchmark", about=whole.name, measure=name, value=value)
    for one in evaluation.scenarios:
        yield from ({**row, "scenario": one.name} for row in _rows_of(one))


def _rows_of(one: ScenarioEvaluation) -> Iterator[dict[str, Any]]:
    """The rows of a scenario, but for its name."""
    for table, figures, compared in (
        ("roles", _COMPARISON, one.roles),
        ("all", _COMPARISON, (one.all_objects,)),
        ("weighted", _WEIGHTED, one.weighted),
    ):
        yield from (_row(table, _flat(figures, each), measure="missed") for each in compared)
    for each in one.classes:
        for name, figure in _measures(each).items():
            yield _row("classes", _flat(_CLASS, each), _flat(_MEASURE, figure), measure=name)
    yield from (_row("slices", _flat(_SLICE, each), measure="missed") for each in one.slices)
    if one.simulated is not None:
        yield _row("simulated", _flat(_SIMULATED, one.simulated), measure="failed")
    yield from (_row("frames", _flat(_WORST, each), measure="missed") for each in one.worst)


def models_rows(found: ModelsEvaluation) -> Iterator[dict[str, Any]]:
    """One row a figure of each model, and one a pair, with the keys of `COLUMNS`."""
    for name, each in found.models.items():
        model = None if found.only is not None else name
        yield from ({**row, "model": model} for row in flat_rows(each))
    yield from (_row("pairs", _flat(_PAIR, pair), measure="missed") for pair in found.pairs)


_UNITS = {"translation": "m", "scale": "1 - IoU", "orientation": "rad", "velocity": "m/s", "attribute": "share wrong"}
"""Units of the errors of boxes that were found."""


def overview(evaluation: Evaluation) -> Table:
    """The answers of all scenarios in one table."""
    rows = [(one, each) for one in evaluation.scenarios for each in one.headline]
    _, head, cells = _table("", _COMPARISON, (each for _, each in rows))
    cells = [(one.name, *row) for (one, _), row in zip(rows, cells, strict=True)]
    if any(each.simulated is not None for each in evaluation.scenarios):
        head = (*head, "SIMULATED", "RECORDINGS SAY")
        for number, (one, each) in enumerate(rows):
            told = one.simulated if one.simulated is not None and one.simulated.about == each.about else None
            share = ("", "") if told is None else (_percent(told.share.rate, told.share.interval), told.says)
            cells[number] += share
    return "scenarios", ("SCENARIO", *head), cells


def models_table(found: ModelsEvaluation) -> Table:
    """Each model beside each that comes before it."""
    several = len({each.scenario for each in found.pairs}) > 1
    first = (_cell("SCENARIO", lambda each: each.scenario),) if several else ()
    return _table("models, each beside those before it", (*first, *_PAIR), found.pairs)


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


def frame_counts(scenario: ScenarioEvaluation) -> str:
    """How many frames match, do not, and are undecided, in words."""
    told = f"{scenario.matching:,} frames match, {scenario.other:,} do not"
    undecided = scenario.undecided
    return f"{told}, {undecided:,} {'is' if undecided == 1 else 'are'} undecided" if undecided else told


def tables(scenario: ScenarioEvaluation, within: DetectionDistances) -> list[Table]:
    """The tables for people: roles, each class at its centre distance, slices."""
    errors = {(each.category, each.group): each.errors for each in scenario.classes if each.errors}
    told = [name for name in ERRORS if any(name in each for each in errors.values())]
    columns = [
        _cell(f"{n.upper()} ({_UNITS[n]})", lambda e, n=n: _error(errors.get((e.category, e.group), {}).get(n)))
        for n in told
    ]
    classes = [each for each in scenario.classes if each.distance_m == within.metres(each.category)]
    found = [
        _table("missed", _COMPARISON, (*scenario.roles, scenario.all_objects)),
        _table(
            f"classes, found within {within}, errors within 2 m",
            (*_CLASS, *columns),
            sorted(classes, key=lambda each: each.category),
        ),
        _table("slices", _SLICE, scenario.slices),
    ]
    return [table for table in found if table[2]]


def worst_table(scenario: ScenarioEvaluation, most: int) -> Table:
    """Frames that match, the worst first."""
    return _table("worst frames", _WORST, scenario.worst[:most])
