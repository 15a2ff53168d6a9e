"""What a program computes before a condition over time is as it was at the first sample of an interval."""

import math

import pytest
from interval_definition import Sample, recording_of

from scenicq.errors import Source
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.dataset import open_dataset
from scenicq.store.writer import write_dataset
from scenicq.temporal.interval_options import IntervalOptions

OBJECTS = """
ego = new Object at (Range(-99, 99), Range(-99, 99)), facing 0
other = new Object at (Range(-99, 99), Range(-99, 99)), facing 0
"""


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    """A recording in which the ego goes 2 m a sample and the other object stays 5 m aside of where the ego began."""
    folder = tmp_path_factory.mktemp("drive") / "d"
    trace = [Sample(0.5 * n, {"ego": (0.0, 2.0 * n), "t": (5.0, 0.0)}) for n in range(8)]
    write_dataset(folder, [recording_of("r", trace)], {}, name="d")
    return folder


def spans(folder, text):
    query = Query(
        open_dataset(folder),
        Source("p.scenic", OBJECTS + text),
        QueryOptions(time=IntervalOptions(intervals="all")),
    )
    return [
        (int(result.frame.rpartition("-")[2]), int(result.interval.last.rpartition("-")[2]))
        for result in query.results()
    ]


@pytest.mark.parametrize(
    "text",
    [
        "start = new Point at ego.position\nterminate when (distance from ego to start) > 5",
        "place = ego.position\nterminate when (distance from ego to place) > 5",
        "def moved(thing, place):\n    return (distance from thing to place) > 5\n"
        "start = ego.position\nterminate when moved(ego, start)",
        "start = ego.position\nmonitor Goes():\n    while (distance from ego to start) < 5:\n        wait\n"
        "    terminate\nrequire monitor Goes()",
        "start = new OrientedPoint at ego.position offset by (0, 1)\n"
        "require always (distance from ego to start) < 6\nterminate when (distance from ego to start) > 4.5",
    ],
)
def test_places_stay_where_they_were(drive, text):
    assert spans(drive, text) == [(first, first + 3) for first in range(5)]


def test_numbers_stay_what_they_were(drive):
    far = [math.hypot(5, 2 * n) for n in range(8)]
    ends = {n: next((m for m in range(n, 8) if far[m] > far[n] + 4), None) for n in range(8)}
    text = "before = distance from ego to other\nterminate when (distance from ego to other) > before + 4"
    assert spans(drive, text) == [(first, last) for first, last in ends.items() if last is not None]


def test_with_a_hidden_number(drive):
    text = "start = ego.position\nlimit = Range(3, 5)\nterminate when (distance from ego to start) > limit"
    assert spans(drive, text) == [(first, last) for first in range(6) for last in (first + 2, first + 3) if last < 8]


def test_what_a_condition_reads_itself_is_read_at_each_sample(drive):
    assert spans(drive, "terminate when ego.position.y > 9") == [(first, 5) for first in range(6)] + [(6, 6), (7, 7)]
