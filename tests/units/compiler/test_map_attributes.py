"""What a program may read of the map is a list: whatever else the classes of elements have is out of its reach."""

from __future__ import annotations

from contextlib import suppress

import pytest

from scenicq.compiler.elements import names_of
from scenicq.geometry import elements

from .scenes import network, refused

HEADER = "model scenic.domains.driving.model\nego = new Car\n"
OWNERS = {
    "network.lanes[0]": elements.Lane,
    "network.laneSections[0]": elements.LaneSection,
    "network.laneGroups[0]": elements.LaneGroup,
    "network.roads[0]": elements.Road,
    "network.intersections[0]": elements.Intersection,
    "network.intersections[0].maneuvers[0]": elements.Maneuver,
    "network.crossings[0]": elements.PedestrianCrossing,
    "network.sidewalks[0]": elements.Sidewalk,
}
READABLE = {
    "Intersection": "crossings id incomingLanes is3Way is4Way isSignalized lanes maneuvers name network "
    "nominalDirectionsAt orientation outgoingLanes roads signals speedLimit tags uid",
    "Maneuver": "conflictingManeuvers connectingLane endLane intersection reverseManeuvers startLane type",
    "Sidewalk": "_predecessor _successor centerline crossings id leftEdge name network orientation predecessor "
    "rightEdge road speedLimit successor tags uid",
}
"""Some of the lists in full."""


@pytest.mark.parametrize("owner", OWNERS)
def test_nothing_else_of_a_class_is_language(owner, monkeypatch):
    kind = OWNERS[owner]
    monkeypatch.setattr(kind, "secret", 5, raising=False)
    monkeypatch.setattr(kind, "_secret", property(lambda _: 5), raising=False)
    own = {name for base in kind.__mro__ for name in (*vars(base), *getattr(base, "__annotations__", ()))}
    readable = names_of(eval(owner, {"network": network()}))
    assert {"secret", "_secret", "__doc__", "__module__"} <= own - readable
    for name in sorted(own - readable | {"__dict__"}):
        code, text = refused(f"{HEADER}x = {owner}.{name}\n")
        assert code in ("unknown-attribute", "unsupported-construct"), (name, code, text)


@pytest.mark.parametrize("owner", OWNERS)
def test_what_is_listed_is_read_or_the_map_says_why_not(owner):
    lacking: list[tuple[str, str]] = []
    for name in sorted(names_of(eval(owner, {"network": network()}))):
        with suppress(AssertionError):
            code, _ = refused(f"{HEADER}x = {owner}.{name}\n")
            lacking.append((name, code))
    assert {code for _, code in lacking} <= {"map-lacks", "unsupported-construct"}, lacking


@pytest.mark.parametrize("owner", [owner for owner, kind in OWNERS.items() if kind.__name__ in READABLE])
def test_the_list_of_a_kind(owner):
    found, listed = names_of(eval(owner, {"network": network()})), set(READABLE[OWNERS[owner].__name__].split())
    assert (found - listed, listed - found) == (set(), set())
