"""Random programs over random labels, judged straight from the definition of a match.

A program is made as a value that has a text and a meaning of its own; no code of the package takes part in the judging.
A label matches if there are a correspondence, outcomes of choices and values of hidden numbers with which all that is
compared and required holds. Hidden points are tried one in each piece of the plane that conditions cut (`arrangement`);
a heading that a label lacks is a hidden number of which the program gives the ends. What a label does not observe of
motion is filled in at random, many times: where two fillings differ, the only right answer is unknown. Numbers are
whole or halves, so that bounds are hit exactly; what comes close to a bound without hitting it is left out, as are
bounds of angles.
"""

from __future__ import annotations

import itertools
import math
import random
import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

sys.path.insert(0, str(Path(__file__).parent))
from arrangement import Circle, representatives

Truth = bool | Literal["either"] | None
"""None: it hangs on what is not observed; "either": on rounding."""

TOLERANCE_M, TOLERANCE_DEG, TOLERANCE_SPEED = 0.25, 5.0, 0.5
CLASSES = {"Car": ("Car",), "Pedestrian": ("Pedestrian",), "Vehicle": ("Car", "Truck"), "Truck": ("Truck",)}
"""The classes of label objects that each class of a program takes."""
MOTION = ("speed", "velocity", "acceleration", "angularSpeed")
_CLOSE = 1e-6
_FILLINGS = 10
_MOST_TRIALS = 40_000


# --- labels


@dataclass(frozen=True)
class Thing:
    """A label object; None is what nobody observed. Degrees, metres, metres a second.

    What is filled in is not compared: a label does not observe it.
    """

    category: str
    x: float
    y: float
    heading: float | None
    speed: float | None
    across: float | None
    ahead: float | None
    acceleration: float | None = None
    turning: float | None = None
    point: str = ""
    """Of a hidden point, its name."""
    filled: bool = False


@dataclass(frozen=True)
class Scene:
    """A label: its ego, None if it has none, and its objects."""

    ego: Thing | None
    others: tuple[Thing, ...]


def random_thing(chance: random.Random, category: str) -> Thing:
    """An object on a grid."""
    heading = None if chance.random() < 0.12 else chance.randrange(-12, 12) * 15.0
    speed, across, ahead = None, None, None
    if chance.random() < 0.65:
        size = chance.choice((0.0, 0.5, 1.0, 1.0, 2.0, 2.5))
        across, ahead = chance.choice(((0.0, 2 * size), (2 * size, 0.0), (3 * size, 4 * size), (0.0, -2 * size)))
        speed = {(3 * size, 4 * size): 5 * size}.get((across, ahead), 2 * size)
    x, y = (chance.randrange(-12, 13) / 2 for _ in range(2))
    return Thing(category, x, y, heading, speed, across, ahead)


def random_scene(chance: random.Random) -> Scene:
    """A label of up to five objects."""
    ego = None if chance.random() < 0.04 else random_thing(chance, chance.choice(("Car", "Car", "Car", "Truck")))
    kinds = ("Car", "Car", "Car", "Truck", "Pedestrian")
    return Scene(ego, tuple(random_thing(chance, chance.choice(kinds)) for _ in range(chance.randrange(6))))


Curve = Circle | tuple[str, float]


# --- worlds in which a program has a meaning


@dataclass(frozen=True)
class Number:
    """A number.

    Attributes:
        value: What it is.
        exact: Whether it is exact.
        hidden: The hidden number that it is with something added.
        curve: The hidden point, and whether it is its "x" or "y", or the place from which it is the distance.
    """

    value: float
    exact: bool = True
    hidden: str = ""
    curve: tuple[str, str | tuple[float, float]] | None = None


@dataclass
class World:
    """A correspondence with outcomes: what names of a program stand for.

    Attributes:
        things: Who plays whom.
        facing: The headings that the program gives, where it gives one; for labels without.
        numbers: Outcomes of choices, and hidden numbers.
        hidden: Which of these are hidden.
        breaks: Gets values of hidden numbers at which conditions change.
        curves: Gets circles, and lines as "x" or "y" with a number, at which conditions on hidden points change.
    """

    things: Mapping[str, Thing]
    facing: Mapping[str, float]
    numbers: dict[str, float]
    hidden: frozenset[str]
    breaks: dict[str, set[float]] = field(default_factory=dict)
    curves: dict[str, set[Curve]] = field(default_factory=dict)

    def cut(self, point: str, curve: Curve) -> None:
        """Note where something about a hidden point changes."""
        self.curves.setdefault(point, set()).add(curve)


@dataclass(frozen=True)
class Term:
    """A number of a program: its text and its value."""

    text: str
    of: Callable[[World], Number | None]


@dataclass(frozen=True)
class Fact:
    """A condition of a program: its text and its truth."""

    text: str
    of: Callable[[World], Truth]


