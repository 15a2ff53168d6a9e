"""Random programs over all of the language paper's appendix B, each with what it means in plain mathematics.

An expression is its text and a function that computes its value from the values of the program's random numbers. The
formulas are those of figures 26 to 35, written down here again; nothing of the package is used.
"""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

Vector = tuple[float, float]
Numbers = Mapping[str, float]
LINE = ((-40.0, 0.0), (-10.0, 30.0), (20.0, 25.0), (60.0, 60.0))
"""The polyline whose direction is the vector field F."""
EGO_VIEW, EGO_ANGLE = 60.0, math.radians(100)
STEPS = 4


class TieError(Exception):
    """The field has several headings here: near a corner of the polyline."""


@dataclass(frozen=True)
class Number:
    """A scalar, a heading or a length."""

    text: str
    value: Callable[[Numbers], float]


@dataclass(frozen=True)
class Place:
    """A vector."""

    text: str
    value: Callable[[Numbers], Vector]


@dataclass(frozen=True)
class Oriented:
    """An oriented point or, with a size, an object."""

    text: str
    position: Callable[[Numbers], Vector]
    heading: Callable[[Numbers], float]
    size: tuple[float, float] | None = None


@dataclass(frozen=True)
class Region:
    """A region: what lies in it, and whether it has an orientation."""

    text: str
    holds: Callable[[Numbers, Vector], bool]
    oriented: bool = False


@dataclass(frozen=True)
class Spot:
    """What a position specifier says.

    Attributes:
        text: The specifier.
        position: The position, given the numbers and the instance's own heading; None where it is random in a region.
        heading: The heading that it leaves to the instance, given the numbers and its position; None for the default.
        region: Where the position lies.
        turned: Whether the position hangs on the instance's own heading.
        on_line: Whether F has a heading there.
        vague: Whether versions and manuals differ on the heading.
    """

    text: str
    position: Callable[[Numbers, float], Vector] | None
    heading: Callable[[Numbers, Vector], float] | None = None
    region: Region | None = None
    turned: bool = False
    on_line: bool = False
    vague: bool = False


@dataclass(frozen=True)
class Made:
    """An instance of the program, with what must be true of it.

    Attributes:
        name: Its name.
        spot: Where it is.
        heading: Its heading, given the numbers and its position; None where versions and manuals differ.
        added: Whether the heading may also be added to that of the spot.
    """

    name: str
    spot: Spot
    heading: Callable[[Numbers, Vector], float] | None
    added: bool = False

    def headings(self, values: Numbers, here: Vector) -> list[float]:
        """The headings that are right; none where versions and manuals differ."""
        if self.heading is None:
            return []
        own = self.heading(values, here)
        return [own, own + self.spot.heading(values, here)] if self.added and self.spot.heading else [own]


PARTS = {
    "front": (0, 1), "back": (0, -1), "left": (-1, 0), "right": (1, 0), "front left": (-1, 1), "front right": (1, 1),
    "back left": (-1, -1), "back right": (1, -1),
}  # fmt: skip
SIDES = {"left of": (-1, 0), "right of": (1, 0), "ahead of": (0, 1), "behind": (0, -1)}


def plus(one: Vector, other: Vector) -> Vector:
    return one[0] + other[0], one[1] + other[1]


def minus(one: Vector, other: Vector) -> Vector:
    return one[0] - other[0], one[1] - other[1]


def rotate(vector: Vector, angle: float) -> Vector:
    x, y = vector
    return x * math.cos(angle) - y * math.sin(angle), x * math.sin(angle) + y * math.cos(angle)


def arctan(vector: Vector) -> float:
    # as Scenic computes it: the null vector has -90 degrees
    return math.remainder(math.atan2(vector[1], vector[0]) - math.pi / 2, math.tau)


def _to_segment(point: Vector, start: Vector, end: Vector) -> float:
    along, away = minus(end, start), minus(point, start)
    share = (away[0] * along[0] + away[1] * along[1]) / (along[0] ** 2 + along[1] ** 2)
    share = min(max(share, 0.0), 1.0)
    return math.dist(point, (start[0] + share * along[0], start[1] + share * along[1]))


def field_at(point: Vector) -> float:
    """F: the heading of the nearest segment of the polyline."""
    found = sorted(
        (_to_segment(point, start, end), arctan(minus(end, start))) for start, end in itertools.pairwise(LINE)
    )
    if found[1][0] - found[0][0] < 1e-6 or found[0][0] > 19.9:
        raise TieError
    return found[0][1]


