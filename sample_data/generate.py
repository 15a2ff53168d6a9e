"""Writes `crossroads/` next to this file: an invented town with simply simulated traffic, the same every time.

It is an interchange folder. Run it with `python sample_data/generate.py`.
"""

from __future__ import annotations

import json
import math
import re
import shutil
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
Point = tuple[float, float]

# The town: Main Street (two lanes each way, west to east), Side Street (one lane each way, south to north), traffic
# on the right, and the intersection between.
LANE_M = 3.5
SETBACK_M = 14.0
MAIN_M = 160.0
SIDE_M = 120.0
WALK_M = 2.5
ARMS = {"west": math.pi / 2, "east": -math.pi / 2, "north": 0.0, "south": math.pi}
"""Each arm's heading away from the intersection; heading 0 is north, counter-clockwise."""


def place(arm: str, right: float, out: float) -> Point:
    """The point of an arm that lies `out` metres from the centre and `right` metres to the right when leaving."""
    cos, sin = math.cos(ARMS[arm]), math.sin(ARMS[arm])
    return round(right * cos - out * sin, 3) + 0.0, round(right * sin + out * cos, 3) + 0.0


def lanes_of(arm: str) -> int:
    """Lanes in each direction."""
    return 2 if arm in ("west", "east") else 1


def length_of(arm: str) -> float:
    """Where the arm ends, from the centre."""
    return MAIN_M if arm in ("west", "east") else SIDE_M


def centre(arm: str, lane: int, *, leaving: bool) -> float:
    """Lateral place of a lane's middle; lane 0 is nearest to the middle of the road."""
    return (LANE_M * (lane + 0.5)) * (1 if leaving else -1)


def feature(id: str, kind: str, ring: Sequence[Point], **properties: Any) -> dict[str, Any]:
    """A polygon of the map, or a line for a curb."""
    if kind == "curb":
        geometry: dict[str, Any] = {"type": "LineString", "coordinates": list(ring)}
    else:
        geometry = {"type": "Polygon", "coordinates": [[*ring, ring[0]]]}
    return {"type": "Feature", "geometry": geometry, "properties": {"id": id, "kind": kind, **properties}}


def strip(arm: str, right: tuple[float, float], out: tuple[float, float]) -> list[Point]:
    """A rectangle of an arm."""
    (low, high), (near, far) = sorted(right), sorted(out)
    return [place(arm, low, near), place(arm, high, near), place(arm, high, far), place(arm, low, far)]


def arm_features(arm: str) -> list[dict[str, Any]]:
    """Road, groups, lanes, sidewalks, curbs and crossing of an arm."""
    side, end = lanes_of(arm) * LANE_M, length_of(arm)
    reach = (SETBACK_M, end)
    found = [
        feature(f"{arm}", "road", strip(arm, (-side, side), reach), forward=f"{arm}-out", backward=f"{arm}-in"),
        feature(f"{arm}-crossing", "crossing", strip(arm, (-side, side), (SETBACK_M, SETBACK_M + 3))),
    ]
    for way, sign in (("out", 1), ("in", -1)):
        other = "in" if way == "out" else "out"
        group = f"{arm}-{way}"
        area = strip(arm, (0, sign * side), reach)
        found.append(feature(group, "lane_group", area, road=arm, opposite=f"{arm}-{other}"))
        edge = sign * side
        found.append(feature(f"{group}-walk", "sidewalk", strip(arm, (edge, edge + sign * WALK_M), reach)))
        found.append(feature(f"{group}-curb", "curb", [place(arm, edge, SETBACK_M), place(arm, edge, end)]))
        for lane in range(lanes_of(arm)):
            area = strip(arm, (sign * LANE_M * lane, sign * LANE_M * (lane + 1)), reach)
            line = [place(arm, centre(arm, lane, leaving=way == "out"), out) for out in reach]
            links: dict[str, Any] = {"road": arm, "group": group}
            if lane > 0:
                links["left"] = f"{group}-{lane - 1}"
            if lane + 1 < lanes_of(arm):
                links["right"] = f"{group}-{lane + 1}"
            turns = [turn for turn in turns_of() if f"{group}-{lane}" in turn[:2]]
            if way == "in":
                links["successors"] = [turn_id(*turn) for turn in turns]
                line.reverse()
            else:
                links["predecessors"] = [turn_id(*turn) for turn in turns]
            found.append(feature(f"{group}-{lane}", "lane", area, centerline=[line], **links))
    return found


