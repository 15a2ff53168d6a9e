"""Conditions over time that have no value for some values of hidden variables, against the definition on a grid."""

from __future__ import annotations

import itertools
import math
import random
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace

import pytest
from interval_definition import Sample, recording_of

from scenicq.errors import Source
from scenicq.geometry.default_street import street
from scenicq.match.options import MatchOptions
from scenicq.match.verdict import Match, NoMatch, Unknown
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.dataset import open_dataset
from scenicq.store.labels import Recording
from scenicq.store.writer import write_dataset
from scenicq.temporal.interval_options import IntervalOptions

STREET = street()
SAMPLES = 5
CENTER = (30.0, 50.0)
"""Of the places of the hidden point: the lanes of a road end at x = 7, so that beyond x = 27 there is no direction."""
PLACE = "p.scenic:4:18"
"""Where programs draw the point."""
Spot = tuple[float, float]


@dataclass(frozen=True)
class Atom:
    """A condition: its text, and its value for a hidden point and the position of the ego, None where it has none."""

    text: str
    value: Callable[[Spot, Spot], bool | None]


def directions(place: Spot) -> tuple[float, ...]:
    return STREET.roadDirection.values(*place)


def random_atom(draw: random.Random) -> Atom:
    """Draw a condition that hangs on the hidden point, or on the position of the ego alone."""
    number = draw.choice([-4.1, -0.35, 0.35, 1.55, 4.1])
    greater = draw.random() < 0.5
    sign = ">" if greater else "<"

    def compared(value: float, end: float) -> bool:
        return value > end if greater else value < end

    match draw.choice(["direction", "direction", "moving", "quotient", "root", "distance", "ego"]):
        case "direction":

            def on_road(spot: Spot, _: Spot) -> bool | None:
                found = directions(spot)
                return any(compared(each, number) for each in found) if found else None

            return Atom(f"((roadDirection at spot) {sign} {number})", on_road)
        case "moving":

            def moved(spot: Spot, ego: Spot) -> bool | None:
                found = directions((spot[0] + ego[0], spot[1]))
                return any(compared(each, number) for each in found) if found else None

            place = "(spot.position.x + ego.position.x) @ spot.position.y"
            return Atom(f"((roadDirection at {place}) {sign} {number})", moved)
        case "quotient":
            zero, end = draw.choice([10.37, 30.37, 31.37]), draw.choice([-9999.1, 0.01, 1.1, 9999.1])

            def quotient(spot: Spot, _: Spot) -> bool | None:
                below = spot[0] - zero
                return None if below == 0 else compared(10 / below, end)

            return Atom(f"(10 / (spot.position.x - {zero}) {sign} {end})", quotient)
        case "root":
            least = draw.choice([-5.1, 12.1, 30.1])

            def root(spot: Spot, ego: Spot) -> bool | None:
                inner = spot[0] + ego[0] - least
                return None if inner < 0 else compared(math.sqrt(inner), abs(number))

            return Atom(f"(math.sqrt(spot.position.x + ego.position.x - {least}) {sign} {abs(number)})", root)
        case "distance":
            end = draw.choice([22.2, 31.1, 52.3])
            return Atom(f"((distance to spot) {sign} {end})", lambda spot, ego: compared(math.dist(spot, ego), end))
        case _:
            end = draw.choice([3.1, 7.1, 11.1])
            return Atom(f"(ego.position.x {sign} {end})", lambda _, ego: compared(ego[0], end))


@dataclass(frozen=True)
class Condition:
    """Atoms put together: what has no value holds no more than its negation."""

    text: str
    value: Callable[[Spot, Spot], bool | None]


def random_condition(draw: random.Random) -> Condition:
    """Draw a condition of one or two atoms."""
    one, other = random_atom(draw), random_atom(draw)
    match draw.choice(["", "", "not", "and", "or"]):
        case "":
            return Condition(one.text, one.value)
        case "not":

            def negated(spot: Spot, ego: Spot) -> bool | None:
                found = one.value(spot, ego)
                return None if found is None else not found

            return Condition(f"(not {one.text})", negated)
        case word:
            decisive = word == "or"

            def both(spot: Spot, ego: Spot) -> bool | None:
                found = one.value(spot, ego), other.value(spot, ego)
                if decisive in found:
                    return decisive
                return None if None in found else not decisive

            return Condition(f"({one.text} {word} {other.text})", both)


@dataclass(frozen=True)
class Program:
    """A program with a hidden point: when it ends, and what must hold until then."""

    spot: str
    places: list[Spot]
    ends: list[Condition]
    requirement: tuple[str, Condition]

    def text(self) -> str:
        lines = [
            "model scenic.domains.driving.model",
            "import math",
            "ego = new Object at (Range(-999, 999), Range(-999, 999)), facing 0, with regionContainedIn None",
            self.spot,
            "require ego.position.x < 1 and (distance to spot) < 99",
            *(f"terminate when {each.text}" for each in self.ends),
            f"require {self.requirement[0]} {self.requirement[1].text}",
        ]
        return "\n".join(lines) + "\n"

    def end_for(self, spot: Spot, trace: list[Spot]) -> int | None:
        """The last sample of the run that a value of the point makes, if it matches."""
        end = next((k for k, ego in enumerate(trace) if any(each.value(spot, ego) for each in self.ends)), None)
        if end is None:
            return None
        word, condition = self.requirement
        held = [bool(condition.value(spot, ego)) for ego in trace[: end + 1]]
        return end if (all(held) if word == "always" else any(held)) else None


