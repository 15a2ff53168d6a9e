"""Choices over time straight from their definition: every outcome, every binding, every pair of samples.

A program is drawn as data, of which the text is one reading and the plain functions here the other. All random
variables have finitely many values that make a difference: outcomes of choices, numbers a quarter apart, and of hidden
points one in each piece into which the circles and lines of the conditions cut the plane (`arrangement`). What is not
observed of a condition at a sample may be either; of few such places every completion is tried. That is more than
what the speeds and places that are missing can make of all conditions together: `jointly` tries values of these.
"""

from __future__ import annotations

import itertools
import math
import random
import re
import sys
from collections import ChainMap
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).parents[1] / "labels"))

from arrangement import representatives
from interval_definition import GAP_S, MONITORS, Formula, conditions, holds, monitored, text_of

from scenicq.store.labels import Label, LabelObject, Recording

MOST_GAPS = 8
COMPLETIONS = 12
MOST_TOGETHER = 4000
SPEEDS = [n / 8 for n in range(120)]
ALONG = [n / 8 for n in range(-104, 105)]
_DRAW = random.Random(0)
PLANE = [(x / 2, y / 2) for x in range(-18, 19, 2) for y in range(-18, 19, 2)]
PLANE += [(_DRAW.uniform(-9, 9), _DRAW.uniform(-9, 9)) for _ in range(300)]
Values = Mapping[str, Any]
"""The value of each random variable: a number, or many side by side where pieces of the plane are gone through."""
TOLERANCE_M = 0.25


@dataclass(frozen=True)
class Seen:
    """What a label says of an object: place, heading in degrees, velocity; None where it does not."""

    x: float
    y: float
    heading: float | None
    velocity: tuple[float, float] | None


@dataclass(frozen=True)
class Moment:
    """Time in seconds, and what is seen of each track; the ego is the track "ego", which may be absent, too."""

    time: float
    seen: dict[str, Seen]


Trace = list[Moment]


def recording_of(name: str, trace: Trace) -> Recording:
    """The recording that shows a trace."""

    def shown(seen: Seen, id_: str, track: str | None) -> LabelObject:
        heading = None if seen.heading is None else math.radians(seen.heading)
        return LabelObject(id_, "Car", "car", seen.x, seen.y, heading, velocity=seen.velocity, track=track)

    labels = [
        Label(
            f"{name}-{number}", name, round(each.time * 1e6), "none",
            shown(each.seen["ego"], "ego", None) if "ego" in each.seen else LabelObject("ego", "", "", 0.0, 0.0),
            tuple(shown(seen, f"{track}{number}", track) for track, seen in each.seen.items() if track != "ego"),
        )
        for number, each in enumerate(trace)
    ]  # fmt: skip
    return Recording(name, "none", tuple(labels))


def speed(trace: Trace, track: str, k: int) -> float | None:
    """The label's own, else by differences over the neighbouring samples of the track."""
    own = [m for m, each in enumerate(trace) if track in each.seen]
    if k not in own:
        return None
    if (velocity := trace[k].seen[track].velocity) is not None:
        return math.hypot(*velocity)
    place = own.index(k)
    near = [m for m in own[max(place - 1, 0) : place + 2] if abs(trace[m].time - trace[k].time) <= 1.5]
    if track == "ego":
        near = [m for m in near if abs(m - k) <= 1]  # no difference crosses a label without an ego
    first, last = trace[near[0]], trace[near[-1]]
    if first is last:
        return None
    one, other = first.seen[track], last.seen[track]
    return math.hypot(other.x - one.x, other.y - one.y) / round(last.time - first.time, 6)


@dataclass(frozen=True)
class Situation:
    """A trace, the track of each role, and the value of each random variable."""

    trace: Trace
    binding: dict[str, str]
    values: Values
    speeds: Mapping[str, float] = field(default_factory=dict[str, float])
    places: Mapping[str, tuple[float, float]] = field(default_factory=dict[str, tuple[float, float]])

    def seen(self, role: str, k: int) -> Seen | None:
        """What is seen of a role, or taken to be there."""
        here = self.trace[k].seen.get(self.binding[role])
        return Seen(*self.places[role], None, None) if here is None and role in self.places else here

    def speed(self, role: str, k: int) -> float | None:
        """The speed of a role, or what it is taken to be."""
        found = speed(self.trace, self.binding[role], k)
        return self.speeds.get(role) if found is None else found


