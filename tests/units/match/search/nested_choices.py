"""Random programs with choices among map elements, one below the other, and whether a label matches one of them.

The meaning is written down here again: every combination of choices is gone through with the elements of the network
themselves, and what a label must satisfy is measured with shapely. Nothing of the matcher is used.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import shapely
import shapely.affinity

from scenicq.geometry.features import MapFeature
from scenicq.geometry.network import Network
from scenicq.store.labels import Label, LabelObject

REACH = 0.25
"""Metres of tolerance."""
_CLOSE = 1e-4
"""Metres within which of a limit nothing is said."""

Combination = Mapping[str, Any]
Check = Callable[[Combination, Mapping[str, tuple[float, float]], float], bool]
"""Whether something holds of a combination of choices and positions by name, with a slack in metres."""


@dataclass
class Program:
    """A program with its meaning.

    Attributes:
        lines: The program.
        choices: Of each random variable in order, its options given those before it.
        checks: What must hold.
        objects: The objects' names, the ego first.
        places: Where an object may stand, given the choices.
    """

    lines: list[str] = field(default_factory=list[str])
    choices: list[tuple[str, Callable[[Combination], list[Any]]]] = field(
        default_factory=list[tuple[str, Callable[[Combination], list[Any]]]]
    )
    checks: list[Check] = field(default_factory=list[Check])
    objects: list[str] = field(default_factory=list[str])
    places: dict[str, Callable[[Combination], Any]] = field(default_factory=dict[str, Callable[[Combination], Any]])

    def combinations(self) -> Iterator[Combination]:
        """Every combination of choices."""
        todo: list[dict[str, Any]] = [{}]
        while todo:
            found = todo.pop()
            if len(found) == len(self.choices):
                yield found
                continue
            name, options = self.choices[len(found)]
            todo += [{**found, name: option} for option in options(found)]

    def matches(self, label: Label, slack: float) -> bool:
        """Whether some combination satisfies everything with a label's objects in the roles of their names."""
        things = {thing.id: (thing.x, thing.y) for thing in label.objects} | {"ego": (label.ego.x, label.ego.y)}
        return any(all(check(each, things, slack) for check in self.checks) for each in self.combinations())


def small_map(features: list[MapFeature], copies: int) -> Network:
    """Copies of a map, each turned and beside the others."""
    found: list[MapFeature] = []
    ids = {feature.id for feature in features}
    for number in range(copies):

        def named(value: Any, number: int = number) -> Any:
            if isinstance(value, list | tuple):
                return [named(each) for each in value]
            if isinstance(value, dict):
                return {key: named(each) for key, each in value.items()}
            return f"{value}-{number}" if value in ids else value

        for feature in features:
            turned = shapely.affinity.rotate(feature.shape, 25 * number, origin=(0, 0))
            shape = shapely.affinity.translate(turned, 260 * number, 0)
            properties = {key: named(value) for key, value in feature.properties.items()}
            found.append(MapFeature(f"{feature.id}-{number}", feature.kind, shape, properties))
    return Network("copies", found)


def _shape(element: Any) -> Any:
    return element.polygon if hasattr(element, "polygon") else shapely.union_all(element.lines)


def _distance(element: Any, point: tuple[float, float]) -> float:
    return float(shapely.distance(_shape(element), shapely.Point(point)))


_STEPS: dict[str, list[tuple[str, str, Callable[[Any], list[Any]]]]] = {
    "intersection": [
        ("lane", "Uniform(*{}.incomingLanes)", lambda i: list(i.incomingLanes)),
        ("maneuver", "Uniform(*{}.maneuvers)", lambda i: list(i.maneuvers)),
        ("road", "Uniform(*{}.roads)", lambda i: list(i.roads)),
    ],
    "lane": [
        ("maneuver", "Uniform(*{}.maneuvers)", lambda lane: list(lane.maneuvers)),
        ("road", "{}.road", lambda lane: [lane.road]),
        ("lane", "Uniform(*{}.group.lanes)", lambda lane: list(lane.group.lanes)),
        ("section", "Uniform(*{}.sections)", lambda lane: list(lane.sections)),
    ],
    "maneuver": [
        ("lane", "{}.startLane", lambda m: [m.startLane]),
        ("lane", "{}.endLane", lambda m: [m.endLane]),
        ("lane", "Uniform({0}.startLane, {0}.endLane)", lambda m: [m.startLane, m.endLane]),
    ],
    "road": [("lane", "Uniform(*{}.lanes)", lambda road: list(road.lanes))],
    "section": [("lane", "{}.lane", lambda section: [section.lane])],
}
_AREAS = ("lane", "intersection", "road", "section")


