"""What simulated traces and recorded tracks show of contracts: is what an object does within its own contract?

Run by `python tests/tools/conformance/contracts.py --map Town05.xodr [--map ...] [--environment FOLDER] [--quantiles]`.

Scenic's Newtonian simulator runs programs of which it is known from when on an object is in which action or library
behavior. Their traces are ingested, and at each settled sample it is asked whether the contract is shown: at the sample
itself, and at any sample of the window (`scenicq/compiler/contracts.py`). Beside these shares stand quantiles of
each number that a contract compares, where it is known. In datasets that are given, each track of a vehicle that
drives is asked whether it keeps its lane, for its own median speed, and how often it would pass for others.
"""

from __future__ import annotations

import argparse
import re
import shutil
import sys
from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from original import Original, environment
from recordings import THINNED, Recorded, write
from run_conformance import SCENIC

from scenicq.compiler.contracts import ACTIONS, Contract, action_contract, behavior_contract
from scenicq.compiler.environment import Environment
from scenicq.compiler.imports import Modules
from scenicq.compiler.interpreter import Interpreter
from scenicq.compiler.temporal import TimedStatements
from scenicq.errors import Source, Span
from scenicq.forest import build
from scenicq.forest.nodes import Compare, Constant, Logic, LogicOp, Node
from scenicq.forest.show import show
from scenicq.forest.walk import postorder
from scenicq.geometry.network import Network
from scenicq.importers.ingest import ingest
from scenicq.store.dataset import open_dataset
from scenicq.store.tracks import RecordingTracks, TrackReader
from scenicq.syntax.parser import parse
from scenicq.temporal.atoms import AtomColumns
from scenicq.temporal.samples import Samples
from scenicq.temporal.truth import FALSE, TRUE, UNKNOWN

MODEL = "model scenic.domains.driving.model\n"
REACTION_S = 1.0
STEPS = 250
SIMULATION_S = 60.0
QUANTILES = (0.01, 0.05, 0.5, 0.95, 0.99)

STRAIGHT = """
lanes = [each for each in network.lanes if each.maneuvers]
start = lanes[{seed} * 7 % len(lanes)]
way = start.maneuvers[{seed} % len(start.maneuvers)]
"""
BESIDE = """
sections = [s for l in network.lanes for s in l.sections if s._laneToLeft is not None]
sections = [s for s in sections if s._laneToLeft.isForward == s.isForward and s.centerline.length > 80]
start = sections[{seed} * 7 % len(sections)]
aim = start._laneToLeft
"""


@dataclass(frozen=True, slots=True)
class Case:
    """A program in which an object is in one action or behavior from a time on.

    Attributes:
        contract: The name of the action or behavior.
        arguments: Those of it, as an expression of the program: a list, or a dictionary of those by name.
        known: Lines that both sides run; `{seed}` and `{speed}` are put in.
        objects: Lines that only Scenic runs: the objects and their behaviors.
        agent: The number of the object in question.
        after_s: From when on; up to the end.
        phase: Which phase of the behavior.
    """

    contract: str
    arguments: str
    known: str
    objects: str
    agent: int = 0
    after_s: float = 0.0
    phase: int = 0