@dataclass(frozen=True, eq=False)
class Condition:
    """An atom.

    Attributes:
        text: Of the program.
        value: Its value at a sample, None where it is not observed.
        plane: Whether it reads two coordinates.
        point: The hidden point that it reads.
        curves: The circles, and the x of the lines, on which it changes with that point.
    """

    text: str
    value: Callable[[Situation, int], Any]
    plane: bool = False
    point: str = ""
    curves: Callable[[Situation, int], tuple[list[tuple[float, float, float]], list[float]]] = lambda s, k: ([], [])


@dataclass(frozen=True)
class Choice:
    """A random variable: its name, what the program says of it, the values of its leaves, and its own value.

    Attributes:
        name, text: Of the program.
        leaves: Values of each leaf, by name.
        value: The value, given those of the leaves: a number, the number of an option.
        regions: The options where they are discs.
        objects: The options where they are objects.
        support: The middle and the radius of the disc, or the middle and the sides of the rectangle, where a hidden
            point is; it has no leaves.
    """

    name: str
    text: str
    leaves: dict[str, tuple[float, ...]]
    value: Callable[[Values], float]
    regions: tuple[tuple[float, float, float], ...] = ()
    objects: tuple[str, ...] = ()
    support: tuple[float, ...] = ()

    @property
    def number(self) -> bool:
        """Whether its value is a number."""
        return not (self.regions or self.objects or self.support)

    def supports(self, x: Any, y: Any) -> Any:
        """Whether a hidden point may be there."""
        if len(self.support) == 3:
            return np.hypot(x - self.support[0], y - self.support[1]) <= self.support[2]
        u, v, width, length = self.support
        return (abs(x - u) <= width / 2) & (abs(y - v) <= length / 2)


def quarters(low: float, high: float) -> tuple[float, ...]:
    """Every value that makes a difference: what is compared with it are whole numbers and halves."""
    return tuple(low + n / 4 for n in range(round((high - low) * 4) + 1))


def halved(values: Iterable[float]) -> tuple[float, ...]:
    """Values and those between, for what is doubled or compared with another that is hidden."""
    ends = sorted(values)
    return tuple(sorted({*ends, *((a + b) / 2 for a, b in itertools.pairwise(ends))}))


