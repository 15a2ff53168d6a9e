"""A query run piece by piece gives what it gives in one go."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from scenicq.errors import DataError
from scenicq.importers.ingest import ingest
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import EXACT, parse_tolerance
from scenicq.query.execution.executors import resumable, run_here
from scenicq.query.execution.pieces import DatasetPiece, find_finished, fingerprint, gather, partitions, write_piece
from scenicq.query.execution.program_files import read_program
from scenicq.query.execution.records import FrameRecord, record
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.dataset import Dataset, open_dataset

ROOT = Path(__file__).parents[4]
PROGRAM = ROOT / "sample_data" / "scenarios" / "01_pedestrian_facing_ego.scenic"
OPTIONS = QueryOptions(MatchOptions(tolerance=parse_tolerance("x=0.25,y=0.25,heading=5deg"), classes="coarse"))


@pytest.fixture(scope="module")
def dataset(tmp_path_factory) -> Dataset:
    target = tmp_path_factory.mktemp("partitions") / "crossroads"
    ingest(ROOT / "sample_data" / "crossroads", target)
    return open_dataset(target)


def run_piece(dataset: Dataset, folder: Path, piece: DatasetPiece, options: QueryOptions = OPTIONS) -> Path:
    source = read_program(PROGRAM)
    query = Query(dataset, source, options, recordings=piece.recordings)
    question = fingerprint(dataset, source.text, options)
    records = (record(result) for result in query.results())
    return write_piece(folder, question, piece, records, query)


def whole(dataset: Dataset) -> tuple[list[dict], Query]:
    query = Query(dataset, read_program(PROGRAM), OPTIONS)
    return [record(result) for result in query.results()], query


@pytest.mark.parametrize("count", [1, 2, 3, 5, 6, 100])
def test_pieces_hold_every_recording_once(dataset, count):
    pieces = partitions(dataset, count)
    names = sorted(dataset.manifest.by_recording)
    stretches = [stretch for piece in pieces for stretch in piece.recordings.values()]
    covered = [name for stretch in stretches for name in names if stretch.first <= name <= stretch.last]
    assert covered == names
    assert len(pieces) <= count
    assert [piece.number for piece in pieces] == list(range(len(pieces)))
    assert sum(piece.frames for piece in pieces) == dataset.manifest.total.frames


@pytest.mark.parametrize("count", [1, 3, 6])
def test_pieces_put_together_are_the_whole(dataset, tmp_path, count):
    expected, query = whole(dataset)
    assert expected
    for piece in reversed(partitions(dataset, count)):
        run_piece(dataset, tmp_path, piece)
    found = gather(tmp_path)
    assert list(found.records()) == expected
    assert found.funnel == replace(query.funnel, warnings=[])
    assert found.funnel.frames == dataset.manifest.total.frames


def test_a_missing_piece_is_named(dataset, tmp_path):
    pieces = partitions(dataset, 3)
    for piece in (pieces[0], pieces[2]):
        run_piece(dataset, tmp_path, piece)
    with pytest.raises(DataError, match="1 of 3 pieces are missing: 2"):
        gather(tmp_path)
    question = fingerprint(dataset, read_program(PROGRAM).text, OPTIONS)
    assert find_finished(tmp_path, question, pieces) == {0, 2}


def test_a_truncated_piece_is_refused(dataset, tmp_path):
    path = run_piece(dataset, tmp_path, partitions(dataset, 1)[0])
    lines = path.read_text().splitlines()
    path.write_text("\n".join(lines[:-1]))
    with pytest.raises(DataError, match="not a complete piece"):
        gather(tmp_path)


def test_pieces_of_two_questions_do_not_mix(dataset, tmp_path):
    (piece,) = partitions(dataset, 1)
    run_piece(dataset, tmp_path, piece)
    run_piece(dataset, tmp_path, piece, replace(OPTIONS, match=MatchOptions(tolerance=EXACT)))
    with pytest.raises(DataError, match="2 different questions"):
        gather(tmp_path)
    assert gather(tmp_path, fingerprint(dataset, read_program(PROGRAM).text, OPTIONS)).funnel.matches


def test_how_it_is_run_is_not_part_of_the_question(dataset):
    text = read_program(PROGRAM).text
    same = fingerprint(dataset, text, replace(OPTIONS, jobs=4, prefilter=False))
    assert same == fingerprint(dataset, text, OPTIONS)
    assert fingerprint(dataset, text + " ", OPTIONS) != same


def test_a_failed_piece_leaves_nothing_behind(dataset, tmp_path):
    (piece,) = partitions(dataset, 1)

    def broken():
        yield FrameRecord(frame="1", recording="r", verdict="match")
        raise KeyboardInterrupt

    query = Query(dataset, read_program(PROGRAM), OPTIONS)
    with pytest.raises(KeyboardInterrupt):
        write_piece(tmp_path, "question", piece, broken(), query)
    assert list(tmp_path.iterdir()) == []


def test_pieces_of_a_program_whose_imports_have_changed_are_made_anew(dataset, tmp_path):
    """The program itself stays as it is: what `far` means is said in a file of a package, in a function even."""
    program, helper = tmp_path / "program.scenic", tmp_path / "places" / "far.scenic"
    helper.parent.mkdir()
    function = "def far():\n    from places import far\n    return far.far\n"
    program.write_text(f"model scenic.domains.driving.model\n{function}ego = new Car\nrequire ego.position.x < far()\n")
    found: dict[int, set[str]] = {}
    for far in (-10_000, 10_000):
        helper.write_text(f"far = {far}\n")
        query = Query(dataset, read_program(program), OPTIONS)
        pieces = partitions(dataset, 2)
        done = resumable(tmp_path / "pieces", run_here)(query, pieces, lambda _: None)
        found[far] = {result.frame for _, (results, _) in done for result in results}
    assert not found[-10_000]
    assert len(found[10_000]) > 3