def negated(value: Truth) -> Truth:
    return (not value) if isinstance(value, bool) else value


def both(values: Sequence[Truth]) -> Truth:
    """The truth of a conjunction."""
    if any(value is False for value in values):
        return False
    if any(value == "either" for value in values):
        return "either"
    return None if any(value is None for value in values) else True


def some(values: Sequence[Truth]) -> Truth:
    """The truth of a disjunction."""
    return negated(both([negated(value) for value in values]))


def compared(op: str, one: Number | None, other: Number | None, world: World) -> Truth:
    """The truth of a comparison."""
    if one is None or other is None:
        return None
    for mine, rest in ((one, other), (other, one)):
        if mine.hidden and not rest.hidden:
            offset = mine.value - world.numbers[mine.hidden]
            world.breaks.setdefault(mine.hidden, set()).add(rest.value - offset)
        if mine.curve is not None and rest.curve is None:
            point, kind = mine.curve
            if isinstance(kind, str):
                world.cut(point, (kind, rest.value))
            elif rest.value > 0:
                world.cut(point, (*kind, rest.value))
    if not (one.exact and other.exact) and abs(one.value - other.value) < _CLOSE:
        return "either"
    a, b = one.value, other.value
    return {"<": a < b, "<=": a <= b, ">": a > b, ">=": a >= b, "==": a == b, "!=": a != b}[op]


def square_root(value: float) -> Number:
    root = math.sqrt(value)
    return Number(root, root * root == value and (4 * root).is_integer())


# --- terms


def constant(value: float) -> Term:
    return Term(f"{value:g}" if value >= 0 else f"({value:g})", lambda world: Number(value))


def drawn(name: str) -> Term:
    """A choice or a hidden number."""
    return Term(name, lambda world: Number(world.numbers[name], hidden=name if name in world.hidden else ""))


def _of(value: float | None) -> Number | None:
    return None if value is None else Number(value)


_PROPERTIES: dict[str, Callable[[Thing], float | None]] = {
    "speed": lambda thing: thing.speed,
    "velocity.x": lambda thing: thing.across,
    "velocity.y": lambda thing: thing.ahead,
    "acceleration": lambda thing: thing.acceleration,
    "angularSpeed": lambda thing: thing.turning,
    "position.x": lambda thing: thing.x,
    "position.y": lambda thing: thing.y,
}


def property_of(role: str, name: str) -> Term:
    def value(world: World) -> Number | None:
        thing = world.things[role]
        found = _of(_PROPERTIES[name](thing))
        return found if found is None or not thing.point else replace(found, curve=(thing.point, name[-1]))

    return Term(f"{role}.{name}", value)


def distance(one: str, other: str) -> Term:
    def value(world: World) -> Number:
        a, b = world.things[one], world.things[other]
        found = square_root((a.x - b.x) ** 2 + (a.y - b.y) ** 2)
        a, b = (b, a) if b.point else (a, b)
        return replace(found, curve=(a.point, (b.x, b.y))) if a.point and not b.point else found

    return Term(f"(distance from {one} to {other})", value)


def total(one: Term, other: Term, sign: int = 1) -> Term:
    def value(world: World) -> Number | None:
        a, b = one.of(world), other.of(world)
        if a is None or b is None:
            return None
        # a sum with two hidden numbers has no breaks of its own
        curve = a.curve if b.curve is None and not b.hidden else None
        return Number(a.value + sign * b.value, a.exact and b.exact, a.hidden if not b.hidden else "", curve)

    return Term(f"({one.text} {'+' if sign > 0 else '-'} {other.text})", value)


def applied(name: str, function: Callable[[float], float], inner: Term) -> Term:
    """`int`, `round` or `abs`."""

    def value(world: World) -> Number | None:
        found = inner.of(world)
        if found is None:
            return None
        return Number(float(function(found.value)), found.exact)

    return Term(f"{name}({inner.text})", value)


def picked(name: str, choose: Callable[[list[float]], float], terms: Sequence[Term]) -> Term:
    """`min`, `max` or an item of `sorted`."""

    def value(world: World) -> Number | None:
        found = [term.of(world) for term in terms]
        known = [each for each in found if each is not None]
        if len(known) < len(found):
            return None
        return Number(choose([each.value for each in known]), all(each.exact for each in known))

    inside = ", ".join(term.text for term in terms)
    return Term(name.format(inside), value)


# --- facts


def comparison(op: str, one: Term, other: Term) -> Fact:
    return Fact(f"({one.text} {op} {other.text})", lambda world: compared(op, one.of(world), other.of(world), world))


def connected(word: str, facts: Sequence[Fact]) -> Fact:
    join = both if word == "and" else some
    return Fact(f"({f' {word} '.join(fact.text for fact in facts)})", lambda w: join([f.of(w) for f in facts]))


