"""Conditions on what is observed, of many labels at once: told as by a search for each label."""

from __future__ import annotations

import pytest

from scenicq.errors import Source
from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.search import first_fit
from scenicq.match.search.label_search import LabelSearch
from scenicq.match.verdict import Match
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.dataset import open_dataset

HEAD = (
    "model scenic.domains.driving.model\n"
    "from scenicq.labels import along, beside, box_distance, count, nearest, others\n"
    "ego = new Car on road, facing Range(-180, 180) deg\n"
)
LEAD = "lead = new Car on road, facing Range(-180, 180) deg\n"
WALKER = "walker = new Pedestrian in everywhere, facing Range(-180, 180) deg\n"
PROGRAMS = {
    "nobody near": "require not any((distance to c) < 15 for c in others(Car))",
    "how many": "require count(Pedestrian, within=CircularRegion(ego, 40)) >= 1",
    "a role is no other": f"{LEAD}require not any((distance from c to lead) < 12 for c in others(Vehicle))",
    "the nearest": f"{LEAD}require lead is nearest(Car)",
    "not the first": f"{LEAD}require any((distance to c) < (distance to lead) for c in others(Car))",
    "two roles": f"{LEAD}{WALKER}require len([c for c in others(Object) if (distance from c to walker) < 20]) != 1",
    "on the course": "require any(0 < along(ego, c) < 30 for c in others(Car))",
    "ahead on the course": f"{LEAD}require 0 < along(ego, lead) < 40 and abs(beside(ego, lead)) < 4",
    "not on the course": f"{LEAD}require not (0 < along(ego, lead) < 40)",
    "the nearest ahead": f"{LEAD}require lead is nearest(Car, ahead=True)",
    "between boxes": f"{LEAD}require box_distance(ego, lead) < 12 or lead.speed > 3",
    "with a parameter": f"param limit = 5\n{LEAD}require along(ego, lead) > 5 or beside(lead, ego) > 1",
    "motion": "require all(c.speed < 9 for c in others(Object))",
    "together": f"{LEAD}require (distance to lead) < 25 or count(Car) > 2",
}


def told(dataset, text: str, classes: str) -> list[object]:
    query = Query(
        dataset, Source("p.scenic", f"{HEAD}{text}\n"),
        QueryOptions(MatchOptions(classes=classes), prefilter=False, every=True),
    )  # fmt: skip
    return [(each.frame, each.verdict) for each in query.results()]


@pytest.mark.parametrize("name", PROGRAMS)
@pytest.mark.one_in(3)
def test_labels_side_by_side_are_told_as_each_alone(crossroads, monkeypatch, name):
    dataset, classes = open_dataset(crossroads), "coarse" if name == "how many" else "fine"
    together = told(dataset, PROGRAMS[name], classes)
    monkeypatch.setattr(first_fit, "observed_form_of", lambda group: None)
    assert together == told(dataset, PROGRAMS[name], classes)
    assert {type(verdict) for _, verdict in together} != {Match} or name in (
        "motion",
        "nobody near",
        "not on the course",
    )


def test_what_surely_holds_needs_no_search(crossroads, monkeypatch):
    dataset = open_dataset(crossroads)
    query = Query(dataset, Source("p.scenic", f"{HEAD}{PROGRAMS['nobody near']}\n"), QueryOptions())
    matching = [each.frame for each in query.results() if isinstance(each.verdict, Match)]
    monkeypatch.setattr(LabelSearch, "solutions", lambda *_, **__: pytest.fail("a search was made"))
    labels = [(label, None) for label in dataset.labels(matching)]
    by_map = {label.map for label, _ in labels}
    assert len(labels) > 1
    for name in by_map:
        matcher = Matcher(query.compile(name)[0], query.options.match)
        found = [*matcher.match_all([each for each in labels if each[0].map == name])]
        assert all(isinstance(each, Match) for each in found)