def euler(point: Vector, distance: float) -> Vector:
    for _ in range(STEPS):
        point = plus(point, rotate((0.0, distance / STEPS), field_at(point)))
    return point


def to_line(point: Vector) -> float:
    return min(_to_segment(point, start, end) for start, end in itertools.pairwise(LINE))


@dataclass
class Composer:
    """Writes a program, construct by construct.

    Attributes:
        rng: What decides.
        lines: The program so far.
        made: The instances so far.
        used: The constructs in it.
    """

    rng: random.Random
    lines: list[str] = field(default_factory=list[str])
    made: list[Made] = field(default_factory=list[Made])
    known: list[Oriented] = field(default_factory=list[Oriented])
    used: set[str] = field(default_factory=set[str])
    variables: int = 0

    def compose(self, points: int, objects: int) -> str:
        """A program of an ego, oriented points and objects."""
        self.lines.append(f"line = PolylineRegion([{', '.join(map(str, LINE))}])")
        self.lines.append("F = line.orientation")
        turn = self.rng.randint(-180, 180)
        size = (2.0, 5.0)
        self.lines.append(
            f"ego = new Object at (3, -4), facing {turn} deg, with width 2, with length 5, "
            f"with visibleDistance {EGO_VIEW}, with viewAngle 100 deg"
        )
        self.known.append(Oriented("ego", lambda _: (3.0, -4.0), lambda _: math.radians(turn), size))
        for number in range(points):
            self._instance(f"p{number}", is_object=False)
        for number in range(objects):
            self._instance(f"o{number}", is_object=True)
        return "\n".join([*self.lines, ""])

    def _pick(self, kind: str, options: dict[str, Callable[[], object]]) -> object:
        name = self.rng.choice(list(options))
        self.used.add(f"{kind}: {name}")
        return options[name]()

    # --- numbers

    def number(self, low: float, high: float) -> Number:
        if self.variables < 3 and self.rng.random() < 0.25:
            name = f"r{self.variables}"
            self.variables += 1
            middle = round(self.rng.uniform(low, high), 2)
            ends = sorted((middle, round(self.rng.uniform(low, high), 2)))
            self.lines += [f"{name} = Range({ends[0]}, {ends[1]})", f"param {name} = {name}"]
            return Number(name, lambda values: values[name])
        value = round(self.rng.uniform(low, high), 2)
        return Number(f"({value})" if value < 0 else f"{value}", lambda _: value)

    def pair(self) -> Place:
        x, y = self.number(-8, 8), self.number(-8, 8)
        return Place(f"({x.text}, {y.text})", lambda values: (x.value(values), y.value(values)))

    def length(self, depth: int = 1) -> Number:
        def between() -> Number:
            a, b = self.vector(depth - 1), self.vector(depth - 1)
            return Number(f"(distance from {a.text} to {b.text})", lambda v: math.dist(a.value(v), b.value(v)))

        def to() -> Number:
            a = self.vector(depth - 1)
            return Number(f"(distance to {a.text})", lambda v: math.dist(a.value(v), self._ego(v)))

        options: dict[str, Callable[[], object]] = {"number": lambda: self.number(0, 9)}
        if depth > 0:
            options |= {"distance from": between, "distance to": to}
        return self._pick("scalar", options)  # type: ignore[return-value]

    def _ego(self, values: Numbers) -> Vector:
        return self.known[0].position(values)

    def heading(self, depth: int = 2) -> Number:
        def degrees() -> Number:
            n = self.number(-170, 170)
            return Number(f"({n.text} deg)", lambda v: math.radians(n.value(v)))

        def own() -> Number:
            op = self.oriented(depth - 1)
            return Number(f"{op.text}.heading", op.heading)

        def angle_to() -> Number:
            a = self.vector(depth - 1)
            return Number(f"(angle to {a.text})", lambda v: arctan(minus(a.value(v), self._ego(v))))

        def angle() -> Number:
            a, b = self.vector(depth - 1), self.vector(depth - 1)
            return Number(f"(angle from {a.text} to {b.text})", lambda v: arctan(minus(b.value(v), a.value(v))))

        def relative_heading() -> Number:
            a, b = self.heading(depth - 1), self.heading(depth - 1)
            return Number(f"(relative heading of {a.text} from {b.text})", lambda v: a.value(v) - b.value(v))

        def relative_to_ego() -> Number:
            a = self.heading(depth - 1)
            return Number(f"(relative heading of {a.text})", lambda v: a.value(v) - self.known[0].heading(v))

        def apparent() -> Number:
            op, a = self.oriented(depth - 1), self.vector(depth - 1)
            text = f"(apparent heading of {op.text} from {a.text})"
            return Number(text, lambda v: op.heading(v) - arctan(minus(op.position(v), a.value(v))))

        def apparent_to_ego() -> Number:
            op = self.known[-1] if len(self.known) > 1 else None
            if op is None:
                return degrees()
            text = f"(apparent heading of {op.text})"
            return Number(text, lambda v: op.heading(v) - arctan(minus(op.position(v), self._ego(v))))

        def relative() -> Number:
            a, b = self.heading(depth - 1), self.heading(depth - 1)
            return Number(f"({a.text} relative to {b.text})", lambda v: a.value(v) + b.value(v))

        def of_field() -> Number:
            a = self.near_line()
            return Number(f"(F at {a.text})", lambda v: field_at(a.value(v)))

        options: dict[str, Callable[[], object]] = {"deg": degrees, "F at V": of_field}
        if depth > 0:
            options |= {
                "heading": own, "angle to": angle_to, "angle from": angle, "relative heading from": relative_heading,
                "relative heading": relative_to_ego, "apparent heading from": apparent,
                "apparent heading": apparent_to_ego, "relative to": relative,
            }  # fmt: skip
        return self._pick("heading", options)  # type: ignore[return-value]

    # --- vectors

    def near_line(self) -> Place:
        """A point close to the polyline, where F has a heading."""
        segment, share = self.rng.randrange(len(LINE) - 1), self.rng.uniform(0.15, 0.6)
        (x, y), (u, v) = LINE[segment], LINE[segment + 1]
        a, b = self.number(-2, 2), self.number(-2, 2)
        px, py = round(x + share * (u - x), 2), round(y + share * (v - y), 2)
        return Place(
            f"(({px}) + {a.text}, {py} + {b.text})", lambda values: (px + a.value(values), py + b.value(values))
        )

    def vector(self, depth: int = 2) -> Place:
        def position() -> Place:
            op = self.rng.choice(self.known)
            return Place(f"{op.text}.position", op.position)

        def offset() -> Place:
            a, by = self.vector(depth - 1), self.pair()
            return Place(f"({a.text} offset by {by.text})", lambda v: plus(a.value(v), by.value(v)))

        def along() -> Place:
            a, way, by = self.vector(depth - 1), self.heading(depth - 1), self.pair()
            text = f"({a.text} offset along {way.text} by {by.text})"
            return Place(text, lambda v: plus(a.value(v), rotate(by.value(v), way.value(v))))

        def along_field() -> Place:
            a, by = self.near_line(), self.pair()
            text = f"({a.text} offset along F by {by.text})"
            return Place(text, lambda v: plus(a.value(v), rotate(by.value(v), field_at(a.value(v)))))

        def of() -> Place:
            op = self.oriented(depth - 1)
            return Place(f"{op.text}.position", op.position)

        options: dict[str, Callable[[], object]] = {"pair": self.pair, "position": position}
        if depth > 0:
            options |= {"offset by": offset, "offset along H": along, "offset along F": along_field, "of": of}
        return self._pick("vector", options)  # type: ignore[return-value]

    # --- oriented points

    def oriented(self, depth: int = 1) -> Oriented:
        def local(base: Oriented, by: Place, text: str) -> Oriented:
            return Oriented(text, lambda v: plus(base.position(v), rotate(by.value(v), base.heading(v))), base.heading)

        def offset() -> Oriented:
            base, by = self.oriented(depth - 1), self.pair()
            return local(base, by, f"({base.text} offset by {by.text})")

        def relative() -> Oriented:
            base, by = self.oriented(depth - 1), self.pair()
            return local(base, by, f"({by.text} relative to {base.text})")

        def part() -> Oriented:
            base = self.rng.choice([each for each in self.known if each.size])
            assert base.size is not None
            word, (right, ahead) = self.rng.choice(list(PARTS.items()))
            self.used.add(f"part: {word}")
            by = (right * base.size[0] / 2, ahead * base.size[1] / 2)
            return local(base, Place("", lambda _: by), f"({word} of {base.text})")

        def follow() -> Oriented:
            start, far = self.near_line(), self.number(1, 9)
            text = f"(follow F from {start.text} for {far.text})"

            def end(v: Numbers) -> Vector:
                return euler(start.value(v), far.value(v))

            return Oriented(text, end, lambda v: field_at(end(v)))

        options: dict[str, Callable[[], object]] = {"named": lambda: self.rng.choice(self.known)}
        if depth > 0:
            options |= {"offset by": offset, "relative to": relative, "part": part, "follow": follow}
        return self._pick("oriented point", options)  # type: ignore[return-value]

    # --- regions

    def region(self) -> Region:
        def circle() -> Region:
            center, radius = self.vector(1), self.number(1, 9)
            text = f"CircularRegion({center.text}, {radius.text})"
            return Region(text, lambda v, p: math.dist(p, center.value(v)) <= radius.value(v) + 1e-6)

        def rectangle() -> Region:
            center, turn, width, length = self.vector(1), self.heading(1), self.number(1, 9), self.number(1, 9)
            text = f"RectangularRegion({center.text}, {turn.text}, {width.text}, {length.text})"

            def holds(v: Numbers, p: Vector) -> bool:
                x, y = rotate(minus(p, center.value(v)), -turn.value(v))
                return abs(x) <= width.value(v) / 2 + 1e-6 and abs(y) <= length.value(v) / 2 + 1e-6

            return Region(text, holds)

        def line() -> Region:
            return Region("line", lambda _, p: to_line(p) < 1e-6, oriented=True)

        def visible() -> Region:
            inner = circle_around_ego()
            return Region(f"(visible {inner.text})", lambda v, p: inner.holds(v, p) and self._sees(v, p))

        def circle_around_ego() -> Region:
            radius = self.number(5, 30)
            text = f"CircularRegion((3, -4), {radius.text})"
            return Region(text, lambda v, p: math.dist(p, (3, -4)) <= radius.value(v) + 1e-6)

        options: dict[str, Callable[[], object]] = {"circle": circle, "rectangle": rectangle, "line": line,
                                                    "visible R": visible}  # fmt: skip
        return self._pick("region", options)  # type: ignore[return-value]

    def _sees(self, values: Numbers, point: Vector) -> bool:
        away = minus(point, self._ego(values))
        turn = math.remainder(arctan(away) - self.known[0].heading(values), math.tau)
        return math.hypot(*away) <= EGO_VIEW + 1e-6 and abs(turn) <= EGO_ANGLE / 2 + 1e-6

    # --- specifiers

    def spot(self, size: tuple[float, float]) -> Spot:
        ego = self.known[0]

        def at() -> Spot:
            a = self.vector()
            return Spot(f"at {a.text}", lambda v, _: a.value(v))

        def at_line() -> Spot:
            a = self.near_line()
            return Spot(f"at {a.text}", lambda v, _: a.value(v), on_line=True)

        def offset() -> Spot:
            by = self.pair()
            return Spot(
                f"offset by {by.text}", lambda v, _: plus(self._ego(v), rotate(by.value(v), ego.heading(v))),
                lambda v, _: ego.heading(v),
            )  # fmt: skip

        def along() -> Spot:
            way, by = self.heading(1), self.pair()
            return Spot(
                f"offset along {way.text} by {by.text}",
                lambda v, _: plus(self._ego(v), rotate(by.value(v), way.value(v))), lambda v, _: ego.heading(v),
            )  # fmt: skip

        def side(base: Oriented | Place) -> Spot:
            word, (right, ahead) = self.rng.choice(list(SIDES.items()))
            self.used.add(f"side: {word} {'V' if isinstance(base, Place) else 'O' if base.size else 'OP'}")
            by = self.length() if self.rng.random() < 0.7 else None
            width, length = size
            if isinstance(base, Oriented) and base.size:
                width, length = width + base.size[0], length + base.size[1]

            def away(v: Numbers) -> Vector:
                gap = by.value(v) if by else 0.0
                return right * (width / 2 + gap) if right else 0.0, ahead * (length / 2 + gap) if ahead else 0.0

            text = f"{word} {base.text}" + (f" by {by.text}" if by else "")
            if isinstance(base, Place):
                return Spot(text, lambda v, own: plus(base.value(v), rotate(away(v), own)), turned=True)
            return Spot(
                text, lambda v, _: plus(base.position(v), rotate(away(v), base.heading(v))),
                lambda v, _: base.heading(v),
            )  # fmt: skip

        def beyond() -> Spot:
            goal, by = self.vector(1), self.pair()
            origin = self.vector(1) if self.rng.random() < 0.5 else None
            text = f"beyond {goal.text} by {by.text}" + (f" from {origin.text}" if origin else "")

            def position(v: Numbers, _: float) -> Vector:
                start = origin.value(v) if origin else self._ego(v)
                return plus(goal.value(v), rotate(by.value(v), arctan(minus(goal.value(v), start))))

            return Spot(text, position, vague=True)

        def visible() -> Spot:
            return Spot("visible", None, region=Region("", self._sees))

        def within() -> Spot:
            region, word = self.region(), self.rng.choice(("in", "on"))
            heading = (lambda _, here: field_at(here)) if region.oriented else None
            return Spot(f"{word} {region.text}", None, heading, region, on_line=region.oriented)

        def following() -> Spot:
            start, far = self.near_line(), self.number(1, 9)
            return Spot(
                f"following F from {start.text} for {far.text}", lambda v, _: euler(start.value(v), far.value(v)),
                lambda _, here: field_at(here), on_line=True,
            )  # fmt: skip

        options: dict[str, Callable[[], object]] = {
            "at": at, "at line": at_line, "offset by": offset, "offset along": along, "beyond": beyond,
            "side of V": lambda: side(self.vector(1)), "side of OP": lambda: side(self.oriented()),
            "side of X": lambda: side(self.rng.choice(self.known)), "visible": visible, "in": within,
            "following": following,
        }  # fmt: skip
        return self._pick("position", options)  # type: ignore[return-value]

    def facing(self, spot: Spot) -> tuple[str, Callable[[Numbers, Vector], float]]:
        def plain() -> object:
            h = self.heading()
            return f"facing {h.text}", lambda v, _: h.value(v)

        def relative() -> object:
            h = self.heading(1)
            return f"facing {h.text} relative to F", lambda v, here: h.value(v) + field_at(here)

        def of_field() -> object:
            return "facing F", lambda _, here: field_at(here)

        def toward() -> object:
            a, away = self.vector(1), self.rng.random() < 0.5
            sign = -1 if away else 1
            self.used.add(f"facing: {'away from' if away else 'toward'}")
            return f"facing {'away from' if away else 'toward'} {a.text}", lambda v, here: arctan(
                (sign * (a.value(v)[0] - here[0]), sign * (a.value(v)[1] - here[1]))
            )

        def apparently() -> object:
            h, a = self.heading(1), self.vector(1) if self.rng.random() < 0.5 else None
            text = f"apparently facing {h.text}" + (f" from {a.text}" if a else "")
            return text, lambda v, here: h.value(v) + arctan(minus(here, a.value(v) if a else self._ego(v)))

        options: dict[str, Callable[[], object]] = {"facing H": plain}
        if not spot.turned:
            options |= {"facing V": toward} | ({} if spot.vague else {"apparently facing": apparently})
        if spot.on_line:
            options |= {"facing H relative to F": relative, "facing F": of_field}
        return self._pick("heading specifier", options)  # type: ignore[return-value]

    def _instance(self, name: str, *, is_object: bool) -> None:
        size = (round(self.rng.uniform(0.5, 3), 2), round(self.rng.uniform(0.5, 5), 2)) if is_object else (0.0, 0.0)
        spot = self.spot(size)
        words, heading = [spot.text], None if spot.vague else spot.heading or (lambda _, here: 0.0)
        if self.rng.random() < 0.5:
            text, heading = self.facing(spot)
            words.append(text)
        added = words[-1].startswith("apparently")
        if is_object:
            words += [f"with width {size[0]}", f"with length {size[1]}"]
        self.lines.append(f"{name} = new {'Object' if is_object else 'OrientedPoint'} {', '.join(words)}")
        self.lines += [f"param {name}_{part} = {name}.{part.replace('_', '.')}" for part in PARAMS]
        self.made.append(Made(name, spot, heading, added))
        self.known.append(
            Oriented(
                name, lambda values: (values[f"{name}_position_x"], values[f"{name}_position_y"]),
                lambda values: values[f"{name}_heading"], size if is_object else None,
            )
        )  # fmt: skip


PARAMS = ("position_x", "position_y", "heading")
