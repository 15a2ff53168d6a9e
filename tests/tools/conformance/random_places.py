"""Random regions, fields and specifiers of Scenic, over random expressions."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

from random_terms import ANY, MAP_SIZE, Term, Terms, turned

SIDES = ("left of", "right of", "ahead of", "behind")
ELEMENTS = (
    "road", "road", "intersection", "roadOrShoulder", "network.laneRegion", "network.lanes[{n}]",
    "network.roads[{n}]", "network.laneSections[{n}]", "network.laneGroups[{n}]", "network.intersections[{k}]",
    "Uniform(*network.lanes)", "Uniform(*network.roads)", "Uniform(*network.intersections)",
    "Uniform(*network.laneSections)", "network.lanes[{n}].centerline", "Uniform(*network.lanes).centerline",
    "Uniform(*network.intersections[{k}].incomingLanes)",
    "Uniform(*network.intersections[{k}].maneuvers).connectingLane",
    "Uniform(*filter(lambda i: i.is3Way, network.intersections))", "network.roads[{n}].forwardLanes",
    "Uniform(*[s for s in network.laneSections if s._laneToLeft is not None])", "network.roads[{n}].lanes[0]",
    "Uniform(*network.lanes).group", "network.laneSections[{n}].lane",
    "Uniform(*network.intersections).maneuvers[0].startLane",
)  # fmt: skip
LOOKED_UP = (
    "{o}.lane", "{o}.road", "{o}.laneGroup", "{o}.laneSection", "{o}.lane.centerline", "{o}.laneGroup.road",
    "network.laneAt({o})", "network.roadAt({o}.position)", "{o}.lane.group",
)  # fmt: skip
WALKED = ("sidewalk", "network.walkableRegion", "Uniform(*network.sidewalks)", "network.sidewalks[{n}]")


@dataclass(frozen=True)
class Spot:
    """What a position specifier says.

    Attributes:
        text: The specifier.
        spread: How far the position may be from where it is.
        turn: The spread of the heading that comes with it; None where it brings none.
        plain: Whether `apparently facing` means the same here and in Scenic 3.1.1.
        turned: Whether the position hangs on the object's own heading.
        on_field: The field that certainly has a heading there.
    """

    text: str
    spread: float
    turn: float | None = None
    plain: bool = False
    turned: bool = False
    on_field: str | None = None


class MapLookups(Terms):
    """Writes regions and specifiers."""

    # --- regions

    def region(self, depth: int = 1) -> Term:
        """A region, whose spread is its diameter and whose turn is that of the headings it gives, -1 for none."""
        if self.driving and self.chance(0.75):
            return self.element(depth)
        center, radius = self.vector(0), self.constant(1, 12)
        turn, wide, long = self.angle(0), self.constant(1, 15), self.constant(1, 15)
        radius, wide, long = (Term(f"{part.size + 0.5}", 0.0, part.size + 0.5) for part in (radius, wide, long))
        r, cap = radius.size, 2 * radius.size + center.spread
        x, y = round(self.rng.uniform(-25, 25), 1), round(self.rng.uniform(-25, 25), 1)
        corners = [(x, y), (x + 9, y), (x + 4, y + 3), (x + 9, y + 12), (x, y + 9)]
        options = [
            Term(f"CircularRegion({center.text}, {radius.text})", cap, turn=-1),
            Term(f"RectangularRegion({center.text}, {turn.text}, {wide.text}, {long.text})",
                 wide.size + long.size + center.spread, turn=-1),
            Term(f"SectorRegion({center.text}, {radius.text}, {turn.text}, {self.rng.randint(20, 300)} deg)", cap,
                 turn=-1),
            Term(f"PolygonalRegion({corners})", 18.0, turn=-1),
            Term(f"PointSetRegion('posts', {corners})", 18.0, turn=-1),
        ]  # fmt: skip
        options += [Term(line, 120.0, turn=ANY) for line in self.polylines]
        if depth > 0:
            options += self.combined(depth, center, r)
        return self.rng.choice(options)

    def combined(self, depth: int, center: Term, r: float) -> list[Term]:
        """Regions made of others; polygons only, so that Scenic can combine them."""
        x, y = round(self.rng.uniform(-20, 20), 1), round(self.rng.uniform(-20, 20), 1)
        disc = Term(f"CircularRegion(({x}, {y}), {r + 5:.1f})", 2 * r + 10, turn=-1)
        hole = f"RectangularRegion(({x + 2}, {y}), {self.rng.randint(0, 90)} deg, {r:.1f}, {r + 4:.1f})"
        far = 4 * r + 30
        combined = [
            replace(disc, text=f"{disc.text}.intersect({hole})"),
            replace(disc, text=f"{disc.text}.difference({hole})"),
            Term(f"{disc.text}.union({hole})", far, turn=-1),
            Term(f"(visible {disc.text})", disc.spread, turn=-1),
            Term(f"(not visible {disc.text})", disc.spread, turn=-1),
        ]
        viewers = [thing for thing in self.things if thing.spread == 0]
        if viewers:
            viewer = self.rng.choice(viewers).name
            combined.append(Term(f"({disc.text} visible from {viewer})", disc.spread, turn=-1))
            combined.append(Term(f"({disc.text} not visible from {viewer})", disc.spread, turn=-1))
        return combined

    def element(self, depth: int) -> Term:
        """A region of the road network where vehicles are."""
        text = self.rng.choice(ELEMENTS)
        on_road = [thing.name for thing in self.things if thing.is_object and thing.name in self.on_road]
        if on_road and self.chance(0.25):
            text = self.rng.choice(LOOKED_UP).replace("{o}", self.rng.choice(on_road))
        text = text.replace("{n}", str(self.rng.randint(0, 9))).replace("{k}", str(self.rng.randint(0, 3)))
        if depth > 0 and self.chance(0.15):
            text = f"(visible {text})" if "." not in text and "(" not in text else text
        return Term(text, MAP_SIZE, turn=ANY)

    # --- positions

    def spot(self, *, walking: bool = False, own_turn: float = 0.0) -> Spot:
        """A position specifier."""
        options: list[Callable[[], Spot]] = [self.at, self.offset, self.beside, self.within, self.away]
        if self.driving:
            options += [self.within] * 4
            if walking:
                options += [self.walked] * 4
        if walking or not self.driving:
            options += [self.ahead_of_point]
        return self.rng.choice(options)()

    def at(self) -> Spot:
        """`at` a vector or a thing."""
        thing = self.rng.choice(self.things)
        if self.chance(0.2):
            return Spot(f"at {thing.name}", thing.spread, thing.turn if thing.oriented else None)
        v = self.elsewhere(0) if self.chance(0.3) else self.vector(2)
        return Spot(f"at {v.text}", v.spread, plain=not v.text.endswith("position"))

    def offset(self) -> Spot:
        """`offset by` and `offset along`: from the ego."""
        ego, by = self.things[0], self.pair(9, 1)
        if self.chance(0.5):
            return Spot(f"offset by {by.text}", ego.spread + turned(by, ego.turn), ego.turn)
        h = self.angle(1)
        return Spot(f"offset along {h.text} by {by.text}", ego.spread + turned(by, h.spread), ANY)

    def beside(self) -> Spot:
        """At a side of an oriented point or an object."""
        thing = self.rng.choice([thing for thing in self.things if thing.oriented])
        by, side = self.gap(), self.rng.choice(SIDES)
        return Spot(f"{side} {thing.name}{by.text}", thing.spread + turned(by, thing.turn), thing.turn)

    def gap(self) -> Term:
        """`by` some way, or nothing."""
        if self.chance(0.15):
            return Term("", 0.0, 10.0)
        way = self.number(0.5, 8, 1) if self.chance(0.7) else self.pair(6)
        return Term(f" by {way.text}", way.spread, way.size + 10)

    def ahead_of_point(self) -> Spot:
        """At a side of a vector, in the direction of one's own heading."""
        v, by = self.vector(1), self.gap()
        return Spot(f"{self.rng.choice(SIDES)} {v.text}{by.text}", v.spread + by.spread + 2 * by.size + 10, turned=True)

    def away(self) -> Spot:
        """`beyond`."""
        v = self.elsewhere(1)
        by = self.number(1, 9, 1) if self.chance(0.5) else self.pair(6, 0)
        origin = self.vector(0) if self.chance(0.5) else None
        start = origin or Term("", self.things[0].spread)
        spread = ANY if v.spread or start.spread else by.spread
        return Spot(f"beyond {v.text} by {by.text}" + (f" from {origin.text}" if origin else ""), spread, ANY)

    def within(self) -> Spot:
        """In a region, or where something sees it."""
        if self.chance(0.1):
            return self.seen()
        region = self.region()
        word = self.rng.choice(("in", "on", "on", "contained in"))
        turn = None if region.turn < 0 else region.turn
        field = region.text if region.text in self.polylines else None
        plain = turn is None and word != "contained in"
        return Spot(f"{word} {region.text}", region.spread, turn, plain, on_field=field and f"{field}.orientation")

    def seen(self) -> Spot:
        """`visible` as a position."""
        oriented = [thing for thing in self.things if thing.spread == 0]
        if oriented and self.chance(0.4):
            return Spot(f"visible from {self.rng.choice(oriented).name}", 150.0)
        return Spot("visible", 150.0)

    def walked(self) -> Spot:
        """Where pedestrians are."""
        return Spot(f"on {self.rng.choice(WALKED).replace('{n}', '0')}", MAP_SIZE, ANY)

    # --- headings

    def facing(self, spot: Spot, *, on_road: bool) -> tuple[str, float]:
        """A heading specifier, with the spread of the heading that it gives."""
        h, v = self.angle(1), self.elsewhere(1)
        options = [(f"facing {h.text}", h.spread), (f"facing {h.text}", h.spread)]
        if not spot.turned:
            to = ANY if v.spread else 0.0
            options += [(f"facing {word} {v.text}", to) for word in ("toward", "away from")]
            options += [(f"facing directly {word} {v.text}", to) for word in ("toward", "away from")]
            if spot.plain and not self.driving:  # where cars inherit the direction of the road
                options.append((f"apparently facing {h.text}", h.spread + self.things[0].spread))
                options.append((f"apparently facing {h.text} from {v.text}", h.spread + to))
        if spot.on_field:
            options += [(f"facing {spot.on_field}", ANY), (f"facing {h.text} relative to {spot.on_field}", ANY)]
        if on_road:
            options += [("facing roadDirection", ANY), (f"facing {h.text} relative to roadDirection", ANY)] * 2
        thing = self.rng.choice([thing for thing in self.things if thing.oriented])
        options.append((f"facing {h.text} relative to {thing.name}", h.spread + thing.turn))
        options.append((f"facing {h.text} relative to {thing.name}.heading", h.spread + thing.turn))
        if spot.turn is None and not spot.turned:
            options.append((f"with heading {h.text}", h.spread))
        text, spread = self.rng.choice(options)
        return text, spread if spread < math.pi else ANY
