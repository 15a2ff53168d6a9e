"""Write the report of a query: one page up to a few hundred frames, else with pictures beside it."""

from __future__ import annotations

import contextlib
import shutil
import tempfile
from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from scenicq.errors import DataError, Diagnostic, ScenarioError
from scenicq.forest.scenario import Scenario
from scenicq.match.matcher import Matcher
from scenicq.match.verdict import Match, NoMatch, Unknown
from scenicq.query.execution.lazy_solver import LazySolver
from scenicq.query.execution.result_summary import ResultCount
from scenicq.query.execution.results import Result
from scenicq.query.execution.run import Query
from scenicq.query.execution.skipped_frames import summarize
from scenicq.query.execution.variable_texts import variable_texts
from scenicq.query.explain.frame_explanation import explain, explain_match
from scenicq.report.backdrop import Backdrop
from scenicq.report.cards import TILE_LETTERS, Card, best_frame, draw_card, draw_tile
from scenicq.report.overview import funnel_section, how_section, program_section
from scenicq.report.page import GENERATOR, page, runs_section
from scenicq.report.picture import LETTERS, Shot, draw
from scenicq.report.runs import FrameRun, find_runs, frame_numbers
from scenicq.report.sensors import SensorFiles, can_make_thumbnails, roots_of
from scenicq.report.shares import program_lines
from scenicq.report.sheet import sheet_section, timelines_section, to_picture
from scenicq.report.templates import markup
from scenicq.report.timelines import interval_runs
from scenicq.store.atomic_files import whole_folder
from scenicq.store.remote_path import AnyPath, RemotePath
from scenicq.store.targets import target_of

if TYPE_CHECKING:
    from markupsafe import Markup

__all__ = ["INLINE", "MOST", "check_target", "new_report", "write_report"]

INLINE = 300
"""Frames up to which everything is in the page itself."""
MOST = 2000
"""Frames that are shown at most."""
THUMBNAILS = 1500
"""Small camera images that are made at most, but one a frame; they take 5 ms each."""
_WORK = ".report-"
"""How the folder begins in which a report is made before it is shown."""
_OWN = ("pictures", "thumbnails", "index.html")


def check_target(folder: AnyPath) -> None:
    """Check that a report may be written to a folder: it must be new, empty, or have an older report of ours.

    Elsewhere it must be new: nothing there is replaced in one step but a file.

    Raises:
        DataError: target-exists, or target-unwritable.
    """
    if isinstance(folder, RemotePath):
        _check_new(folder)
        target_of(folder).check_writable()
        return
    try:
        if not folder.exists() or (folder.is_dir() and not any(folder.iterdir())):
            return
        index = folder / "index.html"
        if index.is_file() and f'content="{GENERATOR} ' in index.read_text(encoding="utf-8", errors="replace")[:4000]:
            return
        if (
            folder.is_dir()
            and any(_leftovers(folder))
            and all(each.name in _OWN or _is_work(each) for each in folder.iterdir())
        ):
            return  # of a run that was killed
    except OSError as error:
        raise _unwritable(folder, error) from None
    hint = "choose a new folder, or one that holds an earlier report"
    raise DataError(Diagnostic("target-exists", f"{folder} is there and is no report", hints=(hint,)))


def _check_new(folder: RemotePath) -> None:
    if folder.exists():
        hint = "choose a new folder: a report elsewhere is never replaced"
        raise DataError(Diagnostic("target-exists", f"{folder} is there already", hints=(hint,)))


def _unwritable(folder: Path, error: OSError) -> DataError:
    return DataError(Diagnostic("target-unwritable", f"{folder} cannot be written: {error.strerror or error}"))