class Composer:
    """Writes programs, choice by choice."""

    def __init__(self, network: Network, rng: random.Random) -> None:
        self.network = network
        self.rng = rng
        self.program = Program(["model scenic.domains.driving.model"])
        self.kinds: dict[str, str] = {}

    def compose(self) -> Program:
        """A program of two to four choices, two objects and up to three requirements."""
        rng, network, program = self.rng, self.network, self.program
        kind = rng.choice(("intersection", "intersection", "lane"))
        whole = {"intersection": ("network.intersections", network.intersections), "lane": (
            "filter(lambda l: l.maneuvers, network.lanes)", [lane for lane in network.lanes if lane.maneuvers]
        )}[kind]  # fmt: skip
        self._choose(kind, f"Uniform(*{whole[0]})", lambda _: list(whole[1]))
        for _ in range(rng.randint(1, 3)):
            above = rng.choice(list(self.kinds))
            kind, text, options = rng.choice(_STEPS[self.kinds[above]])
            self._choose(kind, text.format(above), lambda found, above=above, options=options: options(found[above]))
        for name in ("ego", "other"):
            self._place(name)
        for _ in range(rng.randint(0, 3)):
            self._require()
        return program

    def _choose(self, kind: str, text: str, options: Callable[[Combination], list[Any]]) -> None:
        name = f"v{len(self.kinds)}"
        self.kinds[name] = kind
        self.program.lines.append(f"{name} = {text}")
        self.program.choices.append((name, options))

    def _area(self) -> str | None:
        return self.rng.choice([name for name, kind in self.kinds.items() if kind in _AREAS])

    def _lane(self) -> str | None:
        return self.rng.choice([name for name, kind in self.kinds.items() if kind == "lane"] or [None])

    def _place(self, name: str) -> None:
        program, lane, area = self.program, self._lane(), self._area()
        program.objects.append(name)
        way = self.rng.randrange(4)
        start = f"{name} = new Object"
        free = "facing Range(-180, 180) deg"
        if lane is not None and way == 0:
            last = self.rng.choice((0, -1))
            program.lines.append(f"{start} at {lane}.centerline[{last}], {free}")
            program.places[name] = lambda found: shapely.Point(_ends(found[lane])[last])
        elif lane is not None and way == 1:
            program.lines.append(f"{start} in {lane}.centerline, {free}")
            program.places[name] = lambda found: _shape(found[lane].centerline)
        else:
            program.lines.append(f"{start} in {area}, {free}")
            program.places[name] = lambda found: _shape(found[area])
        where = program.places[name]
        program.checks.append(
            lambda found, things, slack: where(found).distance(shapely.Point(things[name])) <= REACH + slack
        )

    def _require(self) -> None:
        one, other = self._test(), self._test()
        way = self.rng.randrange(4)
        if way == 0:
            self.program.lines.append(f"require {one[0]} or {other[0]}")
            self.program.checks.append(lambda *args: one[1](*args) or other[1](*args))
        elif way == 1:
            self.program.lines.append(f"require not ({one[0]}) or ({other[0]})")
            self.program.checks.append(
                lambda found, things, slack: not one[1](found, things, -slack) or other[1](found, things, slack)
            )
        else:
            self.program.lines.append(f"require {one[0]}")
            self.program.checks.append(one[1])

    def _test(self) -> tuple[str, Check]:
        name, area = self.rng.choice(("ego", "other")), self._area()
        limit = round(self.rng.uniform(1, 60), 1)
        match self.rng.randrange(4):
            case 0:
                return (
                    f"(distance from {name} to {area}) <= {limit}",
                    lambda found, things, slack: _distance(found[area], things[name]) <= limit + slack,
                )
            case 1:
                return (
                    f"(distance from {name} to {area}) >= {limit}",
                    lambda found, things, slack: _distance(found[area], things[name]) >= limit - slack,
                )
            case 2:
                same = self.rng.choice([each for each in self.kinds if self.kinds[each] == self.kinds[area]])
                return f"{area} is {same}", lambda found, *_: found[area] is found[same]
            case _:
                same = self.rng.choice([each for each in self.kinds if self.kinds[each] == self.kinds[area]])
                return f"{area} is not {same}", lambda found, *_: found[area] is not found[same]


def _ends(lane: Any) -> list[tuple[float, float]]:
    return [lane.centerline.lines[0].coords[0], lane.centerline.lines[-1].coords[-1]]


def label_for(program: Program, rng: random.Random) -> Label:
    """A label whose objects stand where some combination puts them, or near by, or where another one puts them."""
    combinations = list(program.combinations())
    found = rng.choice(combinations)
    things: list[LabelObject] = []
    for name in program.objects:
        if rng.random() < 0.2:
            found = rng.choice(combinations)
        shape = program.places[name](found)
        if shape.geom_type in ("Polygon", "MultiPolygon"):
            west, south, east, north = shape.bounds
            point = shape.representative_point()
            for _ in range(20):
                tried = shapely.Point(rng.uniform(west, east), rng.uniform(south, north))
                if shape.contains(tried):
                    point = tried
                    break
        elif shape.geom_type == "Point":
            point = shape
        else:
            point = shapely.get_parts(shape)[0].interpolate(rng.random(), normalized=True)
        off = rng.choice((0.0, 0.0, 0.1, 2.0, 30.0))
        turn = rng.uniform(0, math.tau)
        things.append(
            LabelObject(name, "Car", "Car", point.x + off * math.cos(turn), point.y + off * math.sin(turn), 0.0)
        )
    return Label("0", "r", 0, "copies", things[0], tuple(things[1:]))


def clear(program: Program, label: Label) -> bool | None:
    """Whether a label matches; None where it hangs on a rounding."""
    answers = {program.matches(label, slack) for slack in (-_CLOSE, _CLOSE)}
    return answers.pop() if len(answers) == 1 else None
