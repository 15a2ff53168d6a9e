"""The query paper's scalability experiment (section 6.2, figures 8-11), and how its algorithm fares on the same solver.

Two programs with a size, ten sampled labels of each size, in the program's order and shuffled. Measured are the matcher
as it is, the same with every group sent to the solver (`smt`), with one formula per correspondence (`monolithic`), and
the query paper's algorithm 1 in the variants of `algorithm1`. What is measured is processor time, this process and the
solver's together, so that the numbers hold on a busy machine.

    python tests/tools/bench/scalability.py [--solver NAME]... [--map FILE] [--patience S] [--quick] [--alone]

prints a table and whether each bar is met, and writes `scalability-<map>-<solver>.json` and `.svg` to bench-results/.
"""

from __future__ import annotations

import argparse
import json
import math
import platform
import random
import statistics
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).parents[3]
sys.path[:0] = [str(ROOT / "tests" / "units" / "match"), str(ROOT / "tests" / "oracles" / "labels")]

from algorithm1 import VARIANTS, Variant, matches  # noqa: E402
from clock import cpu_s  # noqa: E402
from curves import Series, svg  # noqa: E402
from scenes import STREET, compiled, drawn, label_of  # noqa: E402

from scenicq.errors import SolverError  # noqa: E402
from scenicq.forest.scenario import Scenario  # noqa: E402
from scenicq.geometry.network import Network, read_geojson  # noqa: E402
from scenicq.match.matcher import Matcher  # noqa: E402
from scenicq.match.options import MatchOptions, Method  # noqa: E402
from scenicq.match.verdict import Match, Unknown, Verdict  # noqa: E402
from scenicq.query.execution.lazy_solver import LazySolver  # noqa: E402
from scenicq.smt.answer import Answer, NoAnswer, Solver, SolverSession  # noqa: E402
from scenicq.smt.problem import Problem  # noqa: E402
from scenicq.smt.worker_solver import WorkerSolver  # noqa: E402
from scenicq.store.labels import Label  # noqa: E402

HEADER = "model scenic.domains.driving.model\n"
BUMPER = """
ego = new Car on road
front = ego
for number in range({size}):
    if number % 3 == 0:
        front = new Car ahead of front by Normal(3, 0.5)
    elif number % 3 == 1:
        new Car left of front by Normal(1.5, 0.25)
    else:
        new Bicycle right of front by Normal(1.5, 0.25)
"""
PARADE = """
ego = new Car on road
for number in range({size}):
    new Pedestrian offset by (Range(-5, 5), Range(3, 103)), facing Range(-120, 120) deg relative to ego.heading
"""
PROGRAMS = {"bumper to bumper": BUMPER, "parade": PARADE}
SIZES = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48)
LABELS = 10
ROUNDS = 3
"""How often the matcher itself is measured; the fastest counts."""
KNOWN, SHUFFLED = "auto, known", "auto, shuffled"


class OutOfTime(Exception):
    """A label took as long as the patience lasts."""


class Patient:
    """A solver that gives up on a label once it has had its time."""

    def __init__(self, session: Solver, patience_s: float) -> None:
        self.name = session.name
        self.patience_s = patience_s
        self.deadline = math.inf
        self.apart: SolverSession | None = None
        """What decides formulas in processes of their own, if they get them."""
        self.apart_from: dict[bool, SolverSession] = {}
        """The same, for formulas about cells and for those that hold the whole map."""
        self.alone = False
        """Whether the matcher is measured alone, without what it is compared with."""
        self._session = session
        self._ticks = 0

    def loads(self) -> bool:
        """Whether it is another one than the built-in solver."""
        return self._session.loads()

    def begin(self) -> None:
        """Start the time of a label."""
        self.deadline = cpu_s() + self.patience_s

    def tick(self) -> None:
        """End the label if it has had its time; looks at the clock now and then."""
        self._ticks += 1
        if self._ticks % 5000 == 0 and cpu_s() > self.deadline:
            raise OutOfTime

    def check(self, problem: Problem, *, precision: float, timeout_s: float) -> Answer:
        """Pass the question on while there is time."""
        if cpu_s() > self.deadline:
            raise OutOfTime
        answer = (self.apart or self._session).check(problem, precision=precision, timeout_s=timeout_s)
        if answer == NoAnswer("timeout"):
            raise OutOfTime
        return answer


@dataclass(frozen=True, slots=True)
class Decider:
    """A way to decide labels.

    Attributes:
        name: What it is called.
        decide: Whether a label matches.
        known: Whether the correspondence is given.
        rounds: How often it is measured; more than once without patience.
        apart: The solver, where each formula gets a process of its own.
    """

    name: str
    decide: Callable[[Label], bool]
    known: bool = False
    rounds: int = 1
    apart: SolverSession | None = None