def write_report(
    query: Query,
    results: Sequence[Result],
    folder: AnyPath,
    *,
    near: Sequence[Result] = (),
    command: str = "",
    elapsed_s: float = 0.0,
    sensors: Path | None = None,
) -> AnyPath:
    """Write a report into a folder; an earlier report there is replaced when the new one is complete.

    Args:
        query: The query, after its results were taken.
        results: Results in the order of the dataset; frames that do not match are passed over.
        folder: Where to.
        near: Near misses.
        command: The command line to run it again.
        elapsed_s: Seconds that the query took.
        sensors: The folder that the paths of sensor files start from; only the dataset's own by default.

    Returns:
        The page.

    Raises:
        DataError: target-exists, or target-unwritable.
    """
    with new_report(folder) as work:
        text = _Report(query, folder, work, sensors).text(results, near, command, elapsed_s)
        (work / "index.html").write_text(text, encoding="utf-8", newline="\n")
    return folder / "index.html"


@contextlib.contextmanager
def new_report(folder: AnyPath) -> Generator[Path]:
    """Make a folder for a report; when it is complete, it replaces an earlier one.

    Args:
        folder: Where the report shall be.

    Yields:
        Where its files go until then; all else there is lost.

    Raises:
        DataError: target-exists, or target-unwritable.
    """
    if isinstance(folder, RemotePath):
        _check_new(folder)
        with whole_folder(folder) as work:
            yield work
        return
    check_target(folder)
    try:
        with target_of(folder).made_folder():
            for each in _leftovers(folder):
                shutil.rmtree(each, ignore_errors=True)
            work = Path(tempfile.mkdtemp(prefix=_WORK, dir=folder))
            try:
                yield work
                _replace(work, folder)
            finally:
                shutil.rmtree(work, ignore_errors=True)
    except OSError as error:
        raise _unwritable(folder, error) from None


def _is_work(path: Path) -> bool:
    return path.name.startswith(_WORK) and path.is_dir() and not path.is_symlink()


def _leftovers(folder: Path) -> list[Path]:
    """Folders that killed runs left; there is only one writer at a time."""
    return [path for path in folder.iterdir() if _is_work(path)]


def _replace(work: Path, folder: Path) -> None:
    for name in _OWN:
        new, old = work / name, folder / name
        if old.is_dir() and not old.is_symlink():
            shutil.rmtree(old)
        if new.exists():
            new.replace(old)
        else:
            with contextlib.suppress(FileNotFoundError):
                old.unlink()


def _fitting(results: Sequence[Result], most: int) -> list[Result]:
    """The first results with at most so many frames together, at least one result."""
    kept: list[Result] = []
    for each in results:
        most -= 1 if each.interval is None else each.interval.count
        if most < 0 and (kept or each.interval is None):
            break
        kept.append(each)
    return kept


@dataclass(eq=False)
class _World:
    scenario: Scenario
    backdrop: Backdrop
    texts: dict[str, str]


