"""Random programs over random labels, judged straight from the definition of a match.

A program is made as a value that has a text and a meaning of its own; no code of the package takes part in the judging.
A label matches if there are a correspondence, outcomes of choices and values of hidden numbers with which all that is
compared and required holds. What a label does not observe of motion is filled in at random, many times: where two
fillings differ, the only right answer is unknown. Numbers are whole or halves, so that bounds are hit exactly; what
comes close to a bound without hitting it is left out, as are bounds of angles.
"""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

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
    """A label object; None is what nobody observed. Degrees, metres, metres a second."""

    category: str
    x: float
    y: float
    heading: float | None
    speed: float | None
    across: float | None
    ahead: float | None
    acceleration: float | None = None
    turning: float | None = None


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


# --- worlds in which a program has a meaning


@dataclass(frozen=True)
class Number:
    """A number; whether it is exact, and the hidden number that it is with something added."""

    value: float
    exact: bool = True
    hidden: str = ""


@dataclass
class World:
    """A correspondence with outcomes: what names of a program stand for.

    Attributes:
        things: Who plays whom.
        facing: The headings that the program gives, where it gives one; for labels without.
        numbers: Outcomes of choices, and hidden numbers.
        hidden: Which of these are hidden.
        breaks: Gets values of hidden numbers at which conditions change.
    """

    things: Mapping[str, Thing]
    facing: Mapping[str, float]
    numbers: dict[str, float]
    hidden: frozenset[str]
    breaks: dict[str, set[float]] = field(default_factory=dict)


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
    return Term(f"{role}.{name}", lambda world: _of(_PROPERTIES[name](world.things[role])))


def distance(one: str, other: str) -> Term:
    def value(world: World) -> Number:
        a, b = world.things[one], world.things[other]
        return square_root((a.x - b.x) ** 2 + (a.y - b.y) ** 2)

    return Term(f"(distance from {one} to {other})", value)


def total(one: Term, other: Term, sign: int = 1) -> Term:
    def value(world: World) -> Number | None:
        a, b = one.of(world), other.of(world)
        if a is None or b is None:
            return None
        # a sum with two hidden numbers has no breaks of its own
        return Number(a.value + sign * b.value, a.exact and b.exact, a.hidden if not b.hidden else "")

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
        return region.distance_squared(thing.x, thing.y) == 0

    return Fact(f"({role}.position in {region.text})", truth)


def turned(one: str, other: str, degrees: float) -> Fact:
    def truth(world: World) -> Truth:
        a, b = (_heading(world, role) for role in (one, other))
        return "either" if a is None or b is None else abs(math.remainder(a - b, 360.0)) < degrees

    return Fact(f"(abs(relative heading of {one} from {other}) < {degrees:g} deg)", truth)


def _heading(world: World, role: str) -> float | None:
    """The heading of a role: the label's, else that of the program if it has one alone."""
    found = world.things[role].heading
    return world.facing.get(role) if found is None else found


# --- what a program says of objects


@dataclass(frozen=True)
class Region:
    """A disc, or a rectangle along the axes."""

    text: str
    center: tuple[float, float]
    radius: float = 0.0
    half: tuple[float, float] = (0.0, 0.0)

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
        place: Its position: a region, two terms, or None for everywhere.
        facing: Degrees from and to; None for all.
        speed: What the program sets, None if nothing.
    """

    name: str
    category: str
    place: Region | tuple[Term, Term] | None = None
    facing: tuple[float, float] | None = None
    speed: Term | tuple[float, float] | None = None

    @property
    def text(self) -> str:
        """The statement that makes it."""
        match self.place:
            case Region():
                where = f"in {self.place.text}"
            case (x, y):
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
            case (x, y):
                found.append(self._near(world, x.of(world), y.of(world)))
            case _:
                pass
        if self.facing is not None and thing.heading is not None:
            low, high = self.facing
            off = math.remainder(thing.heading - (low + high) / 2, 360.0)
            found.append(abs(off) <= (high - low) / 2 + TOLERANCE_DEG)
        if self.speed is not None and thing.speed is not None:
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
        roles: The objects, the ego first.
        required: What is required.
    """

    choices: Mapping[str, tuple[tuple[float, ...], str]]
    hidden: Mapping[str, tuple[float, float]]
    roles: tuple[Role, ...]
    required: tuple[Fact, ...]

    @property
    def text(self) -> str:
        """The program."""
        lines = ["model scenic.domains.driving.model"]
        lines += [f"{name} = {text}" for name, (_, text) in self.choices.items()]
        lines += [f"{name} = Range({low:g}, {high:g})" for name, (low, high) in self.hidden.items()]
        lines += ["def faster(o, c):", "    if o.speed > c:", "        return True", "    return False"]
        lines += [role.text for role in self.roles]
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

    def program(self) -> Program:
        chance = self.chance
        if chance.random() < 0.3:
            options = tuple(chance.randrange(-6, 7) / 1.0 for _ in range(chance.choice((2, 3))))
            listed = ", ".join(f"{each:g}" for each in options)
            self.choices["k"] = options, f"Uniform({listed})"
            if chance.random() < 0.3:
                self.choices["n"] = (1.0, 2.0, 3.0), "DiscreteRange(1, 3)"
        if chance.random() < 0.45:
            low = chance.randrange(-8, 8) / 2
            self.hidden["d"] = low, low + chance.choice((1.0, 2.0, 4.5))
            if chance.random() < 0.3:
                low = chance.randrange(-8, 8) / 2
                self.hidden["e"] = low, low + chance.choice((1.0, 3.0))
        names = ["ego", *(f"o{number}" for number in range(chance.choice((0, 1, 1, 2, 2, 3))))]
        alike = Role("", "Car") if chance.random() < 0.3 else None
        roles: list[Role] = []
        for number, name in enumerate(names):
            if number and alike is not None:
                roles.append(Role(name, "Car"))
            else:
                roles.append(self._role(name, names[:number]))
        required = tuple(self._fact(names, 2) for _ in range(chance.choice((0, 1, 1, 2, 3))))
        return Program(self.choices, self.hidden, tuple(roles), required)

    def _role(self, name: str, before: Sequence[str]) -> Role:
        chance = self.chance
        category = chance.choice(("Car", "Car", "Vehicle")) if name == "ego" else chance.choice(tuple(CLASSES))
        place: Region | tuple[Term, Term] | None = None
        kind = chance.random()
        if kind < 0.35:
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
            names = [constant(low), *map(drawn, (*self.choices, *self.hidden))]
            speed = chance.choice((chance.choice(names), (low, low + 2)))
        return Role(name, category, place, facing, speed)

    def _offset(self) -> Term:
        names = (*self.choices, *self.hidden)
        if names and self.chance.random() < 0.5:
            return drawn(self.chance.choice(names))
        return constant(self.chance.randrange(-12, 13) / 4)

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
        known = (*self.choices, *self.hidden)
        if known and chance.random() < 0.4:
            name = chance.choice(known)
            return drawn(name) if chance.random() < 0.7 else total(drawn(name), constant(chance.randrange(-4, 5) / 2))
        return constant(chance.randrange(-4, 13) / 2) if chance.random() < 0.8 else self._term(names, 0)

    def _atom(self, names: Sequence[str]) -> Fact:
        chance = self.chance
        kind = chance.random()
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


