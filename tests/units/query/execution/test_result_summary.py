"""What results say of themselves, and what everybody who reads them makes of it.

The oracle is `--all`: it names each frame that was looked at, so the others were not.
"""

from __future__ import annotations

import csv
import io
import json
import math
import re
import time
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import pyarrow.parquet as pq
import pytest
from maps_in_turns import maps_in_turns

import scenicq
from scenicq import budget
from scenicq.errors import DataError, Source
from scenicq.importers.ingest import ingest
from scenicq.query.execution.executors import ordered_results, resumable, run_here, usual_pieces
from scenicq.query.execution.option_texts import DRIVING, read_options
from scenicq.query.execution.records import record
from scenicq.query.execution.result_files import read_records, read_results
from scenicq.query.execution.result_summary import RESULT_VERSION, Completeness, ResultCount, ResultSummary
from scenicq.query.execution.run import Query
from scenicq.query.execution.skipped_frames import summarize
from scenicq.store.dataset import Dataset, open_dataset

SAMPLES = Path(__file__).parents[4] / "sample_data"
ANYWHERE = "in everywhere, facing Range(0, 360) deg"
PLAIN = f"ego = new Car {ANYWHERE}"
PAIR = f"{PLAIN}\nother = new Car {ANYWHERE}\nrequire (distance to other) < 20"
OVER_TIME = f"{PLAIN}\nother = new Car {ANYWHERE}\nrequire eventually (distance to other) < 12"
FORMS = ("jsonl", "csv", "parquet")


