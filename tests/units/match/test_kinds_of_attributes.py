"""A label may say a property is something of another kind than a program means: it does not match, nothing breaks."""

from dataclasses import replace

import pytest
from programs import HEADER
from scenes import compiled

from scenicq.errors import ScenarioError
from scenicq.match.matcher import Matcher
from scenicq.match.verdict import Match, NoMatch, Unknown
from scenicq.store.labels import Label, LabelObject

MEANT = {"scalar": "Range(1, 3)", "boolean": "Uniform(True, False)", "vector": "Range(1, 2) @ 2", "text": "'text'"}
SAID = ("much", "", True, 5.0, -1.0, 1e308)
USES = (
    "other.mood", "not other.mood", "other.mood < 9", "other.mood == 3", "abs(other.mood) < 9", "other.mood + 1 < 9",
    "max(other.mood, 1) < 3", "sin(other.mood) < 1", "(distance from ego to other.mood) < 9", "other.mood in road",
    "(angle from ego to other.mood) < 1", "(roadDirection at other.mood) < 1", "other.mood.x < 9",
    "(other.mood relative to 1 @ 2) in road", "(ego offset by other.mood) in road", "ego can see other.mood",
    "other.mood * (1 @ 2) in road", "(ego.position offset along other.mood by 1 @ 2) in road",
    "(relative heading of other.mood) < 1", "(Uniform(1, 2) if other.mood else 3) < 2",
    "Uniform(1, 2) + other.mood > 2",
    "other in CircularRegion(ego.position, other.mood)", "other in CircularRegion(other.mood, 9)",
    "other in SectorRegion(ego.position, 9, other.mood, 1)",
    "other in RectangularRegion(ego.position, other.mood, 2, 3)",
)  # fmt: skip
EGO = LabelObject("ego", "Car", "car", 1.75, 50.0, 0.0, 2.0, 4.5)


def label(**attributes):
    other = LabelObject("other", "Car", "car", 1.75, 58.0, 0.0, 2.0, 4.5, attributes=attributes)
    return Label("f", "r", 0, "street", EGO, (other,))


def programs():
    for kind, given in MEANT.items():
        for use in USES:
            text = f"{HEADER}ego = new Car\nother = new Car with mood {given}\nrequire {use}\n"
            try:
                yield kind, use, compiled(text)
            except ScenarioError:
                continue


@pytest.mark.slow
def test_a_label_that_says_something_of_another_kind_does_not_match():
    tried = set()
    for kind, use, scenario in programs():
        matcher = Matcher(scenario)
        for said in SAID:
            verdicts = [matcher.match(label(mood=said)), *matcher.match_all([(label(mood=said), None)] * 3)]
            # a truth value is a number, as in Python
            if isinstance(said, str) or kind in ("vector", "text"):
                assert all(isinstance(verdict, NoMatch) for verdict in verdicts), (kind, use, said)
                tried.add((kind, use))
            assert len({type(verdict) for verdict in verdicts}) == 1, (kind, use, said)
    assert len(tried) > 40


@pytest.mark.parametrize("said", SAID)
@pytest.mark.parametrize("kind", MEANT)
@pytest.mark.one_in(12)
def test_a_requirement_alone_is_never_more_than_undefined(kind, said):
    """Where a library's default is not compared, and so only what requires it looks at it."""
    for use in USES:
        text = f"{HEADER}class Moody(Car):\n    mood: {MEANT[kind]}\nego = new Car\nother = new Moody\nrequire {use}\n"
        try:
            scenario = compiled(text)
        except ScenarioError:
            continue
        matcher = Matcher(scenario)
        alone = matcher.match(label(mood=said))
        assert {type(each) for each in matcher.match_all([(label(mood=said), None)] * 3)} == {type(alone)}, use
        if kind == "vector" or (isinstance(said, str) and kind != "text"):
            assert isinstance(alone, NoMatch), use


@pytest.mark.parametrize("name", ["heading", "width", "speed", "velocity", "acceleration", "position"])
@pytest.mark.parametrize("said", ["much", True, 5.0])
def test_an_attribute_is_not_what_a_column_says(name, said):
    text = f"{HEADER}ego = new Car\nother = new Car with speed Range(1, 2), with width 2\n"
    text += "require other.speed < 9\nrequire abs(relative heading of other) < 3\n"
    matcher = Matcher(compiled(text))
    given = label(**{name: said})
    moving = replace(given, objects=(replace(given.objects[0], velocity=(0.0, 1.5)),))
    bare = replace(given, objects=(replace(given.objects[0], heading=None, width=None),))
    # what moves is only ever observed
    for each, expected in ((given, Unknown), (moving, Match), (bare, Unknown)):
        without = replace(each, objects=(replace(each.objects[0], attributes={}),))
        verdicts = [matcher.match(each), matcher.match(without), *matcher.match_all([(each, None), (without, None)])]
        assert {type(verdict) for verdict in verdicts} == {expected}