def random_program(draw: random.Random) -> Program:
    xs = [CENTER[0] + n + 0.37 for n in range(-29, 30)]
    ys = [CENTER[1] + n for n in range(-15, 16, 10)]
    spot = "spot = new Point in RectangularRegion(({}, {}), 0, 60, 30), with regionContainedIn None".format(*CENTER)
    if draw.random() < 0.3:
        xs = draw.sample(xs, 4)
        spot = f"spot = new Point at (Uniform({', '.join(map(str, xs))}), Range(35, 65)), with regionContainedIn None"
    ends = [random_condition(draw), Condition("(ego.position.x > 11.1)", lambda _, ego: ego[0] > 11.1)]
    draw.shuffle(ends)
    requirement = draw.choice(["always", "eventually"]), random_condition(draw)
    return Program(spot, list(itertools.product(xs, ys)), ends, requirement)


@pytest.fixture(scope="module")
def trace() -> list[Spot]:
    return [(4.0 * n, 50.0) for n in range(SAMPLES)]


@pytest.fixture(scope="module")
def dataset(tmp_path_factory, trace):
    """The ego goes along the x axis."""
    folder = tmp_path_factory.mktemp("hidden") / "d"
    seen = recording_of("r", [Sample(0.5 * n, {"ego": place}) for n, place in enumerate(trace)])
    labels = tuple(replace(each, map="street") for each in seen.labels)
    write_dataset(folder, [Recording("r", "street", labels)], {"street": STREET.features}, name="d")
    return open_dataset(folder)


def verdicts_of(dataset, text: str):
    """What is told of the one start: the number of a last sample, and the verdict."""
    time = IntervalOptions(intervals="all")
    options = QueryOptions(solver="portable", every=True, match=MatchOptions(timeout_s=4.0), time=time)
    results = Query(dataset, Source("p.scenic", text), options).results()
    return [(each.interval.count - 1, each.verdict) for each in results if each.interval is not None]


def check(dataset, trace, program: Program, told: Counter[str]) -> None:
    text = program.text()
    possible = {program.end_for(spot, trace) for spot in program.places} - {None}
    found = verdicts_of(dataset, text)
    if not any(isinstance(verdict, Unknown) for _, verdict in found):
        assert possible <= {last for last, verdict in found if isinstance(verdict, Match)}, text
    for last, verdict in found:
        told[type(verdict).__name__] += 1
        assert not (isinstance(verdict, NoMatch) and possible), text
        if isinstance(verdict, Match) and PLACE in verdict.witness:
            spot = verdict.witness[PLACE]
            if any(len(directions((spot[0] + ego[0], spot[1]))) > 1 for ego in trace):
                continue  # between lanes either direction does, and others for other conditions
            told["proven"] += 1
            assert program.end_for(spot, trace) == last, text


@pytest.mark.parametrize(
    ("condition", "area", "expected"),
    [
        ("(roadDirection at spot) > -4", "(12, 50), 0, 20, 20", NoMatch),
        ("(roadDirection at spot) > -4", "(22, 50), 0, 20, 20", Match),
        ("not (roadDirection at spot) > 4", "(22, 50), 0, 20, 20", Match),
        ("(roadDirection at spot) > -4 and (distance to spot) < 99", "(22, 50), 0, 20, 20", Match),
        ("(roadDirection at spot) > -4 or (distance to spot) < 99", "(22, 50), 0, 20, 20", NoMatch),
        ("math.sqrt(spot.position.x) > -1", "(22, 50), 0, 20, 20", NoMatch),
        ("math.sqrt(spot.position.x - 20) > -1", "(22, 50), 0, 20, 20", Match),
        ("math.acos(spot.position.y - 50) > -1", "(22, 50), 0, 1, 1", NoMatch),
        ("math.acos(spot.position.y - 50) > -1", "(22, 50), 0, 4, 4", Match),
    ],
)
@pytest.mark.one_in(4)
def test_a_run_goes_on_where_what_would_end_it_has_no_value(dataset, condition, area, expected):
    """Where there is a direction everywhere, all runs end at once; else the last sample is reached."""
    text = f"""model scenic.domains.driving.model
import math
ego = new Object at (Range(-999, 999), Range(-999, 999)), facing 0, with regionContainedIn None
spot = new Point in RectangularRegion({area}), with regionContainedIn None
require ego.position.x < 1 and (distance to spot) < 99
terminate when {condition}
terminate when ego.position.x > 11.1
require eventually ego.position.x > 7.1
"""
    assert {type(each) for _, each in verdicts_of(dataset, text)} == {expected}


@pytest.mark.parametrize("number", range(6))
@pytest.mark.one_in(4)
def test_no_verdict_is_wrong_for_any_place_of_a_grid(dataset, trace, number):
    check(dataset, trace, random_program(random.Random(number)), Counter())


@pytest.mark.slow
def test_most_ends_are_decided(dataset, trace):
    told: Counter[str] = Counter()
    for number in range(6, 60):
        check(dataset, trace, random_program(random.Random(number)), told)
    assert min(told[kind] for kind in ("Match", "NoMatch", "proven")) > 4
    # an end that is not proven and not excluded is told as unknown
    assert told["Unknown"] < (told["Match"] + told["NoMatch"]) / 2
