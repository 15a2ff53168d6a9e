"""A speed that is not observed is not negative: what holds for all such speeds is known."""

import itertools

import pytest
from interval_definition import Sample, recording_of

from scenicq.errors import ScenarioError, Source
from scenicq.match.options import MatchOptions
from scenicq.match.verdict import Match
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.dataset import Dataset, open_dataset
from scenicq.store.writer import write_dataset

OBJECTS = "".join(f"{name} = new Object at (Range(-99, 99), Range(-99, 99)), facing 0\n" for name in ("ego", "a"))
OPERATORS = {
    "<": lambda one, other: one < other,
    "<=": lambda one, other: one <= other,
    ">": lambda one, other: one > other,
    ">=": lambda one, other: one >= other,
    "==": lambda one, other: one == other,
    "!=": lambda one, other: one != other,
}
SPEEDS = (0.0, 0.5, 1.0, 2.0, 9.0)


@pytest.fixture(scope="module")
def dataset(tmp_path_factory) -> Dataset:
    """One label, so that nothing has a speed; the ego stands at 1, -1 and 0."""
    folder = tmp_path_factory.mktemp("speeds") / "d"
    traces = [[Sample(0.0, {"ego": (x, 0.0), "t": (0.0, 5.0)})] for x in (-1.0, 0.0, 1.0)]
    write_dataset(folder, [recording_of(f"r{n}", trace) for n, trace in enumerate(traces)], {}, name="d")
    return open_dataset(folder)


@pytest.mark.parametrize("method", ["auto", "smt", "monolithic"])
@pytest.mark.parametrize("over_time", [False, True])
@pytest.mark.one_in(8)
@pytest.mark.slow
def test_comparisons_with_speeds(dataset, over_time, method):
    ways = (False, True) if method == "auto" else (False,)
    for op, turned, negated in itertools.product(OPERATORS, ways, ways):
        sides = ("ego.position.x", "a.speed") if turned else ("a.speed", "ego.position.x")
        said = f"{sides[0]} {op} {sides[1]}"
        text = f"{OBJECTS}require {'always ' if over_time else ''}{f'not ({said})' if negated else said}\n"
        options = QueryOptions(match=MatchOptions(method=method))
        found = {each.recording: each.verdict for each in Query(dataset, Source("p.scenic", text), options).results()}
        for number, x in enumerate((-1.0, 0.0, 1.0)):
            values = {(OPERATORS[op](x, v) if turned else OPERATORS[op](v, x)) is not negated for v in SPEEDS}
            told = found.get(f"r{number}")
            assert told is None if values == {False} else isinstance(told, Match) == (values == {True}), (text, x)


def test_with_a_hidden_number_what_some_of_its_values_allow_is_no_no(dataset):
    text = OBJECTS + "k = Range(-2, 1)\nrequire a.speed < k\nrequire always a.speed < k\n"
    try:
        found = list(Query(dataset, Source("p.scenic", text), QueryOptions()).results())
    except ScenarioError as error:
        pytest.fail(str(error))
    assert len(found) == 3