class _Report:
    """What the parts of one report share."""

    def __init__(self, query: Query, folder: AnyPath, work: Path, sensors: Path | None) -> None:
        self.query, self.work = query, work
        self.worlds: dict[str, _World | None] = {}
        self.files = SensorFiles(roots_of(query.dataset, sensors), folder, work, can_make_thumbnails())
        self.pictured = 0
        self.tiles: list[Markup] = []

    def world(self, name: str) -> _World | None:
        """The scenario over a map, None if it does not fit."""
        if name not in self.worlds:
            try:
                scenario, network = self.query.compile(name)
                self.worlds[name] = _World(scenario, Backdrop(network), variable_texts(scenario))
            except ScenarioError:
                self.worlds[name] = None
        return self.worlds[name]

    def text(self, results: Sequence[Result], near: Sequence[Result], command: str, elapsed_s: float) -> Markup:
        """The page."""
        funnel, dataset = self.query.funnel, self.query.dataset
        # of a frame that matches in several ways the first is shown, but every interval
        first: dict[object, Result] = {}
        for each in results:
            if isinstance(each.verdict, Match | Unknown):
                first.setdefault(each.frame if each.interval is None else len(first), each)
        results = list(first.values())
        shown = _fitting(results, max(0, MOST - len(near)))
        frames = sum(1 if each.interval is None else each.interval.count for each in shown) + len(near)
        inline = self.files.inside = frames <= INLINE
        self.files.most = max(1, THUMBNAILS // max(frames, 1))
        numbers = frame_numbers(dataset, {result.recording for result in (*shown, *near)})
        over_time = any(each.interval is not None for each in (*shown, *near))
        if over_time:
            runs = list(interval_runs(self.query, (*shown, *near), numbers))
        else:
            runs = [
                *find_runs(shown, numbers),
                *(FrameRun(r.recording, (r,), *numbers[r.frame]) for r in near),
            ]
        cards = list(self.cards(runs, inline=inline))
        recordings = list(dict.fromkeys(run.recording for run in runs))
        left = len(results) - len(shown)
        what = "intervals" if over_time else "frames"
        note = f"{left:,} more {what} are not shown: `--limit` or a narrower scenario shows others." if left else ""
        world = next((found for name in dataset.maps if (found := self.world(name))), None)
        lines, rest = program_lines(world.scenario, funnel.excluded) if world else ([], dict(funnel.excluded))
        name = Path(self.query.source.name).name
        number = f"{funnel.matches:,} {'match' if funnel.matches == 1 else 'matches'}"
        if over_time:
            number = f"{funnel.matches:,} {'interval matches' if funnel.matches == 1 else 'intervals match'}"
        told = f"{number}, {funnel.unknowns:,} unknown {'in' if over_time else 'of'} {funnel.frames:,} frames"
        told += (
            f" of {dataset.manifest.name or dataset.name}"
            if over_time
            else f" in {dataset.manifest.name or dataset.name}"
        )
        body = markup(
            "page",
            "report",
            name=name,
            told=told,
            parts=(sheet_section(self.tiles, len(cards)), timelines_section(runs, over_time=over_time)),
            overview=(
                program_section(lines, rest, funnel.frames),
                funnel_section(funnel, summarize(self.query, ResultCount()).why_cut),
            ),
            runs=runs_section(cards, recordings, [run.kind for run in runs], note, "interval" if over_time else "run"),
            how=how_section(self.query, command, elapsed_s),
        )
        return page(f"{name}: {told}", [body])

    def cards(self, runs: Sequence[FrameRun], *, inline: bool) -> Iterator[Markup]:
        """The cards of runs."""
        frames = [result.frame for run in runs for result in run.results]
        labels = {label.frame: label for label in self.query.dataset.labels(frames)} if frames else {}
        pictured = to_picture(runs)
        with LazySolver(self.query.options.solver) as solver:
            for number, run in enumerate(runs, 1):
                world = self.world(labels[run.results[0].frame].map)
                if world is None:
                    continue
                matcher = Matcher(world.scenario, self.query.options.match, solver)
                shots = [Shot(labels[each.frame], world.scenario, each.verdict) for each in run.results]
                best = best_frame(run, shots)
                for place, shot in enumerate(shots):
                    # of the frames of a run that match the first and the best are explained
                    if isinstance(shot.verdict, NoMatch) or place in (0, best):
                        shots[place] = self.explained(matcher, shot)
                sensors = tuple(self.files.find(shot.label.sensors) for shot in shots)
                pictures = None if inline else tuple(self.picture(shot, world.backdrop) for shot in shots)
                card = Card(number, run, tuple(shots), sensors, world.backdrop, world.texts, pictures)
                if number in pictured:
                    image = None if inline else self.picture(shots[best], world.backdrop, TILE_LETTERS)
                    self.tiles.append(draw_tile(card, image))
                yield draw_card(card)

    def explained(self, matcher: Matcher, shot: Shot) -> Shot:
        """Explain why a frame matches or does not, unless it is inside an interval and no initial scene."""
        why = None
        match shot.verdict:
            case Match(correspondence):
                why = explain_match(matcher, shot.label, correspondence)
            case NoMatch():
                why = explain(matcher, shot.label)
            case _:
                pass
        return shot if why is None else replace(shot, explanation=why)

    def picture(self, shot: Shot, backdrop: Backdrop, letters: float = LETTERS) -> str:
        """Write a picture beside the page; its address."""
        self.pictured += 1
        name = f"pictures/{self.pictured:06}.svg"
        target = self.work / name
        target.parent.mkdir(exist_ok=True)
        target.write_text(draw(shot, backdrop, captioned=False, letters=letters), encoding="utf-8", newline="\n")
        return name
