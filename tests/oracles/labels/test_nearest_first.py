"""The nearest first: which correspondence comes first, by plain enumeration of label objects, sharing no code.

Objects stand on whole metres, so that many are equally far away; of some the width is not known, which a program reads.
"""

from __future__ import annotations

import itertools
import json
import random
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

from scenicq.compiler.program import compile_scenario
from scenicq.errors import Source
from scenicq.limits import LIMITS
from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.search.first_fit import FirstFit
from scenicq.match.verdict import Match
from scenicq.store.labels import Label, LabelObject, Recording
from scenicq.store.writer import write_dataset

sys.path.insert(0, str(Path(__file__).parents[2] / "units/match"))
from scenes import STREET

COMMAND = Path(sys.executable).with_name("scenicq")
KINDS = ("Car", "Pedestrian", "Bicycle")
Roles = dict[str, LabelObject]


@dataclass(frozen=True)
class Asked:
    """A condition: its text, the roles that it names, and what it says of those who play them."""

    text: str
    roles: tuple[str, ...]
    holds: Callable[[Roles], bool]


def _distance(one: LabelObject, other: LabelObject) -> float:
    return ((one.x - other.x) ** 2 + (one.y - other.y) ** 2) ** 0.5


def drawn_condition(draw: random.Random, names: list[str]) -> Asked:
    """A condition on one or two roles."""
    one, other = draw.choice(names), draw.choice(names)
    limit = draw.randint(2, 12) + 0.5
    match draw.choice(["near", "apart", "side", "wide"]):
        case "near":
            return Asked(f"(distance to {one}) < {limit}", (one,), lambda r: _distance(r["ego"], r[one]) < limit)
        case "apart" if one != other:
            text = f"(distance from {one} to {other}) > {limit}"
            return Asked(text, (one, other), lambda r: _distance(r[one], r[other]) > limit)
        case "wide":
            return Asked(f"{one}.width > 1.5 or {one}.position.x > 0", (one,), lambda r: _wide(r[one]))
        case _:
            return Asked(f"{one}.position.x < {limit}", (one,), lambda r: r[one].x < limit)


def _wide(each: LabelObject) -> bool:
    # what is not observed has the program's own width, which is 2 m
    return (2.0 if each.width is None else each.width) > 1.5 or each.x > 0


@dataclass(frozen=True)
class Program:
    """Roles by name with their classes, and conditions."""

    roles: dict[str, str]
    asked: list[Asked]

    @property
    def text(self) -> str:
        """The program."""
        made = [f"{name} = new {kind} at (Range(-99, 99), Range(-99, 99)), facing 0, with width 2\n"
                for name, kind in {"ego": "Object", **self.roles}.items()]  # fmt: skip
        return (
            "model scenic.domains.driving.model\n"
            + "".join(made)
            + "".join(f"require {each.text}\n" for each in self.asked)
        )

    def correspondences(self, label: Label) -> list[dict[str, str]]:
        """All that hold, in order."""
        rank = {each.id: ((each.x - label.ego.x) ** 2 + (each.y - label.ego.y) ** 2, each.id) for each in label.objects}
        options = [
            sorted((each for each in label.objects if each.category == kind), key=lambda each: rank[each.id])
            for kind in self.roles.values()
        ]
        found: list[dict[str, str]] = []
        for chosen in itertools.product(*options):
            roles = {"ego": label.ego, **dict(zip(self.roles, chosen, strict=True))}
            distinct = len({each.id for each in chosen}) == len(chosen)
            # the width that the program gives is compared where a label has one
            fits = all(each.width in (None, 2.0) for each in chosen)
            if distinct and fits and all(each.holds(roles) for each in self.asked):
                found.append({name: each.id for name, each in roles.items()})
        return found


def drawn_program(draw: random.Random) -> Program:
    """One to three roles, often of one class."""
    count = draw.randint(1, 3)
    kinds = [draw.choice(KINDS[: draw.randint(1, 3)]) for _ in range(count)]
    roles = {f"r{number}": kind for number, kind in enumerate(kinds)}
    return Program(roles, [drawn_condition(draw, list(roles)) for _ in range(draw.randint(0, 3))])


def drawn_label(draw: random.Random, frame: str, recording: str = "r", time_us: int = 0) -> Label:
    """An ego and up to nine objects around it."""
    ego = LabelObject("ego", "Car", "car", draw.randint(-3, 3), draw.randint(-3, 3), 0.0, 2.0, 4.0)
    objects = tuple(
        LabelObject(
            f"o{number}", draw.choice(KINDS), "x", ego.x + draw.randint(-9, 9), ego.y + draw.randint(-9, 9), 0.0,
            draw.choice([None, 2.0]), track=f"o{number}",
        )
        for number in draw.sample(range(30), draw.randint(1, 9))
    )  # fmt: skip
    return Label(frame, recording, time_us, "street", ego, objects)


