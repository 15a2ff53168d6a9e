"""What an option of a choice lacks excludes that option and no other, whatever is asked of it and however deep."""

from __future__ import annotations

import pytest

from scenicq.errors import ScenarioError
from scenicq.geometry.elements import Lane
from scenicq.match.matcher import Matcher
from scenicq.match.verdict import Match, NoMatch
from scenicq.store.labels import Label, LabelObject

from .scenes import compiled, network

HEADER = "model scenic.domains.driving.model\n"
ASKED = {
    "attribute": "LANE.group.opposite",
    "look-up": "LANE.sectionAt(SPOT).laneToLeft",
    "look-up to the right": "LANE.sectionAt(SPOT).laneToRight",
    "look-up in the group": "LANE.group.laneAt(SPOT).successor",
    "look-up in the road": "LANE.road.laneSectionAt(SPOT).laneToLeft",
    "look-up that must find": "LANE.road.laneAt(SPOT, reject=True)",
    "of what is found": "LANE.sectionAt(SPOT).fasterLane.laneToRight",
    "choice of a choice": "Uniform(*LANE.maneuvers).connectingLane.sectionAt(SPOT)",
    "item": "LANE.group.lanes[1].sectionAt(SPOT)",
    "filtered": "Uniform(*filter(lambda s: s._laneToLeft is not None, LANE.sections)).laneToLeft.lane",
    "of another choice's choice": "Uniform(*Uniform(*LANE.maneuvers).endLane.sections).laneToLeft",
    "method": "LANE.sectionAt(SPOT).shiftedBy(1)",
}
"""What is asked of a random lane at a random point on its centreline; some lanes have it and others don't."""

LACKING = ("map-lacks", "impossible-requirement", "runtime-error")


def lanes() -> list[Lane]:
    return [lane for lane in network().lanes if lane.centerline is not None]


def middle(lane: Lane) -> tuple[float, float]:
    assert lane.centerline is not None
    point = lane.centerline.lines[0].interpolate(0.37, normalized=True)
    return point.x, point.y


def has(lane: Lane, asked: str) -> bool:
    """Whether the program compiles, and has a scene, with a lane and a place that are known."""
    x, y = middle(lane)
    known = asked.replace("LANE", f'network.elements["{lane.id}"]').replace("SPOT", f"({x}, {y})")
    try:
        compiled(f"{HEADER}ego = new Car at ({x}, {y})\nfound = {known}\nrequire len([found]) == 1\n")
    except ScenarioError as error:
        if error.diagnostics[0].code not in LACKING:
            raise
        return False
    return True


@pytest.mark.parametrize("kind", ASKED)
@pytest.mark.one_in(3)
def test_a_lane_that_has_it_matches_and_one_that_lacks_it_does_not(kind: str) -> None:
    asked = ASKED[kind].replace("LANE", "lane").replace("SPOT", "spot")
    text = (
        f"{HEADER}lane = Uniform(*network.lanes)\nspot = new OrientedPoint in lane.centerline\n"
        f"ego = new Car at spot, with requireVisible False\nfound = {asked}\nrequire len([found]) == 1\n"
    )
    matcher = Matcher(compiled(text))
    seen: set[bool] = set()
    for lane in lanes():
        if network().intersectionAt(*middle(lane)) is not None:
            continue  # several lanes hold the place
        x, y = middle(lane)
        (heading,) = network().roadDirection.values(x, y)
        label = Label("frame", "recording", 0, "street", LabelObject("ego", "Car", "Car", x, y, heading, 2.0, 4.5), ())
        expected = has(lane, ASKED[kind])
        seen.add(expected)
        assert isinstance(matcher.match(label), Match if expected else NoMatch), lane.id
    assert True in seen
