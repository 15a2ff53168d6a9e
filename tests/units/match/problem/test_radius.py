"""The radius: farther label objects play no role, random points lie within it, and what the map says stays."""

from __future__ import annotations

import pytest
from programs import HEADER
from scenes import compiled

from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.verdict import Match, NoMatch
from scenicq.store.labels import Label, LabelObject

EGO = LabelObject("ego", "Car", "car", 1.75, 50.0, 0.0, 2.0, 4.5)


def found(text, y, radius, method="auto"):
    """The verdict on a car so far north on the ego's lane."""
    label = Label("frame", "recording", 0, "street", EGO, (LabelObject("a", "Car", "car", 1.75, y, 0.0, 2.0, 4.5),))
    return Matcher(compiled(HEADER + text), MatchOptions(radius=radius, method=method)).match(label)


@pytest.mark.parametrize(("y", "expected"), [(69.0, Match), (71.0, NoMatch)])
def test_farther_label_objects_play_no_role(y, expected):
    text = "ego = new Car\nother = new Car"
    assert isinstance(found(text, y, 20.0), expected)
    assert isinstance(found(text, y, None), Match)


@pytest.mark.parametrize(("away", "expected"), [(9.0, Match), (30.0, NoMatch)])
def test_random_points_of_the_map_lie_within_it(away, expected):
    text = f"ego = new Car\nspot = new Point on road\nother = new Car at spot + (0 @ {-away})"
    assert isinstance(found(text, 60.0, 20.0), expected)
    assert isinstance(found(text, 60.0, None), Match)


@pytest.mark.parametrize("far", ["<", ">"])
def test_distances_and_directions_are_those_of_the_whole_map(far):
    """The crossing is farther than the radius, and the same for all that."""
    text = (
        "ego = new Car\n"
        "other = new Car ahead of ego by Range(1, 9), facing Range(-1, 1) deg relative to roadDirection\n"
        f"require (distance from ego to intersection) {far} 30"
    )
    everywhere = found(text, 60.0, None)
    assert isinstance(everywhere, Match if far == ">" else NoMatch)
    assert isinstance(found(text, 60.0, 12.0), type(everywhere))
