"""Every program of the repository on every dataset that tests have: with the prefilter and without it the same."""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Callable
from dataclasses import asdict, replace
from functools import cache
from pathlib import Path

import pytest

from scenicq.errors import ScenicqError, Source
from scenicq.importers.ingest import ingest
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import Tolerance
from scenicq.query.execution.records import Record, record
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.dataset import Dataset, open_dataset

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[1] / "match"))
sys.path.insert(0, str(Path(__file__).parents[2] / "oracles/drawn_scenes"))
from examples import Example, examples
from made_up import TIED, made_up
from programs import HEADER
from side_by_side import SideBySide

ROOT = Path(__file__).parents[3]
SAMPLES = ROOT / "sample_data"
REAL = ROOT.parent / "shared" / "data"
SOURCES = {path.parent.name: path.parent for path in sorted(SAMPLES.glob("crossroads/dataset.json"))}
SOURCES |= {path.name: path for path in sorted(SAMPLES.glob("*_tiny"))}
SOURCES |= {name: REAL / name for name in ("boston", "nuscenes-mini", "argoverse2")}
MAPS = {"nuscenes-mini": [REAL / "boston" / "maps" / "boston-seaport.geojson"]}
RANDOM, PARTS = 80, 8
"""Random programs, and parts in which all programs are tried on a dataset."""
FRAMES, SECONDS, MOST_STOPPED = 24, 2.5, 0.1
"""Frames of a dataset of each kind and processor time for a program, and the share of programs that may take longer."""
CROWDED = {"nuscenes-mini": 8, "argoverse2": 8}
"""Fewer frames of those that have dozens of objects: with any of them as the ego, a frame takes up to a second."""
PAPER = MatchOptions(
    tolerance=Tolerance(x=0.25, y=0.25, heading=math.radians(5)), classes="coarse", radius=50.0, ego="any"
)
EXACT = MatchOptions(tolerance=Tolerance(position=0.5, heading=0.1))
BUDGET = {"timeout_s": 0.1, "budget": 2000}
"""So that no program takes long; a frame that is unknown then proves nothing, and is passed over."""


@cache
def programs() -> list[Example]:
    """All of them, in an order that mixes where they are from."""
    tied = {f"tied:{name}": text for name, text in TIED.items()}
    tied |= {f"random:{seed}": made_up(seed) for seed in range(RANDOM)}
    every = [*examples().values(), *(Example(name, HEADER + text) for name, text in tied.items())]
    return [each for part in range(PARTS) for each in every[part::PARTS]]


@pytest.fixture(scope="module")
def dataset(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    name = request.param
    if not SOURCES[name].exists():
        pytest.skip(f"{SOURCES[name]} is not on this machine")
    target = tmp_path_factory.mktemp("every") / name
    ingest(SOURCES[name], target, maps=MAPS.get(name, []))
    return open_dataset(target)


def query(
    dataset: Dataset, program: Example, options: MatchOptions, *, prefilter: bool, proofs: bool = True
) -> Query:  # fmt: skip
    source = Source(f"{program.name}.scenic", program.text)
    how = QueryOptions(
        options,
        solver="portable",
        version=program.version,
        initial=program.initial,
        prefilter=prefilter,
        proofs=proofs,
    )  # type: ignore[arg-type]
    return Query(dataset, source, how)


def named(dataset: Dataset, program: Example, options: MatchOptions) -> dict[str, str]:
    """The verdict on each frame that is not excluded, where nobody reads proofs."""
    results = query(dataset, program, options, prefilter=True, proofs=False).results()
    return {result.frame: record(result).verdict for result in results}


def found(dataset: Dataset, program: Example, options: MatchOptions, *, prefilter: bool) -> dict[str, Record] | str:
    """What a query gives for each frame that is not excluded, or its error."""
    try:
        results = query(dataset, program, options, prefilter=prefilter).results()
        return {result.frame: record(result) for result in results}
    except ScenicqError as error:
        return str(error)


def compare(dataset: Dataset, chosen: list[Example]) -> tuple[list[str], int]:
    """Frames for which any two ways disagree, though both know; and matches of the two with proofs."""
    told: list[str] = []
    matches = 0
    for number, program in enumerate(chosen):
        options = replace(PAPER if number % 2 else EXACT, **BUDGET)
        with_it, without = (found(dataset, program, options, prefilter=each) for each in (True, False))
        if isinstance(with_it, str) or isinstance(without, str):
            told += [f"{program.name}: {with_it} is not {without}"] * (with_it != without)
            continue
        for frame in with_it.keys() | without.keys():
            pair = with_it.get(frame), without.get(frame)
            if not any(each is not None and each.verdict == "unknown" for each in pair):
                told += [f"{program.name}, {frame}: {pair[0]} is not {pair[1]}"] * (pair[0] != pair[1])
                matches += pair[0] == pair[1]
        bare = named(dataset, program, options)
        for frame in with_it.keys() | bare.keys():
            known = with_it[frame].verdict if frame in with_it else None
            odd = known != bare.get(frame) and "unknown" not in (known, bare.get(frame))
            told += [f"{program.name}, {frame}: {bare.get(frame)} without proofs, {known} with them"] * odd
    return told, matches


@pytest.mark.parametrize(
    ("dataset", "step"), [("crossroads", 256), ("nuscenes_tiny", 96), ("waymo_tiny", 96)], indirect=["dataset"]
)
@pytest.mark.one_in(4)
def test_some_programs_find_the_same(dataset: Dataset, step: int) -> None:
    anything = Example("anything", HEADER + "ego = new Car\n")
    told, matches = compare(dataset, [anything, *programs()[::step]])
    assert told == []
    assert matches > 0


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="timers of POSIX")
@pytest.mark.parametrize("part", range(PARTS))
@pytest.mark.parametrize("dataset", SOURCES, indirect=True)
def test_every_program_finds_the_same(
    dataset: Dataset, part: int, monkeypatch: pytest.MonkeyPatch, record_property: Callable[[str, object], None]
) -> None:
    networks = {name: dataset.network(name) for name in dataset.maps}
    monkeypatch.setattr(Dataset, "network", lambda _, name: networks[name])
    frames = CROWDED.get(dataset.path.name, FRAMES)
    with SideBySide(dataset, frames, SECONDS) as both:
        for number, program in enumerate(programs()[part::PARTS]):
            options = replace(PAPER if number % 2 else EXACT, **BUDGET)
            both.compare(program.name, *(query(dataset, program, options, prefilter=each) for each in (True, False)))
    for name, value in asdict(both.found).items():
        record_property(name, value)
    assert both.found.disagreements == []
    assert both.found.frames > 0
    assert len(both.found.stopped) <= MOST_STOPPED * both.found.programs, both.found.stopped