@dataclass(slots=True)
class Results:
    """Seconds of processor time a label, by way and size, and the size at which a way was cut off."""

    seconds: dict[str, dict[int, float]] = field(default_factory=dict)
    cut: dict[str, int] = field(default_factory=dict)


def labels(scenario: Scenario, size: int) -> Iterator[tuple[Label, Label]]:
    """Sampled labels in the program's order, and shuffled."""
    for seed in range(LABELS):
        shuffled = label_of(scenario, drawn(scenario, seed), random.Random(size * 1000 + seed))
        ordered = sorted(shuffled.objects, key=lambda thing: int(thing.id.rpartition("-")[2]))
        yield Label("frame", "recording", 0, "street", shuffled.ego, tuple(ordered)), shuffled


def measured(way: Decider, given: list[Label], solver: Patient) -> tuple[float, bool]:
    """Mean seconds a label, and whether one was cut off; no label is begun once the patience is used up."""
    solver.apart = way.apart
    started = cpu_s()
    if way.rounds > 1:
        # reading the clock for each label would count as much as the label
        solver.deadline = math.inf
        for label in given:
            assert way.decide(label), f"a sampled label must match: {way.name}"
        return (cpu_s() - started) / len(given), False
    for done, label in enumerate(given, 1):
        solver.begin()
        try:
            assert way.decide(label), f"a sampled label must match: {way.name}"
        except OutOfTime:
            return (cpu_s() - started) / done, True
        if cpu_s() - started > solver.patience_s:
            return (cpu_s() - started) / done, False
    return (cpu_s() - started) / len(given), False


def _matched(verdict: Verdict) -> bool:
    """Whether a label matches; the matcher looks at a clock of its own, too."""
    if isinstance(verdict, Unknown) and verdict.reason == "timeout":
        raise OutOfTime
    return isinstance(verdict, Match)


def ways(scenario: Scenario, solver: Patient) -> list[Decider]:
    """All the ways to decide labels of a scenario."""
    given = {thing.name: f"object-{thing.index}" for thing in scenario.objects if thing.index != scenario.ego}

    def matcher(method: Method) -> Matcher:
        return Matcher(scenario, MatchOptions(method=method, timeout_s=solver.patience_s), solver)

    def ours(method: Method) -> Decider:
        made = matcher(method)
        return Decider(f"{method}, shuffled", lambda label: _matched(made.match(label)))

    def published(variant: Variant) -> Decider:
        options = MatchOptions(timeout_s=solver.patience_s)

        def decide(label: Label) -> bool:
            return matches(scenario, label, variant, solver, options, solver.tick)

        return Decider(variant.name, decide, apart=solver.apart_from.get(variant.whole) if variant.process else None)

    auto = matcher("auto")

    def by_auto(known: Mapping[str, str]) -> Callable[[Label], bool]:
        return lambda label: isinstance(auto.match(label, fixed_roles=known), Match)

    own = [
        Decider(KNOWN, by_auto(given), known=True, rounds=ROUNDS),
        Decider(SHUFFLED, by_auto({}), rounds=ROUNDS),
    ]
    # the built-in solver is asked no formulas
    theirs = map(published, VARIANTS if solver.loads() else ())
    return own if solver.alone else [*own, ours("smt"), ours("monolithic"), *theirs]


def _forking(name: str) -> dict[bool, SolverSession]:
    """A process for each formula, for those about cells and those with the whole map, which dReal takes as they are."""
    if name != "dreal":
        return {}
    return {
        False: WorkerSolver("forked_dreal:by_dreal", name=name),
        True: WorkerSolver("forked_dreal:by_dreal_as_it_is", name=name),
    }


def run(name: str, sizes: tuple[int, ...], solver: Patient, network: Network) -> Results:
    """Seconds a label of each way at each size."""
    results = Results()
    for size in sizes:
        scenario = compiled(HEADER + PROGRAMS[name].format(size=size), network)
        pairs = list(labels(scenario, size))
        ordered, shuffled = [pair[0] for pair in pairs], [pair[1] for pair in pairs]
        for way in ways(scenario, solver):
            if way.name in results.cut:
                continue
            what = ordered if way.known else shuffled
            if way.rounds > 1:
                # the first label also pays for the analysis of the scenario
                way.decide(what[0])
            rounds = [measured(way, what, solver) for _ in range(way.rounds)]
            seconds, late = min(rounds)
            results.seconds.setdefault(way.name, {})[size] = seconds
            if late or seconds > solver.patience_s:
                results.cut[way.name] = size
        _show(name, size, results)
    return results