def random_choice(draw: random.Random, name: str, roles: list[str], earlier: list[Choice]) -> Choice:
    """Draw a random variable."""
    numbers = [choice for choice in earlier if choice.number]
    others = [choice for choice in earlier if choice.objects or choice.regions]
    kinds = ["uniform", "discrete", "range", "continuous", "ranges", "objects", "regions", "point"]
    kinds += ["nested"] * 2 * bool(numbers) + ["nested option"] * 2 * bool(others)
    some = draw.sample([-3, -1, 0, 1, 2, 4], draw.randint(2, 3))
    leaf = f"{name}.index"
    match draw.choice(kinds):
        case "uniform":
            return Choice(name, f"Uniform({', '.join(map(str, some))})", {leaf: tuple(range(len(some)))},
                          lambda v: some[int(v[leaf])])  # fmt: skip
        case "discrete":
            weighted = ", ".join(f"{each}: {draw.choice([1, 2])}" for each in some)
            return Choice(name, f"Discrete({{{weighted}, 99: 0}})", {leaf: tuple(range(len(some)))},
                          lambda v: some[int(v[leaf])])  # fmt: skip
        case "range":
            low = draw.randint(-3, 1)
            high = low + draw.randint(1, 3)
            return Choice(name, f"DiscreteRange({low}, {high})", {leaf: tuple(range(low, high + 1))}, lambda v: v[leaf])
        case "continuous":
            low = draw.randint(-3, 1)
            high = low + draw.randint(1, 3)
            return Choice(name, f"Range({low}, {high})", {leaf: quarters(low, high)}, lambda v: v[leaf])
        case "ranges":
            ends = [(low := draw.randint(-3, 2), low + draw.randint(1, 2)) for _ in range(2)]
            parts = {f"{name}.{n}": quarters(*each) for n, each in enumerate(ends)}
            text = ", ".join(f"Range({low}, {high})" for low, high in ends)
            return Choice(name, f"Uniform({text})", {leaf: (0, 1), **parts}, lambda v: v[f"{name}.{int(v[leaf])}"])
        case "objects":
            who = tuple(draw.sample(["ego", *roles], draw.randint(1, len(roles) + 1)))
            weighted = ", ".join(f"{each}: {draw.choice([1, 2])}" for each in who)
            never = [f"{each}: 0" for each in ["ego", *roles] if each not in who]
            text = draw.choice([f"Uniform({', '.join(who)})", f"Discrete({{{', '.join([weighted, *never])}}})"])
            return Choice(name, text, {leaf: tuple(range(len(who)))}, lambda v: v[leaf],
                          objects=who)  # fmt: skip
        case "regions":
            circles = tuple((draw.randint(-3, 3), draw.randint(-3, 3), draw.choice([2.5, 5])) for _ in range(2))
            text = ", ".join(f"CircularRegion(({x}, {y}), {r})" for x, y, r in circles)
            return Choice(name, f"Uniform({text})", {leaf: (0, 1)}, lambda v: v[leaf], regions=circles)
        case "point":
            x, y = draw.randint(-3, 3), draw.randint(-3, 3)
            if draw.random() < 0.5:
                disc = (x, y, draw.choice([1, 2, 4]))
                return Choice(
                    name, f"new Point in CircularRegion(({x}, {y}), {disc[2]})", {}, lambda v: 0, support=disc
                )
            width, length = draw.choice([2, 4]), draw.choice([2, 6])
            text = draw.choice([
                f"in RectangularRegion(({x}, {y}), 0, {width}, {length})",
                f"at (Range({x - width // 2}, {x + width // 2}), Range({y - length // 2}, {y + length // 2}))",
            ])  # fmt: skip
            return Choice(name, f"new Point {text}", {}, lambda v: 0, support=(x, y, width, length))
        case "nested option":
            inner = draw.choice(others)
            last = len(inner.objects or inner.regions)
            if inner.objects:
                who = draw.choice(["ego", *roles])
                more: dict[str, Any] = {"objects": (*inner.objects, who)}
            else:
                x, y, r = draw.randint(-3, 3), draw.randint(-3, 3), draw.choice([2.5, 5])
                who, more = f"CircularRegion(({x}, {y}), {r})", {"regions": (*inner.regions, (x, y, r))}
            return Choice(
                name, f"Uniform({inner.name}, {who})", {leaf: (0, 1), **inner.leaves},
                lambda v: last if v[leaf] else inner.value(v), **more,
            )  # fmt: skip
        case _:
            inner, factor = draw.choice(numbers), draw.choice([-2, 2, 3])
            # three times what is a quarter of something is none
            factor = factor if is_whole(itertools.chain(*inner.leaves.values())) else 2
            finer = {each: v if is_whole(v) else halved(v) for each, v in inner.leaves.items()}
            return Choice(
                name, f"Uniform({inner.name}, {factor} * {inner.name}, {some[0]})", {leaf: (0, 1, 2), **finer},
                lambda v: [1, factor, 0][int(v[leaf])] * inner.value(v) + some[0] * (v[leaf] == 2),
            )  # fmt: skip


def is_whole(values: Iterable[float]) -> bool:
    """Whether all are whole numbers."""
    return all(float(each).is_integer() for each in values)


def random_condition(draw: random.Random, roles: list[str], choices: list[Choice]) -> Condition:
    """Draw an atom."""
    role, number = draw.choice(["ego", *roles]), draw.randint(-3, 4) + draw.choice([0, 0.5])
    if not choices or draw.random() < 0.35:
        match draw.choice(["x", "speed", "distance"]):
            case "x":
                return Condition(
                    f"({role}.position.x > {number})",
                    lambda s, k: None if (p := s.seen(role, k)) is None else p.x > number,
                )
            case "speed":
                return Condition(
                    f"({role}.speed <= {abs(number)})",
                    lambda s, k: None if (v := s.speed(role, k)) is None else v <= abs(number),
                )
            case _:
                other = draw.choice([each for each in ["ego", *roles] if each != role])

                def near(s: Situation, k: int) -> bool | None:
                    p, q = s.seen(role, k), s.seen(other, k)
                    return None if p is None or q is None else math.hypot(p.x - q.x, p.y - q.y) < abs(number) + 1

                return Condition(f"((distance from {role} to {other}) < {abs(number) + 1})", near, plane=True)
    choice = draw.choice(choices)
    name = choice.name
    if choice.regions:

        def inside(s: Situation, k: int) -> bool | None:
            x, y, r = choice.regions[int(choice.value(s.values))]
            return None if (p := s.seen(role, k)) is None else math.hypot(p.x - x, p.y - y) <= r

        return Condition(f"({role}.position in {name})", inside, plane=True)
    if choice.objects:

        def of_option(s: Situation, k: int) -> bool | None:
            p = s.seen(choice.objects[int(choice.value(s.values))], k)
            return None if p is None else p.x > number

        return Condition(f"({name}.position.x > {number})", of_option)
    if choice.support:
        return about_point(draw, choice, role, number)
    if (numbers := [each for each in choices if each.number and each is not choice]) and draw.random() < 0.2:
        other_number = draw.choice(numbers)
        return Condition(
            f"({name} > {other_number.name})", lambda s, k: choice.value(s.values) > other_number.value(s.values)
        )
    match draw.choice(["alone", "x", "x", "speed"]):
        case "alone":
            return Condition(f"({name} > {number})", lambda s, k: choice.value(s.values) > number)
        case "x":
            return Condition(
                f"({role}.position.x <= {name})",
                lambda s, k: None if (p := s.seen(role, k)) is None else p.x <= choice.value(s.values),
            )
        case _:
            return Condition(
                f"({role}.speed > {name})",
                lambda s, k: None if (v := s.speed(role, k)) is None else v > choice.value(s.values),
            )