def inverted(fact: Fact) -> Fact:
    return Fact(f"(not {fact.text})", lambda world: negated(fact.of(world)))


def conditional(test: Fact, then: Fact, otherwise: Fact, shape: str = "({1} if {0} else {2})") -> Fact:
    def truth(world: World) -> Truth:
        # all are looked at, so that all breaks are found
        known, yes, no = test.of(world), then.of(world), otherwise.of(world)
        return some([both([known, yes]), both([negated(known), no]), both([yes, no])])

    return Fact(shape.format(test.text, then.text, otherwise.text), truth)


def counted(roles: Sequence[str], about: Callable[[str], Fact], op: str, count: int) -> Fact:
    """How many of some roles meet a condition."""

    def truth(world: World) -> Truth:
        values = [about(role).of(world) for role in roles]
        doubt = [value for value in values if not isinstance(value, bool)]
        sure = sum(value is True for value in values)
        answers = {compared(op, Number(sure + more), Number(count), world) for more in range(len(doubt) + 1)}
        if len(answers) == 1:
            return answers.pop()
        return "either" if "either" in doubt else None

    return Fact(f"(len([o for o in ({', '.join(roles)},) if {about('o').text}]) {op} {count})", truth)


def inside(role: str, region: Region) -> Fact:
    def truth(world: World) -> Truth:
        thing = world.things[role]
        if thing.point:
            for curve in region.curves:
                world.cut(thing.point, curve)
        return region.within(thing.x, thing.y)

    return Fact(f"({role}.position in {region.text})", truth)


def inside_drawn(role: str, name: str, options: Sequence[Region]) -> Fact:
    """In a region that is drawn."""
    facts = [inside(role, each) for each in options]

    def truth(world: World) -> Truth:
        for each in facts:
            each.of(world)
        return facts[int(world.numbers[name])].of(world)

    return Fact(f"({role}.position in {name})", truth)


def turned(one: str, other: str, degrees: float) -> Fact:
    def truth(world: World) -> Truth:
        a, b = (_heading(world, role) for role in (one, other))
        if a is None or b is None:
            return "either"
        for mine, rest in ((a, b), (b, a)):
            if mine.hidden and not rest.hidden:
                found = world.breaks.setdefault(mine.hidden, set())
                found.update(rest.value + side * degrees + 360 * turn for side in (-1, 1) for turn in range(-2, 3))
        off = abs(math.remainder(a.value - b.value, 360.0))
        return "either" if abs(off - degrees) < _CLOSE or (a.hidden and b.hidden) else off < degrees

    return Fact(f"(abs(relative heading of {one} from {other}) < {degrees:g} deg)", truth)


def _heading(world: World, role: str) -> Number | None:
    """The heading of a role: the label's, else that of the program, which may be hidden."""
    found = world.things[role].heading
    if found is not None:
        return Number(found)
    if (name := heading_of(role)) in world.hidden:
        return Number(world.numbers[name], hidden=name)
    return _of(world.facing.get(role))


def heading_of(role: str) -> str:
    """The name of the hidden number that the heading of a role is."""
    return f"heading of {role}"


# --- what a program says of objects


@dataclass(frozen=True)
class Region:
    """A disc, or a rectangle along the axes."""

    text: str
    center: tuple[float, float]
    radius: float = 0.0
    half: tuple[float, float] = (0.0, 0.0)

    @property
    def curves(self) -> list[Curve]:
        """Its edge."""
        (x, y), (a, b) = self.center, self.half
        return [(x, y, self.radius)] if self.radius else [("x", x - a), ("x", x + a), ("y", y - b), ("y", y + b)]

    def within(self, x: float, y: float) -> Truth:
        """Whether a point is in it."""
        if self.radius:
            off = math.hypot(x - self.center[0], y - self.center[1]) - self.radius
            exact = (2 * x).is_integer() and (2 * y).is_integer()
            return "either" if abs(off) < _CLOSE and not exact else self.distance_squared(x, y) == 0
        return self.distance_squared(x, y) == 0

    def distance_squared(self, x: float, y: float) -> float:
        """To a point, 0 inside."""
        across, ahead = (abs(p - c) for p, c in zip((x, y), self.center, strict=True))
        if self.radius:
            off = across * across + ahead * ahead
            return 0.0 if off <= self.radius**2 else (math.sqrt(off) - self.radius) ** 2
        return max(across - self.half[0], 0.0) ** 2 + max(ahead - self.half[1], 0.0) ** 2

    def near(self, x: float, y: float) -> Truth:
        """Whether it meets the disc of tolerance around a point."""
        across, ahead = (abs(p - c) for p, c in zip((x, y), self.center, strict=True))
        if self.radius:
            return across * across + ahead * ahead <= (self.radius + TOLERANCE_M) ** 2
        return self.distance_squared(x, y) <= TOLERANCE_M**2


