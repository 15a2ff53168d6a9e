"""What results carry of `record`, against plain evaluation of random expressions on the labels.

An expression is drawn together with a function of Python that says its value: None where something that it reads is not
observed (as Kleene has it), `NOTHING` where it has none.
"""

from __future__ import annotations

import math
import random
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from scenicq.errors import Source
from scenicq.match.verdict import Match
from scenicq.query.execution.records import json_text, record
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.dataset import Dataset, open_dataset
from scenicq.store.labels import Label, LabelObject, Recording
from scenicq.store.writer import write_dataset
from scenicq.temporal.interval_options import IntervalOptions

PLACE = "at (Range(-99, 99), Range(-99, 99)), facing Range(-180, 180) deg"
LENGTH = 4.5
"""Of a car of the driving model, where no label says another."""
NOTHING = "nothing"


@dataclass(frozen=True)
class World:
    """Who plays which role at one sample; None where it is not seen, and with which lengths an interval has labels."""

    roles: dict[str, LabelObject | None]
    sized: frozenset[str]


@dataclass(frozen=True)
class Drawn:
    text: str
    value: Callable[[World], object]


def lift(function: Callable[..., object]) -> Callable[..., object]:
    """A function of values as one of what may be unknown or nothing; unknown outweighs nothing."""

    def of(*args: object) -> object:
        if any(each is None for each in args):
            return None
        return NOTHING if any(each is NOTHING for each in args) else function(*args)

    return of


def divided(one: float, other: float) -> object:
    return NOTHING if other == 0 else one / other


def number(draw: random.Random, depth: int) -> Drawn:
    role = draw.choice(["ego", "a"])

    def of(read: Callable[[LabelObject], object]) -> Callable[[World], object]:
        return lambda world: None if (one := world.roles[role]) is None else read(one)

    def length(world: World) -> object:
        one = world.roles[role]
        return (one.length if one else None) if role in world.sized else LENGTH

    def apart(world: World) -> object:
        one, other = world.roles["ego"], world.roles["a"]
        return None if one is None or other is None else math.hypot(one.x - other.x, one.y - other.y)

    kind = draw.randrange(7 if depth == 0 else 14)
    match kind:
        case 0:
            return Drawn("(distance from ego to a)", apart)
        case 1:
            return Drawn(f"{role}.speed", of(lambda one: None if one.velocity is None else math.hypot(*one.velocity)))
        case 2:
            return Drawn(f"{role}.heading", of(lambda one: one.heading))
        case 3:
            return Drawn(f"{role}.position.x", of(lambda one: one.x))
        case 4:
            return Drawn(f"{role}.length", length)
        case 5:
            return Drawn(f"{role}.velocity.y", of(lambda one: None if one.velocity is None else one.velocity[1]))
        case 6:
            size = draw.randint(-3, 3)
            return Drawn(f"({size})", lambda _: float(size))
        case 7 | 8 | 9 | 10:
            text, function = draw.choice([
                ("({} + {})", lambda p, q: p + q), ("({} - {})", lambda p, q: p - q), ("({} * {})", lambda p, q: p * q),
                ("min({}, {})", min), ("max({}, {})", max), ("({} / {})", divided),
            ])  # fmt: skip
            one, other = number(draw, depth - 1), number(draw, depth - 1)
            both = lift(function)
            return Drawn(text.format(one.text, other.text), lambda world: both(one.value(world), other.value(world)))
        case 11:
            one = number(draw, depth - 1)
            size = lift(abs)
            return Drawn(f"abs({one.text})", lambda world: size(one.value(world)))
        case _:
            return chosen(draw, number, depth)


def chosen(draw: random.Random, of: Callable[[random.Random, int], Drawn], depth: int) -> Drawn:
    test, yes, no = truth(draw, depth - 1), of(draw, depth - 1), of(draw, depth - 1)

    def value(world: World) -> object:
        known = test.value(world)
        return known if known is None or known is NOTHING else yes.value(world) if known else no.value(world)

    return Drawn(f"({yes.text} if {test.text} else {no.text})", value)


def truth(draw: random.Random, depth: int) -> Drawn:
    if depth <= 0 or draw.random() < 0.4:
        one, other, sign = number(draw, depth - 1 if depth > 0 else 0), number(draw, 0), draw.choice("<>")
        less = lift(lambda p, q: p < q if sign == "<" else p > q)
        return Drawn(f"({one.text} {sign} {other.text})", lambda world: less(one.value(world), other.value(world)))
    first = truth(draw, depth - 1)
    if draw.random() < 0.3:
        opposite = lift(lambda p: not p)
        return Drawn(f"(not {first.text})", lambda world: opposite(first.value(world)))
    second, word = truth(draw, depth - 1), draw.choice(["and", "or"])
    decisive = word == "or"

    def joined(world: World) -> object:
        values = [first.value(world), second.value(world)]
        if decisive in [each for each in values if each is not None and each is not NOTHING]:
            return decisive
        return None if None in values else NOTHING if NOTHING in values else not decisive

    return Drawn(f"({first.text} {word} {second.text})", joined)


