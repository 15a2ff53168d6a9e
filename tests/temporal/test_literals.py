"""Conditions that are alike, or each other's negation, come out together where what they read is not observed."""

import pytest
from interval_definition import Sample, recording_of

from scenicq.errors import Source
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.dataset import open_dataset
from scenicq.store.writer import write_dataset
from scenicq.temporal.interval_options import IntervalOptions

OBJECTS = "".join(f"{name} = new Object at (Range(-99, 99), Range(-99, 99)), facing 0\n" for name in ("ego", "a"))
SAYS_SO = ("a.position.x > 4", "4 < a.position.x", "not (a.position.x <= 4)", "not (4 >= a.position.x)")
DENIES_IT = ("a.position.x <= 4", "4 >= a.position.x", "not (a.position.x > 4)", "not (4 < a.position.x)")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The object is not seen in the second of three labels."""
    folder = tmp_path_factory.mktemp("gap") / "d"
    seen = [{"ego": (0.0, 0.0), "t": (float(n), 3.0)} for n in range(3)]
    del seen[1]["t"]
    write_dataset(folder, [recording_of("r", [Sample(0.5 * n, each) for n, each in enumerate(seen)])], {}, name="d")
    return folder


def verdicts(folder, text):
    options = QueryOptions(time=IntervalOptions(intervals="all"))
    results = Query(open_dataset(folder), Source("p.scenic", OBJECTS + text), options).results()
    return {(each.frame, each.interval.last): type(each.verdict).__name__ for each in results}


@pytest.mark.parametrize(("one", "other"), list(zip(SAYS_SO, DENIES_IT[1:] + DENIES_IT[:1], strict=True)))
def test_one_of_a_condition_and_its_negation_holds(folder, one, other):
    whole = {("r-0", "r-2"): "Match", ("r-2", "r-2"): "Match"}
    assert verdicts(folder, f"require (always ({one})) or (eventually ({other}))\n") == whole
    assert verdicts(folder, f"terminate when {one}\nterminate when {other}\n") == {
        ("r-0", "r-0"): "Match", ("r-2", "r-2"): "Match",
    }  # fmt: skip
    after = (
        "monitor M():\n    wait\n    if {}:\n        terminate\n    require {}\n    terminate\nrequire monitor M()\n"
    )
    assert verdicts(folder, after.format(one, other)) == {("r-0", "r-1"): "Match"}


@pytest.mark.parametrize(
    ("one", "other"),
    [("a.position.x > 4", "a.position.x <= 5"), ("a.position.x > 4", "a.position.y <= 4"),
     ("a.position.x == 4", "a.position.x > 4")],
)  # fmt: skip
def test_others_may_fail_both(folder, one, other):
    assert verdicts(folder, f"require (next ({one})) or (next ({other}))\n")["r-0", "r-2"] != "Match"


def test_what_has_no_value_satisfies_neither(folder):
    """Of what is not seen not even that it has a value is known."""
    one = "1 / a.position.x > 4"
    assert verdicts(folder, f"require next (({one}) or not ({one}))\n")["r-0", "r-2"] == "Unknown"
