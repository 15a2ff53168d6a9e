"""Do maps say the same here as in Scenic? The direction of traffic and look-ups at random points, and all elements.

Run by `make conformance SCENIC=CHECKOUT`: `python tests/conformance/map_questions.py CHECKOUT`. On each OpenDRIVE map,
Scenic's direction must be one of those that are allowed at each point; what it finds there must be one of what look-ups
of a random place may find, and what they find if the place is known; what its elements say of each other must be what
they say here.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from map_answers import LOOKED_UP, NEIGHBOURS
from original import Original, environment
from published_scenes import maps_of
from run_conformance import SCENIC, read_map

from scenicq.compiler.element_lookups import LOOKUPS, LookupTable
from scenicq.compiler.elements import of_element
from scenicq.errors import Source, Span
from scenicq.geometry.angles import difference
from scenicq.geometry.elements import Maneuver
from scenicq.geometry.network import Network

ANGLE = math.radians(0.01)
"""Headings within this are one: centrelines are written with all digits, and read with some rounding."""
SHOWN = 3
"""Differences of each kind that are printed."""
NOWHERE = Span(Source("no program", ""), 0, 0)


@dataclass
class Tally:
    """What was compared, and what differs.

    Attributes:
        asked, different: By kind of question.
        shown: Some of the differences, one line each.
    """

    asked: Counter[str] = field(default_factory=Counter)
    different: Counter[str] = field(default_factory=Counter)
    shown: list[str] = field(default_factory=list)

    def note(self, kind: str, agrees: bool, what: str) -> None:
        """Count one answer."""
        self.asked[kind] += 1
        if not agrees:
            self.different[kind] += 1
            if self.different[kind] <= SHOWN:
                self.shown.append(f"{kind}: {what}")


def compare_points(network: Network, answers: list[dict[str, Any]], tally: Tally) -> None:
    """Directions and look-ups at points."""
    directions = network.roadDirection.values_many(np.array([(each["x"], each["y"]) for each in answers]))
    tables = {name: LookupTable(name, *_layers(network, name)) for name in LOOKED_UP}
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
            known = _name(getattr(network, name)(each["x"], each["y"]))
            tally.note(f"{name} of a known place", each[name] == known, f"{place}: {each[name]}, here {known}")


def _layers(network: Network, name: str) -> tuple[str, Any]:
    family, layers = LOOKUPS[name]
    return family, layers(network)


def compare_elements(network: Network, answers: dict[str, dict[str, Any]], tally: Tally) -> None:
    """What elements say of each other."""
    for name, kind, value in facts(network):
        own = answers.get(name, {}).get(kind)
        if kind == "predecessor" and own is None:
            continue  # Scenic has none where an intersection is before a lane, and rejects the scene
        tally.note(kind, own == value, f"{name}: {own}, here {value}")


def facts(network: Network) -> Iterator[tuple[str, str, Any]]:
    """What elements say here, as `map_answers` spells it: name, kind, value."""
    for lane in network.lanes:
        yield lane.id, "predecessor", _name(lane._predecessor)
        yield lane.id, "successor", _name(lane._successor)
        yield lane.id, "adjacentLanes", _names(lane.adjacentLanes)
        yield lane.id, "sections", [section.id for section in lane.sections]
        yield lane.id, "maneuvers", sorted(map(_way, lane.maneuvers))
        for section in lane.sections:
            yield section.id, "isForward", section.isForward
            for name in NEIGHBOURS:
                yield section.id, name, _name(getattr(section, name))
    for group in network.laneGroups:
        yield group.id, "opposite", _name(group._opposite)
        yield group.id, "lanes", _names(group.lanes)
    for road in network.allRoads:
        yield road.id, "is1Way", road.is1Way
        yield road.id, "lanes", _names(road.lanes)
    for crossing in network.intersections:
        yield crossing.id, "is3Way", crossing.is3Way
        yield crossing.id, "is4Way", crossing.is4Way
        yield crossing.id, "isSignalized", crossing.properties.get("signalized")
        yield crossing.id, "incomingLanes", _names(crossing.incomingLanes)
        yield crossing.id, "outgoingLanes", _names(crossing.outgoingLanes)
        yield crossing.id, "maneuvers", sorted(_described(each) for each in crossing.maneuvers)


def _described(maneuver: Maneuver) -> list[Any]:
    # no attribute of a maneuver needs an interpreter
    kind, reverse, others = (
        of_element(None, maneuver, name, NOWHERE) for name in ("type", "reverseManeuvers", "conflictingManeuvers")
    )
    return [_way(maneuver), kind, sorted(map(_way, reverse)), sorted(map(_way, others))]


def _name(element: Any) -> str | None:
    return None if element is None else element.id


def _names(elements: Any) -> list[str]:
    return sorted(each.id for each in elements)


def _way(maneuver: Maneuver) -> list[str]:
    lanes = (maneuver.startLane, maneuver.connectingLane, maneuver.endLane)
    return [lane.id if lane else "" for lane in lanes]


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
            elements = original.of_elements()
        finally:
            original.close()
        network, tally = read_map(original.map), Tally()
        compare_points(network, points, tally)
        compare_elements(network, elements, tally)
        print(f"{name}:", *(f"{kind} {tally.different[kind]}/{count}" for kind, count in tally.asked.items()))
        print(*(f"    {line}" for line in tally.shown), sep="\n", flush=True)
        good = good and not tally.different
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
