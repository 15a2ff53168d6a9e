"""What lies ahead of an object in its lanes, by its definition: feet on the middles of lanes, lane by lane.

A place is ahead within so many metres where it lies in the area of one of the object's lanes, or of one that these lead
to, and its foot on the middle of that lane is at most so far on, along the middles, from the object's own foot.
"""

from __future__ import annotations

import random
from collections import Counter
from pathlib import Path

import pytest
import shapely
from test_lanes import AREAS, Passage, dataset_of, label, own_lanes

from scenicq.errors import Source
from scenicq.geometry.elements import Lane
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import EXACT
from scenicq.match.verdict import Match
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.labels import Label, LabelObject, Recording

ACROSS_M = 0.4
"""How far places are from the cuts: at corners of a middle, feet and right angles differ."""
MIDDLES = {lane.id: (lane, area, shapely.LineString(line)) for lane, area, line in AREAS}


def begins_of(owner: LabelObject, lanes: list[Lane]) -> dict[str, float]:
    """How far on each lane begins, which is behind the owner for the first."""
    begins: dict[str, float] = {}
    todo = [(lane.id, -MIDDLES[lane.id][2].project(shapely.Point(owner.x, owner.y))) for lane in lanes]
    while todo:
        name, begin = todo.pop()
        if begin >= begins.get(name, 200.0):
            continue
        begins[name] = begin
        lane, _, line = MIDDLES[name]
        todo += [(each.id, begin + line.length) for each in lane.successors]
    return begins


def how_far(owner: LabelObject, place: LabelObject, rule: str) -> list[float]:
    """How far on a place is, in each lane that it lies in."""
    spot = shapely.Point(place.x, place.y)
    begins = begins_of(owner, own_lanes(owner, rule))
    here = [(name, *MIDDLES[name][1:]) for name in begins]
    return [begins[name] + line.project(spot) for name, area, line in here if area.contains(spot)]


def is_ahead(owner: LabelObject, place: LabelObject, metres: float, rule: str) -> bool:
    return any(0 <= each <= metres for each in how_far(owner, place, rule))


def is_clear(owner: LabelObject, place: LabelObject, metres: float, rule: str) -> bool:
    far = how_far(owner, place, rule)
    return all(min(abs(each), abs(each - metres)) > ACROSS_M for each in far)


METRES = (6.0, 18.0, 45.0)
MODEL = "model scenic.domains.driving.model\nfrom scenicq.labels import ahead, others\n"
ANYWHERE = "in everywhere, facing Range(-180, 180) deg"
FORMS = {
    "in": f"a = new Car {ANYWHERE}\nrequire a.position in ahead(ego, {{d}})",
    "on": "a = new Car on ahead(ego, {d}), facing Range(-180, 180) deg",
    "not": f"a = new Car {ANYWHERE}\nrequire a.position not in ahead(ego, {{d}})",
    "behind": f"a = new Car {ANYWHERE}\nrequire ego.position in ahead(a, {{d}})",
    "others": "require any(c.position in ahead(ego, {d}) for c in others(Car))",
    "nobody": "require not any(c.position in ahead(ego, {d}) for c in others(Car))",
}


def holds(form: str, world: Label, metres: float, rule: str) -> bool:
    told = [is_ahead(world.ego, each, metres, rule) for each in world.objects]
    match form:
        case "in" | "on" | "others":
            return True in told
        case "not":
            return False in told
        case "behind":
            return any(is_ahead(each, world.ego, metres, rule) for each in world.objects)
        case _:
            return True not in told


def clear_labels(draw: random.Random, count: int) -> list[Label]:
    passage, found = Passage(), list[Label]()
    while len(found) < count:
        world = label(draw, len(found), passage, len(found) * 500_000)
        pairs = [(world.ego, each) for each in world.objects] + [(each, world.ego) for each in world.objects]
        if all(is_clear(*pair, d, rule) for pair in pairs for d in METRES for rule in ("along", "any")):
            found.append(world)
        else:
            passage = Passage()
            for each in found:
                for one in (each.ego, *each.objects):
                    passage.pass_on(one, each.timestamp_us)
    return found


def matching(dataset, text: str, **how) -> set[str]:
    results = Query(dataset, Source("p.scenic", text), QueryOptions(MatchOptions(tolerance=EXACT), **how)).results()
    return {each.frame for each in results if isinstance(each.verdict, Match)}


def check(folder: Path, seed: int, frames: int, programs: int) -> Counter[str]:
    draw, seen = random.Random(seed), Counter[str]()
    labels = clear_labels(draw, frames)
    dataset = dataset_of(folder, [Recording("r", labels[0].map, tuple(labels))])
    for number in range(programs):
        form, metres = list(FORMS)[number % len(FORMS)], draw.choice(METRES)
        rule = draw.choice(["along", "along", "any"])
        text = f"{MODEL}ego = new Car {ANYWHERE}\n{FORMS[form].format(d=metres)}\n"
        right = {each.frame for each in labels if holds(form, each, metres, rule)}
        for how in ({}, {"proofs": False}, {"prefilter": False}):
            found = matching(dataset, text, lanes=rule, **how)
            assert found == right, (text, rule, how, found ^ right)
        seen[form] += len(right)
    return seen


def test_frames_are_those_of_the_definition(tmp_path):
    seen = check(tmp_path / "d", 1, 20, 6)
    assert all(seen[form] for form in FORMS), seen


@pytest.mark.slow
def test_many_frames_are_those_of_the_definition(tmp_path):
    for seed in range(2, 4):
        check(tmp_path / f"{seed}", seed, 40, 18)
