"""How an object moves is only ever observed: wherever a plain value is wanted, no default of a class stands in."""

import json
import subprocess

import pytest

from scenicq.errors import ScenicqError, Source
from scenicq.geometry.default_street import street
from scenicq.match.options import MatchOptions
from scenicq.match.verdict import Match, NoMatch, Unknown
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.dataset import Dataset, open_dataset
from scenicq.store.labels import Label, LabelObject, Recording
from scenicq.store.writer import write_dataset

STREET = street()
SAMPLES = 8
HEAD = """model scenic.domains.driving.model
ego = new Car in everywhere, facing Range(0, 360) deg
c = new Car in everywhere, facing Range(0, 360) deg
def over(value):
    if value > 2:
        return "over"
    return "under"
"""
MOVING = {
    "speed": "{0}.speed",
    "velocity": "{0}.velocity.y",
    "acceleration": "({0}.acceleration * 3)",
    "angularSpeed": "({0}.angularSpeed * 10)",
}
"""Each with a number that is between 3 and 9 in the recording, and would be 0 by default."""
PLACES = {
    "int": ("int({0}) > 2", "int({0}) == 0"),
    "round": ("round({0}) > 2", "round({0}) == 0"),
    "bool": ("bool({0})", "not bool({0})"),
    "filter": ("len([o for o in [{0}] if o > 2]) == 1", "len([o for o in [{0}] if o > 2]) == 0"),
    "filter function": ("list(filter(lambda o: o > 2, [{0}]))", "not list(filter(lambda o: o > 2, [{0}]))"),
    "ternary": ("({0} < 10) if {0} > 2 else False", "({0} > 100) if {0} > 2 else True"),
    "function": ("over({0}) == 'over'", "over({0}) == 'under'"),
    "sorted": ("sorted([1, {0}])[1] > 2", "sorted([1, {0}])[0] < 1"),
    "sorted by key": ("sorted([1, {0}], key=lambda o: -o)[0] > 2", "sorted([1, {0}], key=lambda o: -o)[1] < 1"),
    "min by key": ("min([1, {0}], key=lambda o: -o) > 2", "max([1, {0}], key=lambda o: -o) < 1"),
    "any": ("any([o > 2 for o in [{0}]])", "all([o < 1 for o in [{0}]])"),
    "operand": ("({0} > 2 and 5 or 1) == 5", "({0} > 2 and 5 or 1) == 1"),
    "item": ("[1, 5][{0} > 2] == 5", "[1, 5][{0} > 2] == 1"),
    "key": ("{{True: 5, False: 1}}[{0} > 2] == 5", "{{True: 5, False: 1}}[{0} > 2] == 1"),
    "plain": ("{0} > 2", "{0} < 1"),
}
"""Conditions where a plain value is wanted: one that holds of what is observed, and one that holds of 0."""
OVER_TIME = {
    "always": "require always ({0})",
    "eventually": "require eventually ({0})",
    "terminate when": "terminate when ({0})",
    "monitor": (
        "monitor M():\n    while True:\n        if {0}:\n            terminate\n        wait\nrequire monitor M()\n"
    ),
}
WAYS = {
    "auto": QueryOptions(),
    "without prefilter": QueryOptions(prefilter=False),
    "without proofs": QueryOptions(proofs=False),
    "smt": QueryOptions(MatchOptions(method="smt"), solver="portable"),
    "monolithic": QueryOptions(MatchOptions(method="monolithic"), solver="portable"),
}


def recording(*, observed: bool, name: str = "r") -> Recording:
    """Two cars that speed up and turn; where nothing of that is observed, samples far apart and without tracks."""
    labels: list[Label] = []
    for number in range(SAMPLES):
        at = 0.25 * number
        moved = 3.25 * at + at * at
        velocity = (0.0, 3.25 + 2 * at) if observed else None
        things = [
            LabelObject(id_, "Car", "car", x, moved, 0.4 * at, 2.0, 4.5, 1.5, velocity, id_ if observed else None)
            for id_, x in (("ego", 0.0), ("other", 5.0))
        ]
        step_us = 250_000 if observed else 60_000_000
        labels.append(Label(f"{name}{number}", name, 10**12 + number * step_us, STREET.name, things[0], (things[1],)))
    return Recording(name, STREET.name, tuple(labels))


def made(folder, *recordings: Recording) -> Dataset:
    """A dataset of some recordings."""
    write_dataset(folder, iter(recordings), {STREET.name: STREET.features}, name="moving")
    return open_dataset(folder)


@pytest.fixture(scope="module")
def moving(tmp_path_factory) -> Dataset:
    """A recording in which all motion is observed."""
    return made(tmp_path_factory.mktemp("moving") / "d", recording(observed=True))


@pytest.fixture(scope="module")
def still_unknown(tmp_path_factory) -> Dataset:
    """A recording in which no motion is observed."""
    return made(tmp_path_factory.mktemp("unknown") / "d", recording(observed=False))


def verdicts(dataset: Dataset, text: str, options: QueryOptions) -> list[type]:
    """The kinds of the verdicts that are told."""
    return [type(each.verdict) for each in Query(dataset, Source("moves.scenic", HEAD + text), options).results()]


