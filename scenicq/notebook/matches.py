"""What a query has found: results to go through, as a table, in words, as pictures and as a report."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

import msgspec

from scenicq.errors import render
from scenicq.evaluate.evaluation import evaluate_models, name_models
from scenicq.evaluate.evaluation_options import EvaluationTexts
from scenicq.lint.program import lint_query
from scenicq.match.matcher import Matcher
from scenicq.match.verdict import NoMatch
from scenicq.notebook.judgements import Judgement
from scenicq.notebook.pictures import SCROLLS, DisplayedText, Picture, take_picture
from scenicq.query.execution.interval_frames import verdict_at
from scenicq.query.execution.lazy_solver import LazySolver
from scenicq.query.execution.option_texts import read_options
from scenicq.query.execution.recorded_columns import flat_table
from scenicq.query.execution.records import json_text, record
from scenicq.query.execution.result_origin import name_origin
from scenicq.query.execution.result_summary import ResultCount, ResultSummary
from scenicq.query.execution.result_tables import result_schema, result_table, summary_metadata
from scenicq.query.execution.results import Funnel, ModeRecord, Result
from scenicq.query.execution.run import Query
from scenicq.query.execution.skipped_frames import summarize
from scenicq.query.explain.frame_explanation import explain, show_explanation
from scenicq.query.explain.interval_explanation import explain_beginning, explain_recording
from scenicq.query.explain.moments import intervals_around, named_frame, named_moment
from scenicq.report.backdrop import Backdrop
from scenicq.report.picture import LETTERS, Shot, draw
from scenicq.report.write import write_report
from scenicq.store.labels import Label
from scenicq.store.remote_path import AnyPath, any_path

if TYPE_CHECKING:
    import pyarrow as pa

__all__ = ["FrameResult", "Matches"]

_ROWS, _PICTURES = 20, 3
"""Results that a notebook shows at most: as rows, and as pictures."""
_FAILURES = 5
"""What frames fail at that a notebook names at most, where nothing is found."""
_HEAD = ("frame", "recording", "verdict", "objects")
_INTERVAL_HEAD = ("recording", "start_us", "seconds", "frames", "verdict", "objects")
_SMALL = 260
"""Width in pixels of a picture beside others."""
_LETTERS = 2 * LETTERS
"""Height of names in such a picture, where they could not be read else."""
_TILE = f"display:inline-block;margin:4px;vertical-align:top;width:{_SMALL}px;overflow-wrap:anywhere"


class _Origin:
    """What a result came out of: no field of it, as tables and copies of a result are about its frame alone."""

    __slots__ = ("matches", "result")
    matches: Matches
    result: Result


@dataclass(frozen=True, slots=True, repr=False)
class FrameResult(_Origin):
    """The verdict on one frame or interval, as plain values: `dataclasses.asdict`, pandas and Polars take it as it is.

    Attributes:
        frame: Name of the frame, of an interval the first.
        recording: Name of the recording.
        timestamp_us: When, in microseconds.
        verdict: `match`, `no_match` or `unknown`.
        roles: The label object of each object of the program; the track of an interval.
        witness: A value of each random variable that proves a match, by its place in the program.
        sensors: The sensor file of each channel; none of an interval.
        end_us: When the interval ends; of a frame its time.
        frames: How many frames it has; 1 of a frame.
        recorded: What the program records, by name: a value, over an interval a mapping with the values at its samples.
    """

    frame: str
    recording: str
    timestamp_us: int
    verdict: str
    roles: Mapping[str, str]
    witness: Mapping[str, Any]
    sensors: Mapping[str, str]
    end_us: int
    frames: int
    recorded: Mapping[str, Any]

    @staticmethod
    def of(matches: Matches, result: Result) -> FrameResult:
        """The result of a query.

        Args:
            matches: The query that it came out of.
            result: Frame, verdict and sensor files.
        """
        told, span = record(result), result.interval
        made = FrameResult(
            result.frame, result.recording, result.timestamp_us, told.verdict, told.correspondence, told.witness,
            dict(result.sensors), *((result.timestamp_us, 1) if span is None else (span.end_us, span.count)),
            msgspec.to_builtins(told.recorded or {}),
        )  # fmt: skip
        object.__setattr__(made, "matches", matches)
        object.__setattr__(made, "result", result)
        return made

    def __hash__(self) -> int:
        """By the frame."""
        return hash((self.frame, self.recording, self.timestamp_us, self.verdict))

    def __reduce__(self) -> tuple[Callable[..., FrameResult], tuple[Matches, Result]]:
        """Pickled with the query that it came out of, but not with its other results."""
        return FrameResult.of, (self.matches.without_results(), self.result)

    @property
    def record(self) -> Mapping[str, Any]:
        """The values that a line of `scenicq match --format jsonl` has."""
        query = self.matches.query
        (told,) = query.with_timelines([self.result])
        return json.loads(json_text(record(told, self.matches.origin, every=query.options.all_matches)))

    @property
    def timeline(self) -> tuple[ModeRecord, ...]:
        """What roles, monitors and scenarios of an interval that matches do from when to when, found when asked."""
        (told,) = self.matches.query.with_timelines([self.result])
        return told.timeline or ()

    def explain(self) -> DisplayedText:
        """Say why the frame or interval matches, or what prevents it."""
        if self.result.interval is None:
            return self.matches.explain(self.frame)
        query = self.matches.query
        with LazySolver(query.options.solver) as solver:
            return DisplayedText(explain_recording(query, solver, self.recording, self.timestamp_us).text())

    def show(self, *, half: float | None = None, width: int = 600) -> Picture:
        """The frame from above, with what the program says of it; of an interval its first."""
        if self.result.interval is None:
            return self.matches.show(self.frame, half=half, width=width)
        return take_picture(*self.matches.shot_of(self.result), half, width)

    def _repr_svg_(self) -> str:
        return self.show().svg

    def __repr__(self) -> str:
        """Frame, verdict and roles."""
        roles = " ".join(f"{role}={played}" for role, played in self.roles.items() if (role, played) != ("ego", "ego"))
        return f"<{self.verdict} {self.frame}{': ' if roles else ''}{roles}>"


@dataclass(eq=False, repr=False)
class Matches(Sequence[FrameResult]):
    """The results of a query, found while one goes through them and kept.

    `len`, an index and a table need all of them. Whatever is wrong with the program is said when the query is made.

    Attributes:
        query: Dataset, program and options.
        origin: The dataset and its version, as results name it.
    """

    query: Query
    _found: list[FrameResult] = field(default_factory=list["FrameResult"])
    _rest: Iterator[Result] | None = None
    _backdrops: dict[str, Backdrop] = field(default_factory=dict[str, Backdrop])
    origin: str = field(init=False)

    def __post_init__(self) -> None:
        """Compile the program, so that its errors come now."""
        self.query.plans()
        self.query.selection()
        self.origin = name_origin(self.query.dataset)

    @classmethod
    def restored(cls, query: Query, origin: str, results: Sequence[Result] | None) -> Matches:
        """Matches as they were; the program is compiled when it is needed.

        Args:
            query: Dataset, program and options.
            origin: The dataset and its version, as results name it.
            results: What was found, None if it was not looked for.
        """
        made = object.__new__(cls)
        made.query, made.origin, made._backdrops = query, origin, {}
        made._rest = None if results is None else iter(())
        made._found = [FrameResult.of(made, each) for each in results or ()]
        return made

    def without_results(self) -> Matches:
        """The query with none of its results found yet."""
        return Matches.restored(self.query, self.origin, None)

    def __reduce__(self) -> tuple[Callable[..., Matches], tuple[Query, str, list[Result] | None]]:
        """Pickled with all its results; of a query that was not asked yet, without."""
        query = self.query
        bare = Query(query.dataset, query.source, query.options, query.recordings, query.funnel, query.siblings)
        return Matches.restored, (
            bare,
            self.origin,
            [each.result for each in self._all()] if self._rest is not None else None,
        )

    def __iter__(self) -> Iterator[FrameResult]:
        """The results in the order of recording, time and frame."""
        number = 0
        while number < len(self._found) or self._take():
            yield self._found[number]
            number += 1

    def _take(self) -> bool:
        """Find one more result."""
        if self._rest is None:
            results, selection = self.query.results(), self.query.selection()
            if selection is not None:
                results = selection.applied(results, self.query.funnel, lambda found: found)
            self._rest = results
        for result in self._rest:
            self._found.append(FrameResult.of(self, result))
            return True
        return False

    def _all(self) -> list[FrameResult]:
        while self._take():
            pass
        return self._found

    def __len__(self) -> int:
        """How many results there are."""
        return len(self._all())

    def __getitem__(self, which: Any) -> Any:
        """A result by its number, several by a slice."""
        found: Any = self._all()[which]
        return found

    def select(self, *, where: str | None = None, sort: str | None = None) -> Matches:
        """Some of the matches, or all in another order, by what the program records; nothing is matched again.

        Args:
            where: A condition on what is recorded, such as `"gap < 5"`; over time `"gap.minimum < 5"`.
            sort: What to order by, such as `"gap"`, or `"gap:desc"` from the greatest.

        Raises:
            DataError: option-invalid: there is no such value.
        """
        before, results = self.query, [each.result for each in self._all()]
        asked = read_options(where=where, sort=sort)
        options = replace(before.options, where=asked.where, sort=asked.sort, limit=None)
        query = Query(
            before.dataset, before.source, options, before.recordings, replace(before.funnel), before.siblings
        )
        selection = query.selection()
        if selection is not None:
            results = list(selection.ordered(selection.filtered(results)))
            query.funnel.chosen = selection.chosen().after(before.funnel.chosen)
        return Matches.restored(query, self.origin, results)

    @property
    def funnel(self) -> Funnel:
        """How many frames each step has left, and what the others failed at; complete once all results are found."""
        self._all()
        return self.query.funnel

    @property
    def summary(self) -> ResultSummary:
        """What the results say of themselves: whether all frames were looked at, and how many are undecided."""
        every, counted = self.query.options.all_matches, ResultCount()
        for each in self._all():
            counted.add(record(each.result, every=every))
        return summarize(self.query, counted)

    @property
    def warnings(self) -> tuple[DisplayedText, ...]:
        """What the author of the program should know: what cannot be meant, and what no label has to compare."""
        return tuple(DisplayedText(render(each)) for each in (*self.funnel.warnings, *lint_query(self.query)))

    def to_arrow(self) -> pa.Table:
        """The results as an Arrow table with a field a role, as `-o FILE.parquet` has it."""
        every = self.query.options.all_matches
        schema = result_schema(
            self.query.roles(), origin=self.origin, over_time=self.query.is_over_time(), every=every,
            recorded=self.query.recorded_columns(), timelines=self.query.has_timelines(),
        )  # fmt: skip
        schema = schema.with_metadata({**(schema.metadata or {}), **summary_metadata(self.summary)})
        results = self.query.with_timelines([each.result for each in self._all()])
        return result_table((record(each, every=every) for each in results), schema)

    def to_pandas(self) -> Any:
        """The results as a data frame, what is recorded in columns as CSV has them; pandas is to be installed."""
        return flat_table(self.to_arrow()).to_pandas()

    def shot_of(self, result: Result) -> tuple[Shot, Backdrop]:
        """What a picture of a result shows; an interval shows its first frame, with the objects in the roles there."""
        if result.interval is None:
            return self._shot(result.frame)
        return self._shot_in(self.query.dataset.label(result.frame), result)

    def _shot_in(self, label: Label, interval: Result) -> tuple[Shot, Backdrop]:
        """A frame of an interval, with the objects in the roles there."""
        scenario = self.query.compiled_map(label.map).scenario
        return Shot(label, scenario, verdict_at(label, interval)), self._backdrop(label)

    def _backdrop(self, label: Label) -> Backdrop:
        if label.map not in self._backdrops:
            self._backdrops[label.map] = Backdrop(self.query.dataset.network(label.map))
        return self._backdrops[label.map]

    def _shot(self, frame: str) -> tuple[Shot, Backdrop]:
        label = named_frame(self.query.dataset, frame)
        if self.query.is_over_time() and (around := intervals_around(self.query, label)):
            return self._shot_in(label, around[0])
        world = self.query.compiled_map(label.map)
        with LazySolver(self.query.options.solver) as solver:
            matcher = Matcher(world.scenario, self.query.options.match, solver)
            verdict = matcher.match(label)
            why = explain(matcher, label) if isinstance(verdict, NoMatch) else None
        return Shot(label, world.scenario, verdict, why), self._backdrop(label)

    def explain(self, frame: str) -> DisplayedText:
        """Say why a frame or recording matches, or what prevents it and which change would make it match.

        Args:
            frame: The name of any frame of the dataset; over time also of a recording, and after `@` when the interval
                begins, as a timestamp or in seconds, such as `scene-0061@3.5s`.

        Raises:
            DataError: option-invalid: there is no such frame.
        """
        dataset, over_time = self.query.dataset, self.query.is_over_time()
        with LazySolver(self.query.options.solver) as solver:
            if over_time and (moment := named_moment(dataset, frame)) is not None:
                return DisplayedText(explain_recording(self.query, solver, *moment).text())
            label = named_frame(dataset, frame)
            if over_time:
                return DisplayedText(explain_beginning(self.query, solver, label)[1])
            matcher = Matcher(self.query.compiled_map(label.map).scenario, self.query.options.match, solver)
            return DisplayedText(show_explanation(explain(matcher, label)))

    def show(self, frame: str, *, half: float | None = None, width: int = 600) -> Picture:
        """A frame from above, with what the program says of it; over time with the roles of the interval around it.

        Args:
            frame: The name of any frame of the dataset, or of a recording and after `@` a timestamp, or seconds.
            half: Metres from the ego to the edges, 1 to 1,000; chosen if None.
            width: In pixels, 50 to 10,000.

        Raises:
            DataError: option-invalid: there is no such frame, or no such size.
        """
        return take_picture(*self._shot(frame), half, width)

    def report(self, folder: str | Path, *, sensors: str | Path | None = None) -> AnyPath:
        """Write a page with pictures of the results.

        Args:
            folder: New, empty, or with an older report; or a new one elsewhere, as `s3://bucket/report`.
            sensors: The folder that the paths of sensor files start from.

        Returns:
            The page.

        Raises:
            DataError: target-exists, or target-unwritable.
        """
        results = [each.result for each in self._all()]
        return write_report(self.query, results, any_path(folder), sensors=None if sensors is None else Path(sensors))

    def evaluate(self, predictions: str | Path | Sequence[str | Path], **options: Unpack[EvaluationTexts]) -> Judgement:
        """Say whether a model fails on the frames that match.

        Args:
            predictions: A file of what the model has detected; or those of several models, each of which is also
                compared with those before it.
            options: As of `scenicq evaluate`, such as `distance_m=1`, `missing="empty"`, `cluster="drive"` or `seed=7`;
                `scenicq.evaluate.evaluation.evaluate` lists them.

        Raises:
            DataError: A file cannot be read or does not fit the dataset; option-invalid for another distance, seed or
                score, or another word for `missing`.
        """
        name = Path(self.query.source.name.strip("<>")).stem
        paths = (predictions,) if isinstance(predictions, str | Path) else tuple(predictions)
        models = name_models([Path(each) for each in paths])
        judged = evaluate_models(
            {name: self.query}, self.query.dataset, dict(zip(models, paths, strict=True)), **options
        )
        return Judgement(judged.only or judged, self.query.dataset)

    def __repr__(self) -> str:
        """What was asked and, once known, how many results there are."""
        known = f"{len(self._found)} results" if self._rest is not None else "not yet looked for"
        if self.query.funnel.limited is not None:
            known += f", not complete: {self.summary.why_cut}"
        return f"<{self.query.source.name} on {self.query.dataset.name}: {known}>"

    def _repr_html_(self) -> str:
        funnel = self.funnel
        pictures = "".join(f'<div style="{_TILE}">{self._tile(each)}</div>' for each in self._found[:_PICTURES])
        over_time = self.query.is_over_time()
        head = "".join(f"<th>{name}</th>" for name in (_INTERVAL_HEAD if over_time else _HEAD))
        rows = "".join(f"<tr>{_cells(each)}</tr>" for each in self._found[:_ROWS])
        more = f"<p>and {len(self._found) - _ROWS} more</p>" if len(self._found) > _ROWS else ""
        told = f"{funnel.matches} of {funnel.frames} frames match, {funnel.unknowns} unknown"
        if over_time:
            what = "interval matches" if funnel.matches == 1 else "intervals match"
            of = f"{funnel.frames:,} frames of {funnel.over_time['recordings']:,} recordings"
            told = f"{funnel.matches:,} {what}, {funnel.unknowns:,} unknown, in {of}"
        told += f"; not complete: {cut}" if (cut := self.summary.why_cut) else ""
        notes = "".join(f'<pre style="{SCROLLS}">{escape(text)}</pre>' for text in self.warnings)
        table = f'<div style="{SCROLLS}"><table><tr>{head}</tr>{rows}</table></div>'
        if not self._found:
            table = self._failures(over_time=over_time)
        return f"<p>{told}</p>{notes}<div>{pictures}</div>{table}{more}"

    def _failures(self, *, over_time: bool) -> str:
        """What most failed at, where nothing is found."""
        funnel = self.funnel
        parts: list[str] = []
        asked = (("first failed at", "frames", funnel.excluded), ("then failed at", "intervals", funnel.broken))
        for head, of, counts in asked:
            rows = "".join(
                f"<tr><td>{escape(what)}</td><td>{count:,}</td></tr>" for what, count in counts.most_common(_FAILURES)
            )
            if rows:
                parts.append(f"<table><tr><th>{head}</th><th>{of}</th></tr>{rows}</table>")
        named = '"RECORDING"' if over_time else '"FRAME"'
        hint = f"<p><code>matches.explain({named})</code> says what keeps one from matching, and what would do.</p>"
        return "".join([*parts, hint])

    def _tile(self, each: FrameResult) -> str:
        """A small picture, with its frame in letters of the notebook's size below."""
        shot, backdrop = self.shot_of(each.result)
        return f"{draw(shot, backdrop, pixels=_SMALL, captioned=False, letters=_LETTERS)}<br>{escape(each.frame)}"


def _cells(each: FrameResult) -> str:
    objects = ", ".join(f"{role}={played}" for role, played in each.roles.items() if (role, played) != ("ego", "ego"))
    cells = (each.frame, each.recording, each.verdict, objects)
    if each.result.interval is not None:
        seconds = f"{(each.end_us - each.timestamp_us) / 1e6:.1f}"
        cells = (
            each.recording,
            f"{each.timestamp_us}",
            seconds,
            f"{each.frames} from {each.frame}",
            each.verdict,
            objects,
        )
    return "".join(f"<td>{escape(text)}</td>" for text in cells)
