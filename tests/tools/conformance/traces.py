"""Do traces that Scenic simulates match the programs that they come from, over time?

Run by `make conformance-time MAP=Town01.xodr`, or with SCENIC=a checkout for the programs that Scenic's repository
publishes, on the towns that they name or, where the checkout lacks one, on another. Scenic's Newtonian simulator runs
each program (`simulate.py`). Its trace is written as a recording, ingested and matched with `--behaviors ignore`, or as
`--behaviors` says: it must match from its first sample to its last. So must what is left of it at 2 Hz, and with noise
within the tolerance; and changed ones (an object late, stopped, aside, turned, or said to be faster, two that trade
places, the trace cut, or going back the way it came) must match if and only if Scenic, replaying the same states with
or without behaviors, whose actions do nothing, says that the program holds, and must end where it says.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from click.testing import CliRunner
from original import HERE, Original, environment
from published_scenes import SECOND, maps_of, published_programs
from recordings import BEGINS, Recorded, recordings, write
from run_conformance import SCENIC
from temporal_formulas import compare_formulas

from scenicq.importers.ingest import ingest
from scenicq_cli.main import cli

STEPS = 250
"""Steps of a simulation."""
SIMULATION_S = 60.0
"""Processor time that Scenic may take to compile and simulate one program."""
HIDDEN = re.compile(r"^# hidden:", re.MULTILINE)
"""In a program whose requirements hang on random numbers: Scenic replays one of their values, scenicq asks for any."""
OVER_TIME = re.compile(r"^(behavior|monitor|terminate|require (always|monitor))\b|\bbehavior ", re.MULTILINE)
"""In a program that says something of time; others match frames, not intervals."""
COUNTS_STEPS = re.compile(r"\bterminate after \d+ steps\b")
"""In Scenic a step is a sample; here it is a time, so that thinned traces are not compared."""


@dataclass
class Row:
    """What came of one program.

    Attributes:
        name: Of the program.
        traces: Simulated ones.
        right: Recordings of each kind on which both agree.
        compared: Recordings of each kind that were compared.
        broken: Of them, those on which the program does not hold.
        said: What is to be said of it, one line each.
    """

    name: str
    traces: int = 0
    right: Counter[str] = field(default_factory=Counter[str])
    compared: Counter[str] = field(default_factory=Counter[str])
    broken: int = 0
    said: list[str] = field(default_factory=list[str])

    def line(self) -> str:
        """The row of the table."""
        kinds = ("whole", "thinned", "jitter")
        counts = "".join(f"{f'{self.right[kind]}/{self.compared[kind]}':>9}" for kind in kinds)
        right, compared = (sum(c.values()) - sum(c[kind] for kind in kinds) for c in (self.right, self.compared))
        return f"{self.name:<58}{self.traces:>7}{counts}{f'{right}/{compared}':>9}{self.broken:>8}"


HEADING = f"{'program':<58}{'traces':>7}{'whole':>9}{'thinned':>9}{'jitter':>9}{'changed':>9}{'broken':>8}"


def intervals(text: str, dataset: Path, behaviors: str) -> dict[str, list[dict[str, Any]]]:
    """The intervals that begin with the first sample, by recording.

    Raises:
        ValueError: The program is refused.
    """
    # other starts are not looked at, which saves most of the time
    begun = f"{text}\nparam {BEGINS} = 1\n"
    words = ["match", "-", str(dataset), "--behaviors", behaviors, "--intervals", "all", "--exit-zero"]
    words += ["--quiet", "--jobs", "1", "--timeout", "20", "--format", "jsonl"]
    done = CliRunner().invoke(cli, words, input=begun)
    if done.exit_code:
        raise ValueError(done.stderr.strip() or repr(done.exception))
    found: dict[str, list[dict[str, Any]]] = {}
    for line in done.stdout.splitlines():
        record = json.loads(line)
        found.setdefault(record["recording"], []).append(record)
    return found


def says_when_it_ends(text: str, behaviors: str) -> bool:
    """Whether a program ends, by anything but a behavior where these are left out."""
    if behaviors != "ignore":
        return re.search(r"^[^#\n]*\bterminate\b", text, re.MULTILINE) is not None
    in_monitor = False
    for line in text.splitlines():
        if line[:1].strip():
            in_monitor = line.startswith("monitor ")
        if line.startswith("terminate ") or (in_monitor and line.strip().startswith("terminate")):
            return True
    return False


def expected_end(said: tuple[str, int], *, open_ended: bool) -> int | None:
    """The last sample of the interval that Scenic's replay means; None where the program does not hold."""
    kind, step = said
    return step if kind == "terminated" or (kind == "lasts" and open_ended) else None


def judge(
    row: Row, each: Recorded, said: tuple[str, int], found: list[dict[str, Any]], *, text: str, ends: bool
) -> None:
    """Compare what both say of one recording.

    Args:
        row: Takes the result.
        each: The recording.
        said: How Scenic's replay ended.
        found: The intervals from the first sample.
        text: The program.
        ends: Whether it says when it ends.
    """
    if each.kind == "thinned" and COUNTS_STEPS.search(text):
        return
    end = expected_end(said, open_ended=not ends)
    last = len(each.states) - 1
    spans = [(int(one["frames"]["last"].rpartition("/")[2]), one["verdict"], one["correspondence"]) for one in found]
    hidden = HIDDEN.search(text) is not None
    slack = 1 if each.kind == "jitter" else 0  # what is measured from the first sample is measured from a noisy one
    if end is None:
        if hidden:
            return
        same = [one for one in spans if list(one[2].values()) == sorted(one[2].values()) and (ends or one[0] == last)]
        good = not same
        row.broken += 1
    else:
        near = range(end - slack, end + slack + 1)
        if hidden and each.kind != "whole":
            near = range(last + 1)
        good = any(one[0] in near and one[1] == "match" for one in spans)
    row.compared[each.kind] += 1
    row.right[each.kind] += good
    if not good:
        row.said.append(f"{each.name}: Scenic says {said} of {last}, scenicq {[one[:2] for one in spans]}")