def about_point(draw: random.Random, choice: Choice, role: str, number: float) -> Condition:
    """Draw an atom about a hidden point."""
    name = choice.name
    x, y = f"{name}.x", f"{name}.y"
    match draw.choice(["near", "near", "place", "beside"]):
        case "near":
            reach = draw.choice([1.1, 2.1, 3.6])

            def near(s: Situation, k: int) -> Any:
                return (
                    None if (p := s.seen(role, k)) is None else np.hypot(s.values[x] - p.x, s.values[y] - p.y) < reach
                )

            def circle(s: Situation, k: int) -> tuple[list[tuple[float, float, float]], list[float]]:
                return ([] if (p := s.seen(role, k)) is None else [(p.x, p.y, reach)]), []

            return Condition(f"((distance from {role} to {name}) < {reach})", near, True, name, circle)
        case "place":
            return Condition(
                f"({name}.position.x > {number})", lambda s, k: s.values[x] > number, False, name,
                lambda s, k: ([], [number]),
            )  # fmt: skip
        case _:
            return Condition(
                f"({role}.position.x <= {name}.position.x)",
                lambda s, k: None if (p := s.seen(role, k)) is None else p.x <= s.values[x], False, name,
                lambda s, k: ([], [] if (p := s.seen(role, k)) is None else [p.x]),
            )  # fmt: skip


def random_formula(draw: random.Random, atom: Callable[[], Condition], depth: int, *, inside: bool = False) -> Formula:
    """Draw a formula with an operator of time outside, or any inside of one."""
    kinds = ["always", "always", "eventually", "eventually", "next", "until", "and", "or", "not", "implies"]
    kind = draw.choice(kinds)
    parts = 2 if kind in ("and", "or", "until", "implies") else 1
    within = inside or kind not in ("and", "or", "not", "implies")
    inner = [
        random_formula(draw, atom, depth - 1, inside=within) if depth and draw.random() < 0.5 else ("atom", atom())
        for _ in range(parts)
    ]
    if not within:
        inner = [("always", each) if each[0] == "atom" else each for each in inner]
    return kind, *inner


@dataclass(frozen=True)
class Place:
    """Where `a` is at the start: what is added to a hidden number or point, and whether from the ego."""

    choice: Choice
    across: float
    ahead: float
    from_ego: bool

    @property
    def text(self) -> str:
        """In Scenic."""
        name = self.choice.name
        if self.choice.support:
            return f"({name}.position.x + {self.across}, {name}.position.y + {self.ahead})"
        return f"({'ego.position.x + ' if self.from_ego else ''}{name}, Range(-999, 999))"

    def near(self, s: Situation, k: int) -> Any:
        """Whether what is seen there is within tolerance."""
        seen, ego, name = s.seen("a", k), s.seen("ego", k), self.choice.name
        assert seen is not None
        assert ego is not None
        if self.choice.support:
            x, y = s.values[f"{name}.x"] + self.across, s.values[f"{name}.y"] + self.ahead
            return np.hypot(x - seen.x, y - seen.y) <= TOLERANCE_M
        return abs(self.choice.value(s.values) + (ego.x if self.from_ego else 0) - seen.x) <= TOLERANCE_M


