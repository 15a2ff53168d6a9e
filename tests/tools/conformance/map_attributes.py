"""What Scenic's driving library documents of each kind of map element: asked of both sides. Plain data, for both."""

from __future__ import annotations

_ELEMENT = "uid id name vehicleTypes speedLimit tags"
_LONG = f"{_ELEMENT} centerline leftEdge rightEdge _successor _predecessor successor predecessor"

ATTRIBUTES: dict[str, tuple[str, ...]] = {
    kind: tuple(names.split())
    for kind, names in {
        "Road": f"{_LONG} lanes forwardLanes backwardLanes laneGroups sections signals crossings sidewalks "
        "sidewalkRegion is1Way",
        "LaneGroup": f"{_LONG} road lanes curb _sidewalk sidewalk _bikeLane bikeLane _shoulder shoulder "
        "_opposite opposite",
        "Lane": f"{_LONG} group road sections adjacentLanes maneuvers",
        "RoadSection": f"{_LONG} road lanes forwardLanes backwardLanes lanesByOpenDriveID",
        "LaneSection": f"{_LONG} lane group road openDriveID isForward adjacentLanes _laneToLeft laneToLeft "
        "_laneToRight laneToRight _fasterLane fasterLane _slowerLane slowerLane",
        "Sidewalk": f"{_LONG} road crossings",
        "Shoulder": f"{_LONG} road",
        "Intersection": f"{_ELEMENT} roads incomingLanes outgoingLanes maneuvers signals crossings is3Way is4Way "
        "isSignalized",
        "Maneuver": "type startLane endLane connectingLane intersection conflictingManeuvers reverseManeuvers",
        "Signal": "uid openDriveID country type isTrafficLight",
        "Network": "roads connectingRoads allRoads laneGroups lanes intersections crossings sidewalks shoulders "
        "roadSections laneSections driveOnLeft tolerance drivableRegion walkableRegion roadRegion laneRegion "
        "intersectionRegion crossingRegion sidewalkRegion curbRegion shoulderRegion",
    }.items()
}
"""Attributes by kind of element."""

LOOKED_UP: dict[str, tuple[str, ...]] = {
    "Road": ("sectionAt", "laneSectionAt", "laneAt", "laneGroupAt", "crossingAt"),
    "LaneGroup": ("laneAt",),
    "Lane": ("sectionAt",),
    "RoadSection": ("laneAt",),
    "Intersection": ("maneuversAt",),
}
"""Look-ups among the parts of an element at a point, by kind."""

NETWORK_LOOK_UPS = (
    "laneAt", "laneSectionAt", "laneGroupAt", "roadAt", "intersectionAt", "crossingAt", "sidewalkAt", "shoulderAt",
    "elementAt",
)  # fmt: skip
"""Look-ups of the network at a point."""
