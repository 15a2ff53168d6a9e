"""What each step of matching is worth: labels decided with every step, and with one of them switched off.

Labels are drawn from small programs on the built-in street, chains and rows among them, and on the district of Boston
where its map lies beside this checkout: as drawn among distractors, and with one object pushed away. Programs of
crowds are tried on people and cars that were not drawn from them. No solver is asked, so that what a step alone decides
shows as unknown without it.

    python tests/tools/bench/steps.py [--labels N] [--step NAME]... [--program NAME]...

prints for each step the processor time of all labels with and without it, the most that one program gets slower, and
the verdicts that differ without it; writes `steps.json` to bench-results/.
"""

from __future__ import annotations

import argparse
import itertools
import json
import platform
import random
import signal
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

ROOT = Path(__file__).parents[3]
sys.path[:0] = [str(ROOT / "tests" / "units" / "match"), str(ROOT / "tests" / "oracles" / "labels")]

from programs import HEADER, PROGRAMS  # noqa: E402
from scenes import STREET, compiled, drawn, label_of  # noqa: E402

from scenicq.forest.scenario import Scenario  # noqa: E402
from scenicq.geometry.network import Network, read_geojson  # noqa: E402
from scenicq.match.decide import cascade, decomposition  # noqa: E402
from scenicq.match.fields import branch_and_prune, field_solver, trials  # noqa: E402
from scenicq.match.linear.affine_reach import Reach  # noqa: E402
from scenicq.match.matcher import Matcher  # noqa: E402
from scenicq.match.options import MatchOptions  # noqa: E402
from scenicq.match.problem.outcome import Undecided, finish  # noqa: E402
from scenicq.match.search import backtracking, first_fit, group_cache, group_plan, label_search  # noqa: E402
from scenicq.match.search.first_fit import FirstFit  # noqa: E402
from scenicq.match.tolerance import Tolerance  # noqa: E402
from scenicq.store.labels import Label, LabelObject  # noqa: E402

MAP = ROOT.parent / "shared" / "data" / "boston" / "maps" / "boston-seaport.geojson"
CHAINS = {
    "row of 12": "ego = new Car\nlast = ego\nfor i in range(12):\n    last = new Car ahead of last by Range(3, 6)",
    "row of 12, one shift": "shift = Range(-1, 1)\nego = new Car\nlast = ego\nfor i in range(12):\n"
    "    last = new Car at last offset by (shift, Range(5, 9)), facing ego.heading",
    "row of 4 on a spot": "spot = new OrientedPoint on road\nego = new Car at spot\nfor i in range(3):\n"
    "    new Car at spot offset by (Range(-1, 1), Range(6, 9) + i * 8), facing spot.heading",
    "platoon": "ego = new Car on road\nlast = ego\nfor i in range(3):\n"
    "    center = new OrientedPoint following roadDirection from (front of last) for Range(2, 8)\n"
    "    pos = new OrientedPoint right of center by Range(-0.5, 0.5),\n"
    "        facing Range(-5, 5) deg relative to roadDirection\n"
    "    last = new Car ahead of pos",
    "platoon, one shift": "shift = Range(-0.5, 0.5)\nego = new Car on road\nlast = ego\nfor i in range(3):\n"
    "    center = new OrientedPoint following roadDirection from (front of last) for Range(2, 8)\n"
    "    last = new Car right of center by shift",
    "right edge": "lane = Uniform(*Uniform(*network.roads).lanes)\nego = new Car on lane.centerline\n"
    "spot = new OrientedPoint on lane.rightEdge\nother = new Car left of spot by 0.5, facing roadDirection",
    "near a junction": "spot = new Point on road\nrequire 4 < (distance from spot to intersection) < 20\n"
    "ego = new Car at spot + (Range(-1, 1) @ Range(-1, 1))\nother = new Car ahead of ego by Range(4, 9)",
    "crowd of 24": "ego = new Car on road\nfor i in range(24):\n"
    "    new Pedestrian offset by (Range(-5, 5), Range(2, 60)), facing Range(-120, 120) deg relative to ego.heading",
}
ON_MAP = {
    "figure 6": PROGRAMS["figure 6"],
    "figure 6, curb": PROGRAMS["figure 6"].replace("network.laneRegion", "curb"),
    "lane of a spot": "ego = new Car\nspot = new OrientedPoint in visible network.laneRegion\n"
    "other = new Car on network.laneAt(spot)",
    "one lane of many": "ego = new Car on Uniform(*network.lanes)\nother = new Car ahead of ego by Range(4, 10)",
} | {name: CHAINS[name] for name in ("row of 12, one shift", "platoon")} | {
    name: PROGRAMS[name] for name in ("facing field", "badly parked", "follow", "figure 3")
}  # fmt: skip
ANYWHERE = "in everywhere, facing Range(0, 360) deg"


