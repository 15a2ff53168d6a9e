"""What a condition over time asks for and does not find rejects the run at the sample where the condition is read."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest
from interval_definition import Sample, recording_of

from scenicq.errors import Source
from scenicq.geometry.default_street import street
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.dataset import open_dataset
from scenicq.store.writer import write_dataset
from scenicq.temporal.interval_options import IntervalOptions

OBJECTS = """model scenic.domains.driving.model
ego = new Car at (Range(-99, 99), Range(-99, 99)), facing Range(-4, 4), with requireVisible False
other = new Car at (Range(-99, 99), Range(-99, 99)), facing Range(-4, 4), with requireVisible False
"""
OTHER_X = [5.0, 5.0, 9.0, 5.0, 2.0, 2.0, 5.0, 9.0, 5.0, 9.0]
"""Of the other car by sample: in the outer lane at 5 m, in the inner one at 2 m, beside the road at 9 m."""
SAMPLES = range(len(OTHER_X))
ON_LANE = [x < 7 for x in OTHER_X]
HAS_LEFT = [x == 5 for x in OTHER_X]
"""Of the other car's lane section by sample: whether one lies to its left."""


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory):
    """Two cars go north side by side, 2 m a sample; the other one changes lanes and leaves the road."""
    network = street()
    folder = tmp_path_factory.mktemp("drive") / "d"
    trace = [Sample(0.5 * n, {"ego": (2.0, 30 + 2.0 * n), "t": (x, 24 + 2.0 * n)}) for n, x in enumerate(OTHER_X)]
    recording = recording_of("r", trace)
    labels = tuple(replace(label, map=network.name) for label in recording.labels)
    write_dataset(
        folder, [replace(recording, map=network.name, labels=labels)], {network.name: network.features}, name="d"
    )
    return folder


def spans(folder, text: str) -> list[tuple[int, int]]:
    """First and last sample of every match."""
    options = QueryOptions(time=IntervalOptions(intervals="all"))
    found = Query(open_dataset(folder), Source("p.scenic", OBJECTS + text), options).results()
    return [tuple(int(name.rpartition("-")[2]) for name in (each.frame, each.interval.last)) for each in found]


def stretches(holds: Callable[[int], bool]) -> list[tuple[int, int]]:
    """From each sample on as far as it holds: what a program without an end says."""
    ends = {i: next((j for j in SAMPLES if j >= i and not holds(j)), len(SAMPLES)) - 1 for i in SAMPLES}
    return [(i, j) for i, j in ends.items() if j >= i]


def test_an_attribute_that_is_not_there_rejects_whatever_the_formula_says_of_it(drive):
    for formula in (
        "always other.lane is not None",
        "always (other.lane is not None or True)",
        "eventually (other.lane is None) or always (ego.speed > -1)",
        "always (not (other.lane is None))",
        "(ego.speed > -1) until (other.lane.id == 'nowhere') or always ego.speed > -1",
    ):
        assert spans(drive, f"require {formula}") == stretches(ON_LANE.__getitem__), formula


def test_so_does_what_the_found_element_lacks(drive):
    assert spans(drive, "require always other.laneSection.laneToLeft is not None") == stretches(HAS_LEFT.__getitem__)


def test_a_condition_that_ends_a_run_is_read_at_each_of_its_samples(drive):
    ends = {i: next((j for j in SAMPLES if j >= i and OTHER_X[j] == 2), None) for i in SAMPLES}
    assert spans(drive, "terminate when other.lane is ego.lane") == [
        (i, j) for i, j in ends.items() if j is not None and all(ON_LANE[i : j + 1])
    ]


def test_a_monitor_rejects_only_where_it_reads_the_condition(drive):
    program = """
monitor Looks():
    while ego.position.y < 37:
        wait
    if other.lane is ego.lane:
        terminate
require monitor Looks()
terminate after 1 seconds
"""
    expected: list[tuple[int, int]] = []
    for i in SAMPLES:
        read, end = max(i, 4), i + 2
        if read <= end:
            if not ON_LANE[read]:
                continue
            end = read if OTHER_X[read] == 2 else end
        if end < len(OTHER_X):
            expected.append((i, end))
    assert spans(drive, program) == expected


@pytest.mark.slow
def test_what_the_scene_alone_lacks_excludes_the_scene(drive):
    asked = "place = Range(1, 10) @ 50\nrequire always place.x > other.position.x"
    # each end with a place on a lane, which are those up to 7 m, that holds until there and no further
    ends = {
        (i, max(j for j in SAMPLES if j >= i and all(x < place for x in OTHER_X[i : j + 1])))
        for place in (3, 6)
        for i in SAMPLES
        if OTHER_X[i] < place
    }
    assert sorted(spans(drive, asked + " and network.laneAt(place, reject=True) is not None")) == sorted(ends)
    assert set(spans(drive, asked)) > ends