def turns_of() -> list[tuple[str, str]]:
    """Pairs of an incoming and an outgoing lane that a connecting lane joins."""
    around = ["north", "west", "south", "east"]
    pairs: list[tuple[str, str]] = []
    for number, arm in enumerate(around):
        ahead, left, right = (around[(number + step) % 4] for step in (2, 3, 1))
        last = lanes_of(arm) - 1
        for lane in range(lanes_of(arm)):
            pairs.append((f"{arm}-in-{lane}", f"{ahead}-out-{min(lane, lanes_of(ahead) - 1)}"))
        pairs.append((f"{arm}-in-0", f"{left}-out-0"))
        pairs.append((f"{arm}-in-{last}", f"{right}-out-{lanes_of(right) - 1}"))
    return pairs


def turn_id(source: str, target: str) -> str:
    """Name of a connecting lane."""
    return f"{source}>{target}"


def turn_line(source: str, target: str, right: float = 0.0) -> list[Point]:
    """From the end of one lane to the start of another, shifted to the right: straight or a smooth curve."""
    arm_in, _, lane_in = source.split("-")
    arm_out, _, lane_out = target.split("-")
    start = place(arm_in, centre(arm_in, int(lane_in), leaving=False) - right, SETBACK_M)
    end = place(arm_out, centre(arm_out, int(lane_out), leaving=True) + right, SETBACK_M)
    heading_in, heading_out = ARMS[arm_in] + math.pi, ARMS[arm_out]
    reach = math.dist(start, end) * (0.39 if abs(math.sin(heading_in - heading_out)) > 0.5 else 1 / 3)
    first = start[0] - reach * math.sin(heading_in), start[1] + reach * math.cos(heading_in)
    second = end[0] + reach * math.sin(heading_out), end[1] - reach * math.cos(heading_out)
    steps = 12
    return [bezier((start, first, second, end), step / steps) for step in range(steps + 1)]


def bezier(corners: tuple[Point, Point, Point, Point], t: float) -> Point:
    """A point of a cubic curve."""
    weights = ((1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t), t**3)
    x, y = (sum(w * corner[axis] for w, corner in zip(weights, corners, strict=True)) for axis in (0, 1))
    return round(x, 3) + 0.0, round(y, 3) + 0.0


def town_features() -> list[dict[str, Any]]:
    """The map."""
    square = [(-SETBACK_M, -SETBACK_M), (SETBACK_M, -SETBACK_M), (SETBACK_M, SETBACK_M), (-SETBACK_M, SETBACK_M)]
    features = [element for arm in ARMS for element in arm_features(arm)]
    features.append(feature("centre", "intersection", square, roads=["centre-road"]))
    features.append(feature("centre-road", "road", square, forward="centre-group", intersection="centre"))
    features.append(feature("centre-group", "lane_group", square, road="centre-road"))
    for source, target in turns_of():
        ring = [*turn_line(source, target, -1.6), *reversed(turn_line(source, target, 1.6))]
        links = {"road": "centre-road", "group": "centre-group", "predecessors": [source], "successors": [target]}
        line = turn_line(source, target)
        features.append(feature(turn_id(source, target), "lane", ring, centerline=[line], **links))
    return features


@dataclass(frozen=True)
class Actor:
    """Somebody who follows a path.

    Attributes:
        name: Also the track.
        kind: Class.
        size: Width and length in metres.
        path: Corners of the path.
        start: Distance along the path at the beginning, metres.
        speed: Metres per second.
        waits: Seconds before it sets off.
        facing: Heading to keep whatever the path; None to look along the path.
    """

    name: str
    kind: str
    size: tuple[float, float]
    path: Sequence[Point]
    start: float = 0.0
    speed: float = 0.0
    waits: float = 0.0
    facing: float | None = None

    def state(self, seconds: float) -> tuple[Point, float, Point]:
        """Position, heading and velocity at a time."""
        moving = seconds >= self.waits
        left = self.start + self.speed * max(0.0, seconds - self.waits)
        for a, b in zip(self.path, self.path[1:], strict=False):
            piece = math.dist(a, b)
            if left <= piece or b == self.path[-1]:
                ahead = (b[0] - a[0]) / piece, (b[1] - a[1]) / piece
                heading = math.atan2(-ahead[0], ahead[1]) if self.facing is None else self.facing
                speed = self.speed if moving else 0.0
                return (
                    (a[0] + ahead[0] * left, a[1] + ahead[1] * left),
                    heading,
                    (ahead[0] * speed, ahead[1] * speed),
                )
            left -= piece
        raise ValueError(f"{self.name} has no path")