@pytest.fixture(scope="module")
def town(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    return maps_in_turns(tmp_path_factory.mktemp("town"))


def every_frame(dataset: Dataset) -> dict[str, tuple[str, int, str]]:
    return {each.frame: (each.recording, each.timestamp_us, each.frame) for each in dataset.labels()}


def silent(summary: ResultSummary, frames: Mapping[str, tuple[str, int, str]]) -> set[str]:
    said = Completeness(summary, summary.results)
    return {name for name, place in frames.items() if said.why_silent(*place)}


def taken(query: Query, results: Iterator[Any]) -> tuple[list[Any], ResultSummary]:
    counted, found = ResultCount(), list(results)
    for each in found:
        counted.add(record(each, every=query.options.all_matches))
    return found, summarize(query, counted)


@pytest.mark.parametrize(("limit", "jobs"), [(1, 1), (2, 1), (5, 1), (9, 2), (17, 1), (30, 1), (31, 1), (99, 1)])
@pytest.mark.one_in(2)
def test_what_a_limit_skips_is_what_all_does_not_name(town: Dataset, limit: int, jobs: int) -> None:
    options = replace(read_options(limit=limit, every=True, model=DRIVING), jobs=jobs)
    found, summary = taken(query := Query(town, Source("p", PLAIN), options), query.results())
    frames = every_frame(town)
    assert silent(summary, frames) == frames.keys() - {each.frame for each in found}
    assert summary.complete == (len(found) == len(frames))
    assert sum(each.frames for each in summary.skipped) == len(frames) - len(found)
    assert summary.frames == len(frames)


class Clock:
    """A clock that goes on by a second whenever somebody looks whether the time is over."""

    now = 0

    def monotonic(self) -> float:
        self.now += 1
        return float(self.now)

    def __getattr__(self, name: str) -> Any:
        return getattr(time, name)


@pytest.mark.parametrize("engine", [False, True])
@pytest.mark.parametrize("program", [PLAIN, OVER_TIME])
@pytest.mark.one_in(2)
def test_what_a_deadline_skips_is_what_all_does_not_name(
    town: Dataset, monkeypatch: pytest.MonkeyPatch, program: str, engine: bool
) -> None:
    clock = Clock()
    monkeypatch.setattr(budget, "time", clock)

    def run(until: float) -> tuple[set[str], ResultSummary]:
        options = replace(read_options(every=True, prefilter=False, model=DRIVING), until=until)
        query = Query(town, Source("p", program), options)
        results = (
            ordered_results(query, run_here, usual_pieces(query, 9), lambda _: None) if engine else query.results()
        )
        found, summary = taken(query, results)
        return {each.recording if each.interval else each.frame for each in found}, summary

    whole, summary = run(math.inf)
    steps, frames, cut = clock.now, every_frame(town), 0
    assert summary.complete
    for part in range(1, 6):
        clock.now = 0
        named, summary = run(steps * part / 6)
        hidden = silent(summary, frames)
        cut += bool(hidden)
        if program == PLAIN:
            assert hidden == frames.keys() - named
        else:
            # whole recordings
            assert {frames[name][0] for name in hidden} == whole - named
            assert {frames[name][0] for name in frames.keys() - hidden} == named
        assert sum(each.frames for each in summary.skipped) == len(hidden)
        assert summary.complete == (not hidden)
    assert cut > 1


def test_over_time_the_recording_in_which_a_limit_ends_is_open(town: Dataset) -> None:
    frames = every_frame(town)
    whole, _ = taken(query := Query(town, Source("p", OVER_TIME), read_options(model=DRIVING)), query.results())
    for limit in range(1, len(whole) + 1):
        options = read_options(limit=limit, model=DRIVING)
        found, summary = taken(query := Query(town, Source("p", OVER_TIME), options), query.results())
        hidden = {frames[name][0] for name in silent(summary, frames)}
        assert {each.recording for each in whole[limit:]} <= hidden
        assert found[-1].recording in hidden
        assert found == whole[:limit]


def test_of_the_last_frame_other_correspondences_may_be_missing(crossroads: Path) -> None:
    options = {"all_matches": True, "limit": 2}
    found = scenicq.open(crossroads).match(PAIR, **options)
    summary = found.summary
    last = found[-1].result
    said = Completeness(summary, summary.results)
    assert said.why_silent(last.recording, last.timestamp_us, last.frame)
    assert summary.all_matches


# --- every way of cutting, every format

CUTS: dict[str, tuple[str, ...]] = {
    "whole": (),
    "limit": ("--limit", "7"),
    "sample": ("--sample", "7"),
    "deadline": ("--deadline", "1e-9", "--no-prefilter"),
    "unknown": ("--no-prefilter", "--method", "smt", "--timeout", "0.1ms"),
    "limit that is not reached": ("--limit", "100000"),
    "sample of all": ("--sample", "100000"),
    "all matches": ("--all-matches",),
}
INCOMPLETE = {"limit", "sample", "deadline"}


@pytest.fixture(scope="module")
def cut_files(crossroads: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[tuple[str, str], Path]:
    from click.testing import CliRunner

    from scenicq_cli.main import cli

    folder, found = tmp_path_factory.mktemp("cut"), dict[tuple[str, str], Path]()
    for name, options in CUTS.items():
        for form in FORMS:
            file = found[name, form] = folder / f"{name.replace(' ', '_')}.{form}"
            words = ["match", "-e", PAIR, str(crossroads), *options, "-o", str(file), "-q"]
            done = CliRunner().invoke(cli, words)
            assert done.exit_code == (3 if name in ("limit", "deadline", "unknown") else 0), done.output
    return found


def lines_of(file: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in file.read_text().splitlines()]


@pytest.mark.parametrize("case", CUTS)
@pytest.mark.one_in(4)
def test_each_format_says_the_same(cut_files: dict[tuple[str, str], Path], case: str) -> None:
    *_, last = lines_of(cut_files[case, "jsonl"])
    told = last["summary"]
    assert told["complete"] == (case not in INCOMPLETE)
    row = list(csv.DictReader(io.StringIO(cut_files[case, "csv"].read_text())))[-1]
    assert json.loads(row["summary"]) == told
    assert json.loads(pq.read_metadata(cut_files[case, "parquet"]).metadata[b"scenicq.summary"]) == told
    read = [read_results(cut_files[case, form]) for form in FORMS]
    assert len({msgspec.json.encode(each.completeness.summary) for each in read}) == 1
    assert all(each.records == read[0].records or form == 2 for form, each in enumerate(read))
    if case == "unknown":
        assert told["unknown"] == {"timeout": sum(each["verdict"] == "unknown" for each in lines_of(
            cut_files[case, "jsonl"]))}  # fmt: skip


@pytest.mark.parametrize("case", CUTS)
def test_a_line_is_a_result_and_only_the_last_says_more(cut_files: dict[tuple[str, str], Path], case: str) -> None:
    lines = lines_of(cut_files[case, "jsonl"])
    assert [("summary" in each) for each in lines] == [False] * (len(lines) - 1) + [True]
    assert case == "deadline" or all("frame" in each for each in lines)
    held = pq.read_table(cut_files[case, "parquet"])
    assert "summary" not in held.column_names
    assert held.num_rows == (0 if case == "deadline" else len(lines))


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("case", CUTS)
def test_a_comparison_counts_nothing_as_gone_that_was_not_looked_at(
    run: Any, cut_files: dict[tuple[str, str], Path], case: str, form: str
) -> None:
    whole = {each["frame"] for each in lines_of(cut_files["whole", "jsonl"])}
    mine = {each["frame"] for each in lines_of(cut_files[case, "jsonl"])
            if each.get("verdict") == "match"}  # fmt: skip
    for order in (1, -1):
        pair = [cut_files["whole", form], cut_files[case, form]][::order]
        done = run("report", *pair)
        counts = {kind: int(number) for number, kind in re.findall(r"^. +(\d+)  (\w+):", done.stdout, re.M)}
        assert counts.get("went", 0) == counts.get("came", 0) == 0, done.stdout
        assert counts.get("undecided", 0) == len(whole - mine)
        assert ("results-incomplete" in done.stderr) == (case in INCOMPLETE)


@pytest.mark.parametrize("form", ["jsonl", "csv"])
def test_a_file_that_was_cut_afterwards_is_no_whole_one(
    run: Any, cut_files: dict[tuple[str, str], Path], tmp_path: Path, form: str
) -> None:
    head, *rest = cut_files["whole", form].read_text().splitlines()
    first = [head] if form == "csv" else []
    results = rest if form == "csv" else [head, *rest]
    for name, some in (("begin", results[:5]), ("end", results[-5:])):
        (tmp_path / f"{name}.{form}").write_text("\n".join([*first, *some]) + "\n")
    begin = run("report", cut_files["whole", form], tmp_path / f"begin.{form}")
    assert "does not say whether it is complete" in begin.stderr
    assert f"{len(results) - 5} of those that match in the other alone are not named" in begin.stderr
    end = run("report", cut_files["whole", form], tmp_path / f"end.{form}")
    assert f"it has 5 results, and had {len(results)}" in end.stderr
    assert re.search(rf"\? +{len(results) - 5}  undecided", end.stdout)


def test_the_page_says_it_too(run: Any, cut_files: dict[tuple[str, str], Path], tmp_path: Path) -> None:
    pair = (cut_files["whole", "jsonl"], cut_files["limit", "jsonl"])
    assert run("report", *pair, "-o", tmp_path / "page.html").exit_code == 0
    page = (tmp_path / "page.html").read_text()
    assert "B is not complete: --limit 7 ended the query" in page
    assert "undecided" in page


def test_a_report_an_export_and_python_say_it(run: Any, crossroads: Path, tmp_path: Path) -> None:
    words = ("match", "-e", PLAIN, crossroads, "--limit", "4", "--format", "ids")
    done = run(*words, "--report", tmp_path / "pages", "--export", "paths", tmp_path / "paths")
    told = "--limit 4 ended the query before 152 of 156 frames were looked at"
    assert f"the export is not complete: {told}" in done.stderr
    assert f"Not complete: {told}" in (tmp_path / "pages" / "index.html").read_text()
    matches = scenicq.open(crossroads).match(PLAIN, limit=4)
    assert len(matches) == 4
    assert not matches.summary.complete
    assert told in repr(matches)
    assert told in matches._repr_html_()
    assert json.loads(matches.to_arrow().schema.metadata[b"scenicq.summary"])["skipped"][0]["frames"] == 152
    whole = scenicq.open(crossroads).match(PLAIN)
    assert whole.summary.complete
    assert "complete" not in repr(whole)


# --- versions


def test_results_state_their_version(cut_files: dict[tuple[str, str], Path]) -> None:
    for case in CUTS:
        for form in FORMS:
            stated = read_results(cut_files[case, form]).completeness.summary
            assert stated is not None
            assert stated.version == RESULT_VERSION, (case, form)


def of_version(file: Path, version: int | None, target: Path) -> Path:
    """A copy of results that states another version, or none."""
    if file.suffix == ".parquet":
        table = pq.read_table(file)
        metadata = pq.read_metadata(file).metadata
        told = json.loads(metadata[b"scenicq.summary"])
        said = {**told, "version": version} if version is not None else {k: told[k] for k in told if k != "version"}
        dataset = {b"scenicq.dataset": metadata[b"scenicq.dataset"]}
        pq.write_table(table.replace_schema_metadata(dataset | {b"scenicq.summary": json.dumps(said).encode()}), target)
    else:
        text = file.read_text()
        (stated,) = re.findall(rf'"+version"+: ?{RESULT_VERSION}, ?', text)
        said = "" if version is None else stated.replace(str(RESULT_VERSION), str(version))
        target.write_text(text.replace(stated, said))
    return target


@pytest.mark.parametrize("form", FORMS)
def test_results_of_a_newer_version_are_refused_before_anything_of_them_is_read(
    run: Any, cut_files: dict[tuple[str, str], Path], tmp_path: Path, form: str
) -> None:
    newer = of_version(cut_files["whole", form], RESULT_VERSION + 1, tmp_path / f"newer.{form}")
    told = f"holds results of version {RESULT_VERSION + 1}; this program reads versions up to {RESULT_VERSION}"
    if form != "parquet":
        # nothing but the version says that this program cannot know what the results mean
        newer.write_text(newer.read_text().replace("match", "mostly", 1))
    with pytest.raises(DataError, match=told):
        next(iter(read_records(newer)))
    for pair in ([newer, cut_files["whole", form]], [cut_files["whole", form], newer]):
        done = run("report", *pair)
        assert done.exit_code == 2
        assert done.stderr.count("error[") == done.stderr.count("error[results-version]") == 1
        assert told in done.stderr


@pytest.mark.parametrize("form", FORMS)
def test_results_that_state_no_version_are_read_as_those_of_before(
    cut_files: dict[tuple[str, str], Path], tmp_path: Path, form: str
) -> None:
    older = read_results(of_version(cut_files["whole", form], None, tmp_path / f"older.{form}"))
    assert older == read_results(cut_files["whole", form])


@pytest.mark.parametrize("form", ["jsonl", "csv"])
def test_files_that_were_put_together_are_refused_for_any_of_them(
    cut_files: dict[tuple[str, str], Path], tmp_path: Path, form: str
) -> None:
    whole = cut_files["whole", form].read_text()
    newer = of_version(cut_files["whole", form], RESULT_VERSION + 1, tmp_path / f"newer.{form}").read_text()
    (tmp_path / f"both.{form}").write_text(newer + whole[whole.index("\n") + 1 if form == "csv" else 0 :])
    with pytest.raises(DataError, match="holds results of version"):
        list(read_records(tmp_path / f"both.{form}"))


def test_a_piece_of_a_newer_version_is_refused(run: Any, crossroads: Path, tmp_path: Path) -> None:
    run("match", "-e", PAIR, crossroads, "--shard", "1/1", "-o", tmp_path / "p")
    (piece,) = (tmp_path / "p").glob("*-of-*.jsonl")
    *lines, last = piece.read_text().splitlines()
    told = json.loads(last)
    assert told["summary"]["version"] == RESULT_VERSION
    told["summary"]["version"] = RESULT_VERSION + 1
    piece.write_text("\n".join([*lines, json.dumps(told)]) + "\n")
    done = run("gather", tmp_path / "p")
    assert done.exit_code == 2
    assert "error[results-version]" in done.stderr


# --- pieces


def test_pieces_say_what_the_whole_says(run: Any, crossroads: Path, tmp_path: Path) -> None:
    for name in ("whole", "unknown", "all matches"):
        options = CUTS[name]
        words = ("match", "-e", PAIR, crossroads, *options, "--exit-zero")
        for number in (1, 2, 3):
            run(*words, "--shard", f"{number}/3", "-o", tmp_path / name)
        gathered = run("gather", tmp_path / name, "--exit-zero").stdout
        alone = run(*words, "--format", "jsonl").stdout
        if name == "unknown":
            # which label is decided within 0.1 ms differs
            gathered, alone = (re.sub(r".*\n", "", each, count=each.count("\n") - 1) for each in (gathered, alone))
            told, mine = (json.loads(each)["summary"] for each in (gathered, alone))
            assert (told["frames"], told["complete"]) == (mine["frames"], mine["complete"]) == (156, True)
            continue
        assert gathered == alone


def test_pieces_of_a_limited_query_are_cut_where_one_is(town: Dataset, tmp_path: Path) -> None:
    """They lie beside `-o FILE --resume`; each has its own end."""
    from scenicq.query.execution.pieces import gather

    query = Query(town, Source("p", PLAIN), read_options(limit=20, every=True, model=DRIVING))
    pieces = usual_pieces(query, 2)
    engine = resumable(tmp_path, run_here)
    for _ in engine(query, pieces, lambda _: None):
        pass
    gathered = gather(tmp_path)
    assert gathered.summary is not None
    named = {each.name for each in gathered.records()}
    frames = every_frame(town)
    assert not gathered.summary.complete or len(named) == len(frames)
    assert silent(gathered.summary, frames) == frames.keys() - named


def test_a_piece_of_an_older_version_is_gathered_and_says_nothing(run: Any, crossroads: Path, tmp_path: Path) -> None:
    for number in (1, 2):
        run("match", "-e", PAIR, crossroads, "--shard", f"{number}/2", "-o", tmp_path / "p")
    piece = min((tmp_path / "p").glob("*-of-*.jsonl"))
    *lines, last = piece.read_text().splitlines()
    piece.write_text("\n".join([*lines, json.dumps({"funnel": json.loads(last)["funnel"]})]) + "\n")
    done = run("gather", tmp_path / "p")
    assert done.exit_code == 0
    assert "summary" not in done.stdout


@pytest.mark.parametrize("jobs", ["1", "2"])
@pytest.mark.one_in(2)
def test_a_resumed_run_says_what_an_undisturbed_one_says(run: Any, crossroads: Path, tmp_path: Path, jobs: str) -> None:
    for options in ((), ("--limit", "7")):
        words = ("match", "-e", PAIR, crossroads, *options, "--exit-zero", "--jobs", jobs)
        file = tmp_path / f"resumed{len(options)}.jsonl"
        run(*words, "--no-prefilter", "--deadline", "1e-9", "--resume", "-o", file)
        assert not lines_of(file)[-1]["summary"]["complete"]
        run(*words, "--resume", "-o", file)
        assert file.read_text() == run(*words, "--format", "jsonl").stdout


# --- evaluation


@pytest.fixture(scope="module")
def parked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    target = tmp_path_factory.mktemp("parked") / "street"
    ingest(SAMPLES / "parked", target)
    return target


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("limit", [3, 20])
@pytest.mark.one_in(8)
def test_an_evaluation_counts_only_what_was_looked_at(
    run: Any, parked: Path, tmp_path: Path, form: str, limit: int
) -> None:
    program, file = SAMPLES / "parked" / "parked_car.scenic", tmp_path / f"parked_car.{form}"
    words = ("match", program, parked, "--limit", limit)
    run(*words, "-o", file)
    looked_at = [json.loads(line) for line in run(*words, "--all", "--format", "jsonl").stdout.splitlines()]
    total = open_dataset(parked).manifest.total.frames
    done = run("evaluate", file, parked, "--predictions", SAMPLES / "parked" / "predictions.jsonl", "--format", "json")
    assert f"parked_car (results) is not complete: --limit {limit} ended the query" in done.stderr
    (figures,) = json.loads(done.stdout)["scenarios"]
    matching = sum(each["verdict"] == "match" for each in looked_at)
    assert figures["matching_frames"] == matching == limit
    assert figures["other_frames"] == len(looked_at) - matching
    assert figures["undecided_frames"] == total - len(looked_at)
    table = run("evaluate", file, parked, "--predictions", SAMPLES / "parked" / "predictions.jsonl").stdout
    assert f"{total - len(looked_at):,} are undecided" in table


def test_an_evaluation_of_a_sample_knows_no_frame_that_does_not_match(run: Any, parked: Path, tmp_path: Path) -> None:
    program, file = SAMPLES / "parked" / "parked_car.scenic", tmp_path / "parked_car.jsonl"
    run("match", program, parked, "--sample", "5", "-o", file)
    words = (parked, "--predictions", SAMPLES / "parked" / "predictions.jsonl", "--format", "json")
    done = run("evaluate", file, *words)
    (figures,) = json.loads(done.stdout)["scenarios"]
    assert (figures["matching_frames"], figures["other_frames"]) == (5, 0)
    assert "--sample shows 5 of" in done.stderr
    records = [json.loads(line) for line in file.read_text().splitlines()]
    again = scenicq.evaluate.evaluation.evaluate(  # pyright: ignore[reportAttributeAccessIssue]
        {"parked_car": records}, open_dataset(parked), SAMPLES / "parked" / "predictions.jsonl"
    )
    assert (again.scenarios[0].matching, again.scenarios[0].other) == (5, 0)


def test_results_that_say_nothing_of_themselves_are_read_with_a_word(run: Any, parked: Path, tmp_path: Path) -> None:
    program, file = SAMPLES / "parked" / "parked_car.scenic", tmp_path / "parked_car.jsonl"
    run("match", program, parked, "-o", file)
    words = (parked, "--predictions", SAMPLES / "parked" / "predictions.jsonl", "--format", "json")
    whole = run("evaluate", file, *words)
    assert "results-incomplete" not in whole.stderr
    lines = file.read_text().splitlines()
    last = {name: value for name, value in json.loads(lines[-1]).items() if name != "summary"}
    file.write_text("\n".join([*lines[:-1], json.dumps(last)]) + "\n")
    old = run("evaluate", file, *words)
    assert "results-incomplete" in old.stderr
    (mine,), (other,) = (json.loads(each.stdout)["scenarios"] for each in (old, whole))
    for each in other["slices"]:
        each.pop("source", None)  # which only the summary says
    assert mine == other


def test_what_comes_is_out_where_a_query_is_broken_off(command: str, crossroads: Path) -> None:
    """The last result waits for the summary; an end without one must not swallow it."""
    from scenicq.query.execution.records import FrameRecord
    from scenicq_cli.formats import make_writer

    for form in ("jsonl", "csv"):
        sink = io.BytesIO()
        writer = make_writer(form, sink, lambda: ("ego",))
        for name in "ab":
            writer.write(FrameRecord(frame=name, recording="r", verdict="match"))
        assert b"a" in sink.getvalue()
        writer.stop()
        assert len(sink.getvalue().splitlines()) == (2 if form == "jsonl" else 3)
        assert b"complete" not in sink.getvalue()
