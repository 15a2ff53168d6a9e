"""A dataset that is replaced while it is asked: never rows of another one, whoever does the work and wherever."""

from __future__ import annotations

import copy
import os
import pickle
import re
import shutil
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from scenicq.errors import DataError
from scenicq.importers.ingest import ingest
from scenicq.match.options import MatchOptions
from scenicq.query.execution.executors import Executor, local_executor, ordered_results, usual_pieces
from scenicq.query.execution.program_files import read_program
from scenicq.query.execution.records import record
from scenicq.query.execution.results import Result
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.dataset import open_dataset
from scenicq.store.separate_check import check_apart

ROOT = Path(__file__).parents[4]
SAMPLES = ROOT / "sample_data"
PROGRAM = SAMPLES / "scenarios" / "01_pedestrian_facing_ego.scenic"
OPTIONS = QueryOptions(MatchOptions(classes="coarse"), prefilter=False, every=True, jobs=2)


def ingest_over(dataset: Path, other: Path) -> None:
    ingest(other / "source", dataset, force=True)


def swap_folder(dataset: Path, other: Path) -> None:
    dataset.rename(dataset.with_name("before"))
    (other / "d").rename(dataset)


def copy_over(dataset: Path, other: Path) -> None:
    shutil.copytree(other / "d", dataset, dirs_exist_ok=True)


def remove(dataset: Path, _other: Path) -> None:
    shutil.rmtree(dataset)


REPLACEMENTS = [ingest_over, swap_folder, copy_over, remove]


def by_blocks(query: Query) -> Iterator[Result]:
    return query.results()


def by_shards(query: Query) -> Iterator[Result]:
    return ordered_results(query, local_executor(query), usual_pieces(query, 3), lambda _: None)


def by_dask(query: Query) -> Iterator[Result]:
    pytest.importorskip("distributed")
    from scenicq.query.execution.dask_executor import dask

    engine: Executor = dask()
    return ordered_results(query, engine, usual_pieces(query, 3), lambda _: None)


@pytest.fixture
def two(tmp_path: Path) -> tuple[Path, Path]:
    """A dataset, and a folder with another one and its source, of the same frames with every object elsewhere."""
    other = tmp_path / "other"
    shutil.copytree(SAMPLES / "crossroads", other / "source")
    labels = other / "source" / "labels.jsonl"
    labels.write_text(re.sub(r'"heading": ?-?[0-9.]+', '"heading": 0.125', labels.read_text()))
    ingest(SAMPLES / "crossroads", tmp_path / "d")
    ingest(other / "source", other / "d")
    return tmp_path / "d", other


@pytest.mark.parametrize("replacement", REPLACEMENTS)
@pytest.mark.parametrize("way", [by_blocks, by_shards, pytest.param(by_dask, marks=pytest.mark.slow)])
@pytest.mark.one_in(16)
def test_processes_read_the_dataset_that_was_asked_about_or_none(
    two: tuple[Path, Path],
    way: Callable[[Query], Iterator[Result]],
    replacement: Callable[[Path, Path], None],
) -> None:
    dataset, other = two
    query = Query(open_dataset(dataset), read_program(PROGRAM), OPTIONS)
    if way is not by_blocks:
        usual_pieces(query)
    query.is_over_time()
    results = way(query)
    replacement(dataset, other)
    with pytest.raises(DataError) as caught:
        list(results)
    assert {each.code for each in caught.value.diagnostics} <= {"store-damaged", "store-missing"}


@pytest.mark.parametrize("replacement", REPLACEMENTS)
@pytest.mark.one_in(4)
def test_one_process_finds_what_it_had_found_or_nothing(
    two: tuple[Path, Path], replacement: Callable[[Path, Path], None]
) -> None:
    dataset, other = two
    query = Query(open_dataset(dataset), read_program(PROGRAM), replace(OPTIONS, jobs=1))
    before = [record(result) for result in query.results()]
    again = Query(query.dataset, query.source, query.options)
    replacement(dataset, other)
    codes: set[str] = set()
    try:
        found = [record(result) for result in again.results()]
    except DataError as error:
        codes = {each.code for each in error.diagnostics}
    else:
        assert found == before
    assert codes <= {"store-damaged"}


@pytest.mark.parametrize("replacement", REPLACEMENTS)
@pytest.mark.one_in(4)
def test_a_copy_is_the_same_dataset_or_refused(
    two: tuple[Path, Path], replacement: Callable[[Path, Path], None]
) -> None:
    dataset, other = two
    opened = open_dataset(dataset)
    for made in (copy.copy(opened), copy.deepcopy(opened), pickle.loads(pickle.dumps(opened))):
        assert made.manifest == opened.manifest
        del made
    sent = pickle.dumps(opened)
    replacement(dataset, other)
    with pytest.raises(DataError):
        pickle.loads(sent)
    with pytest.raises(DataError):
        check_apart(opened.reference)


@pytest.mark.skipif(os.name != "posix", reason="descriptors of POSIX")
def test_a_copy_closes_no_descriptor_but_its_own(two: tuple[Path, Path], tmp_path: Path) -> None:
    opened = open_dataset(two[0])
    made = [copy.copy(opened), pickle.loads(pickle.dumps(opened))]
    opened.release()
    with (tmp_path / "mine").open("w") as file:
        del made
        file.write("whole")
    assert (tmp_path / "mine").read_text() == "whole"


def test_nothing_opens_a_dataset_in_another_process_by_its_address() -> None:
    """Who opens by address does so for the user, or has just written it; processes get a reference."""
    callers = {
        str(path.relative_to(ROOT))
        for folder in ("scenicq", "cli")
        for path in (ROOT / folder).rglob("*.py")
        if re.search(r"(?<!def )\bopen_dataset\(", path.read_text(encoding="utf-8"))
    }
    assert callers == {
        "cli/datasets.py",
        "cli/index.py",
        "scenicq/importers/ingest.py",
        "scenicq/notebook/datasets.py",
        "scenicq/query/execution/question_notes.py",
        "scenicq/store/dataset.py",
    }


@pytest.mark.parametrize("ways", [by_blocks, by_shards, pytest.param(by_dask, marks=pytest.mark.slow)])
@pytest.mark.one_in(2)
def test_a_file_that_a_program_imports_is_read_once(ways: Callable[[Query], Iterator[Result]], tmp_path: Path) -> None:
    """Whoever does the work, the answers are those of the program as it was when the query began."""
    ingest(SAMPLES / "crossroads", tmp_path / "d")
    program, library = tmp_path / "program.scenic", tmp_path / "lib.scenic"
    program.write_text(
        "model scenic.domains.driving.model\nfrom lib import nearest\nego = new Car\no = new Car\n"
        "require (distance to o) < nearest\n"
    )
    library.write_text("nearest = 25\n")
    query = Query(open_dataset(tmp_path / "d"), read_program(program), replace(OPTIONS, match=MatchOptions()))
    expected = [
        record(result) for result in Query(query.dataset, query.source, replace(query.options, jobs=1)).results()
    ]
    query = Query(open_dataset(tmp_path / "d"), read_program(program), replace(OPTIONS, match=MatchOptions()))
    query.compile("crossroads")
    library.write_text("nearest = 0\n")
    assert [record(result) for result in ways(query)] == expected
    assert len({each.verdict for each in expected}) == 2
