"""Labels with more correspondences than anybody can look at: a query ends soon, and says where it has stopped."""

from __future__ import annotations

import math
from collections import Counter

import pytest

from scenicq.errors import Source
from scenicq.limits import LIMITS
from scenicq.match.options import MatchOptions
from scenicq.match.verdict import Match, Unknown
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.dataset import open_dataset
from scenicq.store.labels import Label, LabelObject, Recording
from scenicq.store.writer import write_dataset

CARS, ROLES, LABELS = 12, 8, 6
CAR = "new Object at (Range(-99, 99), Range(-99, 99)), facing 0"
ALIKE = f"ego = {CAR}\nothers = [{CAR} for _ in range({ROLES})]\n"
APART = f"ego = {CAR}\n" + "".join(f"car{n} = {CAR}\nrequire car{n}.position.x < {50 + n}\n" for n in range(ROLES))
# two intervals that do not overlap
OVER_TIME = "require always ego.position.x < 50\nterminate after 1 seconds\n"


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    """A recording of some cars that stand there."""
    cars = [LabelObject(f"c{n}", "Car", "car", 3.0 * n, 9.0, heading=0.0, track=f"c{n}") for n in range(CARS)]
    ego = LabelObject("ego", "Car", "car", 0.0, 0.0, heading=0.0)
    labels = [Label(f"r-{n}", "r", 500_000 * n, "none", ego, tuple(cars)) for n in range(LABELS)]
    folder = tmp_path_factory.mktemp("many") / "d"
    write_dataset(folder, [Recording("r", "none", tuple(labels))], {}, name="d")
    return open_dataset(folder)


def told(dataset, text: str, options: QueryOptions) -> tuple[Counter[str], Counter[tuple[str, str]]]:
    """Matches and unknowns by the frame that they begin with; those with why they are unknown."""
    matches, unknown = Counter[str](), Counter[tuple[str, str]]()
    for each in Query(dataset, Source("p.scenic", text), options).results():
        if isinstance(each.verdict, Match):
            matches[each.frame] += 1
        else:
            assert isinstance(each.verdict, Unknown)
            unknown[each.frame, each.verdict.reason] += 1
    return matches, unknown


@pytest.mark.parametrize("over_time", [False, True])
def test_alike_objects_are_told_in_one_order(dataset, over_time):
    options = QueryOptions(all_matches=not over_time, every=True)
    matches, unknown = told(dataset, ALIKE + (OVER_TIME if over_time else ""), options)
    assert not unknown
    assert sum(matches.values()) == math.comb(CARS, ROLES) * (2 if over_time else LABELS)


@pytest.mark.parametrize("over_time", [False, True])
def test_what_is_beyond_the_limit_is_unknown_for_each_label(dataset, over_time):
    match = MatchOptions(correspondences=20)
    options = QueryOptions(all_matches=not over_time, every=True, match=match)
    matches, unknown = told(dataset, APART + (OVER_TIME if over_time else ""), options)
    assert unknown == Counter({(f"r-{n}", "budget"): 1 for n in range(LABELS)})
    assert all(count <= 20 for count in matches.values())
    assert matches["r-0"] == 20


def test_beyond_the_starts_of_a_recording_labels_are_unknown(dataset, monkeypatch):
    monkeypatch.setattr(LIMITS, "recording_starts", 50)
    options = QueryOptions(every=True, match=MatchOptions(correspondences=20))
    matches, unknown = told(dataset, APART + OVER_TIME, options)
    assert unknown == Counter({(f"r-{n}", "budget"): 1 for n in range(LABELS)})
    assert matches["r-0"] == 20
    none = APART + "require ego.position.x > 50\n" + OVER_TIME
    assert not list(Query(dataset, Source("p.scenic", none), QueryOptions()).results())


def test_the_time_for_a_label_covers_all_its_correspondences(dataset):
    match = MatchOptions(correspondences=10**9, budget=10**9, timeout_s=0.3)
    matches, unknown = told(dataset, APART, QueryOptions(all_matches=True, every=True, match=match))
    assert unknown == Counter({(f"r-{n}", "timeout"): 1 for n in range(LABELS)})
    assert min(matches.values()) > 20