@dataclass(frozen=True)
class Role:
    """An object of a program.

    Attributes:
        name, category: As in the program.
        place: Its position: a region, the name and the options of a drawn one, two terms, or None for everywhere.
        facing: Degrees from and to; None for all.
        speed: What the program sets, None if nothing.
    """

    name: str
    category: str
    place: Region | tuple[str, tuple[Region, ...]] | tuple[Term, Term] | None = None
    facing: tuple[float, float] | None = None
    speed: Term | tuple[float, float] | None = None

    @property
    def text(self) -> str:
        """The statement that makes it."""
        match self.place:
            case Region():
                where = f"in {self.place.text}"
            case (str(name), _):
                where = f"in {name}"
            case (Term() as x, Term() as y):
                where = f"at ({x.text}, {y.text})"
            case _:
                where = "in everywhere"
        low, high = self.facing or (0.0, 360.0)
        facing = f"facing {low:g} deg" if low == high else f"facing Range({low:g}, {high:g}) deg"
        speed = ""
        if isinstance(self.speed, Term):
            speed = f", with speed {self.speed.text}"
        elif self.speed is not None:
            speed = f", with speed Range({self.speed[0]:g}, {self.speed[1]:g})"
        return f"{self.name} = new {self.category} {where}, {facing}{speed}"

    def holds(self, world: World) -> Truth:
        """Whether what is compared is within tolerance."""
        thing = world.things[self.name]
        found: list[Truth] = []
        match self.place:
            case Region():
                found.append(self.place.near(thing.x, thing.y))
            case (str(name), options):
                found.append(options[int(world.numbers[name])].near(thing.x, thing.y))
            case (Term() as x, Term() as y):
                found.append(self._near(world, x.of(world), y.of(world)))
            case _:
                pass
        if self.facing is not None and thing.heading is not None:
            low, high = self.facing
            off = math.remainder(thing.heading - (low + high) / 2, 360.0)
            found.append(abs(off) <= (high - low) / 2 + TOLERANCE_DEG)
        if self.speed is not None and thing.speed is not None and not thing.filled:
            found.append(self._fast(world, thing.speed))
        return both(found)

    def _near(self, world: World, x: Number | None, y: Number | None) -> Truth:
        if x is None or y is None:
            return None
        thing = world.things[self.name]
        off = (thing.x - x.value, thing.y - y.value)
        for number, mine, other in ((x, off[0], off[1]), (y, off[1], off[0])):
            if number.hidden and abs(other) <= TOLERANCE_M:
                best = world.numbers[number.hidden] + mine
                reach = math.sqrt(TOLERANCE_M**2 - other * other)
                world.breaks.setdefault(number.hidden, set()).update((best - reach, best, best + reach))
        if x.curve is not None and y.curve is not None:
            # the point is what it adds to less than the number: (value - point) is known
            point = world.things[x.curve[0]]
            middle = thing.x - (x.value - point.x), thing.y - (y.value - point.y)
            world.cut(x.curve[0], (*middle, TOLERANCE_M))
        squared = off[0] ** 2 + off[1] ** 2
        exact = x.exact and y.exact and all((value * 64).is_integer() for value in off)
        if not exact and abs(squared - TOLERANCE_M**2) < _CLOSE:
            return "either"
        return squared <= TOLERANCE_M**2

    def _fast(self, world: World, speed: float) -> Truth:
        if isinstance(self.speed, tuple):
            return self.speed[0] - TOLERANCE_SPEED <= speed <= self.speed[1] + TOLERANCE_SPEED
        assert self.speed is not None
        low = compared("<=", total(self.speed, constant(-TOLERANCE_SPEED)).of(world), Number(speed), world)
        return both([low, compared(">=", total(self.speed, constant(TOLERANCE_SPEED)).of(world), Number(speed), world)])


