"""Random programs decided in every way that there is: what one way knows, no other way contradicts.

Scenes are drawn from each program, put among distractors and pushed about, and matched with the prefilter and without
it, with and without the decision procedures before the solver, with several solvers, in two processes, and with the
same tolerance written in two ways. A label that one way cannot decide proves nothing of that way.
"""

import argparse
import math
import os
import random
import shutil
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from scenicq.compiler.program import compile_scenario
from scenicq.errors import ScenicqError, Source
from scenicq.geometry.default_street import street
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import Tolerance, parse_tolerance
from scenicq.match.verdict import NoMatch, Unknown
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.smt.solver import available
from scenicq.store.dataset import Dataset, open_dataset
from scenicq.store.labels import Label, LabelObject, Recording
from scenicq.store.writer import write_dataset

sys.path.insert(0, str(Path(__file__).parents[1] / "conformance"))
sys.path.insert(0, str(Path(__file__).parents[2] / "oracles/drawn_scenes"))
from examining import drawn_labels, shuffled
from random_programs import compose
from rounds import Round, cpu_seconds

STREET = street()
PATIENCE_S = 3.0
"""For one label."""
DRAWING_S = 1.0
"""For one scene."""
MONOLITHIC_EVERY = 4
"""How often one formula for the whole label is tried: it costs as much as all other ways together."""
PROCESSES_EVERY = 20
"""How often two processes are tried: they take as long to start as all else."""


def ways(number: int) -> Iterator[tuple[str, QueryOptions]]:
    """Every way to decide, the usual one first.

    Args:
        number: Of the program.
    """
    plain = MatchOptions(tolerance=Tolerance(position=0.3, heading=0.1), timeout_s=PATIENCE_S)
    usual = QueryOptions(plain, solver="portable")
    yield "usual", usual
    yield "no prefilter", replace(usual, prefilter=False)
    yield "smt", replace(usual, match=replace(plain, method="smt"))
    if number % MONOLITHIC_EVERY == 0:
        yield "monolithic", replace(usual, match=replace(plain, method="monolithic"))
    scoped = parse_tolerance("Object.position=0.3,Object.heading=0.1")
    yield "scoped tolerance", replace(usual, match=replace(plain, tolerance=scoped))
    for solver in SOLVERS:
        yield Path(solver).name, replace(usual, match=replace(plain, method="smt"), solver=solver)
    if number % PROCESSES_EVERY == 0:
        yield "two processes", replace(usual, jobs=2)


_Z3 = shutil.which("z3", path=os.pathsep.join((str(Path(sys.executable).parent), os.environ.get("PATH", ""))))
SOLVERS = (
    *(each.name for each in available() if each.ok and each.name != "portable"),
    *([f"{_Z3} -in"] if _Z3 else []),
)
"""Solvers besides the portable one that this machine has."""


def labels_of(text: str, chance: random.Random) -> list[Label]:
    """Scenes of a program among distractors, as they are and with something pushed, but those that no dataset may hold.

    Raises:
        ScenicqError: The program has no scene.
    """
    scenario = compile_scenario(Source("random.scenic", text), STREET)
    found: list[Label] = []
    for label in drawn_labels(scenario, 2, chance.randrange(2**32), DRAWING_S)[0]:
        for far in (0.0, chance.choice((0.4, 3.0))):
            one = shuffled(label, chance, 2)
            things = [_pushed(each, far, chance) for each in (one.ego, *one.objects)]
            if any((size or 0.0) < 0.0 for each in things for size in (each.width, each.length, each.height)):
                continue
            frame = f"frame-{len(found):02}"
            found.append(replace(one, frame=frame, recording="r", timestamp_us=len(found), ego=things[0],
                                 objects=tuple(things[1:])))  # fmt: skip
    return found


def _pushed(thing: LabelObject, far: float, chance: random.Random) -> LabelObject:
    if chance.random() < 0.5:
        far = 0.0
    x, y = thing.x + chance.uniform(-far, far), thing.y + chance.uniform(-far, far)
    heading = None if thing.heading is None else math.remainder(thing.heading + chance.uniform(-far, far) / 4, math.tau)
    return replace(thing, x=x, y=y, heading=heading)


def verdicts(dataset: Dataset, text: str, options: QueryOptions) -> dict[str, bool | None]:
    """Of each frame: whether it matches, None where that stays unknown. Frames that are excluded do not."""
    found: dict[str, bool | None] = {label.frame: False for label in dataset.labels()}
    for result in Query(dataset, Source("random.scenic", text), options).results():
        found[result.frame] = None if isinstance(result.verdict, Unknown) else not isinstance(result.verdict, NoMatch)
    return found


def contradictions(text: str, labels: list[Label], number: int, folder: Path, counts: Counter[str]) -> list[str]:
    """What two ways say of the same frame that cannot both be true, and which ways refuse a program that has scenes."""
    write_dataset(folder, iter([Recording("r", STREET.name, tuple(labels))]), {STREET.name: STREET.features}, name="t")
    dataset = open_dataset(folder)
    told: list[str] = []
    first: dict[str, bool | None] = {}
    for name, options in ways(number):
        try:
            found = verdicts(dataset, text, options)
        except ScenicqError as error:
            told.append(f"{name} refuses: {error}")
            continue
        for frame, matches in found.items():
            counts[f"{name}: {'unknown' if matches is None else 'match' if matches else 'no match'}"] += 1
            if first.get(frame) is None:
                first[frame] = matches
            elif matches is not None and matches != first[frame]:
                told.append(f"{frame}: {name} says {matches}")
    return told


def main() -> None:
    """Try programs until there were enough; exits with 1 where two ways contradict each other."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--programs", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--minutes", type=float, default=600.0)
    options = parser.parse_args()
    counts: Counter[str] = Counter()
    tried, refused, wrong, number = 0, 0, 0, 0

    def figures() -> str:
        lines = [f"{count:8,}  {name}" for name, count in sorted(counts.items())]
        told = (
            f"{tried} programs ({refused} without a scene), {wrong} with a contradiction, in {cpu_seconds():.0f} CPU s"
        )
        return "\n".join([told, *lines])

    attack = Round(options.minutes, figures)
    while attack.goes_on(tried < options.programs):
        number += 1
        text, began = compose(f"{options.seed}-{number}"), cpu_seconds()
        try:
            labels = labels_of(text, random.Random(text))
        except ScenicqError:
            labels = []
        if not labels:
            refused += 1
            continue
        with tempfile.TemporaryDirectory() as name:
            told = contradictions(text, labels, tried, Path(name) / "d", counts)
        tried += 1
        attack.took(cpu_seconds() - began)
        if told:
            wrong += 1
            print(f"--- program {options.seed}-{number}", text, *told, sep="\n", flush=True)
    sys.exit(wrong > 0)


if __name__ == "__main__":
    main()