CASES: Mapping[str, Case] = {
    "follows from rest": Case(
        "FollowLaneBehavior", "[{speed}]", "", "ego = new Car with behavior FollowLaneBehavior({speed})"
    ),
    "follows, fast": Case(
        "FollowLaneBehavior", "[{speed}]", "",
        "ego = new Car with speed {speed} + 2.5, with behavior FollowLaneBehavior({speed})",
    ),
    "follows a given lane": Case(
        "FollowLaneBehavior", "[{speed}, start]", STRAIGHT,
        "ego = new Car on start.centerline, with behavior FollowLaneBehavior({speed}, laneToFollow=start)",
    ),
    "goes through lanes": Case(
        "FollowTrajectoryBehavior", "[{speed}, [start, way.connectingLane, way.endLane]]", STRAIGHT,
        "behavior Goes():\n"
        "    do FollowTrajectoryBehavior({speed}, [start, way.connectingLane, way.endLane])\n"
        "    terminate\n"
        "ego = new Car on start.centerline, with behavior Goes()",
    ),
    "turns": Case(
        "TurnBehavior", "[[start, way.connectingLane, way.endLane]]", STRAIGHT,
        "behavior Turns():\n"
        "    do TurnBehavior([start, way.connectingLane, way.endLane])\n"
        "    terminate\n"
        "ego = new Car on way.connectingLane.centerline, with behavior Turns()",
    ),
    "changes lanes": Case(
        "LaneChangeBehavior", "[aim, False, {speed}]", BESIDE,
        "behavior Changes():\n"
        "    do FollowLaneBehavior({speed}) for 3 seconds\n"
        "    do LaneChangeBehavior(aim, False, {speed})\n"
        "    terminate\n"
        "ego = new Car on start.centerline, with behavior Changes()",
        after_s=3.0,
    ),
    "avoids collisions": Case(
        "DriveAvoidingCollisions", "[{speed}, 14]", "",
        "ego = new Car with behavior DriveAvoidingCollisions({speed}, 14)\n"
        "other = new Car following roadDirection for 50, with behavior FollowLaneBehavior(3)",
    ),
    "brakes": Case(
        "SetBrakeAction", "[1]", "",
        "behavior Brakes():\n"
        "    do FollowLaneBehavior({speed}) for 5 seconds\n"
        "    while True:\n"
        "        take SetBrakeAction(1)\n"
        "ego = new Car with behavior Brakes()",
        after_s=5.0,
    ),
    "brakes a little": Case(
        "SetBrakeAction", "[0.3]", "",
        "behavior Brakes():\n"
        "    do FollowLaneBehavior({speed}) for 5 seconds\n"
        "    while True:\n"
        "        take SetThrottleAction(0), SetBrakeAction(0.3)\n"
        "ego = new Car with behavior Brakes()",
        after_s=5.0,
    ),
    "sets its speed": Case(
        "SetSpeedAction", "[{speed}]", "",
        "behavior Sets():\n    while True:\n        take SetSpeedAction({speed})\nego = new Car with behavior Sets()",
    ),
    "sets its velocity": Case(
        "SetVelocityAction", "[-3, 4]", "",
        "behavior Sets():\n    while True:\n        take SetVelocityAction(-3, 4)\n"
        "ego = new Car facing Vector(0, 0).angleTo(Vector(-3, 4)), with behavior Sets()",
    ),
    "is offset": Case(
        "OffsetAction", "[(0, 0.5)]", "",
        "behavior Sets():\n    while True:\n        take OffsetAction(Vector(0, 0.5))\n"
        "ego = new Car with behavior Sets()",
    ),
    "reverses": Case(
        "SetReverseAction", "[True]", "",
        "behavior Backs():\n    while True:\n        take SetReverseAction(True), SetThrottleAction(0.3)\n"
        "ego = new Car with behavior Backs()",
    ),
    "walks": Case(
        "WalkForwardBehavior", "[1.5]", "",
        "ego = new Car\nwalker = new Pedestrian on road, facing 40 deg, with regionContainedIn None, "
        "with behavior WalkForwardBehavior(1.5)",
        agent=1,
    ),
    "is told to walk": Case(
        "SetWalkingSpeedAction", "[1.5]", "",
        "behavior Walks():\n    take SetWalkingDirectionAction(1), SetWalkingSpeedAction(1.5)\n"
        "ego = new Car\nwalker = new Pedestrian on road, with regionContainedIn None, with behavior Walks()",
        agent=1,
    ),
    "is told where to walk": Case(
        "SetWalkingDirectionAction", "[1]", "",
        "behavior Walks():\n    take SetWalkingDirectionAction(1), SetWalkingSpeedAction(1.5)\n"
        "ego = new Car\nwalker = new Pedestrian on road, with regionContainedIn None, with behavior Walks()",
        agent=1,
    ),
    "crosses": Case(
        "CrossingBehavior", "{{'reference_actor': ego, 'min_speed': 1.5, 'threshold': 200}}", "",
        "ego = new Car with behavior FollowLaneBehavior(5)\n"
        "walker = new Pedestrian offset by (8, 40), facing 90 deg relative to ego, with regionContainedIn None, "
        "with behavior CrossingBehavior(ego, 1.5, 200)",
        agent=1, phase=1,
    ),
}  # fmt: skip
SPEEDS = (10, 5, 13, 8)


