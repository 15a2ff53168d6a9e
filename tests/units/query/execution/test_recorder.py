"""What recorded values hang on: hidden numbers, attributes, the map, whoever the ego is, what other results observe."""

from __future__ import annotations

import pytest

from scenicq.errors import Source
from scenicq.geometry.default_street import street
from scenicq.match.options import MatchOptions
from scenicq.match.verdict import Match
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.dataset import open_dataset
from scenicq.store.labels import Label, LabelObject, Recording
from scenicq.store.writer import write_dataset
from scenicq.temporal.interval_options import IntervalOptions

PLACE = "at (Range(-999, 999), Range(-999, 999)), facing Range(0, 360) deg"
HEAD = f"ego = new Object {PLACE}\nc = new Object {PLACE}\n"


def label(frame: str, recording: str, time: int, others: list[LabelObject], map_: str = "m") -> Label:
    ego = LabelObject("ego", "Car", "car", 1.75, 60.0, 0.0, 2.0, 4.0, velocity=(0.0, 3.0))
    return Label(frame, recording, time, map_, ego, tuple(others))


def other(name: str, x: float, y: float, **more: object) -> LabelObject:
    return LabelObject(name, "Car", "car", x, y, 0.0, 2.0, track=name, **more)


@pytest.fixture
def made(tmp_path):
    def make(labels: list[Label], maps: dict | None = None):
        by_name: dict[str, list[Label]] = {}
        for each in labels:
            by_name.setdefault(each.recording, []).append(each)
        recordings = [Recording(name, mine[0].map, tuple(mine)) for name, mine in by_name.items()]
        write_dataset(tmp_path / "d", recordings, maps or {}, name="d")
        return open_dataset(tmp_path / "d")

    return make


def results(dataset, text: str, **options: object):
    return [*Query(dataset, Source("p.scenic", text), QueryOptions(**options)).results()]


def test_a_hidden_number_is_that_of_the_witness(made):
    dataset = made([label("f", "r", 0, [other("a", 1.75, 70.0)])])
    text = (
        HEAD
        + "far = Range(4, 30)\nrequire (distance to c) < far\nrecord far as far\nrecord (distance to c) / far as part\n"
    )
    (found,) = results(dataset, text)
    (proof,) = [value for place, value in found.verdict.witness.items() if place == "p.scenic:3:7"]
    assert found.recorded["far"].values == (proof,)
    assert found.recorded["part"].values[0] == pytest.approx(10 / proof)
    assert proof > 10


def test_what_hangs_on_chance_alone_is_null(made):
    dataset = made([label("f", "r", 0, [other("a", 1.75, 70.0)])])
    text = (
        HEAD
        + "record Range(1, 2) as one\nspot = new OrientedPoint at (Range(1, 5), 3)\nrecord (distance to spot) as two\n"
    )
    (found,) = results(dataset, text)
    assert {name: (each.values, each.lacking) for name, each in found.recorded.items()} == {
        "one": ((None,), {"hangs on chance": 1}), "two": ((None,), {"hangs on chance": 1}),
    }  # fmt: skip


def test_texts_of_labels_are_recorded(made):
    dataset = made([
        label("f0", "r0", 0, [other("a", 1.75, 70.0, attributes={"tag": "red"})]),
        label("f1", "r1", 0, [other("a", 1.75, 70.0)]),
    ])  # fmt: skip
    made_of = 'class Tagged(Object):\n    tag: Uniform("red", "blue")\n'
    text = f"{made_of}ego = new Object {PLACE}\nc = new Tagged {PLACE}\nrecord c.tag as tag\n"
    first, second = results(dataset, text)
    assert first.recorded["tag"].values == ("red",)
    # where no label says it, the program does: either
    assert second.recorded["tag"].values == (None,)