@dataclass
class Program:
    """A dynamic program with one or two roles."""

    roles: list[str]
    faces: Choice | None
    choices: list[Choice]
    start: list[Condition]
    requirements: list[Formula]
    ends: list[Condition]
    late_ends: list[Condition]
    after_s: float | None
    monitors: list[tuple[str, list[Condition]]]
    atoms: list[Condition] = field(default_factory=list[Condition])
    place: Place | None = None
    hopes: list[Condition] = field(default_factory=list[Condition])
    by_steps: bool = False

    @property
    def terminates(self) -> bool:
        """Whether it says when it ends."""
        by_monitor = any(kind != "demands" for kind, _ in self.monitors)
        return bool(self.ends or self.late_ends) or self.after_s is not None or by_monitor

    def text(self) -> str:
        """The program in Scenic."""
        anywhere = "new Object at (Range(-999, 999), Range(-999, 999)), facing"
        lines = [f"ego = {anywhere} Range(-180, 180) deg"]
        # what an object is made of comes before it, and a choice among objects after them
        late = [each for each in self.choices if each.objects]
        lines += [f"{each.name} = {each.text}" for each in self.choices if each not in late]
        for role in self.roles:
            facing = self.faces.name if self.faces is not None and role == "a" else "Range(-180, 180)"
            where = (
                self.place.text if self.place is not None and role == "a" else "(Range(-999, 999), Range(-999, 999))"
            )
            lines.append(f"{role} = new Object at {where}, facing {facing} deg")
        lines += [f"{each.name} = {each.text}" for each in late]
        lines += [f"require {each.text}" for each in self.start]
        lines += [f"require[0.5] {each.text}" for each in self.hopes]
        lines += [f"require {text_of(each)}" for each in self.requirements]
        lines += [f"terminate when {each.text}" for each in self.ends]
        lines += [f"terminate simulation when {each.text}" for each in self.late_ends]
        if self.after_s is not None:
            after = f"{round(10 * self.after_s)} steps" if self.by_steps else f"{self.after_s} seconds"
            lines.append(f"terminate after {after}")
        for number, (kind, atoms) in enumerate(self.monitors):
            body = MONITORS[kind][0].format(*(atom.text for atom in atoms))
            lines += [f"monitor M{number}():\n    {body}", f"require monitor M{number}()"]
        return "\n".join(lines) + "\n"

    @cached_property
    def assignments(self) -> list[Values]:
        """Values of the leaves: one of all that give the choices that something hard reads the same values."""
        leaves: dict[str, tuple[float, ...]] = {}
        for choice in self.choices:
            for name, values in choice.leaves.items():
                # the finer ones of two that share a leaf
                leaves[name] = max(values, leaves.get(name, ()), key=len)
        if any(name in atom.text for atom in every_atom(self) for name in self.pairs()):
            leaves = {name: values if is_whole(values) else halved(values) for name, values in leaves.items()}
        parts: list[list[Choice]] = []  # those that share a leaf
        for choice in self.used(hard=True):
            beside = [part for part in parts if any(choice.leaves.keys() & each.leaves for each in part)]
            parts = [part for part in parts if part not in beside] + [[*itertools.chain(*beside), choice]]
        found: list[list[Values]] = []
        for part in parts:
            names = list(dict.fromkeys(name for choice in part for name in choice.leaves))
            ways: dict[tuple[float, ...], Values] = {}
            for row in itertools.product(*(leaves[name] for name in names)):
                values = dict(zip(names, row, strict=True))
                ways.setdefault(tuple(choice.value(values) for choice in part), values)
            found.append(list(ways.values()))
        some = {name: values[0] for name, values in leaves.items()}
        return [dict(ChainMap(*map(dict, way), some)) for way in itertools.product(*found)]

    def pairs(self) -> list[str]:
        """What conditions say that compare two random numbers."""
        names = [each.name for each in self.choices if each.number]
        return [f"{one} > {other}" for one in names for other in names]

    def used(self, *, hard: bool = False) -> list[Choice]:
        """The random variables that something reads, or that one of these is made of; but for soft requirements."""
        passed = r"[A-Z]\d ?=|require\[" if hard else r"[A-Z]\d ?="
        text = " ".join(line for line in self.text().splitlines() if not re.match(passed, line))
        words = set(re.findall(r"\w+", text))
        for choice in reversed(self.choices):
            if choice.name in words:
                words |= set(re.findall(r"\w+", choice.text))
        return [choice for choice in self.choices if choice.name in words]

    def tells_apart(self) -> bool:
        """Whether the program says something of `a` that it does not say of `b`, whatever alike choices are called."""
        if len(self.roles) < 2 or self.faces is not None or self.place is not None:
            return True

        used = {choice.name for choice in self.used(hard=True)}
        # neither a name that nothing reads nor a soft requirement says anything
        lines = [line for line in self.text().splitlines() if not re.match(r"[A-Z]\d ?=", line) or line[:2] in used]
        lines = [line for line in lines if not line.startswith("require[")]

        def said(names: Mapping[str, str]) -> list[str]:
            text = "".join(names.get(word, word) for word in re.split(r"\b", "\n".join(lines)))
            text = re.sub(r", \w+: 0\b", "", text)  # an option without weight is none
            text = re.sub(r"from (\w+) to (\w+)", lambda m: "from {} to {}".format(*sorted(m.groups())), text)
            return sorted(re.sub(r"M\d", "M", text).splitlines())

        alike = [choice.name for choice in self.choices]
        ways = itertools.permutations(alike) if len(alike) < 4 else [alike]
        return all(said({}) != said({"a": "b", "b": "a", **dict(zip(alike, way, strict=True))}) for way in ways)


