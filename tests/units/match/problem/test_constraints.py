"""What is compared with a label: what the program itself sets, within tolerance; requirements hold exactly."""

from __future__ import annotations

import pytest
from programs import HEADER, PROGRAMS
from scenes import compiled

from scenicq.forest.scenario import BuiltIn
from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.problem.constraints import build_groups, relevant_properties
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


FURTHER = {
    "computed of the speed": "ego = new Car\nnew Car ahead of ego by ego.speed, with velocity (0, ego.speed)",
    "required of what is computed": "ego = new Car\nother = new Car\nrequire other.velocity.x > ego.acceleration",
    "computed of what is computed": "class Odd(Car):\n    length: self.speed * 2\nego = new Car\nnew Odd ahead of ego",
    "noise": "ego = new Car on road\nother = new Car ahead of ego by 4, with speed 3\nmutate other",
}


@pytest.mark.parametrize("enforced", [MatchOptions().enforce, frozenset(BuiltIn)], ids=["plain", "enforced"])
@pytest.mark.parametrize("text", [*PROGRAMS.values(), *FURTHER.values()])
@pytest.mark.one_in(3)
def test_what_does_not_matter_changes_no_group(text, enforced):
    scenario, options = compiled(HEADER + text), MatchOptions(enforce=enforced)
    relevant = relevant_properties(scenario, options)
    every = [frozenset(owner.properties) for owner in scenario.objects]
    params = frozenset(scenario.params)
    for lacking in ("", "speed", "width", "heading"):
        seen = [names - {lacking} for names in every]
        short = [names & mine for names, mine in zip(seen, relevant, strict=True)]
        shown = [repr(build_groups(scenario, (*names, params), options)) for names in (short, seen)]
        assert shown[0] == shown[1]


@pytest.mark.parametrize(
    ("text", "matters"),
    [
        ("ego = new Car on road", False),
        ("ego = new Car on road, with speed Range(0, 9)", True),
        ("ego = new Car on road\nrequire ego.velocity.y < 3", True),
    ],
)
def test_motion_matters_where_something_is_computed_of_it(text, matters):
    scenario = compiled(HEADER + text)
    assert ("speed" in relevant_properties(scenario, MatchOptions())[scenario.ego]) is matters