def vector(draw: random.Random, depth: int) -> Drawn:
    role = draw.choice(["ego", "a"])
    if depth > 0 and draw.random() < 0.4:
        return chosen(draw, vector, depth)
    if draw.random() < 0.5:
        return Drawn(f"{role}.position", lambda world: None if (o := world.roles[role]) is None else (o.x, o.y))
    return Drawn(f"{role}.velocity", lambda world: None if (o := world.roles[role]) is None else o.velocity)


def text_of(draw: random.Random, depth: int) -> Drawn:
    word = draw.choice(["near", "far, 'x'", "=1"])
    plain = Drawn(repr(word), lambda _: word)
    return plain if depth == 0 else chosen(draw, text_of, depth)


KINDS = (number, number, truth, vector, text_of)


def objects(draw: random.Random, count: int) -> list[LabelObject]:
    return [
        LabelObject(
            f"o{n}", "Car", "x", draw.uniform(-9, 9), draw.uniform(-9, 9), draw.choice([None, 0.5, -1.5]), 2.0,
            draw.choice([None, 3.0, 5.0]), velocity=draw.choice([None, (0.0, 1.0), (3.0, -4.0)]), track=f"t{n}",
        )
        for n in range(count)
    ]  # fmt: skip


def expected(drawn: Drawn, worlds: list[World]) -> list[object]:
    values = [drawn.value(world) for world in worlds]
    return [None if each is NOTHING else each for each in values]


def same(told: object, wanted: object) -> bool:
    if isinstance(told, tuple) and isinstance(wanted, tuple):
        return all(same(one, other) for one, other in zip(told, wanted, strict=True))
    if type(told) is bool or type(wanted) is bool or told is None or wanted is None or isinstance(wanted, str):
        return told is wanted or told == wanted
    assert isinstance(told, float)
    assert isinstance(wanted, float)
    return math.isclose(told, wanted, rel_tol=1e-9, abs_tol=1e-9)


def lines(dataset: Dataset, text: str, **options: object) -> list[str]:
    query = Query(dataset, Source("p.scenic", text), QueryOptions(**options))
    return [json_text(record(each)) for each in query.results()]


def left_out(query: Query) -> set[str]:
    """What cannot be recorded: numbers of the program alone that are divided by zero."""
    told = [each for each in query.notes() if each.code == "not-recorded"]
    assert all("division by zero" in each.message for each in told), told
    return {each.message.split("`")[1] for each in told}


def program(draw: random.Random) -> tuple[str, list[tuple[str, str, Drawn]]]:
    drawn = [
        (f"v{n}", draw.choice(["record", "record initial", "record final"]), draw.choice(KINDS)(draw, 2))
        for n in range(5)
    ]
    made = "".join(f"{word} {each.text} as {name}\n" for name, word, each in drawn)
    head = f"model scenic.domains.driving.model\nego = new Car {PLACE}\na = new Car {PLACE}\n"
    return f"{head}require (distance from ego to a) < 12\n{made}", drawn


def run_frames(folder: Path, seed: int, programs: int) -> Counter[str]:
    draw, seen = random.Random(seed), Counter[str]()
    labels = []
    for n in range(14):
        ego, *others = objects(draw, draw.randint(1, 4))
        others = [replace(each, track=draw.choice([None, each.track])) for each in others]
        labels.append(Label(f"f{n}", f"r{n:02}", n, "street", replace(ego, id="ego"), tuple(others)))
    write_dataset(folder, [Recording(each.recording, "street", (each,)) for each in labels], {}, name="d")
    dataset, by_frame = open_dataset(folder), {each.frame: each for each in labels}
    for number_ in range(programs):
        text, drawn = program(draw)
        query = Query(dataset, Source("p.scenic", text), QueryOptions(all_matches=number_ % 3 == 0))
        drawn = [each for each in drawn if each[0] not in left_out(query)]
        for result in query.results():
            if not isinstance(result.verdict, Match):
                assert result.recorded is None
                continue
            label = by_frame[result.frame]
            every = {each.id: each for each in (label.ego, *label.objects)}
            roles = {name: every[played] for name, played in result.verdict.correspondence.items()}
            sized = frozenset(name for name, one in roles.items() if one.length is not None)
            world = World(roles, sized)
            for name, _, each in drawn:
                recorded = result.recorded[name]
                (wanted,) = expected(each, [world])
                assert same(recorded.values[0], wanted), (text, label, name, recorded, wanted)
                reason = {None: "not observed", NOTHING: "no value"}.get(each.value(world))
                assert recorded.lacking == ({} if wanted is not None else {reason: 1}), (text, name, recorded)
                seen["null" if wanted is None else type(wanted).__name__] += 1
        if number_ == 0:
            plain = lines(dataset, text)
            assert plain == lines(dataset, text, prefilter=False)
            assert plain == lines(dataset, text, jobs=2)
    return seen


