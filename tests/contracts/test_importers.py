"""What every importer must do, on its sample and on real data where it is there."""

from __future__ import annotations

import math
import shutil
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from label_rows import labels_of
from shapely import box, unary_union

from scenicq.errors import DataError
from scenicq.geometry import angles
from scenicq.importers.argoverse2 import Argoverse2
from scenicq.importers.argoverse2_forecasting import Argoverse2Forecasting
from scenicq.importers.base import Importer, ImportOptions
from scenicq.importers.commonroad import CommonRoad
from scenicq.importers.ego_choice import WITHOUT_EGO
from scenicq.importers.ingest import ingest
from scenicq.importers.interaction import Interaction
from scenicq.importers.interchange import Interchange
from scenicq.importers.kitti import Kitti
from scenicq.importers.nuscenes import NuScenes
from scenicq.importers.openlabel import OpenLabel
from scenicq.importers.registry import importers
from scenicq.importers.report import Report
from scenicq.importers.waymo import Waymo
from scenicq.store.classes import ROOT, is_class, is_subclass
from scenicq.store.dataset import open_dataset
from scenicq.store.labels import Label, Recording

SAMPLES = Path(__file__).parents[2] / "sample_data"
REAL = Path(__file__).parents[3] / "shared" / "data"
BOSTON_MAP = REAL / "boston" / "maps" / "boston-seaport.geojson"
MOVING_MPS = 3.0
"""Slower vehicles stand, turn into drives, park: they need not head along a lane, nor where they move."""


@dataclass(frozen=True)
class Case:
    """A source with what is known of it.

    `golden` is the id of a frame with rows of it: class, x, y, heading, velocity.
    """

    importer: Importer
    path: Path
    frames: int
    objects: int
    tracks: int
    golden: str
    rows: Sequence[tuple[str, float, float, float, tuple[float, float] | None]]
    maps: dict[str, Path] = field(default_factory=dict[str, Path])
    margin_m: float = 60.0