@dataclass
class Measured:
    """What traces show of one contract.

    Attributes:
        settled, shown, in_window: Settled samples; those that show it; those of whose window one does.
        unknown: Settled samples at which it is not known.
        whole, traces: Traces no window of which is without it, and all with a settled sample.
        misses: What the others lack.
        numbers: The numbers that each comparison compares, less its bound where that is a number.
    """

    settled: int = 0
    shown: int = 0
    in_window: int = 0
    unknown: int = 0
    whole: int = 0
    traces: int = 0
    misses: list[str] = field(default_factory=list[str])
    numbers: dict[str, list[NDArray[np.float64]]] = field(
        default_factory=lambda: defaultdict[str, "list[NDArray[np.float64]]"](list)
    )

    def add(self, times: NDArray[np.float64], truth: NDArray[np.int8], from_s: float, window_s: float) -> bool:
        """Add one trace, whose contract is settled from some second on; whether it is broken."""
        known = in_windows(times, truth, window_s)
        mine = times >= from_s + window_s - 1e-6
        if not mine.any():
            return False
        self.traces += 1
        self.settled += int(mine.sum())
        self.shown += int((truth[mine] == TRUE).sum())
        self.in_window += int((known[mine] == TRUE).sum())
        self.unknown += int((known[mine] == UNKNOWN).sum())
        broken = bool((known[mine] == FALSE).any())
        self.whole += not broken
        return broken

    def line(self) -> str:
        """The row of the table."""
        if not self.settled:
            return "nothing is settled"
        shares = (100 * each / self.settled for each in (self.shown, self.in_window, self.unknown))
        return "".join(f"{each:9.2f}" for each in shares) + f"{self.settled:9}{self.whole:6}/{self.traces}"


def in_windows(times: NDArray[np.float64], truth: NDArray[np.int8], window_s: float) -> NDArray[np.int8]:
    """The best truth value among the samples of the last seconds, for each sample."""
    first = np.searchsorted(times, times - window_s - 1e-6)
    return np.array([truth[start : n + 1].max() for n, start in enumerate(first)], dtype=truth.dtype)


def interpreter_of(text: str, network: Network) -> tuple[Interpreter, Mapping[str, Any], Span]:
    """A program as it is run on this side, with its names."""
    source = Source("contract.scenic", text)
    module = parse(source, 3)
    world = Modules(network, 3, False, None, map_defaults=True)
    run = world.interpreter
    run.timed, run.gap_s = TimedStatements("ignore"), 1.5
    scope = Environment({}, Environment({}, world.base, library=True), user=True)
    run.run(module.body, scope)
    return run, scope.names, Span(source, 0, 1)


def contract_of(case: Case, names: Mapping[str, int], network: Network, objects: str) -> Contract:
    """The contract of a case, made by this side's reading of the same lines."""
    text = f"{MODEL}{case.known}\n{objects}\nwanted = {case.arguments}\n".format(**names)
    run, scope, span = interpreter_of(text, network)
    wanted = scope["wanted"]
    positional, keywords = ([], wanted) if isinstance(wanted, dict) else (wanted, {})
    make = action_contract if case.contract in ACTIONS else behavior_contract
    made = make(run, case.contract, run.objects[case.agent], positional, keywords, span)
    assert made is not None
    return made[case.phase] if isinstance(made, tuple) else made


