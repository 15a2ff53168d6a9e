"""Are the programs that Scenic's own repository publishes decided, and rightly?

Run by `make conformance SCENIC=CHECKOUT`: `python tests/tools/conformance/published.py CHECKOUT`. Scenic draws scenes
of each program of `examples/driving` and `examples/carla` on the town that it names and on another, once
(`published_scenes.py`). Each becomes a label with four more objects, in any order, and is matched with its program,
`--initial`, position=0.05 and heading=0.5deg: it must match. With an object displaced to where no program puts one, or
turned across the road, it must not. What takes longer than the limit counts as late. The table has the median and the
worst time of the labels of each program.
"""

from __future__ import annotations

import argparse
import math
import random
import statistics
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import shapely
from comparing import displaced, label_object, shown
from original import environment
from patience import OutOfPatienceError, patience
from published_scenes import Drawing, draw_all, drawings, is_drawn, maps_of, scenes_of
from run_conformance import SCENIC, read_map

from scenicq.compiler.program import compile_scenario
from scenicq.errors import ScenarioError, Source
from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import parse_tolerance
from scenicq.match.verdict import Match, NoMatch
from scenicq.store.labels import Label

TOLERANCE = parse_tolerance("position=0.05,heading=0.5deg")
COMPILING_S = 120.0
"""Seconds of processor time for compiling one program."""
ASIDE = (20.0, 60.0)
"""Metres from every road and sidewalk at which no program puts anything."""
ALONG = math.cos(math.radians(45.0))
"""The least cosine, either way, of the angle between the directions of roads that overlap and go the same way."""


@dataclass
class Row:
    """What came of one program on one town.

    Attributes:
        drawing: Which.
        compiling: Seconds of processor time.
        verdicts: Labels by what came: match, no, unknown, late.
        told, moved: Displaced labels that do not match, and all that were decided.
        times: Seconds of processor time of each label.
        said: What is to be said of it, one line each.
    """

    drawing: Drawing
    compiling: float = 0.0
    verdicts: dict[str, int] = field(default_factory=lambda: dict.fromkeys(("match", "no", "unknown", "late"), 0))
    told: int = 0
    moved: int = 0
    times: list[float] = field(default_factory=list[float])
    said: list[str] = field(default_factory=list[str])

    @property
    def good(self) -> bool:
        """Whether each scene matches and no displaced one does."""
        return not self.said

    def line(self) -> str:
        """The row of the table."""
        counts = "".join(f"{count:>8}" for count in self.verdicts.values())
        middle, worst = (statistics.median(self.times), max(self.times)) if self.times else (0.0, 0.0)
        return (
            f"{self.drawing.name:<66}{counts}{f'{self.told}/{self.moved}':>9}"
            f"{self.compiling:>9.2f}{middle:>9.3f}{worst:>9.3f}"
        )


_COLUMNS = (
    ("match", 8),
    ("no", 8),
    ("unknown", 8),
    ("late", 8),
    ("told", 9),
    ("compile", 9),
    ("median", 9),
    ("worst", 9),
)
HEADING = f"{'program.town':<66}" + "".join(f"{name:>{width}}" for name, width in _COLUMNS)


class Town:
    """A map with the places where nothing is.

    Attributes:
        network: The road network.
    """

    def __init__(self, path: Path) -> None:
        """Read Scenic's own network of a town."""
        self.network = read_map(path)
        elements = (*self.network.allRoads, *self.network.sidewalks, *self.network.shoulders)
        used = shapely.union_all([each.polygon for each in (*elements, *self.network.intersections)])
        self._aside = used.buffer(ASIDE[1]).difference(used.buffer(ASIDE[0]))
        self._crossings = shapely.union_all([each.polygon for each in self.network.intersections]).buffer(10.0)
        shapely.prepare(self._aside)

    def place_aside(self, rng: random.Random) -> tuple[float, float]:
        """A point where no program puts anything."""
        west, south, east, north = self._aside.bounds
        while True:
            point = rng.uniform(west, east), rng.uniform(south, north)
            if shapely.contains_xy(self._aside, *point):
                return point

    def is_along_road(self, x: float, y: float) -> bool:
        """Whether a vehicle at a point can only go along one road: where roads overlap, any of them is allowed."""
        first, *others = self.network.roadDirection.values(x, y) or (0.0,)
        across = any(abs(math.cos(each - first)) < ALONG for each in others)
        return not across and not shapely.contains_xy(self._crossings, x, y)

    def on_road(self, rng: random.Random) -> dict[str, Any]:
        """A car somewhere on a road, along it."""
        line = rng.choice([lane.centerline.lines[0] for lane in self.network.lanes if lane.centerline])
        point = line.interpolate(rng.uniform(0, line.length))
        heading = next(iter(self.network.roadDirection.values(point.x, point.y)), 0.0)
        return _car(point.x, point.y, heading)


def _car(x: float, y: float, heading: float) -> dict[str, Any]:
    return {"classes": ["Car", "Vehicle"], "x": x, "y": y, "heading": heading, "width": 2.0, "length": 4.5}


def labelled(scene: dict[str, Any], town: Town, seed: int, *, on_roads: int) -> Label:
    """A scene with four cars more, some of them on roads and the others where no program puts any."""
    rng = random.Random(seed)
    more = [town.on_road(rng) for _ in range(on_roads)]
    more += [_car(*town.place_aside(rng), rng.uniform(-math.pi, math.pi)) for _ in range(4 - on_roads)]
    ego, *others = (label_object(f"object-{n}", each) for n, each in enumerate([*scene["objects"], *more]))
    rng.shuffle(others)
    return Label("frame", "recording", 0, "map", ego, tuple(others), scene["params"])


