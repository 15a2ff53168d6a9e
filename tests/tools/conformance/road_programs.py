"""Random programs over the whole language, in the driving world on a given map: forms of `road_grammar`, filled in.

A program stays near one place of the map, so that what it says of several objects can be drawn. It is meant to be
refused by neither side, but nothing makes sure of that: what Scenic refuses or never draws says nothing of scenicq.
"""

from __future__ import annotations

import random
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import shapely
from road_grammar import ENDS, FORMS, SPECIFIERS

from scenicq.geometry.network import Network

__all__ = ["Places", "compose"]

LISTS = ("lanes", "laneSections", "laneGroups", "roads", "intersections")
NEAR = 60.0
"""Metres around the place of a program from which it takes elements of the map."""
CLASSES = ("Car", "Car", "Car", "Car", "Pedestrian", "Pedestrian", "NPCCar", "Vehicle")
NAMED = ("lane", "lane", "lane", "turn", "turn", "section", "group", "street", "crossing", "region", "vector")
CLEAR = "with allowCollisions True, with regionContainedIn None"
_HOLE = re.compile(r"\{([a-z]\w*)((?: \w+)?)((?::-?[\d.]+){0,2})((?:[+-]\d+){0,2})\}")
_DRAWN = re.compile(r"Uniform|Range|Normal|Discrete|resample|new |visible|follow |\.sidewalks")
"""What Scenic does not allow inside requirements: whatever it would draw."""
_NEEDS_EGO = re.compile(
    r"\{(?:car|object|other|[a-z]+ car)\}|visible|distance to|angle to|(?:relative|apparent) heading of \{\w+\}\)"
)
_FUNCTIONS = (
    ["    return 0.5 * t + extra"],
    ["    for k in range(3):", "        extra += k / 4", "    return extra + t / 2"],
    ["    if extra > 2:", "        return t - 1", "    return t + extra"],
    ["    total = 0", "    while total < 3:", "        total += 1", "    return total / 2 + t"],
)


@dataclass(frozen=True)
class Places:
    """Where programs of a map may be.

    Attributes:
        points: On the centrelines of lanes, in metres.
        elements: Of each list of the network, the areas of its elements.
    """

    points: list[tuple[float, float]]
    elements: dict[str, list[shapely.Polygon | shapely.MultiPolygon]]

    @classmethod
    def of(cls, network: Network) -> Places:
        """Every fifth metre of each lane of the roads."""
        lanes = [lane.centerline for road in network.roads for lane in road.lanes]
        lines = [line for centerline in lanes if centerline for line in centerline.lines]
        spots = [line.interpolate(at) for line in lines for at in range(2, int(line.length), 5)]
        elements = {name: [each.polygon for each in getattr(network, name)] for name in LISTS}
        return cls([(round(spot.x, 2), round(spot.y, 2)) for spot in spots], elements)


def compose(seed: str, places: Places) -> str:
    """A program; the same for the same seed on the same map."""
    rng = random.Random(seed)
    centre = shapely.Point(rng.choice(places.points))
    points = [at for at in places.points if centre.distance(shapely.Point(at)) < NEAR / 2]
    near = {
        name: [number for number, area in enumerate(areas) if area.distance(centre) < NEAR] or [0]
        for name, areas in places.elements.items()
    }
    return _Program(rng, points, near, rng.choice(points), rng.choice((1, 1, 2, 2, 3))).write()