def truths(columns: AtomColumns, contract: Contract, entry: int, agent: int = 0) -> NDArray[np.int8]:
    """Whether a contract is shown at each sample, for a mode that is entered at one."""
    shown = np.full(len(columns.samples), TRUE) if contract.shows is None else columns.truth_of(contract.shows)
    if contract.shows_from is None:
        return shown
    x, y = (float(each[entry]) for each in columns.samples.observed(agent, "position") or ())
    kept = contract.shows_from(build.constant((x, y)))
    return np.minimum(shown, columns.truth_of(kept))


def missed(
    columns: AtomColumns, contract: Contract, entry: int, truth: NDArray[np.int8], times: NDArray[np.float64],
    settled: float,
) -> str:  # fmt: skip
    """When a contract is not shown, and which of what it asks for."""
    false = (truth == FALSE) & (times >= settled)
    parts: list[str] = []
    asked = [] if contract.shows is None else [contract.shows]
    while asked:
        each = asked.pop()
        if isinstance(each, Logic) and each.op is LogicOp.AND:
            asked += each.args
            continue
        away = int(((columns.truth_of(each) == FALSE) & false).sum())
        if away:
            parts.append(f"{away} x {show(each)[:90]}")
    if contract.shows_from is not None:
        parts.append(f"lanes {int(((truths(columns, replace(contract, shows=None), entry) == FALSE) & false).sum())} x")
    where = times[false]
    return f"{false.sum()} of {len(times)}, {where.min():.1f} to {where.max():.1f} s; " + "; ".join(parts)


def compared(columns: AtomColumns, condition: Node | None) -> Iterator[tuple[str, NDArray[np.float64]]]:
    """The numbers on the left of the comparisons of a condition, with how these are written."""
    for node in postorder((condition,)) if condition is not None else ():
        if isinstance(node, Compare) and isinstance(node.right, Constant):
            found = columns.number(node.left)
            if found is not None:
                yield show(node.left), found


def recordings_of(dataset: Path) -> Iterator[RecordingTracks]:
    """All recordings of a dataset."""
    opened = open_dataset(dataset)
    for part in range(len(opened.files("labels"))):
        with TrackReader(opened, part) as reader:
            count = sum(1 for _ in part_rows(opened, part))
            names = reader.names(range(count))
            starts = [n for n in range(count) if n == 0 or names[n] != names[n - 1]]
            for first, end in zip(starts, [*starts[1:], count], strict=True):
                yield reader.read(first, end)


def part_rows(opened: Any, part: int) -> range:
    """The rows of a part's labels."""
    import pyarrow.parquet as parquet

    return range(parquet.read_metadata(opened.files("labels")[part]).num_rows)


def track(number: int) -> tuple[str, str]:
    """The track of an object of a simulated trace."""
    return ("ego", "") if number == 0 else ("track", f"object-{number}")


def simulate(case: Case, original: Original, network: Network, work: Path, seeds: int) -> dict[str, Measured]:
    """Traces of a case, measured as they are and at 2 Hz."""
    found = {"10 Hz": Measured(), "2 Hz": Measured()}
    traces: dict[str, Contract] = {}
    recorded: list[Recorded] = []
    things: list[dict[str, Any]] = []
    for seed in range(seeds):
        names = {"seed": seed, "speed": SPEEDS[seed % len(SPEEDS)]}
        text = f"{MODEL}{case.known}\n{case.objects}\n".format(**names)
        trace = original.simulate({"text": text}, seed, SIMULATION_S, STEPS)
        if "error" in trace:
            print(f"    Scenic says: {trace['error'][:200]}", file=sys.stderr)
            continue
        things, states, step = trace["objects"], trace["states"], trace["time_step"]
        recorded.append(Recorded(f"whole-{seed}", states, step))
        recorded.append(Recorded(f"thinned-{seed}", states[::THINNED], step * THINNED))
        kind = "Car" if case.contract == "DriveAvoidingCollisions" else "Object"
        objects = "\n".join(f"{'ego = ' if n == 0 else ''}new {kind}" for n in range(len(things)))
        traces[str(seed)] = contract_of(case, names, network, objects)
    if not recorded:
        return found
    write(work / "recordings", original.map, things, recorded)
    ingest(work / "recordings", work / "dataset", force=True)
    for each in recordings_of(work / "dataset"):
        kind, _, seed = each.name.partition("-")
        binding = {n: track(n) for n in range(len(things))}
        columns = AtomColumns(None, Samples(each, binding, 0, len(each)))  # type: ignore[arg-type]
        into = found["10 Hz" if kind == "whole" else "2 Hz"]
        measure(into, columns, traces[seed], each.seconds, case.after_s, f"{kind}, seed {seed}")
    return found


