"""What one label may take: our own work and the solver's on one clock, and what is left over is unknown."""

import itertools
import math

import pytest

from scenicq import budget
from scenicq.compiler.program import compile_scenario
from scenicq.errors import Source
from scenicq.geometry.network import Network
from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.verdict import Match, Unknown
from scenicq.smt.solver import Sat, Unsat
from scenicq.store.dataset import open_dataset
from scenicq.store.labels import Label, LabelObject


@pytest.fixture
def start(monkeypatch):
    """Starts clocks of the thread and of the wall that go on by ten seconds whenever one of them is looked at."""
    ticks = itertools.count(0, 10)

    def start() -> None:
        for clock in ("thread_time", "perf_counter"):
            monkeypatch.setattr(budget.time, clock, lambda: float(next(ticks)))

    return start


def _matcher(program: str, solver: object = None, **options: object) -> Matcher:
    scenario = compile_scenario(Source("p.scenic", f"model scenic.domains.driving.model\n{program}"), Network("m", ()))
    return Matcher(scenario, MatchOptions(**options), solver)


def _label(*places: tuple[float, float]) -> Label:
    cars = (LabelObject(f"c{i}", "Car", "car", x, y, 0.0, 2.0, 4.5) for i, (x, y) in enumerate(places))
    return Label("f", "r", 0, "m", LabelObject("ego", "Car", "car", 0.0, 0.0, 0.0, 2.0, 4.5), tuple(cars))


PROGRAM = """
ego = new Car at 0 @ 0, facing 0
first = new Car at Range(-9, 9) @ Range(-9, 9), facing 0
second = new Car at Range(-9, 9) @ Range(-9, 9), facing 0
require (distance from first to second) * (distance from ego to first) < 20
"""


def _look_often() -> None:
    for _ in range(10):
        budget.look()


def test_nothing_is_limited_without_a_block():
    budget.look()
    with budget.waiting(3.0) as left:
        assert left == 3.0


def test_time_is_up_within_the_block_alone(start):
    start()
    with budget.limited(50.0), pytest.raises(budget.Exhausted):
        _look_often()
    budget.look()


def test_an_inner_block_gives_no_more_than_an_outer_one(start):
    start()
    with budget.limited(30.0), budget.limited(math.inf), pytest.raises(budget.Exhausted):
        _look_often()


def test_what_a_solver_takes_counts(monkeypatch):
    # the block begins, the solver is asked, begins and ends; then the clock is looked at
    now = iter([0.0, 0.0, 0.0, 4.0, 4.0])
    monkeypatch.setattr(budget.time, "thread_time", lambda: 0.0)
    monkeypatch.setattr(budget.time, "perf_counter", lambda: next(now))
    with budget.limited(3.0):
        with budget.waiting(10.0) as left:
            assert left == 3.0
        with pytest.raises(budget.Exhausted):
            budget.look()


def test_a_busy_machine_takes_no_time_from_a_block(monkeypatch):
    wall = itertools.count(0, 100)
    monkeypatch.setattr(budget.time, "thread_time", lambda: 0.0)
    monkeypatch.setattr(budget.time, "perf_counter", lambda: float(next(wall)))
    with budget.limited(3.0):
        _look_often()


@pytest.mark.parametrize("method", ["auto", "smt"])
def test_a_label_that_takes_too_long_is_unknown(method, start):
    matcher = _matcher(PROGRAM, timeout_s=2.0, method=method)
    start()
    verdict = matcher.match(_label((3.0, 3.0), (4.0, 4.0)))
    assert isinstance(verdict, Unknown)
    assert verdict.reason == "timeout"


class _Slow:
    """A solver that notes how much time it is given, and takes it."""

    name = "slow"

    def __init__(self) -> None:
        self.given: list[float] = []

    def loads(self) -> bool:
        return True

    def check(self, problem: object, *, precision: float, timeout_s: float) -> Sat | Unsat:
        self.given.append(timeout_s)
        return Unsat()


def test_a_solver_gets_what_is_left(start):
    solver = _Slow()
    matcher = _matcher(PROGRAM, solver, timeout_s=4000.0, method="smt")
    start()
    matcher.match(_label((3.0, 3.0)))
    matcher.match(_label((3.0, 3.0), (4.0, 4.0)))
    assert solver.given
    assert all(0 < seconds < 4000.0 for seconds in solver.given)


def test_with_enough_time_the_same_label_matches():
    program = PROGRAM.replace("require", "param unused = 1\n# require")
    assert isinstance(_matcher(program).match(_label((3.0, 3.0), (4.0, 4.0))), Match)


@pytest.mark.parametrize(
    "line", ["require (distance from ego to intersection) < 100", "require not (ego in intersection)"]
)
def test_what_a_hidden_place_asks_of_the_map_counts(line, start, crossroads):
    dataset = open_dataset(crossroads)
    (name,) = dataset.maps
    network = Network(name, dataset.features(name))
    text = f"model scenic.domains.driving.model\nego = new Car\nmutate\n{line}"
    matcher = Matcher(compile_scenario(Source("p.scenic", text), network), MatchOptions(timeout_s=2.0))
    label = next(dataset.labels())
    assert isinstance(matcher.match(label), Match)
    start()
    verdict = matcher.match(label)
    assert isinstance(verdict, Unknown)
    assert verdict.reason == "timeout"


def test_finding_every_match_ends_too(start):
    matcher = _matcher(PROGRAM, timeout_s=2.0)
    start()
    assert list(matcher.matches(_label((3.0, 3.0), (4.0, 4.0)))) == []
