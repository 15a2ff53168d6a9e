"""Random expressions of Scenic, each with a bound on how far its value may be from one scene to another.

The bound holds where the positions, headings and sizes of all objects made before are as in the scene at hand, so that
it says how far an object must be displaced to be outside of what the program allows.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from dataclasses import dataclass, field, replace

ANY = math.inf
MAP_SIZE = 1000.0
"""Metres across the map, and more."""


@dataclass(frozen=True)
class Term:
    """An expression.

    Attributes:
        text: Of the expression, in parentheses where it needs them.
        spread: How far two of its values may be apart: a number, an angle in radians, or a distance.
        size: A bound on the absolute value, or on the distance from the origin.
        turn: The spread of its heading, where it has one.
    """

    text: str
    spread: float = 0.0
    size: float = ANY
    turn: float = 0.0


@dataclass(frozen=True)
class Thing:
    """A named point, oriented point or object of the program.

    Attributes:
        name: Of the variable.
        spread, turn: As of a term; 0 for the objects of a label, whose places are observed.
        oriented: Whether it has a heading.
        is_object: Whether it has a size.
    """

    name: str
    spread: float = 0.0
    turn: float = 0.0
    oriented: bool = True
    is_object: bool = False


def turned(by: Term, turn: float) -> float:
    """The spread of an offset that a heading of some spread turns."""
    if turn == 0:
        return by.spread
    return by.spread + by.size * min(2.0, turn)


def product(a: Term, b: Term) -> float:
    """The spread of a product."""
    parts = [one.spread * other.size for one, other in ((a, b), (b, a)) if one.spread > 0 and other.size > 0]
    return sum(parts)


@dataclass
class Terms:
    """Writes expressions.

    Attributes:
        rng: What decides.
        driving: Whether the program has a road network.
        lines: The program so far; expressions may need statements before.
        things: What has been made so far.
        hidden: Named random numbers so far.
        polylines: Names of polylines whose orientation is a field.
        functions: Names of functions of one number, which at most double it.
        on_road: Names of objects that certainly are on the road.
    """

    rng: random.Random
    driving: bool
    lines: list[str] = field(default_factory=list[str])
    things: list[Thing] = field(default_factory=list[Thing])
    hidden: list[Term] = field(default_factory=list[Term])
    polylines: list[str] = field(default_factory=list[str])
    functions: list[str] = field(default_factory=list[str])
    on_road: set[str] = field(default_factory=set[str])

    def pick(self, options: list[Callable[[], Term]]) -> Term:
        """One of several ways to go on."""
        return self.rng.choice(options)()

    def chance(self, share: float) -> bool:
        """True with that probability."""
        return self.rng.random() < share

    def value(self, low: float, high: float) -> float:
        """A number with few digits."""
        return round(self.rng.uniform(low, high), self.rng.choice((0, 1, 2)))

    # --- numbers

    def constant(self, low: float, high: float) -> Term:
        """A number as it is written."""
        value = self.value(low, high)
        return Term(f"({value})" if value < 0 else f"{value}", 0.0, abs(value))

    def distribution(self, low: float, high: float) -> Term:
        """A random number, mostly between the two."""
        a, b = sorted((self.value(low, high), self.value(low, high)))
        size, middle, deviation = max(abs(a), abs(b)), self.value(low, high), max(0.1, abs(high - low) / 8)
        ints = int(a), int(a) + self.rng.randint(1, 4)
        some = [self.value(low, high) for _ in range(self.rng.randint(2, 4))]
        weighted = ", ".join(f"{value}: {self.rng.randint(1, 3)}" for value in dict.fromkeys(some))
        most, apart = max(map(abs, some)), max(some) - min(some)
        return self.rng.choice(
            [
                Term(f"Range({a}, {b})", b - a, size),
                Term(f"Range({b}, {a})", b - a, size),
                Term(f"Normal({middle}, {deviation:.2f})", ANY),
                Term(f"TruncatedNormal({middle}, {deviation:.2f}, {a}, {b + 0.1})", b - a + 0.1, size + 0.1),
                Term(f"DiscreteRange{ints}", ints[1] - ints[0], max(map(abs, ints))),
                Term(f"Uniform({', '.join(map(str, some))})", apart, most),
                Term(f"Uniform(*{some})", apart, most),
                Term(f"Options({some})", apart, most),
                Term(f"Discrete({{{weighted}}})", apart, most),
                Term(f"Uniform(Range({a}, {b}), {middle})", ANY),
            ]
        )

    def number(self, low: float, high: float, depth: int = 1) -> Term:
        """A number, mostly between the two."""
        options: list[Callable[[], Term]] = [
            lambda: self.constant(low, high),
            lambda: self.distribution(low, high),
            lambda: self.named(low, high),
        ]
        if depth > 0:
            options += [lambda: self.arithmetic(low, high, depth), lambda: self.measure(depth)]
            options += [lambda: self.python(low, high, depth)]
        return self.pick(options)

    def named(self, low: float, high: float) -> Term:
        """A random number with a name, or one that has been used before."""
        if self.hidden and self.chance(0.5):
            return self.rng.choice(self.hidden)
        if self.hidden and self.chance(0.2):
            old = self.rng.choice(self.hidden)
            new = replace(old, text=f"v{len(self.hidden)}")
            self.lines.append(f"{new.text} = resample({old.text})")
        else:
            drawn = self.distribution(low, high)
            new = replace(drawn, text=f"v{len(self.hidden)}")
            self.lines.append(f"{new.text} = {drawn.text}")
        self.hidden.append(new)
        return new

    def arithmetic(self, low: float, high: float, depth: int) -> Term:
        """Numbers computed from others."""
        a, b = self.number(low, high, depth - 1), self.number(low, high, depth - 1)
        factor, whole = self.constant(-1.5, 1.5), self.rng.randint(2, 9)
        both = a.spread + b.spread
        return self.rng.choice(
            [
                Term(f"({a.text} + {b.text})", both, a.size + b.size),
                Term(f"({a.text} - {b.text})", both, a.size + b.size),
                Term(f"({factor.text} * {a.text})", factor.size * a.spread if a.spread else 0.0, factor.size * a.size)
                if factor.size else a,
                Term(f"({a.text} * {b.text} / {whole})", product(a, b) / whole, a.size * b.size / whole)
                if 0 not in (a.size, b.size) else a,
                Term(f"({a.text} / {whole})", a.spread / whole, a.size / whole),
                Term(f"(-{a.text})", a.spread, a.size),
                Term(f"abs({a.text})", a.spread, a.size),
                Term(f"min({a.text}, {b.text})", both, a.size + b.size),
                Term(f"max({a.text}, {b.text}, 1)", both, a.size + b.size + 1),
                Term(f"({whole} * sin({a.text}))", whole * min(2.0, a.spread), whole),
                Term(f"({whole} * cos({a.text}))", whole * min(2.0, a.spread), whole),
                Term(f"hypot({a.text}, {b.text})", both, a.size + b.size),
                Term(f"({a.text} % {whole})", 0.0 if a.spread == 0 else whole, whole),
                Term(f"({a.text} // {whole})", 0.0 if a.spread == 0 else a.spread / whole + 1, a.size / whole + 1),
                Term(f"(({a.text}) ** 2 / {whole * 2})", product(a, a) / (2 * whole), a.size * a.size / (2 * whole))
                if a.size else a,
            ]
        )  # fmt: skip

    def python(self, low: float, high: float, depth: int) -> Term:
        """Numbers by way of Python's constructs."""
        a, b = self.number(low, high, depth - 1), self.number(low, high, depth - 1)
        both, size = a.spread + b.spread, a.size + b.size
        number = self.rng.randint(1, 3)
        options = [
            Term(f"[{a.text}, {b.text}, 3][{self.rng.choice((0, -3))}]", a.spread, a.size),
            Term(f"{{'near': {a.text}, 'far': {b.text}}}['far']", b.spread, b.size),
            Term(f"sum([{a.text}, {b.text}])", both, size),
            Term(f"({a.text} if {number} > 2 else {b.text})", both, size),
            Term(f"(lambda t: t + {number})({a.text})", a.spread, a.size + number),
            Term(f"sum(k * {number} for k in range(3))", 0.0, 9.0),
            Term(f"[k for k in range(9) if k % 3 == {number % 3}][1]", 0.0, 9.0),
            Term(f"max({a.text}, *[1, {number}])", a.spread, a.size + 3),
            Term(f"len('{'x' * number}' + f'{{{number}}}')", 0.0, 5.0),
            Term(f"max(map(lambda t: t * 2, [{number}, 1]))", 0.0, 6.0),
            Term(f"({number} if {a.text} is None else {number} ** 2)", 0.0, 9.0),
        ]
        options += [Term(f"{name}({a.text})", 2 * a.spread, 2 * a.size + 9) for name in self.functions]
        return self.rng.choice(options)

    def measure(self, depth: int) -> Term:
        """Numbers that Scenic's operators give."""
        a, b, thing = self.vector(depth - 1), self.vector(depth - 1), self.rng.choice(self.things)
        apart = a.spread + b.spread
        far = a.size + b.size
        options = [
            Term(f"(distance from {a.text} to {b.text})", apart, far),
            Term(f"(distance to {a.text})", a.spread),
            Term(f"(distance from {thing.name})", thing.spread),
            Term(f"{thing.name}.position.{self.rng.choice('xy')}", thing.spread),
            Term(f"{a.text}.distanceTo({b.text})", apart, far),
            Term(f"{a.text}.norm()", a.spread, a.size),
        ]
        if thing.oriented:
            options.append(Term(f"(distance from {a.text} past {thing.name})", ANY if thing.turn else apart, ANY))
        if thing.is_object:
            part = self.rng.choice(("width", "length"))
            options.append(Term(f"{thing.name}.{part}", 0.0, 20.0))
        return self.rng.choice(options)

    # --- headings

    def angle(self, depth: int = 1) -> Term:
        """A heading."""
        return self.pick([lambda: self.degrees(depth), lambda: self.degrees(depth), lambda: self.seen_angle(depth)])

    def degrees(self, depth: int) -> Term:
        """An angle made of a number."""
        n = self.number(-170, 170, min(depth, 1) - 1 if self.chance(0.7) else depth)
        rad = math.pi / 180
        options = [Term(f"({n.text} deg)", n.spread * rad), Term(f"({n.text} deg)", n.spread * rad)]
        options.append(Term(self.constant(-3, 3).text))
        if depth > 0:
            a, b = self.angle(depth - 1), self.angle(depth - 1)
            both = a.spread + b.spread
            options += [
                Term(f"({a.text} relative to {b.text})", both),
                Term(f"({a.text} + {b.text})", both),
                Term(f"({a.text} - {b.text})", both),
            ]
        return self.rng.choice(options)

    def seen_angle(self, depth: int) -> Term:
        """An angle that Scenic's operators give."""
        a, b = self.vector(depth - 1), self.elsewhere(depth - 1)
        to = ANY if a.spread or b.spread else 0.0
        options = [
            Term(f"(angle from {a.text} to {b.text})", to),
            Term(f"(angle to {b.text})", ANY if b.spread else 0.0),
            Term(f"({a.text}).angleTo({b.text})", to),
        ]
        oriented = [thing for thing in self.things if thing.oriented]
        thing, other = self.rng.choice(oriented), self.rng.choice(oriented)
        both = thing.turn + other.turn
        seen = thing.turn + (ANY if thing.spread or b.spread else 0.0)
        options += [
            Term(f"{thing.name}.heading", thing.turn),
            Term(f"(relative heading of {thing.name} from {other.name})", both),
            Term(f"(relative heading of {thing.name})", thing.turn),
            Term(f"(apparent heading of {thing.name} from {b.text})", seen),
        ]
        options += [Term(f"({line}.orientation at {a.text})", ANY) for line in self.polylines]
        if self.on_road:
            placed = self.rng.choice(sorted(self.on_road))
            options += [Term(f"(roadDirection at {placed})", ANY), Term(f"(roadDirection at {placed}.position)", ANY)]
        return self.rng.choice(options)

    # --- vectors

    def elsewhere(self, depth: int) -> Term:
        """A vector that is not where anything else is, so that it has a direction from there."""
        v = self.vector(depth)
        return replace(v, text=f"({v.text} + Vector({self.value(11, 35)}, {self.value(11, 35)}))", size=v.size + 70)

    def pair(self, reach: float = 9.0, depth: int = 0) -> Term:
        """Two numbers as a vector."""
        x, y = self.number(-reach, reach, depth), self.number(-reach, reach, depth)
        text = self.rng.choice((f"({x.text}, {y.text})", f"({x.text}, {y.text})", f"Vector({x.text}, {y.text})",
                                f"({x.text} @ {y.text})"))  # fmt: skip
        return Term(text, x.spread + y.spread, x.size + y.size)

    def vector(self, depth: int = 1) -> Term:
        """A vector, in the plane of the map."""
        thing = self.rng.choice(self.things)
        own = Term(f"{thing.name}.position", thing.spread)
        if depth <= 0:
            return self.rng.choice([own, own, Term(f"Vector({self.value(-30, 30)}, {self.value(-30, 30)})", 0.0, 60.0)])
        a, b, by, h = self.vector(depth - 1), self.vector(depth - 1), self.pair(), self.angle(depth - 1)
        k = self.rng.randint(2, 3)
        sum_, size = a.spread + by.spread, a.size + by.size
        options = [
            own,
            Term(f"({a.text} offset by {by.text})", sum_, size),
            Term(f"({by.text} relative to {a.text})", sum_, size),
            Term(f"({a.text} offset along {h.text} by {by.text})", a.spread + turned(by, h.spread), size),
            Term(f"({a.text} + {by.text if by.text.startswith('V') else 'Vector' + by.text})", sum_, size)
            if " @ " not in by.text else own,
            Term(f"({a.text} - Vector({k}, 3))", a.spread, a.size + 10),
            Term(f"(({a.text} + {b.text}) / {k})", (a.spread + b.spread) / k, a.size + b.size),
            Term(f"({a.text}).rotatedBy({h.text})", ANY if h.spread else a.spread, a.size),
            Term(f"({a.text}).offsetRotated({h.text}, Vector(1, {k}))",
                 a.spread + turned(Term("", 0, 5), h.spread), a.size + 5),
            Term(f"Uniform({a.text}, {b.text})", 0.0 if a.text == b.text and not a.spread else ANY, a.size + b.size)
            if depth >= 2 else own,
            Term(f"((relative position of {a.text} from {b.text}) + ego.position)", a.spread + b.spread),
        ]  # fmt: skip
        if thing.is_object:
            where = self.rng.choice(("front", "back", "left", "right", "front left", "front right", "back left"))
            options.append(Term(f"({where} of {thing.name}).position", ANY if thing.turn else thing.spread))
        if thing.oriented:
            local = thing.spread + turned(by, thing.turn)
            options += [
                Term(f"({thing.name} offset by {by.text}).position", local),
                Term(f"({by.text} relative to {thing.name}).position", local),
            ]
        return self.rng.choice(options)