def measure(
    into: Measured, columns: AtomColumns, contract: Contract, times: NDArray[np.float64], after_s: float, name: str
) -> None:
    """Add one trace."""
    entry = int(np.searchsorted(times, after_s - 1e-6))
    if entry >= len(times):
        return
    truth = truths(columns, contract, entry)
    settled = after_s + REACTION_S
    if into.add(times, truth, settled, contract.settles_s):
        into.misses.append(f"{name}: {missed(columns, contract, entry, truth, times, settled)}")
    mine = times >= settled
    for name, numbers in compared(columns, contract.shows):
        into.numbers[name].append(numbers[mine])


DRIVES = {"Car", "Truck", "Bus", "Van", "Vehicle", "Motorcycle"}
LONG_S = 4.0
"""How long a track must be to be looked at."""


def driven(dataset: Path) -> dict[str, Measured]:
    """What the tracks of vehicles in a dataset show.

    A track that drives is asked whether it keeps its lane at its own median speed; one that comes to a stop, whether it
    brakes from its last peak on; each that drives, how it would pass for another speed, and for one that brakes.
    """
    opened = open_dataset(dataset)
    found: dict[str, Measured] = defaultdict(Measured)
    charts: dict[str, str] = {}
    vehicles: dict[str, dict[tuple[str, str], None]] = defaultdict(lambda: {("ego", ""): None})
    for label in opened.labels():
        charts[label.recording] = label.map
        vehicles[label.recording] |= {
            ("track", each.track): None for each in label.objects if each.track and each.category in DRIVES
        }
    for recording in recordings_of(dataset):
        network = opened.network(charts[recording.name])
        run, _, span = interpreter_of(f"{MODEL}ego = new Car\n", network)
        ego = run.objects[0]
        for key in vehicles[recording.name]:
            x = recording.column(key, "x")
            seen = np.flatnonzero(~np.isnan(x))
            times = recording.seconds[seen[0] : seen[-1] + 1]
            if times[-1] - times[0] < LONG_S:
                continue
            columns = AtomColumns(None, Samples(recording, {0: key}, int(seen[0]), int(seen[-1]) + 1))  # type: ignore[arg-type]
            (speed,) = columns.samples.observed(0, "speed") or ()
            (acceleration,) = columns.samples.observed(0, "acceleration") or ()
            middle = float(np.nanmedian(speed)) if np.isfinite(speed).any() else 0.0
            if middle < 0.2:
                found["rests"].numbers["acceleration at rest"].append(acceleration)
                found["rests"].numbers["speed at rest"].append(speed)
            if middle < 3.0:
                continue
            for name, target in (("keeps its lane and speed", middle), ("would pass for half as fast", middle / 2),
                                 ("would pass for twice as fast", middle * 2)):  # fmt: skip
                made = behavior_contract(run, "FollowLaneBehavior", ego, (target,), {}, span)
                assert made is not None
                measure(found[name], columns, made[0], times, 0.0, str(key))
            assert made is not None
            assert made[0].shows_from is not None
            place = build.constant((float(x[seen[0]]), float(recording.column(key, "y")[seen[0]])))
            kept = made[0].shows_from(place)
            for _, numbers in compared(columns, kept):
                found["keeps its lane and speed"].numbers["metres beside its course"].append(numbers)
            brakes = action_contract(run, "SetBrakeAction", ego, (1,), {}, span)
            assert brakes is not None
            measure(found["would pass for braking"], columns, brakes, times, 0.0, str(key))
            rest = np.flatnonzero(speed < 0.5)
            if len(rest) and rest[0] > 10 and np.nanmax(speed[: rest[0]]) > 4.0:
                peak = float(times[int(np.nanargmax(speed[: rest[0]]))])
                last = int(rest[0]) + 1
                stop = Samples(recording, {0: key}, int(seen[0]), int(seen[0]) + last)
                measure(found["comes to a stop"], AtomColumns(None, stop), brakes, times[:last], peak, str(key))  # type: ignore[arg-type]
    return found