CAR, TRUCK, BUS, BICYCLE, PERSON, CONE = (1.8, 4.4), (2.5, 8.0), (2.6, 11.0), (0.7, 1.8), (0.6, 0.6), (0.4, 0.4)


def drive(*lanes: str, first: float = 0.0) -> list[Point]:
    """The path along lanes that follow each other, through the intersection, without `first` metres of the first."""
    path: list[Point] = []
    for number, lane in enumerate(lanes):
        arm, way, index = lane.split("-")
        right = centre(arm, int(index), leaving=way == "out")
        far, near = place(arm, right, length_of(arm) - first), place(arm, right, SETBACK_M)
        path += [far, near] if way == "in" else [near, place(arm, right, length_of(arm))]
        if number + 1 < len(lanes):
            path += turn_line(lane, lanes[number + 1])[1:-1]
    return path


def shift(arm: str, rights: tuple[float, float], outs: tuple[float, float]) -> list[Point]:
    """A smooth change from one lateral place of an arm to another between two distances."""
    steps = [step / 12 for step in range(13)]
    return [
        place(arm, rights[0] + (rights[1] - rights[0]) * (3 * t**2 - 2 * t**3), outs[0] + (outs[1] - outs[0]) * t)
        for t in steps
    ]


def standing(name: str, kind: str, size: tuple[float, float], arm: str, right: float, out: float, turn: float) -> Actor:
    """Somebody who stays where they are, turned from the direction out of the arm."""
    here = place(arm, right, out)
    return Actor(
        name, kind, size, [here, place(arm, right, out + 1)], facing=math.remainder(ARMS[arm] + turn, math.tau)
    )


def recordings() -> dict[str, list[Actor]]:
    """Each recording's actors, the ego first."""
    walk = LANE_M + 1.2
    return {
        "01-quiet-street": [
            Actor("ego", "Car", CAR, drive("south-in-0", "north-out-0"), 10, 8),
            Actor("truck-1", "Truck", TRUCK, drive("south-in-0", "north-out-0"), 34, 8),
            Actor("walker-1", "Adult", PERSON, [place("south", walk, 100), place("south", walk, 20)], 0, 1.3),
            Actor("walker-2", "Child", PERSON, [place("south", walk + 0.6, 99), place("south", walk, 20)], 0, 1.3),
            Actor("bicycle-1", "Bicycle", BICYCLE, drive("north-in-0", "south-out-0"), 40, 4),
            standing("cone-1", "Cone", CONE, "north", -3.2, 60, 0),
        ],
        "02-pedestrian-crosses": [
            Actor("ego", "Car", CAR, drive("west-in-0", "east-out-0"), 110, 6, waits=11),
            Actor("walker-1", "Adult", PERSON, [place("west", -9, 15.5), place("west", 9, 15.5)], 0, 1.4, waits=2),
            Actor("walker-2", "Adult", PERSON, [place("west", 8.5, 15.5), place("west", 8.5, 90)], 0, 1.2),
            Actor("car-1", "Car", CAR, drive("east-in-1", "west-out-1"), 60, 9),
            Actor("bus-1", "Bus", BUS, drive("west-in-1"), 118, 0),
        ],
        "03-busy-intersection": [
            Actor("ego", "Car", CAR, drive("south-in-0", "north-out-0"), 101, 7, waits=9),
            Actor("car-left-1", "Car", CAR, drive("east-in-0", "west-out-0"), 112, 9),
            Actor("car-right-1", "Car", CAR, drive("west-in-1", "east-out-1"), 108, 9),
            Actor("car-left-2", "Car", CAR, drive("east-in-1", "west-out-1"), 80, 9),
            Actor("car-right-2", "Van", (2.0, 5.4), drive("west-in-0", "east-out-0"), 76, 9),
            Actor("motorcycle-1", "Motorcycle", (0.8, 2.1), drive("west-in-1", "south-out-0"), 70, 8),
        ],
        "04-against-traffic": [
            Actor(
                "ego",
                "Car",
                CAR,
                [
                    place("north", 1.75, 20),
                    *shift("north", (1.75, -1.75), (40, 58)),
                    *shift("north", (-1.75, 1.75), (86, 102)),
                    place("north", 1.75, 120),
                ],
                0,
                7,
            ),
            Actor("car-parked", "Car", CAR, [place("north", 1.9, 74), place("north", 1.9, 75)]),
            Actor("car-behind", "Car", CAR, [place("north", 1.75, 16), place("north", 1.75, 66)], 0, 4),
            standing("cone-1", "Cone", CONE, "north", 3.1, 68, 0),
            Actor("walker-1", "PoliceOfficer", PERSON, [place("north", walk, 70), place("north", walk, 78)], 0, 0.5),
        ],
        "05-two-lane-traffic": [
            Actor("ego", "Car", CAR, drive("south-in-0", "north-out-0"), 4, 8),
            Actor("car-leader", "Car", CAR, drive("south-in-0", "north-out-0"), 22, 8),
            Actor("car-oncoming-1", "Car", CAR, drive("north-in-0", "south-out-0"), 60, 8),
            Actor("car-oncoming-2", "Car", CAR, drive("north-in-0", "south-out-0"), 80, 8),
            Actor("walker-1", "Adult", PERSON, [place("north", walk, 90), place("north", walk, 20)], 0, 1.4),
        ],
        "06-cut-in": [
            Actor("ego", "Car", CAR, [place("east", 1.75, 16), place("east", 1.75, 160)], 2, 5),
            Actor(
                "car-cutting",
                "Car",
                CAR,
                [
                    place("east", 5.25, 16),
                    *shift("east", (5.25, 1.75), (46, 58)),
                    place("east", 1.75, 160),
                ],
                3,
                5.3,
            ),
            Actor("truck-1", "Truck", TRUCK, [place("east", 5.25, 84), place("east", 5.25, 160)], 0, 3),
            Actor("car-1", "Car", CAR, drive("east-in-0", "west-out-0"), 20, 10),
            Actor("dog-1", "Animal", (0.4, 0.9), [place("east", 8.6, 70), place("east", 8.6, 50)], 0, 1),
        ],
    }


