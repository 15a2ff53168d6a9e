"""The query paper's scalability experiment (section 6.2, figures 8-11), and how its algorithm fares on the same solver.

Two programs with a size, ten sampled labels of each size, in the program's order and shuffled. Measured are the matcher
as it is, the same with every group sent to the solver (`smt`), with one formula per correspondence (`monolithic`), and
the query paper's algorithm 1: all permutations, those that extend a partial correspondence known to fail skipped.

    python tests/bench/scalability.py [--quick] [--solver NAME]

prints a table and writes `scalability.json` and `scalability.svg` to bench-results/.
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
import random
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "tests" / "match"))

from scenes import compiled, drawn, label_of  # noqa: E402

from scenicq.forest.groups import Group  # noqa: E402
from scenicq.forest.scenario import Scenario  # noqa: E402
from scenicq.match.asking import ask  # noqa: E402
from scenicq.match.constraints import build_groups  # noqa: E402
from scenicq.match.ladder import Yes, condition_group  # noqa: E402
from scenicq.match.matcher import Matcher  # noqa: E402
from scenicq.match.observe import observe  # noqa: E402
from scenicq.match.options import MatchOptions  # noqa: E402
from scenicq.match.verdict import Match  # noqa: E402
from scenicq.smt.answer import Answer, Solver  # noqa: E402
from scenicq.smt.formula import Problem  # noqa: E402
from scenicq.smt.solver import open_solver  # noqa: E402
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
PATIENCE_S = 60.0
"""Seconds for all labels of one size after which larger sizes are not tried."""


class OutOfTime(Exception):
    """The query paper's algorithm took too long for one size."""


class Patient:
    """A solver that gives up on a label once it has had its time."""

    def __init__(self, solver: Solver) -> None:
        self.solver = solver
        self.name = solver.name
        self.deadline = math.inf

    def check(self, problem: Problem, *, precision: float, timeout_s: float) -> Answer:
        """Pass the question on while there is time."""
        if time.perf_counter() > self.deadline:
            raise OutOfTime
        return self.solver.check(problem, precision=precision, timeout_s=timeout_s)


def paper_algorithm(scenario: Scenario, label: Label, solver: Solver) -> bool:
    """Algorithm 1 as it is printed: permutations in order, bad prefixes skipped, each group sent to the solver."""
    options = MatchOptions()
    things = [label.ego, *label.objects]
    seen = [observe(thing) for thing in things]
    roles = [thing.index for thing in scenario.objects if thing.index != scenario.ego]
    groups: tuple[Group, ...] = build_groups(
        scenario, (*(frozenset(seen[0]) for _ in scenario.objects), frozenset()), options
    )
    bad: set[tuple[int, ...]] = set()
    for chosen in itertools.permutations(range(1, len(things)), len(roles)):
        if any(chosen[:size] in bad for size in range(1, len(chosen) + 1)):
            continue
        cast = {scenario.ego: 0, **dict(zip(roles, chosen, strict=True))}
        if any(things[cast[i]].category != scenario.objects[i].category for i in roles):
            wrong = next(n for n, i in enumerate(roles) if things[cast[i]].category != scenario.objects[i].category)
            bad.add(chosen[: wrong + 1])
            continue
        for group in groups:
            observed = {(i, name): value for i in group.objects for name, value in seen[cast[i]].items()}
            if not isinstance(ask([condition_group(group, observed)], options, solver), Yes):
                last = max((roles.index(i) for i in group.objects if i in roles), default=-1)
                bad.add(chosen[: last + 1])
                break
        else:
            return True
    return False


def labels(scenario: Scenario, size: int) -> Iterator[tuple[Label, Label]]:
    """Sampled labels in the program's order, and shuffled."""
    for seed in range(LABELS):
        shuffled = label_of(scenario, drawn(scenario, seed), random.Random(size * 1000 + seed))
        ordered = sorted(shuffled.objects, key=lambda thing: int(thing.id.rpartition("-")[2]))
        yield Label("frame", "recording", 0, "street", shuffled.ego, tuple(ordered)), shuffled


def measured(work: Callable[[Label], bool], given: list[Label], solver: Patient) -> tuple[float, bool]:
    """Mean seconds a label, and whether larger sizes take too long; what is cut off counts with the time it had."""
    started = time.perf_counter()
    solver.deadline = started + PATIENCE_S
    for done, label in enumerate(given, 1):
        try:
            assert work(label), "a sampled label must match"
        except OutOfTime:
            return (time.perf_counter() - started) / done, True
        if time.perf_counter() - started > PATIENCE_S:
            return (time.perf_counter() - started) / done, True
    return (time.perf_counter() - started) / len(given), False