def random_program(draw: random.Random) -> Program:
    """Draw a program."""
    roles = ["a", "b"][: draw.randint(1, 2)]
    choices: list[Choice] = []
    for number in range(draw.randint(0, 3)):
        choices.append(random_choice(draw, f"C{number}", roles, choices))
    faces = None
    if draw.random() < 0.2:
        some = draw.sample([-90, 0, 90], 2)
        faces = Choice("F9", f"Uniform({some[0]}, {some[1]})", {"F9.index": (0, 1)}, lambda v: some[int(v["F9.index"])])
        choices = [faces, *choices]
    atoms: list[Condition] = []

    def atom() -> Condition:
        if atoms and draw.random() < 0.25:
            # the same again, of the other role where there is one
            again = draw.choice(atoms)
            atoms.append(replace(again))
        else:
            atoms.append(random_condition(draw, roles, choices))
        return atoms[-1]

    place = None
    if draw.random() < 0.25 and (able := [each for each in choices if each.support or each.number]):
        chosen = draw.choice([each for each in able if each.support] or able)
        place = Place(chosen, draw.randint(-1, 2), draw.randint(-1, 1), draw.random() < 0.5)
    start = [atom() for _ in range(draw.choice([0, 1, 1, 2]))]
    requirements = [random_formula(draw, atom, draw.choice([1, 1, 2])) for _ in range(draw.randint(0, 2))]
    ends = [atom() for _ in range(draw.choice([0, 0, 1]))]
    late_ends = [atom() for _ in range(draw.choice([0, 0, 0, 1]))]
    after_s = draw.choice([None, None, 0.5, 1.0])
    kinds = [draw.choice(list(MONITORS)) for _ in range(draw.choice([0, 0, 1]))]
    monitors = [(kind, [atom() for _ in range(MONITORS[kind][1])]) for kind in kinds]
    if not (requirements or ends or late_ends or monitors) and after_s is None:
        after_s = 1.0
    hopes = [random_condition(draw, roles, choices)] if draw.random() < 0.1 else []
    return Program(
        roles, faces, choices, start, requirements, ends, late_ends, after_s, monitors, atoms, place, hopes,
        draw.random() < 0.3,
    )  # fmt: skip


def alike(program: Program) -> Program:
    """The program that says of `b` all that it says of `a`, too, where it has no choice of objects."""
    only_a = program.faces is not None or program.place is not None
    if len(program.roles) < 2 or only_a or any(each.objects for each in program.choices):
        return program

    def other(condition: Condition) -> Condition:
        swap = {"a": "b", "b": "a"}
        text = "".join(swap.get(word, word) for word in re.split(r"\b", condition.text))

        def exchanged(s: Situation) -> Situation:
            binding, speeds, places = (
                {swap.get(role, role): each for role, each in of.items()} for of in (s.binding, s.speeds, s.places)
            )
            return replace(s, binding=binding, speeds=speeds, places=places)

        return replace(
            condition, text=text, value=lambda s, k: condition.value(exchanged(s), k),
            curves=lambda s, k: condition.curves(exchanged(s), k),
        )  # fmt: skip

    def turned(formula: Formula) -> Formula:
        if formula[0] == "atom":
            return "atom", other(formula[1])
        return formula[0], *map(turned, formula[1:])

    return replace(
        program,
        start=[*program.start, *map(other, program.start)],
        requirements=[*program.requirements, *map(turned, program.requirements)],
        ends=[*program.ends, *map(other, program.ends)],
        late_ends=[*program.late_ends, *map(other, program.late_ends)],
        monitors=[*program.monitors, *((kind, [other(each) for each in atoms]) for kind, atoms in program.monitors)],
    )