WEATHER = {"01": "cloudy", "02": "sunny", "03": "sunny", "04": "rainy", "05": "cloudy", "06": "rainy"}
FRAMES = 26
PERIOD_S = 0.5


def crossroads_labels() -> Iterable[dict[str, Any]]:
    """All labels of the town."""
    for number, (name, actors) in enumerate(recordings().items()):
        for step in range(FRAMES):
            frame = f"{name}/{step:02}"
            ego, *others = (described(actor, step * PERIOD_S) for actor in actors)
            del ego["id"], ego["class"], ego["track"]
            yield {
                "id": frame,
                "recording": name,
                "timestamp_us": 1_700_000_000_000_000 + number * 3_600_000_000 + int(step * PERIOD_S * 1e6),
                "map": "crossroads",
                "ego": ego,
                "objects": others,
                "params": {"weather": WEATHER[name[:2]]},
                "sensors": {"CAM_FRONT": f"samples/CAM_FRONT/{frame}.jpg"},
            }


def described(actor: Actor, seconds: float) -> dict[str, Any]:
    """An actor as an object of a label."""
    position, heading, velocity = actor.state(seconds)
    return {
        "id": actor.name,
        "class": actor.kind,
        "track": actor.name,
        "position": [round(value, 3) for value in position],
        "heading": round(heading, 5),
        "width": actor.size[0],
        "length": actor.size[1],
        "velocity": [round(value, 3) for value in velocity],
    }


def write(path: Path, text: str) -> None:
    """Write a text file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text + "\n", encoding="utf-8", newline="\n")


def compact(value: object) -> str:
    """JSON without blanks, and whole numbers without a fraction."""
    return re.sub(r"(?<=[\[,:])(-?\d+)\.0(?=[\],}])", r"\1", json.dumps(value, separators=(",", ":"))).replace(
        ":-0,", ":0,"
    )


def main(folder: Path = HERE) -> None:
    """Write the dataset into a folder, in place of what is there under its name."""
    target = folder / "crossroads"
    shutil.rmtree(target, ignore_errors=True)
    header: dict[str, object] = {"name": "crossroads", "interchange": 1, "angle": "heading", "classes": "scenic"}
    header["source"] = "invented by sample_data/generate.py; Apache-2.0"
    write(target / "dataset.json", json.dumps(header, indent=0))
    write(target / "labels.jsonl", "\n".join(compact(label) for label in crossroads_labels()))
    features = ",\n".join(compact(element) for element in town_features())
    write(target / "maps" / "crossroads.geojson", f'{{"type":"FeatureCollection","features":[\n{features}\n]}}')


if __name__ == "__main__":
    main()
