"""Outcomes of choices over time that put no object near one of a label are not made, and lose nothing."""

import pytest
from interval_definition import Sample
from interval_definition import recording_of as of_samples

from scenicq.errors import Source
from scenicq.match.verdict import Match
from scenicq.query.execution.run import Query
from scenicq.store.dataset import open_dataset
from scenicq.store.writer import write_dataset
from scenicq.temporal import outcomes

DISCS = [50.0 * n for n in range(9)]
"""East coordinates of discs of one metre, in one of which the spot is."""
TEXT = f"""spot = new Point in Uniform({", ".join(f"CircularRegion(({x:g}, 0), 1)" for x in DISCS)})
ego = new Object at spot, facing 0
a = new Object at ego offset by (0, Range(3, 5)), facing 0
require always (distance to spot) < 6
terminate when (distance to spot) > 3
"""


def holds(x: float, ahead: float) -> bool:
    """By the definition: a disc has a point within 0.25 m of where the ego begins, before it drives 4 m north."""
    return any(abs(x - disc) <= 1.25 for disc in DISCS) and 2.75 <= ahead <= 5.25


@pytest.mark.parametrize(
    ("x", "ahead"),
    [(151.2, 4.0), (151.3, 4.0)]
    + [pytest.param(x, ahead, marks=pytest.mark.slow) for x in (0.0, 25.0, 250.5, 400.0) for ahead in (4.0, 6.0)],
)
def test_outcomes_that_are_far_are_not_made(tmp_path, monkeypatch, x, ahead):
    made: list[object] = []
    make = outcomes._from_the_start
    monkeypatch.setattr(outcomes, "_from_the_start", lambda scenario: made.append(scenario) or make(scenario))
    places = [{"ego": (x, 2.0 * n), "t": (x, ahead + 2.0 * n)} for n in range(3)]
    write_dataset(
        tmp_path / "d", [of_samples("r", [Sample(0.5 * n, each) for n, each in enumerate(places)])], {}, name="d"
    )
    found = list(Query(open_dataset(tmp_path / "d"), Source("p.scenic", TEXT)).results())
    matches = [each for each in found if isinstance(each.verdict, Match)]
    assert bool(matches) is holds(x, ahead)
    assert {each.frame for each in matches} <= {"r-0"}
    assert len(made) <= 2
