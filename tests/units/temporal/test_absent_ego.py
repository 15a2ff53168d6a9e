"""Where a label has no ego, nothing is known of it: no point that stands in is read, and no motion crosses it."""

import pytest

from scenicq.errors import Source
from scenicq.geometry.default_street import street
from scenicq.match.options import MatchOptions
from scenicq.match.verdict import Match, Unknown
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.dataset import Dataset, open_dataset
from scenicq.store.labels import Label, LabelObject, Recording
from scenicq.store.writer import write_dataset
from scenicq.temporal.interval_options import IntervalOptions

STREET = street()
ABSENT = (3, 4)
HEAD = """model scenic.domains.driving.model
ego = new Car in everywhere, facing Range(0, 360) deg
c = new Car in everywhere, facing Range(0, 360) deg
"""


@pytest.fixture(scope="module")
def dataset(tmp_path_factory) -> Dataset:
    """An ego that drives at 4 m/s, 30 m behind a car, but for two labels that have none."""
    labels: list[Label] = []
    for number in range(8):
        car = LabelObject("car", "Car", "car", 0.0, 30.0 + 2 * number, 0.0, 2.0, 4.5, 1.5, None, "c")
        ego = LabelObject("ego", "Car", "car", 0.0, 2.0 * number, 0.0, 2.0, 4.5, 1.5, None)
        point = LabelObject("ego", "", "", car.x, car.y)
        labels.append(
            Label(f"f{number}", "r", 10**12 + number * 500_000, STREET.name, point if number in ABSENT else ego, (car,))
        )
    folder = tmp_path_factory.mktemp("absent") / "d"
    recording = Recording("r", STREET.name, tuple(labels))
    write_dataset(folder, iter([recording]), {STREET.name: STREET.features}, name="absent")
    return open_dataset(folder)


def told(
    dataset: Dataset, text: str, match: MatchOptions = MatchOptions(), prefilter: bool = True, **more: object
) -> list[tuple[type, str, str]]:
    options = QueryOptions(match, prefilter=prefilter, time=IntervalOptions(**more))
    found = Query(dataset, Source("absent.scenic", HEAD + text), options).results()
    return [(type(each.verdict), each.frame, each.interval.last) for each in found]


@pytest.mark.parametrize(
    "condition",
    [
        "(distance to c) < 2",
        "ego.position.y > 20",
        "ego.speed > 20",
        "ego.speed < 3",
        "abs(ego.acceleration) > 1",
        "abs(ego.angularSpeed) > 0.1",
        "abs(relative heading of ego from c) > 1",
        "ego.velocity.y > 20",
    ],
)
@pytest.mark.one_in(3)
def test_what_stands_in_for_an_absent_ego_is_not_read(dataset, condition):
    assert {verdict for verdict, _, _ in told(dataset, f"require eventually {condition}")} == {Unknown}
    kept = told(dataset, f"require always not ({condition})")
    # of three samples in a row nobody knows an acceleration
    assert ((Match, "f0", "f2") in kept) == ("acceleration" not in condition)
    assert all(verdict is not Match or not (first <= "f3" <= last) for verdict, first, last in kept)


@pytest.mark.parametrize(
    ("match", "prefilter"), [(MatchOptions(), False), (MatchOptions(), True), (MatchOptions(exact=True), True)]
)
def test_a_plain_requirement_binds_where_another_label_has_no_ego(dataset, match, prefilter):
    for condition, starts in (("ego.position.y > 9", ["f5", "f6"]), ("(distance to c) > 30", [])):
        text = f"require {condition}\nterminate after 0.5 seconds\n"
        found = told(dataset, text, match, prefilter, intervals="all")
        assert [first for verdict, first, _ in found if verdict is Match] == starts


def test_no_motion_crosses_a_label_without_an_ego(dataset):
    motions = [label.ego.motion for label in dataset.labels()]
    for number, motion in enumerate(motions):
        if number in ABSENT:
            assert motion is None or motion.velocity is None
        else:
            assert motion is not None
            assert motion.velocity == pytest.approx((0.0, 4.0))
            assert motion.acceleration is None  # which takes four samples without a gap


def test_frames_of_a_static_program_without_an_ego_are_in_no_interval_that_matches(dataset):
    found = told(dataset, "", min_duration_s=1.0)
    assert [(first, last) for verdict, first, last in found if verdict is Match] == [("f0", "f2"), ("f5", "f7")]