@dataclass(frozen=True)
class Program:
    """A program.

    Attributes:
        choices: Outcomes of each choice, and its text.
        hidden: The ends of each hidden number.
        nested: Choices that hang on others: the options of each by their values, and its text.
        regions: Choices of regions: their options.
        objects: Choices of objects: their options.
        points: Hidden points, and where they are.
        hoped: What is required with a probability, which excludes nothing.
        roles: The objects, the ego first.
        required: What is required.
    """

    choices: Mapping[str, tuple[tuple[float, ...], str]]
    hidden: Mapping[str, tuple[float, float]]
    roles: tuple[Role, ...]
    required: tuple[Fact, ...]
    nested: Mapping[str, tuple[tuple[Term, ...], str]] = field(default_factory=dict)
    regions: Mapping[str, tuple[Region, ...]] = field(default_factory=dict)
    objects: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    points: Mapping[str, tuple[Region, str]] = field(default_factory=dict)
    hoped: tuple[Fact, ...] = ()

    @property
    def plain(self) -> list[Fact]:
        """What is required that hangs on no hidden point."""
        return [fact for fact in self.required if not re.search(r"\bp\b", fact.text)]

    @property
    def text(self) -> str:
        """The program."""
        lines = ["model scenic.domains.driving.model"]
        lines += [f"{name} = {text}" for name, (_, text) in self.choices.items() if text]
        lines += [f"{name} = Range({low:g}, {high:g})" for name, (low, high) in self.hidden.items()]
        lines += [f"{name} = {text}" for name, (_, text) in self.nested.items()]
        lines += [
            f"{name} = Uniform({', '.join(each.text for each in options)})" for name, options in self.regions.items()
        ]
        lines += [f"{name} = new Point {text}" for name, (_, text) in self.points.items()]
        lines += ["def faster(o, c):", "    if o.speed > c:", "        return True", "    return False"]
        lines += [role.text for role in self.roles]
        lines += [f"{name} = Uniform({', '.join(options)})" for name, options in self.objects.items()]
        lines += [f"require[0.5] {fact.text}" for fact in self.hoped]
        lines += [f"require {fact.text}" for fact in self.required]
        return "\n".join(lines) + "\n"


# --- random programs

_OPERATORS = ("<", "<=", ">", ">=", "<", ">", "==", "!=")