def compare(name: str, path: Path, original: Original, work: Path, seeds: range, behaviors: str) -> Row:
    """Simulate a program and match its traces, one of each seed."""
    row = Row(name)
    text = path.read_text(encoding="utf-8")
    for seed in seeds:
        trace = original.simulate({"file": str(path.resolve())}, seed, SIMULATION_S, STEPS)
        if "error" in trace:
            row.said.append(f"Scenic says: {trace['error'][:300]}")
            continue
        row.traces += 1
        ends = says_when_it_ends(text, behaviors)
        if ends and trace["end"] == "timeLimit":
            row.said.append("the simulation was not over in time")
        recorded = list(recordings(trace, seed))
        states = [{"states": each.states, "time_step": each.time_step} for each in recorded]
        said = original.replay(states, behaviors=behaviors != "ignore")
        folder = work / "recordings"
        write(folder, original.map, trace["objects"], recorded)
        ingest(folder, work / "dataset", force=True)
        try:
            found = intervals(text, work / "dataset", behaviors)
        except ValueError as error:
            row.said.append(f"refused: {str(error)[:300]}")
            return row
        # what a behavior has ended is cut off for the rest of a program that ends otherwise
        last = len(recorded[0].states) - 1
        if expected_end(said[0], open_ended=not ends) != last and trace["end"] != "terminatedByBehavior":
            row.said.append(f"whole: replayed, Scenic says {said[0]} of {last}")
        for each, verdict in zip(recorded, said, strict=True):
            if verdict[0].startswith("failed"):
                row.said.append(f"{each.name}: Scenic {verdict[0]}")
                continue
            judge(row, each, verdict, found.get(each.name, []), text=text, ends=ends)
    return row


def programs(arguments: argparse.Namespace) -> Iterator[tuple[str, Path, Path]]:
    """The name, the path and the map of each program."""
    if arguments.map is not None:
        for path in sorted((HERE / "programs_over_time").glob("*.scenic")):
            yield path.stem, path, arguments.map
        return
    towns = maps_of([arguments.checkout / "assets", *arguments.maps])
    for program, own in published_programs(arguments.checkout):
        if not OVER_TIME.search((arguments.checkout / program).read_text(encoding="utf-8")):
            continue
        town = next((name for name in (own, *SECOND) if name in towns), None)
        if town is None:
            raise SystemExit(f"no town for {program}: give --maps")
        name = program.removeprefix("examples/").removesuffix(".scenic")
        yield name if town == own else f"{name} ({town})", arguments.checkout / program, towns[town]


def parse_arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    which = parser.add_mutually_exclusive_group(required=True)
    which.add_argument("--map", type=Path, help="an OpenDRIVE map, for the programs of the list")
    which.add_argument("--checkout", type=Path, help="a checkout of Scenic's repository, for its programs")
    parser.add_argument("--maps", type=Path, action="append", default=[], help="more folders of OpenDRIVE maps")
    parser.add_argument("--environment", type=Path, default=Path(".conformance-venv"), help="where Scenic is installed")
    parser.add_argument("--work", type=Path, default=Path(".conformance/traces"), help="folder of maps and recordings")
    parser.add_argument("--seeds", type=int, default=2, help="traces of each program")
    parser.add_argument("--first-seed", type=int, default=0, help="the seed of the first of them")
    parser.add_argument(
        "--behaviors", choices=("ignore", "guards", "motion"), default="ignore", help="as of `scenicq match`"
    )
    parser.add_argument("--formulas", type=int, default=10_000, help="random temporal formulas to compare with rv_ltl")
    parser.add_argument("--only", default="", metavar="PATTERN", help="programs in whose name this is found")
    return parser.parse_args()


def main() -> int:
    """Simulate and match; 0 if both sides always agree."""
    arguments = parse_arguments()
    python = environment(arguments.environment, SCENIC, "verifai")
    seeds = range(arguments.first_seed, arguments.first_seed + arguments.seeds)
    different = compare_formulas(python, arguments.formulas)
    print(f"rv_ltl: {arguments.formulas} formulas and traces, {different} differ", flush=True)
    rows: list[Row] = []
    originals: dict[Path, Original] = {}
    print(HEADING)
    try:
        for name, path, chart in programs(arguments):
            if not re.search(arguments.only, name):
                continue
            if chart not in originals:
                originals[chart] = Original(python, chart, arguments.work / chart.stem, "simulate.py")
            row = compare(name, path, originals[chart], arguments.work, seeds, arguments.behaviors)
            rows.append(row)
            print(row.line(), *(f"    {line}" for line in row.said), sep="\n", flush=True)
    finally:
        for original in originals.values():
            original.close()
    right = sum((row.right for row in rows), Counter[str]())
    compared = sum((row.compared for row in rows), Counter[str]())
    print(", ".join(f"{kind} {right[kind]}/{compared[kind]}" for kind in compared))
    print(f"{sum(row.traces for row in rows)} traces of {sum(row.traces > 0 for row in rows)} programs;", end=" ")
    print(f"on {sum(row.broken for row in rows)} of {compared.total()} recordings the program does not hold")
    return 0 if not different and right == compared and not any(row.said for row in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
