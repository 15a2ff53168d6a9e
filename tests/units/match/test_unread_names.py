"""What a program computes and never reads excludes nothing: Scenic evaluates it lazily."""

import pytest
from scenes import compiled

from scenicq.errors import ScenarioError
from scenicq.match.matcher import Matcher
from scenicq.match.verdict import Match, NoMatch
from scenicq.store.labels import Label, LabelObject

HEADER = "model scenic.domains.driving.model\nego = new Object at (Range(-900, 900), Range(-900, 900))\n"
OFF_THE_ROAD = Label("f", "r", 0, "street", LabelObject("ego", "Object", "thing", 800.0, 800.0, 0.0, 1.0, 1.0), ())
NAMED = {
    "network.laneAt(ego, reject=True)": "zone is not None",
    "network.laneAt(ego, reject=True).centerline": "(distance from ego to zone) >= 0",
    "network.laneAt(ego).group": "zone is not None",
    "network.roadAt(ego, reject='off').lanes": "len(zone) > 0",
    "[network.laneAt(ego, reject=True), 3]": "zone[1] == 3",
    "list(filter(lambda lane: True, [network.laneAt(ego, reject=True)]))": "len(zone) == 1",
    "sorted([network.laneAt(ego, reject=True)], key=lambda lane: 1)": "len(zone) == 1",
}


def verdict(text: str):
    return Matcher(compiled(HEADER + text)).match(OFF_THE_ROAD)


@pytest.mark.parametrize("value", NAMED)
def test_a_name_that_nothing_reads(value):
    assert isinstance(verdict(f"zone = {value}\n"), Match)
    assert isinstance(verdict(f"zone = {value}\nother = zone\n"), Match)
    assert isinstance(verdict(f"zone = {value}\nother = list(filter(lambda each: True, [zone]))\n"), Match)
    assert isinstance(verdict(f"def f():\n    zone = {value}\n    return 3\nrequire f() == 3\n"), Match)


@pytest.mark.parametrize("value", NAMED)
def test_a_name_that_is_read(value):
    assert isinstance(verdict(f"zone = {value}\nrequire {NAMED[value]}\n"), NoMatch)
    assert isinstance(
        verdict(f"zone = {value}\nother = zone\nrequire {NAMED[value].replace('zone', 'other')}\n"), NoMatch
    )


@pytest.mark.parametrize(
    "value",
    ["network.lanes[0].sections[0].laneToRight.laneToRight", "network.lanes[0].sections[0].fasterLane.lane",
     "[network.laneAt((1.75, 20)).sections[0].laneToRight.laneToRight, 3]"],
)  # fmt: skip
def test_what_the_map_lacks_is_an_error_once_it_is_read(value):
    assert isinstance(verdict(f"zone = {value}\nother = zone\n"), Match)
    with pytest.raises(ScenarioError, match="the map"):
        verdict(f"zone = {value}\nrequire zone is not None\n")


@pytest.mark.parametrize(
    "choice", ["*Uniform([], [])", "*Uniform(*[[]])", "*Uniform(*network.lanes[:1]).group.lanes[9:]"]
)
def test_a_choice_of_nothing_is_an_error_once_it_is_read(choice):
    nothing = f"zone = Uniform({choice})\n"
    assert isinstance(verdict(nothing), Match)
    with pytest.raises(ScenarioError, match="nothing to choose from"):
        verdict(nothing + "require zone > 3\n")


def test_what_the_map_lacks_for_a_requirement_that_need_not_hold_excludes_nothing():
    needs = "network.lanes[0].sections[0].laneToRight.laneToRight is not None"
    for head in ("require[0.6]", "require[0.1]"):
        assert isinstance(verdict(f"{head} {needs}\n"), Match)
    for head in ("require", "require[1]"):
        with pytest.raises(ScenarioError, match="the map"):
            verdict(f"{head} {needs}\n")