CASES = {
    "crossroads": Case(
        Interchange(),
        SAMPLES / "crossroads",
        156,
        676,
        26,
        "05-two-lane-traffic/04",
        [
            ("Car", 1.75, -82.0, 0.0, (0.0, 8.0)),
            ("Car", -1.75, 44.0, math.pi, (0.0, -8.0)),
            ("Car", -1.75, 24.0, math.pi, (0.0, -8.0)),
            ("Adult", 4.7, 87.2, math.pi, (0.0, -1.4)),
        ],
    ),
    "nuscenes_tiny": Case(
        NuScenes(),
        SAMPLES / "nuscenes_tiny",
        6,
        12,
        4,
        "ae3a09d52cac72d35dbf945b84620f5d",
        [
            ("Car", 80.0, 1.75, math.pi / 2, (-8.0, 0.0)),
            ("Adult", 50.0, -4.0, 0.0, (0.0, 1.0)),
        ],
    ),
    # --- further formats
    "argoverse2_tiny": Case(
        Argoverse2(),
        SAMPLES / "argoverse2_tiny",
        6,
        12,
        2,
        "5ce0c0de-0000-4000-8000-000000000001/1700000000100000000",
        [
            ("Car", 49.2, 1.75, math.pi / 2, (-8.0, 0.0)),
            ("Pedestrian", 40.0, -4.85, 0.0, (0.0, 1.5)),
        ],
    ),
    "argoverse2": Case(
        Argoverse2(),
        REAL / "argoverse2",
        312,
        23442,
        260,
        "7fab2350-7eaf-3b7e-a39d-6937a4c1bede/315966254659660000",
        # Composed with rotation matrices from the files, apart from the importer.
        [("Bicycle", 5219.975816947425, 2398.1309706453403, -2.038165584305748, (0.146339193, -0.106351570))],
    ),
    "forecasting_tiny": Case(
        Argoverse2Forecasting(),
        SAMPLES / "forecasting_tiny",
        6,
        12,
        2,
        "5ce0c0de-0000-4000-8000-000000000002/1",
        [
            ("Vehicle", 49.2, 1.75, math.pi / 2, (-8.0, 0.0)),
            ("Pedestrian", 40.0, -4.85, 0.0, (0.0, 1.5)),
        ],
    ),
    "waymo_tiny": Case(
        Waymo(),
        SAMPLES / "waymo_tiny",
        12,
        22,
        4,
        "5ce0c0de00000001/1",
        [
            ("Vehicle", 49.2, 1.75, math.pi / 2, (-8.0, 0.0)),
            ("Pedestrian", 40.0, -4.85, 0.0, (0.0, 1.5)),
        ],
    ),
    "commonroad_tiny": Case(
        CommonRoad(),
        SAMPLES / "commonroad_tiny",
        12,
        24,
        4,
        "ZAM_Tiny-1_1_T-1_2020a/1",
        [
            ("Car", 11.0, -1.75, -math.pi / 2, (10.0, 0.0)),
            ("Pedestrian", 40.0, -4.85, 0.0, (0.0, 1.5)),
        ],
    ),
    "kitti_tiny": Case(
        Kitti(),
        SAMPLES / "kitti_tiny",
        6,
        12,
        2,
        "0000/000001",
        # The map frame begins where the ego begins.
        [
            ("Car", 39.2, 3.5, math.pi / 2, (-8.0, 0.0)),
            ("Pedestrian", 30.0, -3.1, 0.0, (0.0, 1.5)),
        ],
    ),
    "openlabel_tiny": Case(
        OpenLabel(),
        SAMPLES / "openlabel_tiny",
        6,
        12,
        2,
        "tiny/1",
        [
            ("Car", 49.2, 1.75, math.pi / 2, None),
            ("Pedestrian", 40.0, -4.85, 0.0, None),
        ],
    ),
    "interaction_tiny": Case(
        Interaction(),
        SAMPLES / "interaction_tiny",
        6,
        12,
        2,
        "TINY_Street/000/2",
        [("Car", 11.0, -1.75, -math.pi / 2, (10.0, 0.0))],
    ),
    # --- end of them
    "boston": Case(
        Interchange(),
        REAL / "boston",
        707,
        725,
        0,
        "9ddf9d3f42e848549db68d137bb3a14e",
        [
            ("Car", 1742.6141749817075, 918.5494356389863, 1.00562380840094, None),
            ("Barrier", 1720.972906650457, 881.0964771326235, 0.9214291252970274, None),
            ("Barrier", 1665.7056711094685, 871.1206674315966, -0.015097098027738953, None),
        ],
    ),
    "nuscenes-mini": Case(
        NuScenes(),
        REAL / "nuscenes-mini",
        404,
        18538,
        911,
        "ca9a282c9e77460f8360f564131a8af5",
        [("Adult", 373.256, 1130.419, -1.9389037193297651, (0.0, 0.0))],
        {"boston-seaport": BOSTON_MAP},
    ),
}


@pytest.fixture(params=CASES.values(), ids=CASES)
def case(request: pytest.FixtureRequest) -> Case:
    if not request.param.path.exists():
        pytest.skip(f"{request.param.path.name} is not on this machine")
    return request.param


def read(case: Case) -> list[Recording]:
    report = Report()
    found = list(case.importer.read(case.path, ImportOptions(case.maps), report).recordings(report))
    return [Recording(each.name, each.map, tuple(labels_of(each))) for each in found]


def read_labels(case: Case) -> list[Label]:
    return [label for recording in read(case) for label in recording.labels]


def test_recognises_its_sample_and_nobody_else_does(case: Case) -> None:
    assert [name for name, importer in importers().items() if importer.recognises(case.path)] == [case.importer.name]