def random_trace(draw: random.Random) -> Trace:
    """Draw a trace."""
    tracks = ["ego", "t", "u", "v"][: draw.randint(2, 4)]
    time, trace = 0.0, list[Moment]()
    gaps = draw.random() < 0.5
    alone = draw.random() < 0.15
    places = {track: (draw.randint(-3, 5), draw.randint(-3, 5)) for track in tracks}
    for _ in range(draw.randint(1, 6)):
        seen = {
            track: Seen(
                float(x), float(y), draw.choice([None, 0.0, 90.0, -90.0]) if gaps else draw.choice([0.0, 90.0, -90.0]),
                draw.choice([None, (3.0, 4.0), (1.0, 0.0), (0.0, 0.0)]),
            )
            for track, (x, y) in places.items()
            if track == "ego" or not gaps or draw.random() < 0.65
        }  # fmt: skip
        if alone and draw.random() < 0.25:
            del seen["ego"]
        trace.append(Moment(time, seen))
        time += draw.choice([0.5, 0.5, 0.5, 1.0, 1.6 if gaps else 0.5])
        places = {t: (x + draw.randint(-3, 3), y + draw.randint(-2, 2)) for t, (x, y) in places.items()}
    return trace


def bindings(program: Program, trace: Trace) -> list[dict[str, str]]:
    """Every way to give roles distinct tracks."""
    tracks = sorted({track for each in trace for track in each.seen} - {"ego"})
    return [
        {"ego": "ego", **dict(zip(program.roles, chosen, strict=True))}
        for chosen in itertools.permutations(tracks, len(program.roles))
    ]


def life_end(trace: Trace, binding: dict[str, str], i: int) -> int:
    """The last sample of the common life of the tracks of a binding; -1 where one is not observed at i."""
    end = len(trace) - 1
    for track in binding.values():
        own = [k for k, each in enumerate(trace) if track in each.seen and k >= i]
        if not own or own[0] != i:
            return -1
        last = i
        for k in own[1:]:
            if round(trace[k].time - trace[last].time, 6) > GAP_S:
                break
            last = k
        end = min(end, last)
    return end


def ends_in(program: Program, trace: Trace, truth: Callable[[Condition, int], bool], i: int, last: int) -> set[int]:
    """The samples at which the run from one may end as a match, in one completion."""
    found = set[int]()
    if not all(truth(each, i) for each in program.start):
        return found
    for j in range(i, last + 1):
        late = program.after_s is not None and trace[j].time - trace[i].time >= program.after_s - 1e-6
        # these stop the monitors before they run
        stopped = late or any(truth(each, j) for each in program.ends)
        done = [monitored(kind, atoms, truth, i, j - stopped) for kind, atoms in program.monitors]
        over = stopped or "end" in done or any(truth(each, j) for each in program.late_ends)
        fits = "reject" not in done and all(holds(each, truth, i, j) for each in program.requirements)
        if fits and (over or not program.terminates):
            found.add(j)
        if over and program.terminates:
            break
    return found


@dataclass
class Expected:
    """What is right of a start.

    Attributes:
        sure: Ends of matches: those in every completion, of a program without an end the last one.
        common: Every sample at which some outcome matches in every completion.
        possible: Whether some outcome matches in some completion.
        exact: Whether all completions were tried.
    """

    sure: set[int] = field(default_factory=set[int])
    common: set[int] = field(default_factory=set[int])
    possible: bool = False
    exact: bool = True


def expected(program: Program, trace: Trace, binding: dict[str, str], i: int, *, jointly: bool = False) -> Expected:
    """What is right of a start.

    Args:
        program: The program.
        trace: The recording.
        binding: The track of each role.
        i: The start.
        jointly: Whether conditions that read the same missing speed or place hang together.
    """
    last, right = life_end(trace, binding, i), Expected()
    if last < 0:
        return right
    facing = trace[i].seen[binding["a"]].heading if program.faces is not None else None
    atoms = list({each.text: each for each in every_atom(program)}.values())
    pieces = list(points(program, trace, binding, i, last, atoms, jointly=jointly))
    before = set[tuple[bool | None, ...]]()
    for values, point in itertools.product(program.assignments, pieces):
        situation = Situation(trace, binding, {**values, **point})
        if program.faces is not None and facing is not None and program.faces.value(values) != facing:
            continue
        if program.place is not None and not program.place.near(situation, i):
            continue
        known = {(each.text, k): each.value(situation, k) for each in atoms for k in range(i, last + 1)}
        if (alike := tuple(known.values())) in before and not jointly:
            continue
        before.add(alike)
        parts = [[{(each, k): False}, {(each, k): True}] for (each, k), value in known.items() if value is None]
        if jointly:
            parts = [part for k in range(i, last + 1) for part in ways(situation, atoms, k, right)]
        some: Iterator[Iterable[Mapping[At, bool]]] = itertools.product(*parts)
        if math.prod(map(len, parts)) > (MOST_TOGETHER if jointly else 1 << MOST_GAPS):
            right.exact = False
            draw = random.Random(len(parts))
            some = ([draw.choice(part) for part in parts] for _ in range(COMPLETIONS))
        common = set(range(i, last + 1))
        for completion in some:
            whole = dict(known)
            for part in completion:
                whole.update(part)
            ends = ends_in(program, trace, lambda c, k, whole=whole: bool(whole[c.text, k]), i, last)
            common &= ends
            right.possible = right.possible or bool(ends)
        right.common |= common
        right.sure |= {max(common)} if common else set()
    return right