def conditions(which: int) -> list[str]:
    """Every property in every place, of either object."""
    return [
        PLACES[place][which].format(value.format(owner))
        for place in PLACES
        for value in MOVING.values()
        for owner in ("ego", "c")
    ]


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.one_in(8)
def test_frames_are_read_as_they_are_observed(moving, way):
    held = "".join(f"require ({each})\n" for each in conditions(0))
    assert verdicts(moving, held, WAYS[way]).count(Match) >= SAMPLES - 2
    assert Match not in verdicts(moving, "require " + " or ".join(f"({each})" for each in conditions(1)), WAYS[way])


@pytest.mark.parametrize("place", OVER_TIME)
@pytest.mark.parametrize("way", ["auto", "smt"])
@pytest.mark.one_in(4)
def test_samples_are_read_as_they_are_observed(moving, place, way):
    every = " and ".join(f"({each})" for each in conditions(0))
    assert Match in verdicts(moving, OVER_TIME[place].format(every), WAYS[way])
    some = " or ".join(f"({each})" for each in conditions(1))
    assert Match not in verdicts(moving, OVER_TIME[place].format(some), WAYS[way])


COMMANDS = (("auto",), ("smt",), ("monolithic",), ("auto", "--no-prefilter"), ("smt", "--no-prefilter", "--jobs", "2"))


@pytest.mark.parametrize("words", COMMANDS, ids=" ".join)
@pytest.mark.parametrize("place", ["frames", *OVER_TIME])
@pytest.mark.one_in(36)
@pytest.mark.slow
def test_the_installed_command_reads_what_is_observed(moving, still_unknown, place, words, command, tmp_path):
    form = "require ({0})" if place == "frames" else OVER_TIME[place]

    def told(dataset: Dataset, condition: str) -> list[str]:
        (tmp_path / "p.scenic").write_text(HEAD + form.format(condition) + "\n")
        line = [command, "match", tmp_path / "p.scenic", dataset.path, "--format", "jsonl", "--exit-zero", "--method"]
        run = subprocess.run([*map(str, line), *words], capture_output=True, text=True, check=False)
        assert run.returncode == 0 or "error[impossible-requirement]" in run.stderr, run.stderr
        return [json.loads(each)["verdict"] for each in run.stdout.splitlines()]

    every, some = (joint.join(f"({each})" for each in conditions(n)) for n, joint in enumerate((" and ", " or ")))
    assert told(moving, every).count("match") >= (SAMPLES - 2 if place == "frames" else 1)
    assert "match" not in told(moving, some)
    assert "match" not in told(still_unknown, some)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.one_in(8)
def test_a_frame_that_hangs_on_what_is_not_observed_is_unknown(still_unknown, way):
    for which in (0, 1):
        for word in (" and ", " or "):
            # no operand decides
            text = "require " + word.join(f"({each})" for each in conditions(which))
            assert verdicts(still_unknown, text, WAYS[way]) == [Unknown] * SAMPLES


@pytest.mark.parametrize("place", OVER_TIME)
@pytest.mark.one_in(4)
def test_an_interval_that_hangs_on_what_is_not_observed_is_unknown(still_unknown, place):
    for which, word in ((0, " and "), (0, " or "), (1, " and "), (1, " or ")):
        condition = word.join(f"({each})" for each in conditions(which) if "ego" in each)
        alone = HEAD.replace("c = new Car in everywhere, facing Range(0, 360) deg\n", "")
        text = OVER_TIME[place].format(condition)
        found = Query(still_unknown, Source("moves.scenic", alone + text), QueryOptions()).results()
        assert {type(each.verdict) for each in found} == {Unknown}, text


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize(
    ("text", "verdict"),
    [
        ("require ego.speed < 1 or ego.position.x == 0", Match),
        ("require ego.speed < 1 and ego.position.x > 1", None),
        ("require (c.position.x == 5) if ego.speed < 1 else (c.position.x > 4)", Match),
        ("require (c.position.x == 4) if ego.speed < 1 else (c.position.x > 5)", None),
        ("D = Range(1, 2)\nrequire D > 1.5 or ego.speed > 2", Match),
        ("D = Range(1, 2)\nrequire D > 1.5 and ego.speed > 2", Unknown),
        ("D = Range(1, 2)\nrequire D > 2.5 and ego.speed > 2", None),
        ("require len([o for o in (ego, c) if o.speed > 3 or o.position.x >= 0]) == 2", Match),
    ],
)
@pytest.mark.one_in(8)
def test_unknown_only_where_it_makes_a_difference(still_unknown, way, text, verdict):
    found = verdicts(still_unknown, text + "\n", WAYS[way])
    assert set(found) - {NoMatch} == ({verdict} - {None})
    assert len(found) == SAMPLES or verdict is None


@pytest.mark.parametrize("way", WAYS)
def test_a_place_that_hangs_on_what_is_not_observed_is_unknown(still_unknown, way):
    placed = HEAD.replace("c = new Car in everywhere", "c = new Car at ego offset by (5, ego.speed)")
    found = Query(still_unknown, Source("moves.scenic", placed), WAYS[way]).results()
    assert {type(each.verdict) for each in found} == {Unknown}


@pytest.mark.parametrize("text", ["str({0}) == '0.0'", "f'{{{0}}}' == '0.0'", "len(range(int({0}))) == 0"])
def test_what_cannot_be_read_is_refused_by_name(moving, text):
    for value in MOVING.values():
        for place in ("require {0}", *OVER_TIME.values()):
            with pytest.raises(ScenicqError) as error:
                verdicts(moving, place.format(text.format(value.format("ego"))), QueryOptions())
            assert error.value.diagnostics[0].code in ("random-branch", "unsupported-construct")