@pytest.mark.one_in(6)
def test_counts(case: Case) -> None:
    labels = read_labels(case)
    objects = [member for label in labels for member in label.objects]
    tracks = {(label.recording, member.track) for label in labels for member in label.objects if member.track}
    assert (len(labels), len(objects), len(tracks)) == (case.frames, case.objects, case.tracks)


@pytest.mark.one_in(6)
def test_identifiers_are_unique_and_recordings_sorted(case: Case) -> None:
    recordings = read(case)
    names = [recording.name for recording in recordings]
    assert names == sorted(set(names))
    frames = [label.frame for recording in recordings for label in recording.labels]
    assert len(frames) == len(set(frames))
    for recording in recordings:
        for label in recording.labels:
            ids = ["ego", *(member.id for member in label.objects)]
            assert len(ids) == len(set(ids))
            assert (label.recording, label.map, label.ego.id) == (recording.name, recording.map, "ego")


@pytest.mark.one_in(6)
def test_time_increases_in_a_recording(case: Case) -> None:
    for recording in read(case):
        times = [label.timestamp_us for label in recording.labels]
        assert times == sorted(set(times))


@pytest.mark.one_in(6)
def test_classes_are_known(case: Case) -> None:
    for label in read_labels(case):
        assert is_subclass(label.ego.category, "Car")
        assert all(is_class(member.category) and member.category != ROOT for member in label.objects)


@pytest.mark.one_in(6)
def test_values_are_finite_metres_and_radians(case: Case) -> None:
    for label in read_labels(case):
        for member in (label.ego, *label.objects):
            numbers = [member.x, member.y, *(member.velocity or ())]
            assert all(math.isfinite(number) for number in numbers)
            assert member.heading is None or -math.pi < member.heading <= math.pi
            assert all(0 < size < 40 for size in (member.width, member.length, member.height) if size is not None)
            assert member.velocity is None or math.hypot(*member.velocity) < 60


@pytest.mark.one_in(6)
def test_length_is_along_the_heading(case: Case) -> None:
    vehicles = [
        member
        for label in read_labels(case)
        for member in (label.ego, *label.objects)
        if is_subclass(member.category, "Vehicle") and member.width and member.length
    ]
    if not vehicles:
        pytest.skip("no vehicle has a size")
    assert sum(member.length > member.width for member in vehicles) > 0.98 * len(vehicles)


@pytest.mark.one_in(3)
def test_moving_vehicles_head_where_they_move(case: Case) -> None:
    apart = [
        angles.distance(member.heading, angles.heading_of(*member.velocity))
        for label in read_labels(case)
        for member in (label.ego, *label.objects)
        if is_subclass(member.category, "Vehicle") and member.heading is not None
        # Slower ones are dominated by noise of the annotation.
        and member.velocity is not None and math.hypot(*member.velocity) > MOVING_MPS
    ]  # fmt: skip
    if not apart:
        pytest.skip("no velocities")
    assert sum(angle < math.radians(15) for angle in apart) >= 0.99 * len(apart)


@pytest.mark.one_in(6)
def test_egos_lie_on_the_map(case: Case) -> None:
    source = case.importer.read(case.path, ImportOptions(case.maps), Report())
    area = {
        name: box(*unary_union([feature.shape for feature in features]).bounds).buffer(case.margin_m)
        for name, features in source.maps.items()
    }
    for recording in read(case):
        for label in recording.labels:
            if label.map in area:
                assert area[label.map].contains(box(label.ego.x, label.ego.y, label.ego.x + 0.1, label.ego.y + 0.1))


@pytest.mark.one_in(6)
def test_store_round_trip(case: Case, tmp_path: Path) -> None:
    maps = [f"{name}={file}" for name, file in case.maps.items()]
    summary = ingest(case.path, tmp_path / "d", maps=maps)
    assert (summary.frames, summary.objects, summary.tracks) == (case.frames, case.objects, case.tracks)
    dataset = open_dataset(tmp_path / "d")
    assert list(dataset.labels()) == read_labels(case)
    for name, features in case.importer.read(case.path, ImportOptions(case.maps), Report()).maps.items():
        assert dataset.features(name) == features


