"""Programs made of scenarios against programs that say the same without: each finds what the others find together."""

import math
import random

import pytest
from interval_definition import random_trace, recording_of

from scenicq.errors import Source
from scenicq.query.execution.option_texts import DRIVING
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.dataset import open_dataset
from scenicq.store.writer import write_dataset
from scenicq.temporal.interval_options import IntervalOptions

CARS = "new Car in CircularRegion((0, 0), 100), facing Range(0, 360) deg, with requireVisible False"
EGO = f"ego = {CARS}\n"

SAME = {
    "scenarios side by side": (
        f"""
scenario Main():
    setup:
        ego = {CARS}
    compose:
        do Near(), Quick(2.5)
scenario Near():
    setup:
        a = {CARS}
        require (distance from a to ego) < 6
        require always a.position.x < 4
scenario Quick(limit):
    setup:
        b = {CARS}
        require eventually b.speed > limit
""",
        [f"""{EGO}a = {CARS}
b = {CARS}
require (distance from a to ego) < 6
require always a.position.x < 4
require eventually b.speed > 2.5
"""],
    ),
    "the program ends with what it composes": (
        f"""
scenario Main():
    setup:
        ego = {CARS}
    compose:
        do Near()
scenario Near():
    setup:
        a = {CARS}
        require always a.position.x > -4
        terminate when ego.speed > 2.5
""",
        [f"""{EGO}a = {CARS}
require always a.position.x > -4
terminate when ego.speed > 2.5
"""],
    ),
    "a time": (
        f"""
scenario Main():
    setup:
        ego = {CARS}
    compose:
        do Near() for 1 seconds
scenario Near():
    a = {CARS}
    require (distance from a to ego) < 6
""",
        [f"""{EGO}a = {CARS}
require (distance from a to ego) < 6
terminate after 1 seconds
"""],
    ),
    "a number that both hang on": (
        f"""
scenario Main():
    setup:
        ego = {CARS}
        D = Range(-3, 3)
    compose:
        do Ahead(D)
scenario Ahead(d):
    setup:
        a = {CARS}
        require a.position.x > d
        require always a.position.x < d + 2
""",
        [f"""{EGO}D = Range(-3, 3)
a = {CARS}
require a.position.x > D
require always a.position.x < D + 2
"""],
    ),
    "one or the other": (
        f"""
scenario Main():
    setup:
        ego = {CARS}
    compose:
        do choose Left(), Right()
scenario Left():
    setup:
        a = {CARS}
        require a.position.x < 0
        terminate when ego.speed > 2
scenario Right():
    setup:
        b = {CARS}
        require b.position.x > 0
        require always b.speed < 4
        terminate after 1 seconds
""",
        [
            f"{EGO}a = {CARS}\nrequire a.position.x < 0\nterminate when ego.speed > 2\n",
            f"{EGO}b = {CARS}\nrequire b.position.x > 0\nrequire always b.speed < 4\nterminate after 1 seconds\n",
        ],
    ),
    "what another scenario makes": (
        f"""
scenario Main():
    setup:
        ego = {CARS}
    compose:
        first = First()
        second = Second(first.a, first.most)
        do first, second
scenario First():
    setup:
        a = {CARS}
        most = 4
scenario Second(car, most):
    require always car.position.x < most
    require (distance from car to ego) < 6
""",
        [f"{EGO}a = {CARS}\nrequire always a.position.x < 4\nrequire (distance from a to ego) < 6\n"],
    ),
    "an ego of a scenario": (
        f"""
scenario Main():
    compose:
        do Alone()
scenario Alone():
    setup:
        ego = {CARS}
        a = {CARS}
        require always (distance from ego to a) < 6
""",
        [f"{EGO}a = {CARS}\nrequire always (distance from ego to a) < 6\n"],
    ),
    "behaviors of what scenarios make": (
        f"""
behavior Waits():
    require self.position.x < 4
    wait
    require self.position.x > -4
    wait
    terminate
scenario Main():
    setup:
        ego = {CARS}
    compose:
        do One()
scenario One():
    a = {CARS}, with behavior Waits()
""",
        # the scenario ends with the third sample, what composes it with the fourth
        [f"""
behavior Waits():
    require self.position.x < 4
    wait
    require self.position.x > -4
    wait
    wait
monitor Fourth():
    wait
    wait
    wait
    terminate
{EGO}a = {CARS}, with behavior Waits()
require monitor Fourth()
"""],
    ),
    "one scenario after the other": (
        f"""
scenario Main():
    setup:
        ego = {CARS}
        a = {CARS}
    compose:
        do Until(a, 0)
        do Until(a, 2)
scenario Until(car, x):
    terminate when car.position.x > x
""",
        [f"""
monitor Both():
    while not a.position.x > 0:
        wait
    while not a.position.x > 2:
        wait
    terminate
{EGO}a = {CARS}
require monitor Both()
"""],
    ),
}  # fmt: skip