def run_time(folder: Path, seed: int, programs: int) -> Counter[str]:
    draw, seen = random.Random(seed), Counter[str]()
    recordings = []
    for n in range(4):
        ego, *others = objects(draw, 4)
        labels = []
        for k in range(9):
            now = [
                replace(each, id=f"{each.id}-{k}", x=each.x + 0.3 * k, velocity=(1.0 + k, 0.5),
                        heading=draw.choice([each.heading, 1.0]), length=draw.choice([each.length, None]))
                for each in others
                if draw.random() < 0.8
            ]  # fmt: skip
            me = replace(ego, id="ego", heading=0.1 * k, velocity=(2.0, 0.0))
            labels.append(Label(f"r{n}-{k}", f"r{n}", k * 500_000, "street", me, tuple(now)))
        recordings.append(Recording(f"r{n}", "street", tuple(labels)))
    write_dataset(folder, recordings, {}, name="d")
    dataset, by_name = open_dataset(folder), {each.name: each.labels for each in recordings}
    for number_ in range(programs):
        text, drawn = program(draw)
        options = QueryOptions(time=IntervalOptions(min_duration_s=0.5, intervals="all"))
        if number_ % 2:
            # a role may be unseen in between
            text += "require eventually ego.speed > 0\nterminate after 1.5 seconds\n"
            options = QueryOptions(time=IntervalOptions(intervals="all"))
        query = Query(dataset, Source("p.scenic", text), options)
        drawn = [each for each in drawn if each[0] not in left_out(query)]
        for result in query.results():
            if not isinstance(result.verdict, Match):
                continue
            labels = by_name[result.recording]
            first = next(k for k, each in enumerate(labels) if each.frame == result.frame)
            stretch = labels[first : first + result.interval.count]
            assert stretch[-1].frame == result.interval.last
            worlds = []
            for label in stretch:
                tracks = {each.track: each for each in label.objects} | {"ego": label.ego}
                worlds.append({name: tracks.get(who) for name, who in result.verdict.correspondence.items()})
            sized = frozenset(name for name in ("ego", "a") if any(w[name] and w[name].length for w in worlds))
            at_each = [World(each, sized) for each in worlds]
            for name, word, each in drawn:
                recorded = result.recorded[name]
                wanted = expected(each, at_each)
                if word != "record":
                    wanted = [wanted[0 if word.endswith("initial") else -1]]
                assert recorded.series == (word == "record")
                assert len(recorded.values) == len(wanted)
                for told, value in zip(recorded.values, wanted, strict=True):
                    assert same(told, value), (text, result, name, recorded, wanted)
                assert sum(recorded.lacking.values()) == wanted.count(None)
                seen["null" if None in wanted else "known"] += 1
        if number_ < 2:
            plain = lines(dataset, text, time=options.time)
            assert plain == lines(dataset, text, time=options.time, prefilter=False)
            assert plain == lines(dataset, text, time=options.time, jobs=2)
    return seen


@pytest.mark.parametrize("seed", [1])
def test_frames_carry_what_plain_evaluation_says(tmp_path, seed):
    seen = run_frames(tmp_path / "d", seed, 8)
    assert min(seen[each] for each in ("null", "float", "bool", "tuple", "str")) > 20, seen


@pytest.mark.parametrize("seed", [3])
@pytest.mark.slow
def test_intervals_carry_what_plain_evaluation_says(tmp_path, seed):
    seen = run_time(tmp_path / "d", seed, 6)
    assert min(seen["null"], seen["known"]) > 20, seen


@pytest.mark.slow
def test_many_programs_carry_what_plain_evaluation_says(tmp_path):
    for seed in range(100, 103):
        run_frames(tmp_path / f"f{seed}", seed, 24)
        run_time(tmp_path / f"t{seed}", seed, 24)
