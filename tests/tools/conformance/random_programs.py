"""Random programs of Scenic 3's static fragment, for the differential test.

An object's line ends in `# free: P H`: its place may be P metres from where it is and its heading H radians from what
it is, given the other objects; `inf` where nothing is known. Each object made by itself has a width of its own, so that
none can play the role of another.
"""

from __future__ import annotations

import math
import random

from random_places import MapLookups, Spot
from random_terms import ANY, Thing
from wrong_lines import WRONG, WRONG_ON_ROADS

DRIVING_CLASSES = ("Car", "Car", "Car", "Pedestrian")


def compose(seed: str) -> str:
    """A program; the same for the same seed."""
    rng = random.Random(seed)
    return _Program(rng, driving=rng.random() < 0.4).write()


class _Program(MapLookups):
    made: int = 0
    mutated: bool = False

    def write(self) -> str:
        """The whole program."""
        if self.driving:
            self.lines.append("model scenic.domains.driving.model")
        elif self.chance(0.1):
            self.lines.append("workspace = Workspace(RectangularRegion((0, 0), 0, 400, 400))")
        self._ego()
        self.mutated = self.chance(0.08)
        for _ in range(self.rng.randint(0, 4)):
            self._statement()
        self._object(by_itself=True)
        if self.mutated:
            self._mutate()
        elif self.chance(0.6):
            for _ in range(self.rng.randint(1, 2)):
                self._requirement()
        if self.chance(0.12):
            wrong = self.rng.choice(WRONG + WRONG_ON_ROADS if self.driving else WRONG)
            self.lines.append(wrong)
        return "\n".join([*self.lines, ""])

    def _ego(self) -> None:
        view = self.rng.choice(("", ", with viewAngle 100 deg", ", with visibleDistance 60", ", with viewAngle 1.5"))
        if self.driving:
            place = self.rng.choice(("", "", " on road", f" on {self.element(0).text}"))
            self.lines.append(f"ego = new Car{place or ' with speed 0'}{view}")
            self.on_road.add("ego")
        elif self.chance(0.3):
            self.things.append(Thing("ego"))  # what follows may not refer to it
            self.things.clear()
            self.lines.append(f"ego = new Object at (Range(-3, 3), {self.rng.randint(-3, 3)}), "
                              f"facing Range(-20, 20) deg, with width 2, with length 5{view}")  # fmt: skip
        else:
            self.lines.append(f"ego = new Object at (3, -4), facing {self.rng.randint(-180, 180)} deg, "
                              f"with width 2, with length 5{view}")  # fmt: skip
        self.things.append(Thing("ego", is_object=True))

    def _statement(self) -> None:
        options = [self._object, self._object, self._object, self._point, self._point, self._param, self._function]
        options += [self._class, self._loop, self._polyline]
        self.rng.choice(options)()

    # --- things

    def _point(self) -> None:
        name = f"p{len(self.things)}"
        spot = self.spot(walking=True)
        oriented = self.chance(0.7)
        if not oriented and spot.turned:
            return
        words, turn = [spot.text], 0.0 if spot.turn is None else spot.turn
        if oriented and self.chance(0.4):
            text, turn = self.facing(spot, on_road=False)
            words.append(text)
        if self.chance(0.2):
            words.append("with visibleDistance 25")
        self.lines.append(f"{name} = new {'OrientedPoint' if oriented else 'Point'} {', '.join(words)}")
        self.things.append(Thing(name, spot.spread, turn, oriented))

    def _object(self, kind: str | None = None, extra: list[str] | None = None, *, by_itself: bool = True) -> None:
        kind = kind or (self.rng.choice(DRIVING_CLASSES) if self.driving else "Object")
        walking = kind == "Pedestrian" or not self.driving
        spot = self.spot(walking=walking)
        # a car that may be off the road has no direction of traffic there, and Scenic says 0 instead
        on_road = kind == "Car" and self.chance(0.45) and not spot.text.startswith("contained in")
        width = round(0.6 + 0.17 * self.made, 2)
        words, turn = [spot.text], 0.0 if spot.turn is None else spot.turn
        if self.driving and spot.turn is None:
            turn = ANY
        if self.chance(0.5) or (kind == "Car" and not on_road and spot.turn is None):
            text, turn = self.facing(spot, on_road=on_road)
            words.append(text)
        if self.driving and spot.turned:
            turn = ANY
        self.made += 1
        words += [f"with width {width}"]
        words += [f"with length {self.value(0.5, 3)}"] * self.chance(0.7)
        words += ["with allowCollisions True"] * self.chance(0.8)
        words += ["with requireVisible False"] * self.chance(0.8)
        if self.driving and not on_road:
            words.append("with regionContainedIn None")
        words += ["visible"] * (self.chance(0.08) and not spot.text.startswith("visible"))
        words += extra or []
        head, rest = words[0], words[1:]
        self.rng.shuffle(rest)
        name = f"o{len(self.things)}"
        free = f"  # free: {spot.spread:.3g} {turn:.3g}" if by_itself and width > 0 else ""
        self.lines.append(f"{name} = new {kind} {', '.join([head, *rest])}{free}")
        self.things.append(Thing(name, is_object=True))
        if on_road:
            self.on_road.add(name)

    def _class(self) -> None:
        name = f"Kind{len(self.lines)}"
        base = self.rng.choice(("Car", "Pedestrian")) if self.driving else "Object"
        body = [f"    length: {self.number(1, 3, 0).text}"]
        if self.chance(0.5):
            body.append(f"    gap: {self.number(1, 3, 1).text}")
            body.append(f"    cargo: self.gap + {self.rng.randint(1, 3)}")
        if self.chance(0.3) and not self.driving:
            body.append(f"    heading: {self.rng.randint(-90, 90)} deg + self.twist")
            body.append(f"    twist: Range({self.rng.randint(0, 3)}, 4) deg")
        self.lines += [f"class {name}({base}):", *body]
        if self.chance(0.4):
            sub = f"{name}b"
            self.lines += [f"class {sub}({name}):", f"    allowCollisions: {self.chance(0.5)}"]
            name = sub
        spot: Spot = self.spot(walking=base != "Car")
        width = round(0.6 + 0.17 * self.made, 2)
        self.made += 1
        words = [spot.text, f"with width {width}", "with requireVisible False", "with allowCollisions True"]
        if self.driving:
            text, _ = self.facing(spot, on_road=False)
            words += [text, "with regionContainedIn None"]
        instance = f"o{len(self.things)}"
        self.lines.append(f"{instance} = new {name} {', '.join(words)}  # free: {spot.spread:.3g} inf")
        self.things.append(Thing(instance, is_object=True))

    def _loop(self) -> None:
        thing = self.rng.choice([thing for thing in self.things if thing.is_object])
        count, gap = self.rng.randint(1, 3), self.number(1, 4, 0)
        kind, last = ("Car" if self.driving else "Object"), f"last{len(self.lines)}"
        clear = ", with allowCollisions True, with requireVisible False"
        clear += ", with regionContainedIn None" * self.driving
        form = self.rng.randrange(3)
        if form == 0:
            self.lines += [
                f"{last} = {thing.name}",
                f"for i in range({count}):",
                f"    {last} = new {kind} {self.rng.choice(('ahead of', 'left of'))} {last} by {gap.text}, "
                f"with width 0.3{clear}",
            ]
        elif form == 1:
            self.lines += [
                f"for k, side in enumerate([-4, 5, 9][:{count}]):",
                "    if k % 2 == 0 and side > 100:",
                "        continue",
                f"    new {kind} at {thing.name}.position + Vector(side, 3 * k), facing side * 3 deg, "
                f"with width 0.3{clear}",
            ]
        else:
            self.lines += [
                f"def row{len(self.lines)}(start, gap=2):",
                f"    return [new {kind} at start offset by (n * 3, gap), facing 9 deg, with width 0.3{clear} "
                f"for n in range({count})]",
                f"row{len(self.lines)}({thing.name}, gap={gap.text})",
            ]

    def _polyline(self) -> None:
        if self.driving:
            self._object()
            return
        x, y = self.rng.randint(-9, 9), self.rng.randint(-9, 9)
        name = f"line{len(self.lines)}"
        corners = [(x, y), (x + 20, y + 8), (x + 25, y + 30), (x + 9, y + 40)]
        self.lines.append(f"{name} = PolylineRegion({corners})")
        self.polylines.append(name)

    def _function(self) -> None:
        name = f"f{len(self.lines)}"
        self.lines += [
            f"def {name}(t, extra={self.rng.randint(0, 4)}):",
            "    if extra > 2:",
            "        return 2 * t + 1",
            "    return t + extra",
        ]
        self.functions.append(name)

    def _param(self) -> None:
        value = (
            self.number(0, 9).text if self.chance(0.6) else self.rng.choice(("Uniform('dry', 'wet')", "'dry'", "True"))
        )
        self.lines.append(f"param q{len(self.lines)} = {value}")

    def _mutate(self) -> None:
        things = [thing.name for thing in self.things if thing.is_object]
        chosen = self.rng.choice(things)
        by = self.rng.choice(("", " by 2", " by 0.5"))
        self.lines.append("mutate" if self.chance(0.3) else f"mutate {chosen}{by}")

    # --- requirements

    def _requirement(self) -> None:
        wanted = self._condition(2)
        head = self.rng.choice(("require", "require", "require", "require[0.7]"))
        name = " as wish" if self.chance(0.1) and "implies" not in wanted else ""
        self.lines.append(f"{head} {wanted}{name}")

    def _condition(self, depth: int) -> str:
        if depth > 0 and self.chance(0.5):
            a, b = self._condition(depth - 1), self._condition(depth - 1)
            form = self.rng.choice(("({a}) or ({b})", "({a}) and ({b})", "({a}) implies ({b})", "not ({a})", "({a})"))
            return form.format(a=a, b=b)
        one, two = self.rng.choice(self.things), self.rng.choice(self.things)
        limit, half = self.rng.randint(4, 60), self.rng.randint(10, 180)
        others = [thing for thing in self.things if thing.name != "ego"]  # Scenic stumbles over the ego itself
        far = self.rng.choice(others) if others else one
        turned = self.rng.choice([thing for thing in others if thing.oriented] or [one])
        options = [
            f"(distance from {one.name} to {far.name}) {self.rng.choice('<>')} {limit}",
            f"(distance to {far.name}) <= {limit}",
            f"{one.name}.position.x {self.rng.choice('<>')} {self.rng.randint(-20, 20)}",
            f"{one.name} in CircularRegion((0, 0), {limit})",
            f"{one.name} not in RectangularRegion((3, 3), 20 deg, {limit}, 9)",
            f"all([distance from ego to t < {limit + 20} for t in [{one.name}, {two.name}]])",
            f"5 < (distance from {one.name} to (3, 3)) < {limit + 5}",
            f"abs(angle from ego to {one.name}) < {half} deg",
        ]
        if one.oriented:
            options += [
                f"{one.name} can see {two.name}",
                f"abs(relative heading of {turned.name}) < {half} deg",
                f"(apparent heading of {one.name} from (50, 50)) > {half - 120} deg",
            ]
        if one.is_object:
            options.append(f"{one.name} intersects CircularRegion((0, 0), {limit})")
            options.append(f"{one.name}.width < 1.1 or {one.name}.length > 2")
        if self.driving and one.is_object:
            options += [
                f"{one.name} in road", f"not ({one.name} in intersection)",
                f"(distance from {one.name} to intersection) < {limit}", f"{one.name}._lane is not None",
                f"network.laneAt({one.name}) is network.laneAt({two.name})",
                f"{one.name}._intersection is None",
                f"{one.name}._road is not {self.rng.choice(sorted(self.on_road))}.road",
            ]  # fmt: skip
        options += [f"{term.text} > {self.rng.randint(-3, 3)}" for term in self.hidden if "v" in term.text]
        return self.rng.choice(options)


def freedoms(text: str) -> dict[float, tuple[float, float]]:
    """By the width of an object: how far it may be from where it is, and turned from how it is."""
    found: dict[float, tuple[float, float]] = {}
    for line in text.splitlines():
        if "# free: " in line and "with width " in line:
            width = float(line.split("with width ")[1].split(",")[0].split("#")[0])
            place, heading = map(float, line.split("# free: ")[1].split())
            found[width] = (place, heading)
    if any(line.startswith("mutate") for line in text.splitlines()):
        return dict.fromkeys(found, (math.inf, math.inf))
    return found
