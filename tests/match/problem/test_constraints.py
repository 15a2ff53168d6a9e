"""What is compared with a label: what the program itself sets, within tolerance; requirements hold exactly."""

from __future__ import annotations

import pytest
from programs import HEADER
from scenes import compiled

from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import Tolerance
from scenicq.match.verdict import Match, NoMatch
from scenicq.store.labels import Label, LabelObject

EGO = LabelObject("ego", "Car", "car", 1.75, 50.0, 0.0, 2.0, 4.5)


def found(text, y=60.0, width=2.0, **options):
    """The verdict on a car ahead of the ego."""
    label = Label("frame", "recording", 0, "street", EGO, (LabelObject("a", "Car", "car", 1.75, y, 0.0, width, 4.5),))
    return Matcher(compiled(HEADER + text), MatchOptions(**options)).match(label)


@pytest.mark.parametrize(
    ("text", "compared"),
    [
        ("other = new Car", False),
        ("other = new Car with width 2", True),
        ("class Narrow(Car):\n    width: 2\nother = new Narrow", True),
        ("class Narrow(Car):\n    speed: 2\nother = new Narrow", False),
    ],
)
def test_a_size_is_compared_only_if_the_program_itself_gives_it(text, compared):
    assert isinstance(found(f"ego = new Car\n{text}", width=2.0), Match)
    assert isinstance(found(f"ego = new Car\n{text}", width=3.0), NoMatch if compared else Match)


@pytest.mark.parametrize(("y", "expected"), [(59.999, Match), (60.001, NoMatch)])
def test_a_requirement_on_what_is_observed_knows_no_tolerance(y, expected):
    text = "ego = new Car\nother = new Car\nrequire (distance to other) < 10"
    assert isinstance(found(text, y, tolerance=Tolerance(position=1.0)), expected)
