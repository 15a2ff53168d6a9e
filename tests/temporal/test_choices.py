"""Choices over time against their definition, by every method.

    python tests/temporal/test_choices.py [--seed 1] [--minutes 60]

draws programs for so long and says what differs; every seed draws other ones.
"""

from __future__ import annotations

import argparse
import random
import sys
import tempfile
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from choices_definition import Program, Trace, alike, bindings, expected, random_program, random_trace, recording_of

from scenicq.errors import Source
from scenicq.match.options import MatchOptions
from scenicq.match.verdict import Match, Unknown
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.dataset import open_dataset
from scenicq.store.writer import write_dataset
from scenicq.temporal.interval_options import IntervalOptions

Key = tuple[str, tuple[tuple[str, str], ...], int]
"""A recording, who plays whom, a start."""


@dataclass
class Found:
    """What a query says of starts: the ends of matches, and what else is possible, with its reasons."""

    sure: dict[Key, list[int]] = field(default_factory=dict)
    unknown: dict[Key, set[str]] = field(default_factory=dict)
    undecided: set[tuple[str, int]] = field(default_factory=set)


def found_by_query(folder: Path, program: Program, method: str) -> Found:
    """Every interval of a program."""
    options = QueryOptions(match=MatchOptions(method=method), time=IntervalOptions(intervals="all"))
    found = Found()
    for each in Query(open_dataset(folder), Source("p.scenic", program.text()), options).results():
        start, end = (int(name.rpartition("-")[2]) for name in (each.frame, each.interval.last))
        key = each.recording, tuple(sorted(each.verdict.correspondence.items())), start
        if len(each.verdict.correspondence) <= len(program.roles):
            found.undecided.add((each.recording, start))
        elif isinstance(each.verdict, Match):
            found.sure.setdefault(key, []).append(end)
        elif isinstance(each.verdict, Unknown):
            found.unknown.setdefault(key, set()).add(each.verdict.reason)
    return found


def compare(folder: Path, traces: dict[str, Trace], program: Program, method: str, seen: Counter[str]) -> None:
    """Compare every start of every binding; an assertion says what differs."""
    found = found_by_query(folder, program, method)
    apart = program.tells_apart()
    for name, trace in traces.items():
        for binding in bindings(program, trace):
            if not apart and binding["a"] > binding["b"]:
                continue
            for i in range(len(trace)):
                key = name, tuple(sorted(binding.items())), i
                right = expected(program, trace, binding, i)
                sure, unknown = found.sure.pop(key, []), found.unknown.pop(key, set())
                told = (program.text(), method, key, trace, sure, unknown, right)
                assert len(set(sure)) == len(sure), told
                if unknown - {"unobserved"} or (name, i) in found.undecided:
                    seen.update(f"undecided: {reason}" for reason in unknown or {"whole label"})
                    assert set(sure) <= right.common, told
                    continue
                as_told = set(sure) == right.sure if right.exact else set(sure) <= right.common
                wanted = bool(unknown) == right.possible if right.exact else unknown or not right.possible
                if not (as_told and (sure or wanted)) or (unknown and not sure):
                    # what hangs on the same missing speed or place comes out together
                    joint = expected(program, trace, binding, i, jointly=True)
                    told = (*told, joint)
                    assert set(sure) <= joint.common, told
                    assert sure or unknown or not joint.possible, told
                    assert not joint.exact or set(sure) == joint.sure or right.sure < joint.sure, told
                    if unknown and not sure and (joint.sure or not joint.possible):
                        seen["needless" if joint.exact else "needless as far as seen"] += 1
                        print("needless:", *told, sep="\n", flush=True)
                elif not right.exact:
                    seen["not judged"] += 1
                seen["match" if sure else "unknown" if unknown else "no"] += 1
    assert not found.sure, (program.text(), method, found.sure)
    assert not found.unknown, (program.text(), method, found.unknown)


METHODS = ("auto", "auto", "smt", "monolithic")


def run(folder: Path, seed: int, programs: int, until: float = float("inf")) -> Counter[str]:
    """Compare random programs over one random dataset; how many verdicts of each kind there were."""
    draw, seen = random.Random(seed), Counter[str]()
    traces = {f"r{number:02}": random_trace(draw) for number in range(24)}
    write_dataset(folder, [recording_of(*each) for each in traces.items()], {}, name="d")
    for number in range(programs):
        if time.monotonic() > until:
            break
        program = random_program(draw)
        if draw.random() < 0.3:
            program = alike(program)
        compare(folder, traces, program, METHODS[number % len(METHODS)], seen)
    return seen


def test_choices_over_time_are_those_of_the_definition(tmp_path: Path):
    seen = run(tmp_path / "d", 1, 6)
    assert min(seen["match"], seen["no"]) > 10
    assert seen["undecided"] < sum(seen.values()) / 100


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_many_choices_over_time_are_those_of_the_definition(tmp_path: Path):
    for seed in range(2, 12):
        run(tmp_path / f"{seed}", seed, 40)


def main() -> None:
    """Draw programs until the time is up."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seed", type=int, default=time.time_ns() % 1_000_000)
    parser.add_argument("--minutes", type=float, default=60.0)
    asked = parser.parse_args()
    until, seed, seen, differ = time.monotonic() + 60 * asked.minutes, asked.seed, Counter[str](), 0
    while time.monotonic() < until:
        with tempfile.TemporaryDirectory() as folder:
            try:
                seen += run(Path(folder) / "d", seed, 24, until)
            except AssertionError as error:
                differ += 1
                print(f"seed {seed} differs:\n{error}\n", flush=True)
        seed += 1
    print(f"seeds {asked.seed} to {seed - 1}: {dict(seen)}, {differ} datasets with a difference")
    sys.exit(bool(differ))


if __name__ == "__main__":
    main()
