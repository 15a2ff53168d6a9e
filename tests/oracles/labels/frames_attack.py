"""Random programs over random labels, decided by every way and compared with the definition (`frames`).

`make oracle-frames MINUTES=60 SEED=1` goes on for an hour; a difference is printed with its program.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[2] / "tools/fuzz"))
from frames import (
    Correspondence,
    Maker,
    Program,
    Scene,
    Thing,
    TooManyError,
    Truth,
    possible,
    random_scene,
    wrong_answer,
    wrong_correspondences,
)
from rounds import Round, cpu_seconds

from scenicq.errors import ScenarioError, Source
from scenicq.geometry.default_street import street
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import parse_tolerance
from scenicq.match.verdict import Match, NoMatch, Unknown
from scenicq.query.execution.results import Result
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.dataset import Dataset, open_dataset
from scenicq.store.labels import Label, LabelObject, Recording
from scenicq.store.writer import write_dataset

STREET = street()
SCENES = 40
SHOW_UNNEEDED = "SHOW_UNNEEDED" in os.environ
PROGRAMS_A_DATASET = 25
_PLAIN = MatchOptions(tolerance=parse_tolerance("position=0.25,heading=5deg,speed=0.5"), timeout_s=20.0)
_USUAL = QueryOptions(_PLAIN, solver="portable")
WAYS: Mapping[str, QueryOptions] = {
    "auto": _USUAL,
    "names alone": replace(_USUAL, proofs=False),
    "no prefilter": replace(_USUAL, prefilter=False),
    "smt": replace(_USUAL, match=replace(_PLAIN, method="smt")),
    "monolithic": replace(_USUAL, match=replace(_PLAIN, method="monolithic"), prefilter=False),
}


def dataset_of(scenes: Sequence[Scene], folder: Path) -> Dataset:
    """A dataset of labels that have nothing to do with each other."""
    recordings = [
        Recording(f"r{number:03}", STREET.name, (_label(scene, number),)) for number, scene in enumerate(scenes)
    ]
    write_dataset(folder, iter(recordings), {STREET.name: STREET.features}, name="oracle")
    return open_dataset(folder)


def _label(scene: Scene, number: int) -> Label:
    ego = LabelObject("ego", "", "", 0.0, 0.0) if scene.ego is None else _object("ego", scene.ego)
    others = tuple(_object(f"x{place}", thing) for place, thing in enumerate(scene.others))
    return Label(f"f{number:03}", f"r{number:03}", 10**12, STREET.name, ego, others)


def _object(id_: str, thing: Thing) -> LabelObject:
    heading = None if thing.heading is None else math.remainder(math.radians(thing.heading), math.tau)
    velocity = None if thing.across is None or thing.ahead is None else (thing.across, thing.ahead)
    return LabelObject(id_, thing.category, "", thing.x, thing.y, heading, 2.0, 4.0, 1.5, velocity)


ALL = "all matches"
ASKED: Mapping[str, tuple[str, ...]] = {
    "asked": (),
    "asked of two processes": ("--jobs", "2", "--no-prefilter"),
    "asked by smt": ("--method", "smt", "--jobs", "2"),
    "asked by monolithic": ("--method", "monolithic"),
}
"""Ways of the installed command, which take seconds for themselves: one of them for one program in `EACH`."""
EACH = 12


def answers(dataset: Dataset, text: str, options: QueryOptions) -> tuple[dict[str, bool | None], Counter[str]]:
    """Whether each frame matches, None for unknown; and the reasons of these."""
    found: dict[str, bool | None] = {}
    reasons: Counter[str] = Counter()
    for result in _results(dataset, text, options):
        unknown = isinstance(result.verdict, Unknown)
        reasons.update([result.verdict.reason] if isinstance(result.verdict, Unknown) else [])
        found[result.frame] = None if unknown else not isinstance(result.verdict, NoMatch)
    return found, reasons


def _results(dataset: Dataset, text: str, options: QueryOptions) -> list[Result]:
    try:
        return list(Query(dataset, Source("oracle.scenic", text), options).results())
    except ScenarioError as error:
        if error.diagnostics[0].code != "impossible-requirement":
            raise
        return []  # no label matches


def all_answers(
    dataset: Dataset, text: str, roles: Sequence[str]
) -> tuple[dict[str, set[Correspondence]], frozenset[str]]:
    """All correspondences by which each frame matches, in the order of the roles but the ego; what is left open."""
    found: dict[str, set[Correspondence]] = {}
    open_: set[str] = set()
    for result in _results(dataset, text, replace(_USUAL, all_matches=True)):
        if isinstance(result.verdict, Match):
            one = tuple(int(result.verdict.correspondence[role][1:]) for role in roles)
            assert one not in found.setdefault(result.frame, set()), (result.frame, one)
            found[result.frame].add(one)
        elif isinstance(result.verdict, Unknown):
            open_.add(result.frame)
    return found, frozenset(open_)


def asked_answers(dataset: Dataset, text: str, words: Sequence[str]) -> tuple[dict[str, bool | None], Counter[str]]:
    """What the installed command says."""
    command = Path(sys.executable).with_name("scenicq")
    options = ("--tolerance", "position=0.25,heading=5deg,speed=0.5", "--timeout", "20", "--solver", "portable")
    run = subprocess.run(
        [command, "match", "-", dataset.path, "--format", "jsonl", "--exit-zero", *options, *words],
        input=text, capture_output=True, text=True, check=False,
    )  # fmt: skip
    if run.returncode and "impossible-requirement" not in run.stderr:
        raise AssertionError(run.stderr)
    lines = [json.loads(line) for line in run.stdout.splitlines()]
    kinds = {"match": True, "unknown": None, "no_match": False}
    return {each["frame"]: kinds[each["verdict"]] for each in lines}, Counter()


def differences(
    program: Program, scenes: Sequence[Scene], dataset: Dataset, ways: Sequence[str], seed: str, counts: Counter[str]
) -> list[str]:
    """The frames of which some way says what is not so."""
    told: list[str] = []
    right: list[set[Truth]] = []
    for number, scene in enumerate(scenes):
        try:
            right.append(possible(program, scene, random.Random(f"{seed}/{number}")))
        except TooManyError:
            right.append({"either"})
    for way in ways:
        if way == ALL:
            told += _wrong_correspondences(program, scenes, dataset, right, counts)
            continue
        if way in ASKED:
            found, reasons = asked_answers(dataset, program.text, ASKED[way])
        else:
            found, reasons = answers(dataset, program.text, WAYS[way])
        counts.update({f"reason {reason}": number for reason, number in reasons.items()})
        for number, scene in enumerate(scenes):
            answer = found.get(f"f{number:03}", False)
            wrong = wrong_answer(right[number], answer)
            said = "unknown" if answer is None else "match" if answer else "no match"
            counts[f"{way}: {'left out' if wrong == '?' else said}"] += 1
            if wrong == "unneeded":
                if SHOW_UNNEEDED:
                    print(f"unneeded: {way}: f{number:03}: {reasons}: {scene}\n{program.text}", flush=True)
                counts[f"{way}: unknown, although no two fillings differ"] += 1
            elif wrong and wrong != "?":
                told.append(f"{way}: f{number:03} is told as {said}, but {wrong}\n{scene}")
    return told


def _wrong_correspondences(
    program: Program, scenes: Sequence[Scene], dataset: Dataset, right: Sequence[set[Truth]], counts: Counter[str]
) -> list[str]:
    """The frames of which not all is told by which they match, or something else."""
    told: list[str] = []
    found, left = all_answers(dataset, program.text, [role.name for role in program.roles[1:]])
    for number, scene in enumerate(scenes):
        mine = found.get(f"f{number:03}", set())
        if f"f{number:03}" in left:
            counts[f"{ALL}: unknown"] += 1
            continue
        if right[number] in ({True}, {False}):
            counts[f"{ALL}: {'match' if mine else 'no match'}"] += 1
            if wrong := wrong_correspondences(program, scene, mine):
                told.append(f"{ALL}: f{number:03} is told as {sorted(mine)}, but {wrong}\n{scene}")
    return told


def main() -> None:
    """Try programs until the time is over; exits with 1 where an answer is wrong."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--seed", default="1")
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--programs", type=int, default=10**9)
    parser.add_argument("--ways", default=",".join([*WAYS, ALL]))
    parser.add_argument("--only", help="the name of one program, as a difference is told with it")
    given = parser.parse_args()
    counts: Counter[str] = Counter()
    going = Round(given.minutes, lambda: ", ".join(f"{name} {count}" for name, count in sorted(counts.items())))
    wrong = 0
    number = int(given.only.rsplit("-", 1)[1]) if given.only else 0
    last = number + 1 if given.only else given.programs
    seed = given.only.rsplit("-", 1)[0] if given.only else given.seed
    folder = Path(tempfile.mkdtemp(prefix="oracle-"))
    scenes: list[Scene] = []
    dataset: Dataset | None = None
    try:
        while going.goes_on(number < last):
            if dataset is None or number % PROGRAMS_A_DATASET == 0:
                chance = random.Random(f"{seed}-{number // PROGRAMS_A_DATASET}")
                scenes = [random_scene(chance) for _ in range(SCENES)]
                shutil.rmtree(folder, ignore_errors=True)
                dataset = dataset_of(scenes, folder)
            name, before = f"{seed}-{number}", cpu_seconds()
            program = Maker(random.Random(name)).program()
            try:
                ways = [*given.ways.split(","), *([] if number % EACH else [[*ASKED][number // EACH % len(ASKED)]])]
                told = differences(program, scenes, dataset, ways, name, counts)
            except Exception as error:
                told = [f"{type(error).__name__}: {error}"]
            for each in told[:3]:
                print(f"--- program {name}: {each}\n{program.text}", flush=True)
            wrong += bool(told)
            counts["programs"] += 1
            going.took(cpu_seconds() - before)
            number += 1
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
