"""`apparently facing`: from the line of sight alone (the papers), or from it and what a place gives (Scenic 3.1)."""

import math

import pytest
from programs import HEADER
from scenes import compiled

from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.verdict import Match, NoMatch
from scenicq.store.labels import Label, LabelObject

EGO = LabelObject("ego", "Car", "car", 1.75, 40.0, 0.3, 2.0, 4.0)
SEEN = math.radians(50)

PARENTS: dict[str, tuple[tuple[float, float], float | None]] = {
    "Car at (-1.75, 20)": ((-1.75, 20.0), math.pi),
    "Car on road": ((-1.75, 20.0), math.pi),
    "Car following roadDirection from (-1.75, 30) for 10": ((-1.75, 20.0), math.pi),
    "Object at (5, 9), with parentOrientation 70 deg": ((5.0, 9.0), math.radians(70)),
    "Object at (5, 9)": ((5.0, 9.0), None),
    "Object offset by (0, 10)": ((1.75 - 10 * math.sin(0.3), 40 + 10 * math.cos(0.3)), 0.3),
    "Object ahead of (new OrientedPoint at (5, 8), facing 90 deg) by 4": ((-1.0, 8.0), math.pi / 2),
    "Car at (400, 300)": ((400.0, 300.0), None),
}
"""What is placed: where, and what the place gives for its heading, if anything (nothing far from all roads)."""


def verdicts(text: str, place: tuple[float, float], headings: list[float], method: str = "auto") -> list[type]:
    """What becomes of an object at a place with each heading."""
    kind = "Car" if "Car" in text.splitlines()[-1] else "Object"
    matcher = Matcher(compiled(text), MatchOptions(method=method))
    things = [LabelObject("o", kind, "thing", *place, each, 2.0, 4.0) for each in headings]
    return [type(matcher.match(Label("f", "r", 0, "street", EGO, (each,)))) for each in things]


@pytest.mark.parametrize("method", ["auto", "smt"])
@pytest.mark.parametrize("placed", PARENTS)
def test_both_readings_match_where_a_place_has_an_orientation(placed, method):
    place, parent = PARENTS[placed]
    text = f"{HEADER}ego = new Car at (1.75, 40), facing 0.3\nnew {placed}, apparently facing 50 deg\n"
    sight = SEEN + math.atan2(-(place[0] - EGO.x), place[1] - EGO.y)
    wrong = [sight + 2.2, sight - 0.9]
    assert verdicts(text, place, [sight, *wrong], method) == [Match, NoMatch, NoMatch]
    added = sight + (math.pi / 7 if parent is None else parent)
    assert verdicts(text, place, [added], method) == [NoMatch if parent is None else Match]


def test_up_to_scenic_2_it_is_the_line_of_sight_alone():
    ego = "ego = Car at 1.75 @ 40, facing 0.3\n"
    text = f"{HEADER}{ego}Car at -1.75 @ 20, apparently facing 50 deg\n"
    sight = SEEN + math.atan2(3.5, -20)
    assert verdicts(text, (-1.75, 20.0), [sight, sight + math.pi]) == [Match, NoMatch]
