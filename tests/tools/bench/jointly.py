"""Jointly dependent features on a real map: figure 6 of the query paper over the district of Boston.

Two cars are placed by one hidden spot, on the curb as in the paper or anywhere on a lane. Sampled labels must match,
and the same labels with one car pushed out of its reach must not, with each solver. Measured is the processor time of
a label, this process and the solver's together, as the matcher decides it and with every group sent to the solver.

    python tests/tools/bench/jointly.py [--labels N] [--solver NAME]... [--map FILE]

prints a table and writes `jointly.json` to bench-results/.
"""

from __future__ import annotations

import argparse
import json
import math
import platform
import random
import statistics
import sys
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path

ROOT = Path(__file__).parents[3]
sys.path[:0] = [str(ROOT / "tests" / "units" / "match"), str(ROOT / "tests" / "oracles" / "labels")]

from clock import cpu_s  # noqa: E402
from scenes import compiled, drawn, label_of  # noqa: E402

from scenicq.errors import SolverError  # noqa: E402
from scenicq.forest.scenario import Scenario  # noqa: E402
from scenicq.geometry.network import Network, read_geojson  # noqa: E402
from scenicq.match.matcher import Matcher  # noqa: E402
from scenicq.match.options import MatchOptions, Method  # noqa: E402
from scenicq.match.tolerance import EXACT  # noqa: E402
from scenicq.match.verdict import Match, NoMatch  # noqa: E402
from scenicq.query.execution.lazy_solver import LazySolver  # noqa: E402
from scenicq.smt.answer import Solver  # noqa: E402
from scenicq.store.labels import Label  # noqa: E402

MAP = ROOT.parent / "shared" / "data" / "boston" / "maps" / "boston-seaport.geojson"
HEADER = "model scenic.domains.driving.model\n"
FIGURE = """
spot = new OrientedPoint on {region}
ego = new Car at (spot offset by (Range(2, 4), Range(5, 10)))
sideCar = new Car left of spot by Range(1, 3)
"""
PROGRAMS = {"figure 6": FIGURE.format(region="curb"), "on a lane": FIGURE.format(region="network.laneRegion")}
METHODS: tuple[Method, ...] = ("auto", "smt")
BAR_MS = 20.0


@dataclass(frozen=True, slots=True)
class Run:
    """What came of the labels of one program, by one method, on one solver.

    Attributes:
        right: How many labels got the verdict that they must get.
        wrong: The other verdicts, with what was expected.
        times_ms: Milliseconds of processor time of each label.
    """

    right: int
    wrong: Counter[str]
    times_ms: list[float]


def pushed(label: Label, rng: random.Random) -> Label:
    """A label whose side car is out of reach of every spot that the ego's place leaves."""
    (side,) = label.objects
    # spot and side car are at most 3 m and half a width apart, spot and ego at most 10.8 m
    away, turn = rng.uniform(20.0, 60.0), rng.uniform(-math.pi, math.pi)
    return replace(
        label, objects=(replace(side, x=label.ego.x + away * math.cos(turn), y=label.ego.y + away * math.sin(turn)),)
    )


def nudged(label: Label, rng: random.Random) -> Label:
    """A label whose side car is pushed along the spot's heading: close by, but beside no spot of the ego's."""
    (side,) = label.objects
    off = rng.choice((-1.0, 1.0)) * rng.uniform(8.0, 12.0)
    return replace(
        label,
        objects=(replace(side, x=side.x - off * math.sin(side.heading), y=side.y + off * math.cos(side.heading)),),
    )


def examples(scenario: Scenario, count: int) -> list[tuple[Label, type]]:
    """Sampled labels and perturbed ones, pushed far and nearby in turn, with the verdict that each must get."""
    found: list[tuple[Label, type]] = []
    for seed in range(count):
        rng = random.Random(seed)
        label = label_of(scenario, drawn(scenario, seed, 20_000), rng)
        found.append((label, Match))
        found.append(((pushed if seed % 2 else nudged)(label, rng), NoMatch))
    return found


def decided(scenario: Scenario, labels: list[tuple[Label, type]], method: Method, solver: Solver) -> Run:
    """Decide every label."""
    matcher = Matcher(scenario, MatchOptions(tolerance=EXACT, method=method), solver)
    matcher.match(labels[0][0])
    right, wrong, times = 0, Counter[str](), list[float]()
    for label, expected in labels:
        began = cpu_s()
        verdict = matcher.match(label)
        times.append(1000 * (cpu_s() - began))
        if isinstance(verdict, expected):
            right += 1
        else:
            wrong[f"{type(verdict).__name__} instead of {expected.__name__}"] += 1
    return Run(right, wrong, times)


def main() -> None:
    """Measure, print and keep."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--labels", type=int, default=200, help="sampled, and as many perturbed")
    parser.add_argument("--solver", action="append", help="default: portable, and dreal where it loads")
    parser.add_argument("--map", type=Path, default=MAP, help="GeoJSON of a road network")
    given = parser.parse_args()
    if not given.map.exists():
        print(f"{given.map} is not there: nothing is measured")
        return
    network = Network(given.map.stem, read_geojson(given.map, lambda identifier, message: None))
    found: list[dict[str, object]] = []
    for program, text in PROGRAMS.items():
        scenario = compiled(HEADER + text, network)
        labels = examples(scenario, given.labels)
        for name in given.solver or ("portable", "dreal"):
            try:
                with LazySolver(name) as solver:
                    solver.loads()
                    for method in METHODS:
                        run = decided(scenario, labels, method, solver)
                        median, worst = statistics.median(run.times_ms), max(run.times_ms)
                        met = run.right == len(labels) and median < BAR_MS
                        print(
                            f"{'ok  ' if met else 'MISS'} {program:10} {solver.name:9} {method:5} "
                            f"{run.right} of {len(labels)} right, median {median:.2f} ms, worst {worst:.1f} ms "
                            f"{dict(run.wrong) or ''}",
                            flush=True,
                        )
                        found.append(
                            {
                                "program": program,
                                "solver": solver.name,
                                "method": method,
                                "labels": len(labels),
                                "right": run.right,
                                "wrong": run.wrong,
                                "median ms": median,
                                "worst ms": worst,
                                "met": met,
                            }
                        )
            except SolverError as error:
                print(f"{name} is left out: {error.diagnostics[0].message}")
    target = ROOT / "bench-results"
    target.mkdir(exist_ok=True)
    content = {"map": network.name, "python": platform.python_version(), "bar ms": BAR_MS, "runs": found}
    (target / "jointly.json").write_text(json.dumps(content, indent=1) + "\n")


if __name__ == "__main__":
    main()