def judged(program: Program, label: Label, told: list[Match]) -> None:
    """All correspondences are told, interchangeable objects in one order, and in order."""
    expected = program.correspondences(label)
    found = [dict(each.correspondence) for each in told]
    assert found[:1] == expected[:1], program.text
    places = [expected.index(each) for each in found]
    assert places == sorted(set(places)), program.text
    # each that is not told is one that is, with objects of one class exchanged
    bags = {frozenset((program.roles.get(name, ""), who) for name, who in each.items()) for each in found}
    assert bags == {frozenset((program.roles.get(n, ""), who) for n, who in each.items()) for each in expected}


WAYS = ["plain", "searched", "constrained first", "many roles", "smt", "monolithic"]


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.one_in(3)
def test_the_nearest_correspondence_comes_first(way, monkeypatch):
    if way != "plain":
        monkeypatch.setattr(FirstFit, "fill", lambda *_: iter(()))
    if way == "constrained first":
        monkeypatch.setattr(LIMITS, "ordered_steps", 3)
    if way == "many roles":
        monkeypatch.setattr(LIMITS, "ordered_slots", 0)
    options = MatchOptions(method=way) if way in ("smt", "monolithic") else MatchOptions()
    draw, several = random.Random(41), 0
    for number in range(40 if way == "plain" else 15):
        program = drawn_program(draw)
        matcher = Matcher(compile_scenario(Source("p.scenic", program.text), STREET), options)
        for _ in range(4):
            label = drawn_label(draw, f"f{number}")
            told = list(matcher.matches(label))
            judged(program, label, told)
            several += len(told) > 1
            first, verdict = program.correspondences(label)[:1], matcher.match(label)
            assert [dict(verdict.correspondence)] == first if isinstance(verdict, Match) else not first
    assert several > 10


def lines(*words: object) -> str:
    """What the command says."""
    run = subprocess.run(
        [COMMAND, "match", *map(str, words), "--exit-zero"], capture_output=True, text=True, check=True
    )
    return run.stdout


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Label]]:
    """Recordings of one sample each."""
    draw, folder = random.Random(4), tmp_path_factory.mktemp("nearest") / "d"
    labels = [drawn_label(draw, f"f{number}", f"r{number:02}", number) for number in range(40)]
    write_dataset(folder, [Recording(each.recording, "street", (each,)) for each in labels], {}, name="d")
    return folder, {each.frame: each for each in labels}


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.one_in(2)
@pytest.mark.slow
def test_every_way_through_a_query_tells_the_same_first(folder, seed, tmp_path):
    dataset, labels = folder
    program = drawn_program(random.Random(100 + seed))
    file = tmp_path / "p.scenic"
    file.write_text(program.text)
    first = {frame: found[0] for frame, label in labels.items() if (found := program.correspondences(label))}
    told = lines(file, dataset)
    assert {each["frame"]: each["correspondence"] for each in map(json.loads, told.splitlines())} == first
    every = lines(file, dataset, "--all-matches")
    for way in (["--no-prefilter"], ["--jobs", "2"]):
        assert lines(file, dataset, *way) == told
        assert lines(file, dataset, "--all-matches", *way) == every
    heads = {}
    for each in map(json.loads, every.splitlines()):
        heads.setdefault(each["frame"], each["correspondence"])
    assert heads == first


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.one_in(3)
@pytest.mark.slow
def test_intervals_come_in_the_same_order(folder, seed, tmp_path):
    dataset, labels = folder
    program = drawn_program(random.Random(200 + seed))
    file = tmp_path / "p.scenic"
    file.write_text(program.text + "terminate after 0.1 seconds\n" if seed == 2 else program.text)
    words = [file, dataset, "--min-duration", "0"] if seed < 2 else [file, dataset]
    told = lines(*words)
    for way in (["--no-prefilter"], ["--jobs", "2"]):
        assert lines(*words, *way) == told
    by_frame: dict[str, list[dict[str, str]]] = {}
    for each in map(json.loads, told.splitlines()):
        by_frame.setdefault(each["frames"]["first"], []).append(each["correspondence"])
    assert by_frame or seed == 2
    for frame, found in by_frame.items():
        expected = program.correspondences(labels[frame])
        places = [expected.index(each) for each in found]
        assert places == sorted(places)
        assert places[0] == 0