class Maker:
    """Makes one program."""

    def __init__(self, chance: random.Random) -> None:
        self.chance = chance
        self.choices: dict[str, tuple[tuple[float, ...], str]] = {}
        self.hidden: dict[str, tuple[float, float]] = {}
        self.nested: dict[str, tuple[tuple[Term, ...], str]] = {}
        self.regions: dict[str, tuple[Region, ...]] = {}
        self.objects: dict[str, tuple[str, ...]] = {}
        self.points: dict[str, tuple[Region, str]] = {}

    def program(self) -> Program:
        chance = self.chance
        if chance.random() < 0.35:
            options = tuple(dict.fromkeys(chance.randrange(-6, 7) / 1.0 for _ in range(chance.choice((2, 3)))))
            listed = ", ".join(f"{each:g}" for each in options)
            weighted = ", ".join(f"{each:g}: {chance.choice((1, 2))}" for each in options)
            text = chance.choice((f"Uniform({listed})", f"Discrete({{{weighted}, 77: 0}})"))
            self.choices["k"] = options, text
            if chance.random() < 0.3:
                low = chance.randrange(-2, 3)
                self.choices["n"] = tuple(map(float, range(low, low + 3))), f"DiscreteRange({low}, {low + 2})"
        if chance.random() < 0.45:
            low = chance.randrange(-8, 8) / 2
            self.hidden["d"] = low, low + chance.choice((1.0, 2.0, 4.5))
            if chance.random() < 0.3:
                low = chance.randrange(-8, 8) / 2
                self.hidden["e"] = low, low + chance.choice((1.0, 3.0))
        known = (*self.choices, *self.hidden)
        if known and chance.random() < 0.3:
            one = chance.choice(known)
            terms = (drawn(one), total(drawn(one), constant(2.0)), constant(chance.randrange(-3, 4) / 1.0))
            self.choices["m index"] = (0.0, 1.0, 2.0), ""
            self.nested["m"] = terms, f"Uniform({', '.join(each.text for each in terms)})"
        if chance.random() < 0.15:
            self.regions["w"] = tuple(self._region() for _ in range(2))
            self.choices["w"] = (0.0, 1.0), ""
        if not self.hidden and chance.random() < 0.4:
            region = self._region()
            text = f"in {region.text}"
            if not region.radius and chance.random() < 0.5:
                (x, y), (a, b) = region.center, region.half
                text = f"at (Range({x - a:g}, {x + a:g}), Range({y - b:g}, {y + b:g}))"
            self.points["p"] = region, text
        names = ["ego", *(f"o{number}" for number in range(chance.choice((0, 1, 1, 2, 2, 3))))]
        alike = Role("", "Car") if chance.random() < 0.3 else None
        roles: list[Role] = []
        for number, name in enumerate(names):
            if number and alike is not None:
                roles.append(Role(name, "Car"))
            else:
                roles.append(self._role(name, names[:number]))
        if len(names) > 1 and chance.random() < 0.15:
            some = tuple(chance.sample(names, 2))
            self.objects["t"], self.choices["t"] = some, ((0.0, 1.0), "")
        required = tuple(self._fact(names, 2) for _ in range(chance.choice((0, 1, 1, 2, 3))))
        hoped = (self._fact(names, 1),) if chance.random() < 0.05 else ()
        return Program(
            self.choices,
            self.hidden,
            tuple(roles),
            required,
            self.nested,
            self.regions,
            self.objects,
            self.points,
            hoped,
        )

    def _role(self, name: str, before: Sequence[str]) -> Role:
        chance = self.chance
        category = chance.choice(("Car", "Car", "Vehicle")) if name == "ego" else chance.choice(tuple(CLASSES))
        place: Region | tuple[str, tuple[Region, ...]] | tuple[Term, Term] | None = None
        kind = chance.random()
        if self.points and chance.random() < 0.35:
            offset = (constant(chance.randrange(-6, 7) / 2) for _ in range(2))
            parts = (property_of("p", "position.x"), property_of("p", "position.y"))
            x, y = (total(part, off) for part, off in zip(parts, offset, strict=True))
            place = x, y
        elif self.regions and chance.random() < 0.4:
            place = "w", self.regions["w"]
        elif kind < 0.35:
            place = self._region()
        elif kind < 0.55 and before:
            owner = chance.choice(before)
            place = (
                total(property_of(owner, "position.x"), self._offset()),
                total(property_of(owner, "position.y"), constant(chance.randrange(-6, 7) / 2)),
            )
            if chance.random() < 0.15:
                place = place[0], total(property_of(owner, "position.y"), property_of(owner, "speed"))
        elif kind < 0.6:
            place = (self._offset(), constant(chance.randrange(-12, 13) / 2 + chance.choice((0.0, 0.25))))
        facing: tuple[float, float] | None = None
        if chance.random() < 0.25:
            low = chance.randrange(-12, 12) * 15.0 + 2
            facing = low, low + chance.choice((0.0, 45.0, 120.0, 200.0))
        speed: Term | tuple[float, float] | None = None
        if chance.random() < 0.15:
            low = chance.randrange(0, 6) / 1.0
            names = [constant(low), *map(self._drawn, self._numbers())]
            speed = chance.choice((chance.choice(names), (low, low + 2)))
        return Role(name, category, place, facing, speed)

    def _offset(self) -> Term:
        names = self._numbers()
        if names and self.chance.random() < 0.5:
            return self._drawn(self.chance.choice(names))
        return constant(self.chance.randrange(-12, 13) / 4)

    def _numbers(self) -> list[str]:
        """The names of choices of numbers, and of hidden numbers."""
        named = [name for name, (_, text) in self.choices.items() if text]
        return [*named, *self.hidden, *self.nested]

    def _drawn(self, name: str) -> Term:
        """The number that a name stands for."""
        if name not in self.nested:
            return drawn(name)
        terms = self.nested[name][0]
        return Term(name, lambda world: terms[int(world.numbers[f"{name} index"])].of(world))

    def _about_drawn(self, names: Sequence[str]) -> list[Fact]:
        """Conditions about what is drawn and no number: one of each kind that there is."""
        chance = self.chance
        found: list[Fact] = []
        op, bound = chance.choice(_OPERATORS[:4]), constant(chance.randrange(-6, 7) / 2)
        if self.regions:
            found.append(inside_drawn(chance.choice(names), "w", self.regions["w"]))
        if self.objects:
            name = chance.choice(("speed", "position.x", "position.y"))
            options = [comparison(op, property_of(each, name), bound) for each in self.objects["t"]]

            def truth(world: World) -> Truth:
                return [each.of(world) for each in options][int(world.numbers["t"])]

            found.append(Fact(f"(t.{name} {op} {bound.text})", truth))
        if self.points:
            reach = constant(chance.choice((1.0, 2.5, 4.0)))
            found += [
                comparison(op, property_of("p", chance.choice(("position.x", "position.y"))), bound),
                comparison(op, distance("p", chance.choice(names)), reach),
                inside("p", self._region()),
                comparison(op, property_of("p", "position.x"), property_of(chance.choice(names), "position.x")),
            ]
        return found

    def _region(self) -> Region:
        chance = self.chance
        x, y = (chance.randrange(-12, 13) / 2 for _ in range(2))
        if chance.random() < 0.5:
            radius = chance.choice((2.0, 4.5, 5.0, 7.25))
            return Region(f"CircularRegion(({x:g}, {y:g}), {radius:g})", (x, y), radius)
        width, length = chance.choice((2.0, 6.0, 9.5)), chance.choice((3.0, 8.0, 12.0))
        text = f"RectangularRegion(({x:g}, {y:g}), 0, {width:g}, {length:g})"
        return Region(text, (x, y), half=(width / 2, length / 2))

    def _term(self, names: Sequence[str], depth: int = 1) -> Term:
        chance = self.chance
        one = chance.choice(names)
        kind = chance.random()
        if kind < 0.5:
            measured = property_of(one, chance.choice(("speed", "speed", "speed", "speed", "velocity.y", "velocity.x")))
            if chance.random() < 0.06:
                measured = property_of(one, chance.choice(("acceleration", "angularSpeed")))
        elif kind < 0.75:
            measured = property_of(one, chance.choice(("position.x", "position.y")))
        elif len(names) > 1:
            measured = distance(*chance.sample(names, 2))
        else:
            measured = property_of(one, "position.x")
        shape = chance.random()
        if depth and shape < 0.12:
            name, function = chance.choice((("int", int), ("round", round), ("abs", abs)))
            return applied(name, function, measured)
        if depth and shape < 0.24:
            terms = [measured, *(self._term(names, 0) for _ in range(chance.choice((1, 2))))]
            name, choose = chance.choice(
                (("min({})", min), ("max({})", max), ("sorted([{}])[0]", min), ("sorted([{}])[-1]", max))
            )
            return picked(name, choose, terms)
        if depth and shape < 0.3:
            return total(measured, self._term(names, 0), chance.choice((1, -1)))
        return measured

    def _bound(self, names: Sequence[str]) -> Term:
        chance = self.chance
        known = self._numbers()
        if known and chance.random() < 0.4:
            name = chance.choice(known)
            one = self._drawn(name)
            return one if chance.random() < 0.7 else total(one, constant(chance.randrange(-4, 5) / 2))
        return constant(chance.randrange(-4, 13) / 2) if chance.random() < 0.8 else self._term(names, 0)

    def _atom(self, names: Sequence[str]) -> Fact:
        chance = self.chance
        kind = chance.random()
        if (drawn_ones := self._about_drawn(names)) and chance.random() < 0.5:
            return chance.choice(drawn_ones)
        if kind < 0.1:
            return inside(chance.choice(names), self._region())
        if kind < 0.17 and len(names) > 1:
            return turned(*chance.sample(names, 2), chance.choice((20.0, 50.0, 100.0)))
        if kind < 0.27:
            op, bound = chance.choice(_OPERATORS[:4]), constant(chance.randrange(0, 8) / 1.0)

            def about(role: str) -> Fact:
                return comparison(op, property_of(role, "speed"), bound)

            return counted(names, about, chance.choice(("==", ">=", "<")), chance.randrange(0, len(names) + 1))
        if kind < 0.33:
            name, bound = chance.choice(names), chance.randrange(0, 6) / 1.0
            fast = comparison(">", property_of(name, "speed"), constant(bound))
            return Fact(f"faster({name}, {bound:g})", fast.of)
        return comparison(chance.choice(_OPERATORS), self._term(names), self._bound(names))

    def _fact(self, names: Sequence[str], depth: int) -> Fact:
        chance = self.chance
        kind = chance.random()
        if depth == 0 or kind < 0.45:
            return self._atom(names)
        if kind < 0.75:
            parts = [self._fact(names, depth - 1) for _ in range(chance.choice((2, 2, 3)))]
            return connected(chance.choice(("and", "or", "or")), parts)
        if kind < 0.87:
            return inverted(self._fact(names, depth - 1))
        return conditional(self._atom(names), self._fact(names, depth - 1), self._fact(names, depth - 1))