def test_an_ego_is_chosen_or_the_choice_is_refused(case: Case, tmp_path: Path) -> None:
    """An option that cannot change anything is told."""
    if case.path.parent == REAL:
        pytest.skip("samples are enough")
    name = case.importer.name
    if name not in WITHOUT_EGO:
        with pytest.raises(DataError, match="option-invalid"):
            ingest(case.path, tmp_path / "d", format=name, ego="none")
        assert not (tmp_path / "d").exists()
        return
    ingest(case.path, tmp_path / "d", format=name, ego="none")
    # a file of OpenLABEL may have one, and that of the sample does
    assert all(label.has_ego is (name == "openlabel") for label in open_dataset(tmp_path / "d").labels())


def test_golden_rows(case: Case) -> None:
    label = next(label for label in read_labels(case) if label.frame == case.golden)
    for member, (category, x, y, heading, velocity) in zip(label.objects, case.rows, strict=False):
        assert member.category == category
        assert (member.x, member.y) == pytest.approx((x, y), abs=1e-9)
        assert member.heading is not None
        assert angles.distance(member.heading, heading) < 1e-5
        assert member.velocity == (None if velocity is None else pytest.approx(velocity, abs=1e-9))


@pytest.mark.parametrize(
    ("source", "maps", "recordings"),
    [
        # Where no velocity is known, what is not parked cannot be told apart: all vehicles count.
        ("boston", [], 1),
        ("nuscenes-mini", [BOSTON_MAP], 1),
        ("argoverse2", [], 2),
    ],
)
@pytest.mark.one_in(3)
def test_moving_vehicles_in_one_lane_head_along_it(
    tmp_path: Path, source: str, maps: list[Path], recordings: int
) -> None:
    if not (REAL / source).exists():
        pytest.skip(f"{source} is not on this machine")
    ingest(REAL / source, tmp_path / "d", maps=maps)
    query = """
        WITH near AS (
            SELECT frame, object, count(*) FILTER (kind = 'lane') AS lanes, bool_or(kind = 'intersection') AS inside
            FROM memberships WHERE distance = 0 GROUP BY frame, object
        )
        SELECT CASE WHEN labels.map = 'boston-seaport' THEN labels.map ELSE labels.recording END,
            objects.class, heading, vx, vy, objects.road_directions[1]
        FROM objects JOIN labels USING (frame) JOIN near ON near.frame = objects.frame AND near.object = objects.id
        WHERE lanes = 1 AND NOT inside AND heading IS NOT NULL AND len(objects.road_directions) > 0
    """
    apart: defaultdict[str, list[float]] = defaultdict(list)
    for recording, category, heading, vx, vy, direction in open_dataset(tmp_path / "d").connect().sql(query).fetchall():
        if is_subclass(category, "Vehicle") and (vx is None or math.hypot(vx, vy) > MOVING_MPS):
            apart[recording].append(angles.distance(heading, direction))
    assert len(apart) == recordings
    for found in apart.values():
        assert len(found) > 100
        assert sum(angle < math.radians(15) for angle in found) >= 0.95 * len(found)


@pytest.mark.one_in(4)
def test_a_copy_elsewhere_gives_the_same_bytes(case: Case, tmp_path: Path) -> None:
    shutil.copytree(case.path, tmp_path / "copy" / case.path.name)
    maps = [f"{name}={file}" for name, file in case.maps.items()]
    ingest(case.path, tmp_path / "one", maps=maps)
    ingest(tmp_path / "copy" / case.path.name, tmp_path / "two", maps=maps, jobs=2)
    one, two = open_dataset(tmp_path / "one").manifest, open_dataset(tmp_path / "two").manifest
    assert one.tables == two.tables
    differing = [name for name in one.__slots__ if getattr(one, name) != getattr(two, name)]
    assert differing in (["provenance"], [])
