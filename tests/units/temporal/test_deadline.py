"""A query over time ends when its time is over, wherever it is then, and what it has told by then is right."""

from __future__ import annotations

import gc
import math
import sys
import time
from collections.abc import Iterator
from typing import Any

import pytest
from programs_over_time import HEADER, PROGRAMS

from scenicq import budget
from scenicq.errors import Source
from scenicq.query.execution.records import record
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.dataset import Dataset, open_dataset
from scenicq.store.labels import Label, LabelObject, Recording
from scenicq.store.writer import write_dataset
from scenicq.temporal.hidden_runs import HiddenRuns


def label(sample: int) -> Label:
    cars = tuple(
        LabelObject(
            f"{track}-{sample}", "Car", "car", 3.0 * place - 3, 10 + 20 * place + 30 * math.sin(sample / (20 + place)),
            0.0, track=track, velocity=(0.0, float((sample + place) % 7)),
        )
        for place, track in enumerate(("a", "b"))
    )  # fmt: skip
    ego = LabelObject("ego", "Car", "car", 0.0, 0.0, 0.0, velocity=(0.0, 0.0))
    return Label(f"{sample:05}", "r", sample * 100_000, "none", ego, cars)


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """What makes a dataset of one recording of so many samples."""
    made: dict[int, Dataset] = {}

    def of(samples: int) -> Dataset:
        if samples not in made:
            folder = tmp_path_factory.mktemp("long") / "d"
            labels = tuple(map(label, range(samples)))
            write_dataset(folder, [Recording("r", "none", labels)], {}, name="d")
            made[samples] = open_dataset(folder)
        return made[samples]

    return of


def query(dataset: Dataset, program: str, **options: Any) -> Query:
    return Query(dataset, Source("p.scenic", HEADER + PROGRAMS[program]), QueryOptions(**options))


class Ticking:
    """A clock of which each look takes a second by the wall, whose processor time stands still."""

    def __init__(self) -> None:
        """Begin at 0."""
        self.now = 0.0

    def perf_counter(self) -> float:
        return self.monotonic()

    def monotonic(self) -> float:
        self.now += 1
        return self.now

    def thread_time(self) -> float:
        return 0.0


@pytest.mark.parametrize("program", PROGRAMS)
@pytest.mark.one_in(4)
def test_wherever_the_time_is_over_nothing_of_the_recording_is_told(program, recording, monkeypatch):
    """Everything that looks at the clock may be the last that was done."""
    dataset = recording(40)
    clock = Ticking()
    monkeypatch.setattr(budget, "time", clock)
    whole = query(dataset, program, until=math.inf)
    every = [record(each) for each in whole.results()]
    assert every or whole.funnel.frames == 40
    looks = clock.now
    for part in range(1, 6):
        cut = query(dataset, program, until=clock.now + looks * part / 6)
        found = [record(each) for each in cut.results()]
        assert (found, cut.funnel.frames, cut.funnel.cut) == ([], 0, True), part


class Sampling:
    """The clock, which keeps how much processor time passes between two looks at it, and where they are."""

    def __init__(self) -> None:
        """Begin now."""
        self.longest: tuple[float, str, str] = 0.0, "", ""
        self.last = time.thread_time(), "the start"

    def perf_counter(self) -> float:
        caller = sys._getframe(2)
        now, here = time.thread_time(), f"{caller.f_code.co_filename}:{caller.f_lineno}"
        self.longest = max(self.longest, (now - self.last[0], self.last[1], here))
        self.last = time.thread_time(), here
        return time.perf_counter()

    def __getattr__(self, name: str) -> Any:
        return getattr(time, name)


@pytest.fixture
def only_ours() -> Iterator[None]:
    """The collector looks at no object from before: what else the process holds is no matter of the query."""
    gc.collect()
    gc.freeze()
    yield
    gc.unfreeze()


@pytest.mark.parametrize("program", PROGRAMS)
@pytest.mark.one_in(6)
@pytest.mark.usefixtures("only_ours")
def test_nothing_takes_long_between_two_looks_at_the_clock(program, recording, monkeypatch):
    dataset = recording(8000)
    list(query(recording(40), program).results())  # what is loaded once is no matter of the recording
    clock = Sampling()
    monkeypatch.setattr(budget, "time", clock)
    list(query(dataset, program, until=time.monotonic() + 20).results())
    assert clock.longest[0] < 0.5, clock.longest


def counted(monkeypatch: pytest.MonkeyPatch, owner: Any, name: str) -> Iterator[int]:
    """How often something was called since it was last asked, from now on."""
    calls, original = [0], getattr(owner, name)

    def counting(*args: Any, **named: Any) -> Any:
        calls[0] += 1
        return original(*args, **named)

    monkeypatch.setattr(owner, name, counting)
    while True:
        yield calls[0]
        calls[0] = 0


@pytest.mark.parametrize("program", ["a number", "a number of the scene"])
def test_runs_are_followed_once_for_all_starts(program, recording, monkeypatch):
    """Where rounding may decide, only those are followed again that nothing else proves."""
    calls = counted(monkeypatch, HiddenRuns, "_run")
    next(calls)
    for samples in (100, 800):
        assert list(query(recording(samples), program).results())
        assert next(calls) <= 2, samples