def _crowd(people: int, cars: int, *conditions: str) -> str:
    """A program of people p0, p1, ... and cars c0, c1, ... of which only their distances matter."""
    names = [f"p{n} = new Pedestrian" for n in range(people)] + [f"c{n} = new Car" for n in range(cars)]
    lines = [f"{each} {ANYWHERE}" for each in ("ego = new Car", *names)]
    return "\n".join([*lines, *(f"require {condition}" for condition in conditions)])


CROWDS = {
    "two pairs": _crowd(2, 2, "(distance from p0 to p1) < 30", "(distance from c0 to c1) < 1"),
    "8 apart": _crowd(8, 0, *(f"(distance from p{a} to p{b}) > 3" for a, b in itertools.combinations(range(8), 2))),
    "first and last of 6": _crowd(6, 0, "(distance from p0 to p5) < 1"),
}
"""Tried on crowds that are not drawn from them."""
LIMIT_S = 1.0
"""Processor time after which a label is given up: "late"."""
PATIENCE_S = 4.0
"""Processor time after which the other labels of a program are late without being tried."""
TOLERANCE = Tolerance(position=0.25, heading=0.0873)

Off = Callable[[ExitStack], object]


def _set(owner: Any, name: str, value: object) -> Off:
    """Another value for an attribute while a step is off."""
    return lambda stack: stack.enter_context(patch.object(owner, name, value))


def _undecided(parts: Sequence[Sequence[Any]], *_: object) -> Undecided:
    return Undecided(parts[0][0][0], "switched off")


def _at_once(decide: Callable[..., Any]) -> Callable[..., Iterator[Any]]:
    """What decides in one step as something that may take several."""

    def steps(*given: Any) -> Iterator[Any]:
        yield from ()
        return decide(*given)

    return steps


def _back_by_one(frames: Sequence[Any], failed: Any, *rest: Any) -> None:
    failed.blamed.update(frame.slot.name for frame in frames[-1:])
    _JUMP(frames, failed, *rest)


def _anew(self: Any, plan: Any, assignment: Mapping[int, int]) -> tuple[Any, Any]:
    with self.trials:
        return plan.group, finish(self._steps(plan, assignment))


_JUMP = backtracking._jump
STEPS: dict[str, Off] = {
    "backjumping": _set(backtracking, "_jump", _back_by_one),
    "interchangeable objects": _set(group_plan, "interchangeable", lambda *_: {}),
    "enough later candidates": _set(backtracking, "_followers", lambda *_: {}),
    "most constrained first": _set(backtracking, "_order", lambda slots, *_: sorted(slots, key=lambda s: s.name)),
    "answers kept": _set(group_cache.GroupCache, "of", _anew),
    "first fit": _set(FirstFit, "fill", lambda *_: iter(())),
    "forms of what is observed": _set(first_fit, "observed_form_of", lambda *_: None),
    "closed forms": _set(group_plan, "closed_form_of", lambda *_: None),
    "arc consistency": _set(label_search, "arc_consistent", lambda plan, candidates, *_: (candidates, None)),
    "subgroups": _set(group_plan, "subgroups_of", lambda *_: ()),
    "affine inversion": _set(cascade._Cascade, "_invert", lambda self, item: Reach(None, {})),
    "decomposition": _set(
        group_cache, "search_decomposed", _at_once(lambda items, tolerance, *_: cascade.decide(items, tolerance))
    ),
    "choice search": _set(group_cache, "search_choices", _at_once(lambda *_: None)),
    "areas of hidden distances": _set(decomposition, "with_areas", lambda *_, **__: None),
    "branch and prune": _set(
        branch_and_prune, "branch_and_prune", lambda items, _: Undecided(items[0][0], "switched off")
    ),
    "trial": _set(field_solver, "find_witness", lambda *_, **__: None),
    "ways back": _set(trials, "steps_back", lambda *_: []),
    "heading propagation": _set(field_solver, "search_directions", _at_once(_undecided)),
    "parts by a shared number": _set(decomposition, "_shared", lambda *_: None),
}


def examples(scenario: Scenario, count: int) -> Iterator[Label]:
    """Labels drawn from a scenario, the same for the same count: as drawn, and one object pushed away."""
    for seed in range(count):
        rng = random.Random(seed)
        label = label_of(scenario, drawn(scenario, seed, 20_000), rng, distractors=4)
        yield label
        if label.objects:
            place = rng.randrange(len(label.objects) - 4) if len(label.objects) > 4 else 0
            far = replace(label.objects[place], x=label.objects[place].x + rng.uniform(1, 6))
            yield replace(label, objects=(*label.objects[:place], far, *label.objects[place + 1 :]))


