"""Conditions on what is observed, of many labels at once: told as by a search for each label."""

from __future__ import annotations

import math
import random
from pathlib import Path

import pytest

from scenicq.errors import Source
from scenicq.geometry.default_street import street
from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.search import first_fit
from scenicq.match.search.label_search import LabelSearch
from scenicq.match.search.verdict_builder import VerdictBuilder
from scenicq.match.verdict import Match, Unknown
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.dataset import Dataset, open_dataset
from scenicq.store.labels import Label, LabelObject, Recording
from scenicq.store.writer import write_dataset

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


ANYWHERE = (
    "model scenic.domains.driving.model\n"
    "from scenicq.labels import along, beside, count, nearest, others\n"
    "ego = new Object in everywhere, facing A\n"
)
ROLES = {
    "": "",
    "lead": "lead = new Car in everywhere, facing A\n",
    "two": "lead = new Car in everywhere, facing A\nnext = new Car in everywhere, facing A\n",
    "alike": "lead = new Object in everywhere, facing A\nnext = new Object in everywhere, facing A\n",
}
UNCERTAIN = {
    ("", "not any(0 < along(ego, c) < 30 for c in others(Car))"),
    ("", "count(Car, ahead=True) >= 2"),
    ("", "any(c.speed < 3 for c in others(Car)) or any(along(ego, c) < 0 for c in others(Object))"),
    ("lead", "0 < along(ego, lead) < 20 and abs(beside(ego, lead)) < 2"),
    ("lead", "lead is nearest(Car, ahead=True)"),
    ("lead", "along(lead, ego) < 12 or beside(ego, lead) > 1"),
    ("lead", "not any(along(ego, c) < along(ego, lead) for c in others(Car))"),
    ("two", "0 < along(ego, lead) < 25\nrequire along(lead, next) > 2"),
    ("two", "along(ego, lead) > 0\nrequire (distance from lead to next) < 12\nrequire along(ego, next) < 30"),
    ("alike", "along(ego, lead) > 0\nrequire along(ego, next) > 0"),
    ("", "any(0 < along(ego, c) < 30 for c in others(Car)) and not any(beside(ego, c) > 1 for c in others(Vehicle))"),
    ("", "any(beside(ego, c) > 5 for c in others(Car)) or not any(beside(ego, c) > 5 for c in others(Car))"),
    ("", "any(beside(ego, c) > 5 for c in others(Car)) and not any(beside(ego, c) > 5 for c in others(Car))"),
    ("", "len([c for c in others(Object) if along(c, ego) > 0]) == 2"),
    ("", "all(along(ego, c) < 40 for c in others(Car))\nrequire ego.speed < 3"),
    ("lead", "not any(c is lead and along(ego, c) > 3 for c in others(Object))"),
    ("lead", "not any((distance from c to lead) < 9 and c.speed < 3 for c in others(Object))"),
}


def _uncertain(folder: Path, seed: int) -> Dataset:
    """Egos that stop, turn back and are seen for a moment, with cars about them: much is unknown on their courses."""
    draw = random.Random(seed)
    recordings: list[Recording] = []
    for number in range(6):
        labels: list[Label] = []
        x, y, heading = draw.uniform(-4, 4), draw.uniform(-20, 20), draw.uniform(-3, 3)
        turn, speed = draw.uniform(-0.4, 0.4), draw.choice([0.0, 2.0, 6.0])
        about = [(draw.uniform(-6, 6), draw.uniform(-30, 90), draw.uniform(-3, 3)) for _ in range(4)]
        for k in range(draw.choice([1, 4, 9])):
            others = [
                LabelObject(
                    f"o{n}", draw.choice(["Car", "Car", "Vehicle"]), "car", x + dx, y + dy, h, 1.8, 4.5, None,
                    draw.choice([None, (1.0, 1.0)]), f"t{n}",
                )
                for n, (dx, dy, h) in enumerate(about)
            ]  # fmt: skip
            ego = LabelObject("ego", "Car", "car", x, y, heading, 1.8, 4.5)
            labels.append(Label(f"r{number}-{k}", f"r{number}", k * 500_000, "street", ego, tuple(others)))
            heading = math.remainder(heading + 0.5 * turn, math.tau)
            x, y = x - math.sin(heading) * speed * 0.5, y + math.cos(heading) * speed * 0.5
        recordings.append(Recording(f"r{number}", "street", tuple(labels)))
    write_dataset(folder, recordings, {"street": street().features}, name="d")
    return open_dataset(folder)


def _verdicts(dataset: Dataset, text: str, *, prefilter: bool, proofs: bool = True) -> dict[str, object]:
    options = QueryOptions(prefilter=prefilter, every=proofs, proofs=proofs)
    query = Query(dataset, Source("p.scenic", text), options)
    return {each.frame: each.verdict for each in query.results()}


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.one_in(12)
def test_what_is_not_observed_is_told_of_many_as_of_each(tmp_path, monkeypatch, seed, rounds):
    dataset = _uncertain(tmp_path / "d", seed)
    unknown = searched = 0
    undecided = VerdictBuilder.undecided

    def counted(*args):
        nonlocal searched
        searched += 1
        return undecided(*args)

    every = sorted(UNCERTAIN)
    for roles, condition in every if rounds(99) == 99 else every[1::3]:
        text = f"{ANYWHERE}{ROLES[roles]}require {condition}\n".replace("facing A", "facing Range(0, 360) deg")
        with monkeypatch.context() as patch:
            patch.setattr(VerdictBuilder, "undecided", counted)
            together = _verdicts(dataset, text, prefilter=False)
            # columns of the store say where on the ego's course others are, not courses that are made
            sifted = _verdicts(dataset, text, prefilter=True)
        with monkeypatch.context() as patch:
            patch.setattr(first_fit, "observed_form_of", lambda group: None)
            assert together == _verdicts(dataset, text, prefilter=False), text
        # without proofs columns tell some of it
        names = _verdicts(dataset, text, prefilter=True, proofs=False)
        told = {frame: type(verdict) for frame, verdict in sifted.items() if isinstance(verdict, Match | Unknown)}
        assert told == {frame: type(verdict) for frame, verdict in names.items()}, text
        left = {frame: verdict for frame, verdict in together.items() if isinstance(verdict, Match | Unknown)}
        assert left == {frame: sifted[frame] for frame in left}, text
        unknown += sum(isinstance(verdict, Unknown) for verdict in together.values())
    assert unknown > 3
    # they are looked at twice
    assert searched < unknown
