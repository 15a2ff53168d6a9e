"""Choices over time, one program at a time: the outcome is one for all that reads it, by every method."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from interval_definition import Sample
from interval_definition import recording_of as of_samples

from scenicq.errors import ScenarioError, Source
from scenicq.match.options import MatchOptions
from scenicq.match.verdict import Match
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.dataset import Dataset, open_dataset
from scenicq.store.writer import write_dataset
from scenicq.temporal.interval_options import IntervalOptions

OBJECTS = "model scenic.domains.driving.model\n" + "".join(
    f"{name} = new Car in everywhere, facing Range(0, 360) deg\n" for name in ("ego", "o1")
)
TURNED = OBJECTS.rpartition("o1")[0] + "side = Uniform(-90, 90)\no1 = new Car in everywhere, facing side deg\n"
METHODS = ("auto", "smt", "monolithic")
DISCS = "w = Uniform(CircularRegion((0, 0), 3), CircularRegion((20, 0), 3))\nrequire ego.position in w\n"
OBJECT = "t = Uniform(ego, o1)\nrequire t.position.x > 5\n"
NESTED = "a = Uniform(-1, 1)\nb = Uniform(a, 5 * a)\nrequire b > 0\n"
NUMBER = "D = Uniform(Range(1, 3), Range(6, 8))\n"
IN_DISC = "P = new Point in CircularRegion((0, 0), 3)\n"
STEADY = (
    "monitor Steady():\n    while True:\n        require ego.position.x < 5\n        wait\nrequire monitor Steady()\n"
)

ONE_OUTCOME = [
    (OBJECTS + "side = Uniform(-1, 1)\nrequire side > 0\nrequire eventually side < 0\n", set()),
    (OBJECTS + "side = Discrete({-1: 1, 1: 2})\nrequire side > 0\nrequire eventually side < 0\n", set()),
    (OBJECTS + "side = DiscreteRange(-1, 1)\nrequire side > 0\nrequire eventually side < 0\n", set()),
    (OBJECTS + DISCS + "require eventually not (ego.position in w)\n", {"goes-0"}),
    (OBJECTS + OBJECT + "require eventually t.position.x < 5\n", set()),
    (OBJECTS + "t = Uniform(ego, o1)\nrequire t.position.x < 5\nrequire eventually t.position.x > 5\n", {"goes-0"}),
    (TURNED + "require eventually side > 0\n", set()),
    (TURNED + "require eventually side < 0\n", set()),
    (OBJECTS + NESTED + "require eventually a < 0\n", set()),
    (OBJECTS + NUMBER + "require always D > 8\n", set()),
    (OBJECTS + "k = Uniform(2, 9)\nrequire ego.position.x > k\nrequire always ego.position.x < k\n", set()),
]
EVERYWHERE = [
    NESTED + "require eventually a > 0\n",
    NUMBER + "require always D > 0\n",
    "n = Discrete({1: 1, 1.25: 1, 2: 1})\nrequire n <= 1.25\nrequire n != 1\nrequire always n > 0\n",
]
POINTS = [
    ("require eventually (distance from ego to P) > 16\n", {f"goes-{n}" for n in range(4)}),
    ("require always (distance from ego to P) < 0.5\nrequire eventually P.position.x > 0.6\n", set()),
    ("require always P.position.x > 1\nrequire eventually P.position.x < 0\n", set()),
    ("require always P.position.x > 4\n", set()),
    ("require eventually ego.position.x - P.position.x > 19\n", {f"goes-{n}" for n in range(4)}),
]
EVERY_FRAME = {f"{name}-{n}" for name in ("goes", "stands", "lone") for n in range(4)}


@pytest.fixture(scope="module")
def dataset(tmp_path_factory) -> Dataset:
    """Recordings of two seconds: in one all stand, in the other the ego goes 20 m to the right."""
    folder = tmp_path_factory.mktemp("rows") / "d"
    stands = [Sample(0.5 * n, {"ego": (0.0, 0.0), "t": (10.0, 5.0)}) for n in range(4)]
    goes = [Sample(0.5 * n, {"ego": (0.0 if n < 1 else 20.0, 0.0), "t": (10.0, 5.0)}) for n in range(4)]
    # alone for longer than motion is derived over
    lone = [Sample(2.0 * n, {"ego": (0.0, 0.0), "t": (10.0, 5.0)}) for n in range(4)]
    write_dataset(
        folder, [of_samples("goes", goes), of_samples("lone", lone), of_samples("stands", stands)], {}, name="d"
    )
    return open_dataset(folder)


def told(dataset: Dataset, text: str, method: str) -> list[tuple[str, str, str]]:
    """The first and last frame of each interval, and what is told of it."""
    options = QueryOptions(match=MatchOptions(method=method), time=IntervalOptions(intervals="all"))
    results = list(Query(dataset, Source("p.scenic", text), options).results())
    last = [each.frame if each.interval is None else each.interval.last for each in results]
    return sorted((each.frame, end, type(each.verdict).__name__) for each, end in zip(results, last, strict=True))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(("text", "frames"), ONE_OUTCOME)
@pytest.mark.one_in(12)
def test_an_outcome_is_one_for_the_start_and_for_all_that_follows(dataset, text, frames, method):
    assert {first for first, _, _ in told(dataset, text, method)} == frames


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("text", EVERYWHERE)
@pytest.mark.one_in(3)
def test_outcomes_that_do_not_hang_on_the_label_match_everywhere(dataset, text, method):
    found = told(dataset, OBJECTS + text, method)
    assert {verdict for _, _, verdict in found} == {"Match"}
    assert {first for first, _, _ in found} == EVERY_FRAME


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(("text", "frames"), POINTS)
@pytest.mark.one_in(32)
def test_a_point_of_which_the_start_says_nothing_is_one_for_all_that_follows(dataset, text, frames, method):
    found = told(dataset, OBJECTS + IN_DISC + text, method)
    assert {(first, verdict) for first, _, verdict in found} == {(first, "Match") for first in frames}


@pytest.mark.parametrize(
    ("text", "frames"),
    [
        *ONE_OUTCOME,
        *((OBJECTS + text, EVERY_FRAME) for text in EVERYWHERE),
        *((OBJECTS + IN_DISC + text, frames) for text, frames in POINTS),
        (OBJECTS + STEADY + "terminate when ego.position.x > 5\n", {f"goes-{n}" for n in range(4)}),
        (OBJECTS + "require always ego.position.x > 5\nterminate when o1.speed > 1\n", set()),
        (OBJECTS + STEADY + "terminate simulation when ego.position.x > 5\n", set()),
    ],
)
@pytest.mark.parametrize(
    "words",
    [
        ("--method", "auto"), ("--method", "smt"), ("--method", "monolithic"), ("--method", "auto", "--no-prefilter"),
        ("--method", "smt", "--no-prefilter", "--jobs", "2"), ("--method", "auto", "--jobs", "2"),
    ],
    ids=" ".join,
)  # fmt: skip
@pytest.mark.one_in(140)
@pytest.mark.slow
def test_the_installed_command_says_so_by_every_method(dataset, tmp_path, text, frames, words):
    (tmp_path / "p.scenic").write_text(text)
    command = Path(sys.executable).with_name("scenicq")
    words = ["match", tmp_path / "p.scenic", dataset.path, *words, "--intervals", "all", "--format", "jsonl"]
    run = subprocess.run([command, *words, "--exit-zero"], capture_output=True, text=True, check=False)
    assert run.returncode == 0 or "error[impossible-requirement]" in run.stderr, run.stderr
    lines = [json.loads(line) for line in run.stdout.splitlines()]
    assert {(each["frames"]["first"], each["verdict"]) for each in lines} == {(first, "match") for first in frames}
    if "terminate when" in text:
        assert [each["frames"]["last"] for each in lines if each["frames"]["first"] == "goes-0"] in ([], ["goes-1"])


@pytest.mark.parametrize("method", METHODS)
def test_discrete_outcomes_come_before_a_solver_in_frames(dataset, method):
    text = OBJECTS + "n = Discrete({1: 1, 1.25: 1, 2: 1})\nrequire n <= 1.25\nrequire n != 1\n"
    options = QueryOptions(match=MatchOptions(method=method))
    results = list(Query(dataset, Source("p.scenic", text), options).results())
    assert len(results) == 12
    assert all(isinstance(each.verdict, Match) for each in results)


def test_an_end_stops_monitors_before_they_run(dataset):
    found = told(dataset, OBJECTS + STEADY + "terminate when ego.position.x > 5\n", "auto")
    assert [each for each in found if each[0] == "goes-0"] == [("goes-0", "goes-1", "Match")]
    late = told(dataset, OBJECTS + STEADY + "terminate simulation when ego.position.x > 5\n", "auto")
    assert [each for each in late if each[2] == "Match"] == []


def test_what_every_end_refutes_is_no_whatever_is_not_observed(dataset):
    text = OBJECTS + "require always ego.position.x > 5\nterminate when o1.speed > 1\n"
    assert [each for each in told(dataset, text, "auto") if not each[0].startswith("goes")] == []
    open_ = told(dataset, OBJECTS + "require always ego.position.x < 5\nterminate when o1.speed > 1\n", "auto")
    assert {first for first, _, verdict in open_ if verdict == "Unknown"} == {f"lone-{n}" for n in range(4)}


@pytest.mark.parametrize(
    "line",
    [
        "t = ego", "t = Uniform(ego)", "t = Uniform(ego, o1)", "t = Discrete({o1: 0, ego: 2})", "t = [o1, ego][1]",
        "for t in [o1, ego]:\n    require t.position.x >= 0",
        "require all([(distance to t) < 90 for t in [o1, ego]])",
        "require always max([distance to t for t in [o1, ego]]) < 90",
        "require len([t for t in [o1, ego] if (distance to t) < 90]) == 2",
        "def near(t):\n    return (distance to t) < 90\nrequire near(ego)",
        "require all(map(lambda t: (distance to t) < 90, [o1, ego]))",
    ],
)  # fmt: skip
@pytest.mark.parametrize("over_time", [False, True])
@pytest.mark.one_in(3)
def test_the_ego_is_called_ego_whatever_else_names_it(dataset, line, over_time):
    text = f"{OBJECTS}{line}\n" + ("require eventually ego.position.x >= 0\n" if over_time else "")
    found = [each.verdict for each in Query(dataset, Source("p.scenic", text), QueryOptions()).results()]
    assert found
    assert all(isinstance(each, Match) and each.correspondence.keys() == {"ego", "o1"} for each in found)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    ("condition", "frames"),
    [
        ("{1: 3, 2: 15}[k] < ego.position.x", {"goes-1", "goes-2", "goes-3"}),
        ("{1: 13, 2: 25}[k] < ego.position.x", {"goes-1", "goes-2", "goes-3"}),
        ("{True: 3, False: 50}[ego.position.x > 5] == 3", {"goes-1", "goes-2", "goes-3"}),
        ("{True: 3, False: 50}[ego.position.x > 5] < ego.position.x", {"goes-1", "goes-2", "goes-3"}),
        ("[3, 15, 99][k] < ego.position.x", {"goes-1", "goes-2", "goes-3"}),
        ("{'a': 3, 'b': 15}[name] < ego.position.x", {"goes-1", "goes-2", "goes-3"}),
        ("range(3, 30, 12)[k] < ego.position.x", {"goes-1", "goes-2", "goes-3"}),
        ("{1: 3, 2: 5}[k] > 4 and k < 2", set()),
    ],
)
@pytest.mark.parametrize("over_time", [False, True])
@pytest.mark.one_in(12)
def test_a_dict_is_indexed_by_what_is_random_or_observed(dataset, condition, frames, method, over_time):
    text = (
        f"{OBJECTS}k = Uniform(1, 2)\nname = Uniform('a', 'b')\nrequire {'always ' if over_time else ''}{condition}\n"
    )
    assert {first for first, _, verdict in told(dataset, text, method) if verdict == "Match"} == frames


def test_what_is_drawn_in_a_condition_is_no_index(dataset):
    with pytest.raises(ScenarioError, match="draw it before, outside of the condition"):
        told(dataset, OBJECTS + "require {1: 3, 2: 15}[Uniform(1, 2)] < ego.position.x\n", "auto")
