"""`count` and `nearest` of those ahead of the ego: what its course says, written out, wherever that is known."""

from __future__ import annotations

import pytest

from scenicq.errors import Source
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.dataset import open_dataset

HEAD = """model scenic.domains.driving.model
from scenicq.labels import along, count, nearest, others
ego = new Car
"""
LEAD = "lead = new Car in everywhere, facing Range(-180, 180) deg\n"
ALIKE = {
    "how many": (
        "require count(Car, ahead=True) >= 2",
        "require len([c for c in others(Car) if along(ego, c) > 0]) >= 2",
    ),
    "in a region": (
        "require count(Car, within=road, ahead=True) == 1",
        "require len([c for c in others(Car) if along(ego, c) > 0 and c.position in road]) == 1",
    ),
    "all": ("require count(Car, ahead=False) > 1", "require count(Car) > 1"),
    "the nearest": (
        f"{LEAD}require lead is nearest(Car, ahead=True)",
        f"{LEAD}require along(ego, lead) > 0\n"
        "require not any(along(ego, c) > 0 and (distance to c) < (distance to lead) for c in others(Car))",
    ),
}


def verdicts(dataset, text: str, **how) -> dict[str, str]:
    results = Query(dataset, Source("p.scenic", f"{HEAD}{text}\n"), QueryOptions(every=True, **how)).results()
    return {each.frame: type(each.verdict).__name__ for each in results}


SLOW = [pytest.param(each, marks=pytest.mark.slow) for each in ("in a region", "all")]


@pytest.mark.parametrize("name", ["how many", "the nearest", *SLOW])
@pytest.mark.one_in(2)
def test_ahead_is_along_the_course_of_the_ego(crossroads, name):
    short, long = ALIKE[name]
    found, written = (verdicts(open_dataset(crossroads), text) for text in (short, long))
    # beyond the end of a course it is known to be ahead, but not how far
    assert found == written
    assert {"Match", "NoMatch"} <= set(found.values())