At = tuple[str, int]
"""A condition by its text, and a sample."""


def points(
    program: Program, trace: Trace, binding: dict[str, str], i: int, last: int, atoms: list[Condition], *, jointly: bool
) -> Iterator[Values]:
    """Values of all hidden points, one of each piece within which nothing changes."""
    nowhere = Situation(trace, binding, {})
    found: list[list[Values]] = []
    for choice in program.used():
        if not choice.support:
            continue
        own = [(each, k) for each in atoms if each.point == choice.name for k in range(i, last + 1)]
        circles, lines = [choice.support] if len(choice.support) == 3 else [], [n / 2 for n in range(-12, 13)]
        rows: list[float] = []
        if len(choice.support) == 4:
            x, y, width, length = choice.support
            lines += [x - width / 2, x + width / 2]
            rows += [y - length / 2, y + length / 2]
        for each, k in own:
            rings, columns = each.curves(nowhere, k)
            circles, lines = circles + rings, lines + columns
        near = program.place if program.place is not None and program.place.choice is choice else None
        if near is not None and (seen := trace[i].seen.get(binding["a"])) is not None:
            circles = [*circles, (seen.x - near.across, seen.y - near.ahead, TOLERANCE_M)]
        x, y = representatives(circles, lines, rows).T
        keep = choice.supports(x, y)
        x, y = x[keep], y[keep]
        many = replace(nowhere, values={f"{choice.name}.x": x, f"{choice.name}.y": y})
        told = [each.value(many, k) for each, k in own]
        columns = [np.broadcast_to(each, x.shape) for each in told if each is not None]
        columns += [near.near(many, i)] if near is not None else []
        # what is not seen of a role may be anywhere beside it
        columns += [np.floor(2 * x)] if jointly else []
        columns += [np.zeros_like(x)]
        table: NDArray[np.float64] = np.column_stack(columns).astype(float)
        first = np.unique(table, axis=0, return_index=True)[1]
        found.append([{f"{choice.name}.x": float(x[n]), f"{choice.name}.y": float(y[n])} for n in first])
    for each in itertools.product(*found):
        yield {name: value for values in each for name, value in values.items()}


def ways(situation: Situation, atoms: list[Condition], k: int, right: Expected) -> Iterator[list[dict[At, bool]]]:
    """What speeds and places that are missing at a sample can make of the conditions that read them, apart."""
    open_ones = [each for each in atoms if each.value(situation, k) is None]
    roles = list(situation.binding)
    absent = [role for role in roles if situation.seen(role, k) is None]
    for role in roles:
        guessed = [replace(situation, speeds={role: each}) for each in SPEEDS]
        yield vectors([each for each in open_ones if each.value(guessed[0], k) is not None], guessed, k)
    here = [
        each
        for each in open_ones
        if each.value(replace(situation, places=dict.fromkeys(absent, (0, 0))), k) is not None
    ]
    if len(absent) > 1 and any(each.plane for each in here):
        right.exact = False
        draw = random.Random(k)
        guessed = [replace(situation, places={role: draw.choice(PLANE) for role in absent}) for _ in range(1500)]
        yield vectors(here, guessed, k)
        return
    for role in absent:
        own = [each for each in here if each.value(replace(situation, places={role: (0, 0)}), k) is not None]
        plane = any(each.plane for each in own)
        right.exact = right.exact and not plane
        pool = PLANE if plane else [(x, 0.0) for x in ALONG]
        yield vectors(own, [replace(situation, places={role: each}) for each in pool], k)


def vectors(atoms: list[Condition], guessed: list[Situation], k: int) -> list[dict[At, bool]]:
    """The different values of conditions together."""
    found = {tuple(bool(each.value(guess, k)) for each in atoms) for guess in guessed} if atoms else {()}
    return [{(each.text, k): value for each, value in zip(atoms, values, strict=True)} for values in sorted(found)]


def every_atom(program: Program) -> list[Condition]:
    """The atoms of a program."""
    found = [*program.start, *program.ends, *program.late_ends]
    found += [each for formula in program.requirements for each in conditions(formula)]
    return found + [each for _, atoms in program.monitors for each in atoms]