def _show(name: str, size: int, results: Results) -> None:
    for way, found in results.seconds.items():
        if size in found:
            least = ">" if results.cut.get(way) == size else " "
            sys.stdout.write(f"{name:18} {size:3}  {way:34} {least}{found[size]:10.4f} s\n")
    sys.stdout.flush()


def bars(results: dict[str, Results]) -> Iterator[tuple[str, bool]]:
    """What is asked of the matcher, and whether it was met."""
    for name, found in results.items():
        known, shuffled = found.seconds[KNOWN], found.seconds[SHUFFLED]
        ratio, size = max((shuffled[size] / known[size], size) for size in known)
        yield f"{name}: shuffled at most twice known: {ratio:.2f} at worst, at {size}", ratio <= 2.0
        if 48 in shuffled:
            yield f"{name}: 48 objects under 0.25 s: {shuffled[48]:.4f} s", shuffled[48] < 0.25
            power = growth({size: seconds for size, seconds in shuffled.items() if size >= 8})
            yield f"{name}: no worse than quadratic: exponent {power:.2f} from 8 objects on", power <= 2.0
        for way, times in found.seconds.items():
            if way in (KNOWN, SHUFFLED):
                continue
            cut = found.cut.get(way, math.inf)
            size = 6 if 6 in times else max(times)
            least = "at least " if cut == size else ""
            times_faster = times[size] / shuffled[size]
            text = f"{name}: 1,000 times faster than {way} at {size} objects: {least}{times_faster:,.0f}"
            yield text, times_faster >= 1000.0


def growth(times: dict[int, float]) -> float:
    """The exponent of a power law through measurements, by least squares on logarithms."""
    xs, ys = [math.log(size) for size in times], [math.log(seconds) for seconds in times.values()]
    return statistics.linear_regression(xs, ys).slope


def experiment(
    name: str, sizes: tuple[int, ...], only: str | None, patience_s: float, network: Network, *, alone: bool
) -> None:
    """Run everything on one solver and keep it."""
    with ExitStack() as stack:
        session = stack.enter_context(LazySolver(name))
        session.loads()
        solver = Patient(session, patience_s)
        solver.alone = alone
        if not alone:
            solver.apart_from = {which: stack.enter_context(one) for which, one in _forking(solver.name).items()}
        results = {each: run(each, sizes, solver, network) for each in PROGRAMS if only in (None, each)}
    met = list(bars(results))
    for text, ok in met:
        sys.stdout.write(f"{'ok  ' if ok else 'MISS'} {solver.name}: {text}\n")
    target = ROOT / "bench-results"
    target.mkdir(exist_ok=True)
    stem = f"scalability-{network.name}-{solver.name}"
    content = {
        "solver": solver.name,
        "map": network.name,
        "python": platform.python_version(),
        "unit": "seconds of processor time a label",
        "patience_s": patience_s,
        "programs": {each: {"seconds": found.seconds, "cut off at": found.cut} for each, found in results.items()},
        "bars": [{"bar": text, "met": ok} for text, ok in met],
    }
    (target / f"{stem}.json").write_text(json.dumps(content, indent=1) + "\n")
    series = {each: [Series(way, times) for way, times in found.seconds.items()] for each, found in results.items()}
    (target / f"{stem}.svg").write_text(svg(series, "objects besides the ego", "CPU seconds a label"))


def _ignore(identifier: str, message: str) -> None:
    """Pass over a feature that cannot be read."""


def main() -> None:
    """Run the experiment on each solver that is there."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="up to 8 objects")
    parser.add_argument("--solver", action="append", help="default: portable, and dreal where it loads")
    parser.add_argument("--only", choices=PROGRAMS, help="one of the programs")
    parser.add_argument("--patience", type=float, default=60.0, help="seconds after which a label is given up")
    parser.add_argument("--alone", action="store_true", help="measure the matcher without what it is compared with")
    parser.add_argument("--map", type=Path, help="GeoJSON of a road network; default: a made-up street")
    given = parser.parse_args()
    network = STREET if given.map is None else Network(given.map.stem, read_geojson(given.map, _ignore))
    sizes = tuple(size for size in SIZES if not given.quick or size <= 8)
    for name in given.solver or ("portable", "dreal"):
        try:
            experiment(name, sizes, given.only, given.patience, network, alone=given.alone)
        except SolverError as error:
            sys.stdout.write(f"{name} is left out: {error.diagnostics[0].message}\n")


if __name__ == "__main__":
    main()