def changed(scene: dict[str, Any], town: Town, seed: int) -> list[tuple[str, dict[str, Any]]]:
    """The scene with its last object where no program puts one, and with it turned across the road."""
    rng = random.Random(seed)
    number = len(scene["objects"]) - 1
    last = scene["objects"][number]
    x, y = town.place_aside(rng)
    away = {**scene, "objects": [*scene["objects"][:number], {**last, "x": x, "y": y}]}
    found = [("displaced", away)]
    if "Vehicle" in last["classes"] and town.is_along_road(last["x"], last["y"]):
        found.append(("turned", displaced(scene, number, seed, turn=math.pi / 2)))
    return found


def matched(drawing: Drawing, text: str, kept: dict[str, Any], town: Town, limit: float, first: int) -> Row:
    """Match what was drawn of a program."""
    row = Row(drawing)
    if not kept.get("scenes"):
        row.said.append(f"Scenic says: {kept.get('error') or kept.get('ended')}")
        return row
    started = time.process_time()
    try:
        with patience(COMPILING_S):
            source = Source(drawing.program, text)
            scenario = compile_scenario(source, town.network, initial=True, lanes="any")
    except (ScenarioError, OutOfPatienceError) as error:
        row.said.append(f"not compiled: {error}")
        return row
    row.compiling = time.process_time() - started
    matcher = Matcher(scenario, MatchOptions(tolerance=TOLERANCE))
    for number, scene in enumerate(kept["scenes"][:first]):
        _match(row, matcher, labelled(scene, town, number, on_roads=2), number, limit)
        for what, moved in changed(scene, town, number):
            _tell_apart(row, matcher, labelled(moved, town, number, on_roads=0), f"{number}, {what}", limit)
    return row


def _match(row: Row, matcher: Matcher, label: Label, number: int, limit: float) -> None:
    started = time.process_time()
    try:
        with patience(limit):
            verdict = matcher.match(label)
    except OutOfPatienceError:
        kind, what = "late", f"late: more than {limit:g} s"
    else:
        kind = "match" if isinstance(verdict, Match) else "no" if isinstance(verdict, NoMatch) else "unknown"
        what = shown(verdict)
    row.verdicts[kind] += 1
    row.times.append(time.process_time() - started)
    if kind != "match":
        row.said.append(f"scene {number}: {what}")


def _tell_apart(row: Row, matcher: Matcher, label: Label, what: str, limit: float) -> None:
    try:
        with patience(limit):
            verdict = matcher.match(label)
    except OutOfPatienceError:
        return
    row.moved += 1
    row.told += isinstance(verdict, NoMatch)
    if isinstance(verdict, Match):
        row.said.append(f"scene {what}: matches")


def parse_arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("checkout", type=Path, help="a checkout of Scenic's repository, with its maps")
    parser.add_argument("--maps", type=Path, action="append", default=[], help="more folders of OpenDRIVE maps")
    parser.add_argument("--environment", type=Path, default=Path(".conformance-venv"), help="where Scenic is installed")
    parser.add_argument("--work", type=Path, default=Path(".conformance/published"), help="folder of what is drawn")
    parser.add_argument("--scenes", type=int, default=20, help="scenes of each program on each town")
    parser.add_argument("--towns", type=int, default=2, help="towns of each program, its own first")
    parser.add_argument("--seconds", type=float, default=20.0, help="limit of processor time for one label")
    parser.add_argument("--only", default="", metavar="TEXT", help="programs and towns whose name has this in it")
    parser.add_argument("--drawn", action="store_true", help="draw nothing: match what earlier runs have drawn")
    return parser.parse_args()


def main() -> int:
    """Draw and match; 0 if every scene matches and no displaced one does."""
    arguments = parse_arguments()
    towns = maps_of([arguments.checkout / "assets", *arguments.maps])
    wanted = [each for each in drawings(arguments.checkout, towns, arguments.towns) if arguments.only in each.name]
    if not arguments.drawn:
        python = environment(arguments.environment, SCENIC, "verifai")
        for drawing, what in draw_all(wanted, arguments.checkout, towns, python, arguments.work, arguments.scenes):
            print(f"drawn: {drawing.name}: {what}", flush=True)
    rows: list[Row] = []
    print(HEADING)
    for name in dict.fromkeys(each.town for each in wanted):
        town = Town(arguments.work / name / "map.geojson")
        for drawing in (each for each in wanted if each.town == name and is_drawn(arguments.work, each)):
            text = (arguments.checkout / drawing.program).read_text(encoding="utf-8")
            kept = scenes_of(arguments.work, drawing)
            row = matched(drawing, text, kept, town, arguments.seconds, arguments.scenes)
            rows.append(row)
            print(row.line(), *(f"    {line}" for line in row.said), sep="\n", flush=True)
    times = [each for row in rows for each in row.times]
    counts = {kind: sum(row.verdicts[kind] for row in rows) for kind in ("match", "no", "unknown", "late")}
    print(", ".join(f"{count} {kind}" for kind, count in counts.items()), f"of {len(times)} labels;", end=" ")
    print(f"{sum(row.told for row in rows)} of {sum(row.moved for row in rows)} displaced ones told apart")
    if times:
        print(f"median {statistics.median(times):.3f} s, worst {max(times):.3f} s")
    return 0 if all(row.good for row in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