# --- the judge


class TooManyError(Exception):
    """There are too many cases to go through."""


Correspondence = tuple[int, ...]
"""Which object of a label plays each role but the ego, in order."""


def judged(program: Program, scene: Scene) -> Truth:
    """Whether a label matches, as far as what it observes tells (Kleene's logic)."""
    found = judged_each(program, scene, first=True)
    return some(list(found.values())) if found else False


def judged_each(program: Program, scene: Scene, *, first: bool = False) -> dict[Correspondence, Truth]:
    """Whether a label matches by each correspondence; not more than the first by which it does, if that is enough."""
    found: dict[Correspondence, Truth] = {}
    if scene.ego is None:
        return found
    # the ego of a program is the label's, whatever its class
    ego, *others = program.roles
    for chosen in itertools.permutations(range(len(scene.others)), len(others)):
        things = [scene.others[number] for number in chosen]
        if all(thing.category in CLASSES[role.category] for role, thing in zip(others, things, strict=True)):
            named = {role.name: thing for role, thing in zip(others, things, strict=True)}
            found[chosen] = _with(program, {ego.name: scene.ego, **named})
            if first and found[chosen] is True:
                break
    return found


def _with(program: Program, things: Mapping[str, Thing]) -> Truth:
    """Whether a correspondence matches with some outcomes."""
    facing = {role.name: role.facing[0] for role in program.roles if role.facing and role.facing[0] == role.facing[1]}
    hidden = dict(program.hidden)
    for role in program.roles:
        if things[role.name].heading is None and role.name not in facing:
            hidden[heading_of(role.name)] = role.facing or (0.0, 360.0)
    middles = {
        name: Thing("Point", *region.center, *[None] * 4, point=name) for name, (region, _) in program.points.items()
    }
    found: list[Truth] = []
    for outcome in itertools.product(*(options for options, _ in program.choices.values())):
        chosen = dict(zip(program.choices, outcome, strict=True))
        start = chosen | {name: low for name, (low, _) in hidden.items()}
        world = World({**things, **middles}, facing, start, frozenset(hidden))
        if both([each.of(world) for each in program.plain]) is False and not (program.hidden or world.breaks):
            found.append(False)
            continue
        _holds(program, world)
        values = [
            [low] if name not in program.hidden and name not in world.breaks
            else _values(low, high, world.breaks.get(name, set()))
            for name, (low, high) in hidden.items()
        ]  # fmt: skip
        places = [_places(name, region, world.curves.get(name, set())) for name, (region, _) in program.points.items()]
        if math.prod(map(len, [*values, *places])) > _MOST_TRIALS:
            raise TooManyError
        for numbers, points in itertools.product(itertools.product(*values), itertools.product(*places)):
            numbered = chosen | dict(zip(hidden, numbers, strict=True))
            placed = {**things, **{each.point: each for each in points}}
            found.append(_holds(program, World(placed, facing, numbered, world.hidden)))
            if found[-1] is True:
                return True
    return some(found)