def crowds(count: int) -> Iterator[Label]:
    """Labels of people at seven corners, and of cars in a row with 5 m between their centres."""
    ego = LabelObject("ego", "Car", "car", 0.0, 0.0, 0.0, 2.0, 4.5)
    for seed in range(count):
        rng = random.Random(seed)
        corners = [(12.0 * n - 40, rng.uniform(-9, 9)) for n in range(7)]
        people = [
            (x + rng.uniform(-1, 1), y + rng.uniform(-1, 1)) for x, y in corners for _ in range(rng.randint(1, 3))
        ]
        spots = [("Pedestrian", *spot) for spot in people] + [("Car", 5.0 * n, 40.0) for n in range(24)]
        rng.shuffle(spots)
        others = (LabelObject(f"o{n}", each[0], each[0], *each[1:], 0.0, 0.7, 0.7) for n, each in enumerate(spots))
        yield Label("frame", "recording", 0, "street", ego, tuple(others))


def decided(
    scenarios: Mapping[str, tuple[Scenario, list[Label]]], off: Off | None
) -> dict[str, tuple[float, list[str]]]:
    """CPU seconds and verdicts of each program, with a step switched off."""
    found: dict[str, tuple[float, list[str]]] = {}
    with ExitStack() as stack:
        if off is not None:
            off(stack)
        for name, (scenario, labels) in scenarios.items():
            matcher = Matcher(scenario, MatchOptions(tolerance=TOLERANCE))
            _verdict(matcher, labels[0])
            started, verdicts = time.process_time(), list[str]()
            for label in labels:
                tried = time.process_time() - started < PATIENCE_S
                verdicts.append(_verdict(matcher, label) if tried else "late")
            found[name] = time.process_time() - started, verdicts
    return found


class LateError(Exception):
    """A label took all the time that it may."""


def _verdict(matcher: Matcher, label: Label) -> str:
    def late(*_: object) -> None:
        raise LateError

    signal.signal(signal.SIGVTALRM, late)
    signal.setitimer(signal.ITIMER_VIRTUAL, LIMIT_S)
    try:
        return type(matcher.match(label)).__name__
    except LateError:
        return "late"
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)


def main() -> None:
    """Measure, print and keep."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--labels", type=int, default=3, help="drawn from each program, and as many perturbed")
    parser.add_argument("--step", action="append", choices=STEPS, help="default: all")
    parser.add_argument("--program", action="append", help="default: all")
    given = parser.parse_args()
    texts = [(f"{name}", text, STREET) for name, text in (PROGRAMS | CHAINS).items()]
    if MAP.exists() and given.program is None:
        network = Network(MAP.stem, read_geojson(MAP, lambda identifier, message: None))
        texts += [(f"{name} (Boston)", text, network) for name, text in ON_MAP.items()]
    scenarios: dict[str, tuple[Scenario, list[Label]]] = {}
    for name, text, network in texts:
        if given.program is None or name in given.program:
            scenario = compiled(HEADER + text, network)
            scenarios[name] = scenario, list(examples(scenario, given.labels))
    for name, text in CROWDS.items():
        if given.program is None or name in given.program:
            scenarios[name] = compiled(HEADER + text, STREET), list(crowds(2 * given.labels))
    base = decided(scenarios, None)
    whole = sum(seconds for seconds, _ in base.values())
    labels = sum(len(verdicts) for _, verdicts in base.values())
    dearest = sorted(base, key=lambda name: -base[name][0])[:5]
    print(", ".join(f"{name}: {base[name][0]:.2f} s" for name in dearest))
    print(f"{len(base)} programs, {labels} labels, {whole:.2f} s of processor time, verdicts {_count(base)}")
    kept: dict[str, object] = {"programs": len(base), "labels": labels, "seconds": whole}
    for step in given.step or STEPS:
        without = decided(scenarios, STEPS[step])
        seconds = sum(seconds for seconds, _ in without.values())
        changes = Counter(
            f"{old} -> {new}"
            for name, (_, verdicts) in base.items()
            for old, new in zip(verdicts, without[name][1], strict=True)
            if old != new
        )
        ratios = {name: without[name][0] / max(used, 1e-3) for name, (used, _) in base.items()}
        slowest = sorted(ratios, key=lambda name: -ratios[name])[:3]
        fastest = min(ratios, key=lambda name: ratios[name])
        shown = ", ".join(f"{name} x {ratios[name]:.1f}" for name in (*slowest, fastest))
        print(f"without {step:20} {seconds:7.2f} s  {dict(changes) or 'no verdict changes'}; {shown}", flush=True)
        kept[step] = {"seconds": seconds, "changes": changes, "ratios": ratios}
    target = ROOT / "bench-results"
    target.mkdir(exist_ok=True)
    content = {"python": platform.python_version(), "steps": kept}
    (target / "steps.json").write_text(json.dumps(content, indent=1) + "\n")


def _count(found: Mapping[str, tuple[float, list[str]]]) -> dict[str, int]:
    return dict(Counter(verdict for _, verdicts in found.values() for verdict in verdicts))


if __name__ == "__main__":
    main()