def judged(program: Program, scene: Scene) -> Truth:
    """Whether a label matches, as far as what it observes tells (Kleene's logic)."""
    if scene.ego is None:
        return False
    found = [_with(program, things) for things in _correspondences(program, scene)]
    return some(found) if found else False


def _correspondences(program: Program, scene: Scene) -> Iterator[dict[str, Thing]]:
    # the ego of a program is the label's, whatever its class
    ego, *others = program.roles
    assert scene.ego is not None
    for chosen in itertools.permutations(range(len(scene.others)), len(others)):
        things = [scene.others[number] for number in chosen]
        if all(thing.category in CLASSES[role.category] for role, thing in zip(others, things, strict=True)):
            yield {ego.name: scene.ego} | {role.name: thing for role, thing in zip(others, things, strict=True)}


def _with(program: Program, things: Mapping[str, Thing]) -> Truth:
    """Whether a correspondence matches with some outcomes."""
    facing = {role.name: role.facing[0] for role in program.roles if role.facing and role.facing[0] == role.facing[1]}
    found: list[Truth] = []
    for outcome in itertools.product(*(options for options, _ in program.choices.values())):
        chosen = dict(zip(program.choices, outcome, strict=True))
        start = chosen | {name: low for name, (low, _) in program.hidden.items()}
        world = World(things, facing, start, frozenset(program.hidden))
        _holds(program, world)
        values = [_values(*program.hidden[name], world.breaks.get(name, set())) for name in program.hidden]
        if math.prod(map(len, values)) > _MOST_TRIALS:
            raise TooManyError
        for numbers in itertools.product(*values):
            world = World(things, facing, chosen | dict(zip(program.hidden, numbers, strict=True)), world.hidden)
            found.append(_holds(program, world))
            if found[-1] is True:
                return True
    return some(found)


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
        across, ahead = chance.choice(((0.0, size), (size, 0.0), (0.0, -size), (-size, 0.0)))
        thing = Thing(thing.category, thing.x, thing.y, thing.heading, size, across, ahead)
    rates = (chance.choice((-20.0, -1.25, 0.25, 1.75, 20.0)) for _ in range(2))
    return Thing(
        thing.category, thing.x, thing.y, thing.heading, thing.speed, thing.across, thing.ahead, *rates
    )  # fmt: skip


def unmatched_answers(program: Program, scene: Scene, answer: bool | None, chance: random.Random) -> str:
    """What is wrong with an answer (None: unknown): "" if nothing is, "?" where rounding decides.

    "unneeded" is an unknown where no two fillings differ.
    """
    known = judged(program, scene)
    if known == "either":
        return "?"
    if known is not None:
        return "" if answer is known else "unneeded" if answer is None else f"is {known}"
    found = {judged(program, filled) for filled in fillings(scene, chance)}
    if "either" in found:
        return "?"
    if answer is None:
        return "unneeded" if len(found) == 1 else ""
    return "" if found == {answer} else f"may be {' and '.join(map(str, found))}"