def _places(name: str, region: Region, curves: set[Curve]) -> list[Thing]:
    """Where a hidden point may be, once in each piece that conditions on it cut."""
    every = [*curves, *region.curves]
    lines = {axis: [each[1] for each in every if each[0] == axis] for axis in ("x", "y")}
    circles = [each for each in every if len(each) == 3]
    found = representatives(circles, lines["x"], lines["y"]).tolist()
    return [Thing("Point", x, y, *[None] * 4, point=name) for x, y in found if region.within(x, y) is True]


def _holds(program: Program, world: World) -> Truth:
    return both([role.holds(world) for role in program.roles] + [fact.of(world) for fact in program.required])


def _values(low: float, high: float, breaks: set[float]) -> list[float]:
    """Where conditions on a hidden number change, and what lies between."""
    ends = sorted({low, high, *(each for each in breaks if low <= each <= high)})
    return sorted({*ends, *((a + b) / 2 for a, b in itertools.pairwise(ends))})


def fillings(scene: Scene, chance: random.Random) -> Iterator[Scene]:
    """The label with what it does not observe of motion, in many ways."""
    for number in range(_FILLINGS):
        yield Scene(
            scene.ego and _filled(scene.ego, chance, number),
            tuple(_filled(each, chance, number) for each in scene.others),
        )


def _filled(thing: Thing, chance: random.Random, number: int) -> Thing:
    if thing.speed is None:
        size = (0.0, 60.0)[number] if number < 2 else chance.choice((0.0, 0.75, 2.25, 3.75, 5.25, 8.25))
        ways = ((0.0, size), (size, 0.0), (0.0, -size), (-size, 0.0), (size * 0.6, size * 0.8))
        across, ahead = chance.choice(ways)
        thing = replace(thing, speed=size, across=across, ahead=ahead, filled=True)
    rates = (chance.choice((-20.0, -1.25, 0.25, 1.75, 20.0)) for _ in range(2))
    return replace(thing, acceleration=next(rates), turning=next(rates))


def possible(program: Program, scene: Scene, chance: random.Random) -> set[Truth]:
    """What a label may turn out to be, whatever it does not observe."""
    known = judged(program, scene)
    return {known} if known is not None else {judged(program, filled) for filled in fillings(scene, chance)}


def wrong_answer(found: set[Truth], answer: bool | None) -> str:
    """What is wrong with an answer (None: unknown): "" if nothing is, "?" where rounding decides.

    "unneeded" is an unknown where no two fillings differ.
    """
    if "either" in found:
        return "?"
    if answer is None:
        return "unneeded" if len(found) == 1 else ""
    return "" if found == {answer} else f"may be {' and '.join(map(str, found))}"


def wrong_correspondences(program: Program, scene: Scene, told: set[Correspondence]) -> str:
    """What is wrong with all by which a label is told to match; "" if nothing is.

    One that is not told must be another order of interchangeable roles: of all of the label, each is what the other is.
    """
    truths = judged_each(program, scene)
    for each in told:
        if truths.get(each, False) is False:
            return f"{each} is none of the matches"
    for each, truth in truths.items():
        if truth is not True or each in told:
            continue
        for order in itertools.permutations(range(len(each))):
            if tuple(each[place] for place in order) in told and all(
                truths.get(tuple(other[place] for place in order)) == value for other, value in truths.items()
            ):
                break
        else:
            return f"{each} is a match that is not told"
    return ""