def found(folder, text, behaviors="guards", **options):
    query = Query(
        open_dataset(folder), Source("p.scenic", text), QueryOptions(behaviors=behaviors, model=DRIVING, **options)
    )
    return [
        (
            each.recording, each.frame, each.interval.last, type(each.verdict).__name__,
            tuple(sorted(each.verdict.correspondence.items())),
        )
        for each in query.results()
    ]  # fmt: skip


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    draw = random.Random(5)
    folder = tmp_path_factory.mktemp("modular") / "dataset"
    traces = {f"r{number:02}": random_trace(draw, gaps=False) for number in range(12)}
    write_dataset(folder, [recording_of(*each) for each in traces.items()], {}, name="d")
    return folder, traces


@pytest.fixture(scope="module")
def traces(drawn):
    return drawn[0]


@pytest.mark.parametrize("name", SAME)
@pytest.mark.parametrize("intervals", ["longest", "all"])
@pytest.mark.one_in(4)
def test_scenarios_find_what_plain_programs_find(name, intervals, traces):
    modular, plain = SAME[name]
    time = IntervalOptions(intervals=intervals)
    wanted = [each for text in plain for each in found(traces, text, time=time)]
    mine = found(traces, modular, time=time)
    assert wanted
    assert sorted(mine) == sorted(wanted)
    # in the order of recordings and time
    assert [each[:1] for each in mine] == sorted(each[:1] for each in mine)
    assert mine == found(traces, modular, time=time, prefilter=False)


LATER = f"""
scenario Main():
    setup:
        ego = {CARS}
    compose:
        wait
        do Sub()
scenario Sub():
    setup:
        a = {CARS}
        require (distance from a to ego) < 6
        require always a.position.x < 4
        terminate after 1 seconds
"""


def first_at(trace, k, seconds):
    """The first sample so many seconds after one; None where the recording ends before."""
    return next((j for j in range(k + 1, len(trace)) if trace[j].time - trace[k].time >= seconds - 1e-6), None)


def test_an_object_that_comes_later_is_bound_from_then_on(drawn):
    folder, traces = drawn
    expected = []
    for name, trace in traces.items():
        for start in range(len(trace) - 1):
            end = first_at(trace, start + 1, 1.0)
            for track in sorted(trace[0].seen.keys() - {"ego"}):
                near = math.dist(trace[start + 1].seen[track], trace[start + 1].seen["ego"]) < 6
                if end is None or not near:
                    continue
                if all(trace[k].seen[track][0] < 4 for k in range(start + 1, end + 1)):
                    roles = (("a", track), ("ego", "ego"))
                    expected.append((name, f"{name}-{start}", f"{name}-{end}", "Match", roles))
    assert len(expected) > 5
    mine = found(folder, LATER, time=IntervalOptions(intervals="all"))
    assert sorted(mine) == sorted(expected)


PLACED = f"""
scenario Main():
    setup:
        ego = {CARS}
    compose:
        wait until ego.position.x > 0
        do Sub()
scenario Sub():
    setup:
        a = new Car at ego.position + (Range(-3, 3), Range(-2, 2)), facing 0 deg
        terminate after 0.5 seconds
"""


def test_where_an_object_comes_is_asked_where_it_comes(drawn):
    folder, traces = drawn
    expected = []
    for name, trace in traces.items():
        for start in range(len(trace)):
            begins = next((k for k in range(start, len(trace)) if trace[k].seen["ego"][0] > 0), None)
            end = None if begins is None else first_at(trace, begins, 0.5)
            for track in sorted(trace[0].seen.keys() - {"ego"}):
                if end is None:
                    continue
                x, y = (a - b for a, b in zip(trace[begins].seen[track], trace[begins].seen["ego"], strict=True))
                if abs(x) <= 3.2 and abs(y) <= 2.2:
                    roles = (("a", track), ("ego", "ego"))
                    expected.append((name, f"{name}-{start}", f"{name}-{end}", "Match", roles))
    assert len(expected) > 3
    mine = found(folder, PLACED, time=IntervalOptions(intervals="all"))
    assert sorted(mine) == sorted(expected)


def test_a_scenario_that_begins_again_makes_another_object(drawn):
    folder, _ = drawn
    again = LATER.replace("        do Sub()\n", "        do Sub()\n        do Sub()\n").replace("1 sec", "0.5 sec")
    results = found(folder, again, time=IntervalOptions(intervals="all"))
    assert results
    for *_, roles in results:
        assert len(roles) == 3
        assert len({track for _, track in roles}) == 3