def works(scenario: Scenario, solver: Solver) -> dict[str, Callable[[Label], bool]]:
    """What decides a label, by method."""
    given = {thing.name: f"object-{thing.index}" for thing in scenario.objects if thing.index != scenario.ego}
    methods = ("auto", "smt", "monolithic")
    auto, smt, monolithic = (Matcher(scenario, MatchOptions(method=method), solver) for method in methods)
    return {
        "auto, known": lambda label: isinstance(auto.match(label, given=given), Match),
        "auto, shuffled": lambda label: isinstance(auto.match(label), Match),
        "smt, shuffled": lambda label: isinstance(smt.match(label), Match),
        "monolithic, shuffled": lambda label: isinstance(monolithic.match(label), Match),
        "paper, shuffled": lambda label: paper_algorithm(scenario, label, solver),
    }


def run(name: str, sizes: tuple[int, ...], solver: Patient) -> dict[str, dict[int, float]]:
    """Seconds a label of each method at each size."""
    results: dict[str, dict[int, float]] = {}
    stopped: set[str] = set()
    for size in sizes:
        scenario = compiled(HEADER + PROGRAMS[name].format(size=size))
        pairs = list(labels(scenario, size))
        ordered, shuffled = [pair[0] for pair in pairs], [pair[1] for pair in pairs]
        for method, work in works(scenario, solver).items():
            if method in stopped:
                continue
            what = ordered if method.endswith("known") else shuffled
            if method.startswith("auto"):
                # the first label also pays for the analysis of the scenario
                work(what[0])
            seconds, late = measured(work, what, solver)
            results.setdefault(method, {})[size] = seconds
            if late:
                stopped.add(method)
        shown = "  ".join(f"{method} {found[size]:9.4f}" for method, found in results.items() if size in found)
        sys.stdout.write(f"{name:18} {size:3}  {shown}\n")
        sys.stdout.flush()
    return results


COLOURS = ("#1b6ca8", "#0f9d58", "#e37400", "#9334e6", "#c5221f")


def svg(results: dict[str, dict[str, dict[int, float]]]) -> str:
    """Curves: seconds a label over size, both logarithmic."""
    width, height, margin = 480, 320, 48
    panels: list[str] = []
    for column, (name, methods) in enumerate(results.items()):
        left = column * width

        def place(size: float, seconds: float, left: int = left) -> str:
            x = left + margin + (width - 2 * margin) * math.log(size) / math.log(SIZES[-1])
            y = height - margin - (height - 2 * margin) * (math.log10(max(seconds, 1e-4)) + 4) / 6
            return f"{x:.1f},{y:.1f}"

        panels.append(f'<text x="{left + margin}" y="24" font-size="14">{name}: seconds a label</text>')
        for power in range(-4, 3):
            x, y = place(1, 10.0**power).split(",")
            panels.append(f'<text x="{float(x) - 40}" y="{y}" font-size="10">1e{power}</text>')
        for number, (method, found) in enumerate(methods.items()):
            line = " ".join(place(size, seconds) for size, seconds in found.items())
            colour = COLOURS[number % len(COLOURS)]
            panels.append(f'<polyline points="{line}" fill="none" stroke="{colour}" stroke-width="2"/>')
            panels.append(
                f'<text x="{left + margin + 8}" y="{44 + 14 * number}" font-size="11" fill="{colour}">{method}</text>'
            )
    total = width * max(1, len(results))
    body = "\n".join(panels)
    return f'<svg xmlns="http://www.w3.org/2000/svg" width="{total}" height="{height}">\n{body}\n</svg>\n'


def main() -> None:
    """Run the experiment."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="up to 8 objects")
    parser.add_argument("--solver", default="auto")
    parser.add_argument("--only", choices=PROGRAMS, help="one of the programs")
    given = parser.parse_args()
    sizes = tuple(size for size in SIZES if not given.quick or size <= 8)
    with open_solver(given.solver) as solver:
        results = {name: run(name, sizes, Patient(solver)) for name in PROGRAMS if given.only in (None, name)}
    target = ROOT / "bench-results"
    target.mkdir(exist_ok=True)
    (target / "scalability.json").write_text(json.dumps(results, indent=1))
    (target / "scalability.svg").write_text(svg(results))


if __name__ == "__main__":
    main()