def print_quantiles(measured: Measured) -> None:
    """The quantiles of what is compared."""
    for name, parts in measured.numbers.items():
        numbers = np.concatenate(parts)
        numbers = numbers[np.isfinite(numbers)]
        if len(numbers):
            shown = "".join(f"{each:9.2f}" for each in np.quantile(numbers, QUANTILES))
            print(f"        {name[:60]:<60}{shown}")


HEADING = f"{'':<40}{'shown':>9}{'window':>9}{'unknown':>9}{'samples':>9}  whole"


def parse_arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--map", type=Path, action="append", default=[], help="an OpenDRIVE map")
    parser.add_argument("--data", type=Path, action="append", default=[], help="a dataset whose tracks are looked at")
    parser.add_argument("--environment", type=Path, default=Path(".conformance-venv"), help="where Scenic is installed")
    parser.add_argument("--work", type=Path, default=Path(".conformance/contracts"), help="folder of maps and traces")
    parser.add_argument("--seeds", type=int, default=5, help="traces of each case on each map")
    parser.add_argument("--only", default="", metavar="PATTERN", help="cases in whose name this is found")
    parser.add_argument("--quantiles", action="store_true", help="print what is compared, too")
    return parser.parse_args()


def main() -> int:
    """Measure; 0 if every case has at least 99 % of its settled samples within its contract."""
    arguments = parse_arguments()
    python = environment(arguments.environment, SCENIC, "verifai")
    print(HEADING)
    good = True
    for chart in arguments.map:
        original = Original(python, chart, arguments.work / chart.stem, "simulate.py")
        try:
            network: Network | None = None
            for name, case in CASES.items():
                if not re.search(arguments.only, name):
                    continue
                network = network or network_of(original, arguments.work)
                found = simulate(case, original, network, arguments.work / chart.stem, arguments.seeds)
                for rate, each in found.items():
                    print(f"{chart.stem + ': ' + name:<34}{rate:<6}{each.line()}", flush=True)
                    print(*(f"        {miss}" for miss in each.misses), sep="\n", end="\n" * bool(each.misses))
                    good &= not each.settled or each.in_window >= 0.99 * each.settled
                if arguments.quantiles:
                    print_quantiles(found["10 Hz"])
        finally:
            original.close()
    for dataset in arguments.data:
        for name, each in driven(dataset).items():
            print(f"{dataset.name + ': ' + name:<40}{each.line()}", flush=True)
            if arguments.quantiles:
                print_quantiles(each)
    return 0 if good else 1


def network_of(original: Original, work: Path) -> Network:
    """This side's map of a simulation, as a dataset gives it."""
    answer = original.simulate({"text": f"{MODEL}ego = new Car"}, 0, SIMULATION_S, 2)
    folder = work / "empty"
    write(folder, original.map, answer["objects"], [Recorded("whole", answer["states"], answer["time_step"])])
    ingest(folder, work / "chart", force=True)
    shutil.rmtree(folder)
    return open_dataset(work / "chart").network("town")


if __name__ == "__main__":
    sys.exit(main())