@dataclass
class _Program:
    """A program that is being written.

    Attributes:
        rng: What decides.
        points: Places that it may name, in metres.
        near: Of each list of the network, the numbers of the elements that it may name.
        corner: Where polygons and polylines begin.
        depth: How deep expressions may nest others.
        lines: The program so far; expressions may need statements before.
        cars: Objects that are likely on a road.
        objects, points_made, oriented: What has a place, what of it is a mere point, and what has a heading.
        hidden, functions, checks, classes: Names of numbers, functions of one, conditions on two things, classes.
        named: Names of what is of the map, by kind.
        made: How many names there are.
    """

    rng: random.Random
    points: list[tuple[float, float]]
    near: dict[str, list[int]]
    corner: tuple[float, float]
    depth: int
    lines: list[str] = field(default_factory=lambda: ["model scenic.domains.driving.model"])
    cars: list[str] = field(default_factory=list[str])
    objects: list[str] = field(default_factory=list[str])
    points_made: list[str] = field(default_factory=list[str])
    oriented: list[str] = field(default_factory=list[str])
    hidden: list[str] = field(default_factory=list[str])
    functions: list[str] = field(default_factory=list[str])
    checks: list[str] = field(default_factory=list[str])
    classes: list[str] = field(default_factory=list[str])
    named: dict[str, list[str]] = field(default_factory=dict[str, list[str]])
    made: int = 0

    @property
    def has_ego(self) -> bool:
        return bool(self.objects)

    def write(self) -> str:
        """The whole program."""
        before = (self.number, self.point, self.point, self.function, self.kind, self.element, self.element)
        for _ in range(self.rng.choice((0, 0, 1, 2))):
            self.rng.choice(before)()
        self.ego()
        for _ in range(self.rng.randint(1, 3)):
            if self.chance(0.33):
                self.rng.choice((*before, self.param))()
            self.rng.choice((self.object, self.object, self.object, self.object, self.object, self.loop))()
        for _ in range(self.rng.choice((0, 1, 1, 2, 3))):
            self.requirement()
        if self.chance(0.06):
            of = self.rng.choice(("", f" {self.rng.choice(self.objects)}", f" {self.rng.choice(self.objects)} by 0.5"))
            self.lines.append(f"mutate{of}")
        return "\n".join([*self.lines, ""])

    def chance(self, share: float) -> bool:
        return self.rng.random() < share

    def fresh(self, letter: str) -> str:
        self.made += 1
        return f"{letter}{self.made}"

    # --- statements

    def number(self) -> None:
        value, name = self.fill("{number:1:12}"), self.fresh("n")
        self.lines.append(f"{name} = {value}")
        self.hidden.append(name)

    def element(self) -> None:
        """A name for something of the map; where nothing reads it, it constrains nothing."""
        kind = self.rng.choice(NAMED)
        value, name = self.fill("{" + kind + "}"), self.fresh("u")
        self.lines.append(f"{name} = {value}")
        self.named.setdefault(kind, []).append(name)

    def point(self) -> None:
        position, oriented = self.specifier("position"), self.chance(0.8)
        facing = ""
        if oriented and "facing" not in position and self.chance(0.5):
            facing = f", {self.specifier('heading')}"
        if not oriented:
            position = position.split(", facing")[0]
        name = self.fresh("p")
        self.lines.append(f"{name} = new {'OrientedPoint' if oriented else 'Point'} {position}{facing}")
        self.points_made.append(name)
        if oriented:
            self.oriented.append(name)

    def function(self) -> None:
        name = self.fresh("f")
        if self.chance(0.4):
            body = ["    d = distance from a to b", f"    return {self.rng.choice(('d > far - 1', 'd < 100 * far'))}"]
            self.lines += [f"def {name}(a, b, far={self.constant(2, 9)}):", *body]
            self.checks.append(name)
        else:
            self.lines += [f"def {name}(t, extra={self.constant(0, 4)}):", *self.rng.choice(_FUNCTIONS)]
            self.functions.append(name)

    def kind(self) -> None:
        base = self.rng.choice(("Car", "Car", "Pedestrian"))
        bodies = (
            [f"    length: {self.fill('{number:1:5}')}"],
            ["    gap: Range(1, 3)", "    width: self.gap / 2 + 1"],
            ["    roadDeviation: Range(-20, 20) deg"] if base == "Car" else ["    width: 0.6"],
            [f"    regionContainedIn: {self.fill('{area}')}"],
            ["    allowCollisions: True", "    viewAngle: 200 deg"],
        )
        name = self.fresh("Kind")
        self.lines += [f"class {name}({base}):", *self.rng.choice(bodies)]
        self.classes.append(name)

    def param(self) -> None:
        value = self.fill(self.rng.choice(("{number:0:9}", "Uniform('dry', 'wet')", "'noon'", "{truth}")))
        self.lines.append(f"param {self.fresh('q')} = {value}")

    def ego(self) -> None:
        place = self.specifier("place of ego")
        words = [place] if place else []
        if self.chance(0.25):
            words.append(f"with visibleDistance {self.fill('{number:30:80}')}")
        words += [f"with viewAngle {self.constant(60, 330)} deg"] * self.chance(0.25)
        words += ["with regionContainedIn None"] * self.chance(0.7)
        self.lines.append(
            f"ego = new {self.rng.choice(('Car', 'Car', 'Car', *self.classes))} {', '.join(words)}".rstrip()
        )
        self.objects.append("ego")
        self.oriented.append("ego")
        self.cars.append("ego")

    def object(self) -> None:
        kind = self.rng.choice((*CLASSES, *self.classes))
        walks = kind == "Pedestrian"
        words = [self.specifier("position", *(["place on foot"] if walks else []))]
        if "facing" not in words[0] and self.chance(0.5):
            words.append(self.specifier("heading", *([] if walks else ["heading on a road"])))
        if self.chance(0.15):
            words.append(f"with width {self.fill('{number:1:3}')}")
        words += ["with requireVisible True"] * self.chance(0.05)
        words += ["visible"] * (self.chance(0.05) and "visible" not in words[0])
        if "contained in" not in words[0] and self.chance(0.85):
            words.append(self.rng.choice(("with regionContainedIn None", "with regionContainedIn everywhere")))
        words += ["with allowCollisions True"] * self.chance(0.85)
        if not walks and self.chance(0.06):
            words.append(f"with roadDeviation {self.fill('{number:-20:20}')} deg")
        name = self.fresh("o")
        self.lines.append(f"{name} = new {kind} {', '.join(words)}")
        self.objects.append(name)
        self.oriented.append(name)
        if not walks and not any(word in words[0] for word in ("sidewalk", "shoulder", "curb", "Edge")):
            self.cars.append(name)

    def loop(self) -> None:
        """Objects that a loop, a comprehension or a function makes."""
        gap, owner, last = self.fill("{number:5:9}"), self.rng.choice(self.oriented), self.rng.choice(self.objects)
        name, rounds = self.fresh("o"), self.rng.randint(1, 2)
        side, turn = self.rng.choice(("ahead of", "behind", "left of")), self.constant(-40, 40)
        self.lines += self.rng.choice((
            [f"{name} = {last}", f"for i in range({rounds}):", f"    {name} = new Car {side} {name} by {gap}, {CLEAR}"],
            [f"{name}s = [new Car at {owner} offset by (k * 4, {gap}), {CLEAR} for k in range(1, {rounds + 1})]",
             f"{name} = {name}s[0]"],
            [f"def make{name}(spot, gap):",
             f"    return new Car {side} spot by gap, facing {turn} deg relative to spot, {CLEAR}",
             f"{name} = make{name}({owner}, gap={gap})"],
        ))  # fmt: skip
        self.objects.append(name)
        self.oriented.append(name)

    def requirement(self) -> None:
        head = self.rng.choice(("require", "require", "require", "require", "require[0.6]", "require[1]"))
        wanted = self.fill("{condition}")
        while _DRAWN.search(wanted):
            wanted = self.fill("{condition}")
        self.lines.append(f"{head} {wanted}{' as wish' * self.chance(0.05)}")

    # --- forms and their holes

    def specifier(self, kind: str, *more: str) -> str:
        forms = [*SPECIFIERS[kind], *(form for name in more for form in SPECIFIERS[name])]
        if self.has_ego:
            forms += SPECIFIERS.get(f"{kind} from ego", ())
        return self.fill(self.possible(forms))

    def possible(self, forms: Sequence[str]) -> str:
        """A form that needs no ego while there is none."""
        return self.rng.choice([form for form in forms if self.has_ego or not _NEEDS_EGO.search(form)])

    def fill(self, form: str, depth: int | None = None, low: float = 1.0, high: float = 9.0) -> str:
        """The form with something in each of its holes, numbers between the two where the hole does not say."""
        left = self.depth if depth is None else depth

        def put(hole: re.Match[str]) -> str:
            bounds = [float(each) for each in hole[3].split(":")[1:]]
            between = (bounds[0], bounds[1]) if bounds else (low, high)
            return self.hole(hole[1], hole[2].strip(), left, between, hole[4])

        return _HOLE.sub(put, form).replace("{{", "{").replace("}}", "}")

    def hole(self, kind: str, extra: str, depth: int, between: tuple[float, float], shift: str) -> str:
        low, high = between
        if kind in self.named and self.chance(0.4):
            return self.rng.choice(self.named[kind])
        if kind in ENDS:
            deep = depth > 0 and kind in FORMS and self.chance(0.45 if kind in ("number", "lane") else 0.6)
            return self.fill(self.possible(FORMS[kind] if deep else ENDS[kind]), depth - 1, low, high)
        if kind == "whole":
            known = {"low": low, "high": high}.get(extra)
            return str(int(known) if known is not None else self.rng.randint(int(low), int(high)))
        if kind == "place":
            return self.place(shift)
        ends: dict[str, Callable[[], str]] = {
            "constant": lambda: self.constant(low, high),
            "low": lambda: self.written(low + 0.1 * (high - low)),
            "middle": lambda: self.written((low + high) / 2),
            "high": lambda: self.written(high - 0.1 * (high - low)),
            "deviation": lambda: self.written(max(0.05, (high - low) * self.rng.choice((0.02, 0.1, 0.25)))),
            "hidden": lambda: self.rng.choice(self.hidden or [self.constant(low, high)]),
            "nth": lambda: str(self.rng.choice(self.near[extra])),
            "some": lambda: f"Uniform({', '.join(self.fill(f'network.{extra}[{{nth {extra}}}]') for _ in range(3))})",
        }
        return ends[kind]() if kind in ends else self.plain(kind)

    def plain(self, kind: str) -> str:
        """What fills a hole that says nothing but its kind."""
        x, y = self.rng.choice(self.points)
        far = "(lambda a, b: (distance from a to b) < 90)"
        ends: dict[str, Callable[[], Sequence[str]]] = {
            "truth": lambda: ("True", "False"),
            "compare": lambda: ("<", ">", "<=", ">=", "!="),
            "side": lambda: ("left of", "right of", "ahead of", "behind"),
            "rad": lambda: (str(round(self.rng.uniform(-3, 3), 2)),),
            "end": lambda: ("0", "0", "-1"),
            "function": lambda: self.functions or ["abs"],
            "check": lambda: self.checks or [far],
            "x": lambda: (str(x),),
            "beside": lambda: (
                f"({x}, Range({round(y - 1.5, 2)}, {y}))",
                f"(Range({x}, {round(x + 2.2, 2)}), {y})",
                f"({x} + {self.fill('{number:-2:2}')}, {y})",
            ),
            "thing": lambda: self.objects + self.points_made or [self.made_point()],
            "point": lambda: self.points_made or [self.made_point()],
            "orientedpoint": lambda: [p for p in self.points_made if p in self.oriented] or [self.made_point()],
            "oriented": lambda: self.oriented or [self.made_point()],
            "object": lambda: self.objects,
            "other": lambda: self.objects[1:] or self.points_made or [self.place("")],
            "car": lambda: self.cars,
            "nearlane": lambda: [f"network.lanes[{number}]" for number in self.near["lanes"]],
            "group0": lambda: [f"network.laneGroups[{number}]" for number in self.near["laneGroups"]],
            "street0": lambda: [f"network.roads[{number}]" for number in self.near["roads"]],
            "crossing0": lambda: [f"network.intersections[{number}]" for number in self.near["intersections"]],
        }
        return self.rng.choice(ends[kind]())

    def made_point(self) -> str:
        name = self.fresh("p")
        self.lines.append(f"{name} = new OrientedPoint at {self.place('')}, facing {self.constant(-180, 180)} deg")
        self.points_made.append(name)
        self.oriented.append(name)
        return name

    def place(self, shift: str) -> str:
        x, y = self.corner if shift else self.rng.choice(self.points)
        by = [float(each) for each in re.findall(r"[+-]\d+", shift)] or [0.0, 0.0]
        return f"({round(x + by[0], 2)}, {round(y + by[1], 2)})"

    def constant(self, low: float, high: float) -> str:
        return self.written(self.rng.uniform(low, high))

    def written(self, value: float) -> str:
        return str(round(value, self.rng.choice((1, 1, 2))))
