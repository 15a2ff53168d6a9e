"""Every correspondence of a label that nothing excludes is looked at over time, whatever else the label holds."""

import pytest
from interval_definition import Sample
from interval_definition import recording_of as of_samples

from scenicq.errors import Source
from scenicq.limits import LIMITS
from scenicq.match.options import MatchOptions
from scenicq.match.verdict import Match, Unknown
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.dataset import Dataset, open_dataset
from scenicq.store.writer import write_dataset
from scenicq.temporal.interval_options import IntervalOptions

OBJECTS = "".join(f"{name} = new Object at (Range(-99, 99), Range(-99, 99)), facing 0\n" for name in ("ego", "a"))
METHODS = ("auto", "smt", "monolithic")


@pytest.fixture(scope="module")
def dataset(tmp_path_factory) -> Dataset:
    """Three objects that stand still for a second; none has a speed in the last frame, where it is alone."""
    folder = tmp_path_factory.mktemp("open") / "d"
    places = {"ego": (0.0, 0.0), "t": (0.0, 5.0), "u": (0.0, 10.0), "v": (0.0, 15.0)}
    trace = [Sample(0.0, places), Sample(9.0, {"ego": (0.0, 0.0)})]
    moving = [Sample(0.5 * n, {**places, "t": (0.0, 5.0 + 4 * n)}) for n in range(3)]
    write_dataset(folder, [of_samples("alone", trace), of_samples("moving", moving)], {}, name="d")
    return open_dataset(folder)


def told(dataset: Dataset, text: str, method: str = "auto") -> list[tuple[str, str, type]]:
    options = QueryOptions(match=MatchOptions(method=method), time=IntervalOptions(intervals="all"))
    results = Query(dataset, Source("p.scenic", OBJECTS + text), options).results()
    return sorted((each.frame, each.verdict.correspondence.get("a", ""), type(each.verdict)) for each in results)


@pytest.mark.parametrize("method", METHODS)
def test_each_open_correspondence_is_told(dataset, method):
    text = "require a.speed > 5\nrequire always (distance to a) > 7\n"
    found = told(dataset, text, method)
    assert [(track, kind) for frame, track, kind in found if frame == "alone-0"] == [("u", Unknown), ("v", Unknown)]


@pytest.mark.parametrize("method", METHODS)
def test_those_beside_a_match_are_told_too(tmp_path, method):
    places = {"t": (0.0, 5.0), "u": (0.0, 10.0), "v": (0.0, 15.0)}
    trace = [Sample(0.0, {"ego": (0.0, 0.0), **places}), Sample(0.5, {"ego": (0.0, 0.0), "t": (0.0, 9.0)})]
    write_dataset(tmp_path / "d", [of_samples("r", trace)], {}, name="d")
    found = told(open_dataset(tmp_path / "d"), "require a.speed > 5\nterminate after 0 seconds\n", method)
    assert found == [("r-0", "t", Match), ("r-0", "u", Unknown), ("r-0", "v", Unknown), ("r-1", "t", Match)]


@pytest.mark.parametrize("most", [0, 1, 2])
def test_more_open_starts_than_can_be_held_leave_the_label_open(dataset, monkeypatch, most):
    monkeypatch.setattr(LIMITS, "recording_starts", most)
    found = told(dataset, "require a.speed > 5\nterminate after 0 seconds\n")
    alone = [(track, kind) for frame, track, kind in found if frame == "alone-0"]
    assert sorted(alone) == sorted([("", Unknown), *((track, Unknown) for track in ("t", "u", "v")[:most])])
