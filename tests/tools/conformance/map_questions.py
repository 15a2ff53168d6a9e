"""Do maps say the same here as in Scenic? The direction of traffic and look-ups at random points, and all elements.

Run by `make conformance SCENIC=CHECKOUT`: `python tests/tools/conformance/map_questions.py CHECKOUT`. On each OpenDRIVE
map, Scenic's direction must be one of those that are allowed at each point; what it finds there must be one of what
look-ups of a random place may find, and what they find if the place is known; what its elements say of each other must
be what they say here.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from map_attributes import LOOKED_UP, NETWORK_LOOK_UPS
from original import Original, environment
from published_scenes import maps_of
from run_conformance import SCENIC, read_map

from scenicq.compiler.attributes import attribute
from scenicq.compiler.element_lookups import LookupTable
from scenicq.compiler.interpreter import Interpreter
from scenicq.errors import ScenarioError, Source, Span
from scenicq.forest import build
from scenicq.forest.nodes import Constant
from scenicq.geometry.angles import difference
from scenicq.geometry.elements import Maneuver, NetworkElement, Signal
from scenicq.geometry.network import Network
from scenicq.geometry.regions import PolygonSet, PolylineSet

ANGLE = math.radians(0.01)
"""Headings within this are one: centrelines are written with all digits, and read with some rounding."""
SHARE = 5e-3
"""Of an area, that closing cracks between parts may change."""
SHOWN = 3
"""Differences of each kind that are printed."""
NOWHERE = Span(Source("no program", ""), 0, 0)


@dataclass
class Tally:
    """What was compared, and what differs.

    Attributes:
        asked, different, refused: By kind of question.
        shown: Some of the differences, one line each.
    """

    asked: Counter[str] = field(default_factory=Counter)
    different: Counter[str] = field(default_factory=Counter)
    refused: Counter[str] = field(default_factory=Counter)
    shown: list[str] = field(default_factory=list)

    def note(self, kind: str, agrees: bool, what: str) -> None:
        """Count one answer."""
        self.asked[kind] += 1
        if not agrees:
            self.different[kind] += 1
            if self.different[kind] <= SHOWN:
                self.shown.append(f"{kind}: {what}"[:400])

    def compare(self, kind: str, own: Any, here: Any, where: str) -> None:
        """Count one answer of both; one that is refused by name is counted as such."""
        refused = here == "refused"
        self.refused[kind] += refused
        self.note(kind, refused or _same(own, here), f"{where}: {own}, here {here}")


def compare_points(network: Network, answers: list[dict[str, Any]], tally: Tally) -> None:
    """Directions and look-ups at points."""
    directions = network.roadDirection.values_many(np.array([(each["x"], each["y"]) for each in answers]))
    tables = {name: LookupTable.of_network(network, name) for name in NETWORK_LOOK_UPS}
    for each, allowed in zip(answers, directions, strict=True):
        place = f"({each['x']:.3f}, {each['y']:.3f})"
        own = each["direction"]
        agrees = any(abs(difference(own, heading)) <= ANGLE for heading in allowed)
        shown = ", ".join(f"{math.degrees(heading):.2f}" for heading in allowed)
        tally.note("roadDirection", agrees, f"{place}: {math.degrees(own):.2f}, here {shown}")
        for name, table in tables.items():
            options = [*(option.id for option in table.options), None]
            found = [options[number] for number in table.occupancy.at(each["x"], each["y"])]
            tally.note(name, each[name] in found, f"{place}: {each[name]}, here {found}")
            known = plain(getattr(network, name)(each["x"], each["y"]))
            tally.note(f"{name} of a known place", each[name] == known, f"{place}: {each[name]}, here {known}")


def compare_elements(network: Network, answers: list[dict[str, Any]], tally: Tally) -> None:
    """What the network, its elements, their maneuvers and signals say, and what elements say of points."""
    run = Interpreter(3, False, _load_nothing, network)
    run.budget.steps = 1 << 60
    things: dict[str, Any] = {"network": network, **network.elements}
    for answer in answers:
        kind, name = answer["kind"], answer["name"]
        thing = things.get(name) if "." not in name else _listed(things, name)
        tally.note(f"{kind} is there", thing is not None, name)
        if thing is None:
            continue
        for attribute_name, own in answer["says"].items():
            here = _ask(lambda thing=thing, asked=attribute_name: attribute(run, thing, asked, NOWHERE))
            tally.compare(f"{kind}.{attribute_name}", own, here, name)
        for point in answer.get("points", ()):
            _compare_point(run, thing, kind, point, tally)


def _listed(things: dict[str, Any], name: str) -> Any:
    """The maneuver or signal of a name such as `intersection3.maneuvers[2]`."""
    owner, _, listed = name.partition(".")
    plural, _, number = listed.rstrip("]").partition("[")
    own = getattr(things.get(owner), plural, ())
    return own[int(number)] if int(number) < len(own) else None


def _compare_point(run: Interpreter, thing: Any, kind: str, point: dict[str, Any], tally: Tally) -> None:
    x, y = point["x"], point["y"]
    place = build.constant((x, y))
    where = f"{thing.id} at ({x:.3f}, {y:.3f})"
    allowed = thing.orientation.values(x, y)
    agrees = any(abs(difference(point["orientation"], heading)) <= ANGLE for heading in allowed)
    shown = ", ".join(f"{math.degrees(heading):.2f}" for heading in allowed)
    tally.note(f"{kind}.orientation", agrees, f"{where}: {math.degrees(point['orientation']):.2f}, here {shown}")
    for name in (*LOOKED_UP.get(kind, ()), "nominalDirectionsAt"):
        here = _ask(lambda asked=name: attribute(run, thing, asked, NOWHERE).call(NOWHERE, place))
        if name == "nominalDirectionsAt" and _tied(point[name], allowed):
            here = point[name]
        tally.compare(f"{kind}.{name}", point[name], here, where)


def _tied(own: list[float], allowed: Sequence[float]) -> bool:
    """Whether a single heading is one of those that tie: rounding decides there."""
    return len(own) == 1 and any(abs(difference(own[0], heading)) <= ANGLE for heading in allowed)


def _ask(question: Callable[[], Any]) -> Any:
    try:
        return plain(question())
    except ScenarioError as error:
        first = error.diagnostics[0]
        named = first.code == "unsupported-construct" or first.message.startswith("the map does not say")
        return "refused" if named else "rejected" if first.code == "map-lacks" else f"refused: {first.code}"


def plain(value: Any) -> Any:
    """A value as `map_answers` spells it."""
    if isinstance(value, Maneuver):
        return [plain(lane) for lane in (value.startLane, value.connectingLane, value.endLane)]
    if isinstance(value, NetworkElement):
        return value.id
    if isinstance(value, Signal):
        return value.uid
    if isinstance(value, Constant):
        return plain(value.value)
    if isinstance(value, PolylineSet):
        line = shapely.MultiLineString(list(value.pieces))
        return {"points": len(shapely.get_coordinates(line)), "length": line.length, "middle": _middle(line)}
    if isinstance(value, PolygonSet):
        area = shapely.union_all(value.pieces)
        return {"area": area.area, "middle": _middle(area)} if area.area else {"area": 0.0}
    if isinstance(value, dict):
        return {str(key): plain(each) for key, each in value.items()}
    if isinstance(value, tuple | list):
        return [plain(each) for each in value]
    return sorted(map(str, value)) if isinstance(value, frozenset) else value


def _middle(shape: Any) -> list[float]:
    return [shape.centroid.x, shape.centroid.y]


def _same(own: Any, here: Any) -> bool:
    """Whether two answers are one but for what rounding and closing of cracks change."""
    if isinstance(own, dict) and isinstance(here, dict) and "area" in own:
        return math.isclose(own["area"], here.get("area", -1.0), rel_tol=SHARE, abs_tol=0.5)
    if isinstance(own, dict) and isinstance(here, dict) and "length" in own:
        return math.isclose(own["length"], here.get("length", -1.0), rel_tol=1e-4, abs_tol=1e-3) and all(
            abs(a - b) < 1e-2 for a, b in zip(own["middle"], here["middle"], strict=True)
        )
    if isinstance(own, float) and isinstance(here, float):
        return abs(own - here) <= ANGLE
    if isinstance(own, list) and isinstance(here, list):
        return len(own) == len(here) and all(map(_same, own, here))
    return own == here


def _load_nothing(name: str, place: int, span: Span) -> Any:
    raise NotImplementedError


def parse_arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("checkout", type=Path, help="a checkout of Scenic's repository, with its maps")
    parser.add_argument("--maps", type=Path, action="append", default=[], help="more folders of OpenDRIVE maps")
    parser.add_argument("--environment", type=Path, default=Path(".conformance-venv"), help="where Scenic is installed")
    parser.add_argument("--work", type=Path, default=Path(".conformance/published"), help="folder for the maps")
    parser.add_argument("--points", type=int, default=10_000, help="points of each map")
    parser.add_argument("--only", default="Town", metavar="TEXT", help="maps whose name has this in it")
    return parser.parse_args()


def main() -> int:
    """Ask both and compare; 0 if nothing differs."""
    arguments = parse_arguments()
    towns = maps_of([arguments.checkout / "assets", *arguments.maps])
    python = environment(arguments.environment, SCENIC, "verifai")
    good = True
    for name, chart in towns.items():
        if arguments.only not in name:
            continue
        original = Original(python, chart, arguments.work / name)
        try:
            points = original.at_points(arguments.points, 1)
            elements = original.of_elements(4, 2)
        finally:
            original.close()
        network, tally = read_map(original.map), Tally()
        compare_points(network, points, tally)
        compare_elements(network, elements, tally)
        print(f"{name}:", *(f"{kind} {tally.different[kind]}/{count}" for kind, count in tally.asked.items()))
        print("    refused:", *(f"{kind} {count}" for kind, count in tally.refused.items() if count))
        print(*(f"    {line}" for line in tally.shown), sep="\n", flush=True)
        good = good and not tally.different
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