def test_values_hang_on_no_other_result(made):
    """A length that one recording has for a while, another at no time: batches must not matter."""
    labels = [
        label(f"{r}{k}", r, k * 500_000, [other("a", 1.75, 70.0, length=4.0 if r == "r" and k == 1 else None)])
        for r in ("r", "s")
        for k in range(3)
    ]
    dataset = made(labels)
    text = (
        f"model scenic.domains.driving.model\nego = new Car {PLACE}\nc = new Car {PLACE}\nrecord c.length as length\n"
    )
    frames = {each.frame: each.recorded["length"].values[0] for each in results(dataset, text)}
    assert frames == {"r0": 4.5, "r1": 4.0, "r2": 4.5, "s0": 4.5, "s1": 4.5, "s2": 4.5}
    over_time = results(dataset, text, time=IntervalOptions(min_duration_s=0.9))
    assert {each.recording: each.recorded["length"].values for each in over_time} == {
        "r": (None, 4.0, None), "s": (4.5, 4.5, 4.5),
    }  # fmt: skip


def test_what_the_map_lacks_has_no_value_and_excludes_nothing(made):
    dataset = made(
        [
            label("f0", "r", 0, [other("a", 1.75, 70.0)], "street"),
            label("f1", "r", 1, [other("a", 300.0, 300.0)], "street"),
        ],
        {"street": street().features},
    )
    text = HEAD + (
        "model scenic.domains.driving.model\n"
        "record roadDirection at c as way\nrecord abs(relative heading of c from (roadDirection at c)) as off\n"
        "record 1 / (c.position.x - 1.75) as inverse\n"
    )
    found = {each.frame: each for each in results(dataset, f"{text}")}
    assert set(found) == {"f0", "f1"}
    assert found["f0"].recorded["way"].values[0] == pytest.approx(0, abs=1e-9)
    assert found["f1"].recorded["way"].lacking == {"no value": 1}
    assert found["f0"].recorded["inverse"].lacking == {"no value": 1}
    assert found["f1"].recorded["inverse"].values[0] == pytest.approx(1 / 298.25)


def test_the_ego_may_be_anybody(made):
    dataset = made([label("f", "r", 0, [other("a", 1.75, 70.0, velocity=(0.0, 9.0)), other("b", 1.75, 90.0)])])
    text = HEAD + "record ego.position.y as y\nrecord (distance to c) as gap\n"
    found = results(dataset, text, match=MatchOptions(ego="any"), all_matches=True)
    told = {
        (each.verdict.correspondence["ego"], each.verdict.correspondence["c"]): (
            each.recorded["y"].values[0], each.recorded["gap"].values[0],
        )
        for each in found
    }  # fmt: skip
    places = {"ego": 60.0, "a": 70.0, "b": 90.0}
    assert len(told) >= 4
    for (one, two), (y, gap) in told.items():
        assert (y, gap) == (places[one], abs(places[one] - places[two]))


def test_what_is_unknown_carries_nothing(made):
    dataset = made([label("f", "r", 0, [other("a", 1.75, 70.0)])])
    text = HEAD + "require c.speed < 3\nrecord (distance to c) as gap\n"
    (found,) = results(dataset, text, every=True)
    assert not isinstance(found.verdict, Match)
    assert found.recorded is None


def test_a_choice_of_lanes_is_known_where_they_agree(made):
    """On the street a lane leads to several ways through the intersection, which overlap there."""
    network = street()
    (x, y), *_ = [
        (at.x, at.y)
        for lane in network.lanes
        for at in [lane.polygon.representative_point()]
        if len(network.lanesAt(at.x, at.y)) > 1
    ]
    assert len(network.lanesAt(1.75, 70.0)) == 1
    dataset = made(
        [label("f0", "r", 0, [other("a", 1.75, 70.0)], "street"), label("f1", "r", 1, [other("a", x, y)], "street")],
        {"street": network.features},
    )
    text = HEAD + (
        "model scenic.domains.driving.model\n"
        "record c.position in network.laneAt(c) as inside\nrecord network.laneAt(c) is network.laneAt(ego) as same\n"
        "record c.position in network.laneAt(ego) as behind\n"
    )
    first, second = results(dataset, text)
    told = [{name: each.values[0] for name, each in found.recorded.items()} for found in (first, second)]
    assert told[0] == {"inside": True, "same": True, "behind": True}
    assert told[1] == {"inside": True, "same": False, "behind": False}
