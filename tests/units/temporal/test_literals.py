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
@pytest.mark.one_in(2)
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


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """A recording of one label, so that nothing tells how fast anything is."""
    folder = tmp_path_factory.mktemp("alone") / "d"
    write_dataset(folder, [recording_of("r", [Sample(0.0, {"ego": (0.0, 0.0), "t": (1.0, 3.0)})])], {}, name="d")
    return folder


@pytest.mark.parametrize(
    ("start", "over_time", "expected"),
    [
        ("a.speed > 4", "always not (a.speed > 4)", {}),
        ("a.speed > 4", "always (4 >= a.speed)", {}),
        ("not (a.speed > 4)", "eventually (a.speed > 4)", {}),
        ("a.speed > 4", "always (4 < a.speed)", {("r-0", "r-0"): "Unknown"}),
        ("a.speed > 4", "always (a.speed < 9)", {("r-0", "r-0"): "Unknown"}),
        ("a.speed > 4", "(always (a.speed > 4)) or (always (a.position.x > 0))", {("r-0", "r-0"): "Unknown"}),
    ],
)
def test_the_start_and_what_follows_say_the_same_of_one_label(alone, start, over_time, expected):
    assert verdicts(alone, f"require {start}\nrequire {over_time}\n") == expected


@pytest.mark.parametrize(
    ("condition", "expected"),
    [
        ("(a.speed > 4) or not (a.speed > 4)", "Match"),
        ("(a.speed > 4) or (4 >= a.speed)", "Match"),
        ("((a.speed > 4) and (a.position.x > 0)) or not (a.speed > 4)", "Match"),
        ("(a.speed > 4) and not (a.speed > 4)", None),
        ("(a.speed > 4) == (a.speed > 4)", "Match"),
        ("(a.speed > 4) or (a.speed < 3)", "Unknown"),
        ("(a.speed > 4) or (a.speed < 5)", "Match"),
        ("(a.speed > 4) and (a.speed <= 4)", None),
    ],
)
@pytest.mark.parametrize("form", ["require {}\nrequire always True\n", "require always ({})\n"])
@pytest.mark.one_in(3)
def test_one_condition_says_the_same_of_what_it_reads_twice(alone, form, condition, expected):
    found = verdicts(alone, form.format(condition))
    assert set(found.values()) == ({expected} if expected else set())
