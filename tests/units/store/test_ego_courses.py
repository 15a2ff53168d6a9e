"""Columns of where objects are on the ego's course: those that a query measures, with null where there is no end."""

import math
from pathlib import Path

import numpy as np
import pytest

from scenicq.geometry.default_street import street
from scenicq.geometry.driven_courses import measure
from scenicq.geometry.network import Network
from scenicq.store.dataset import Dataset, open_dataset
from scenicq.store.labels import Label, LabelObject, Recording
from scenicq.store.recorded_tracks import EGO
from scenicq.store.writer import write_dataset


def _car(name: str, x: float, y: float, heading: float | None = 0.0) -> LabelObject:
    return LabelObject(name, "Car" if name != "absent" else "", "car", x, y, heading, 1.8, 4.5, track=name)


def _written(
    folder: Path, network: Network, ways: list[list[LabelObject]], around: list[tuple[float, float]]
) -> Dataset:
    recordings: list[Recording] = []
    for number, way in enumerate(ways):
        labels = [
            Label(f"r{number}-{k}", f"r{number}", k * 500_000, network.name, ego,
                  tuple(_car(f"o{n}", ego.x + dx, ego.y + dy) for n, (dx, dy) in enumerate(around)))
            for k, ego in enumerate(way)
        ]  # fmt: skip
        recordings.append(Recording(f"r{number}", network.name, tuple(labels)))
    maps = {network.name: network.features} if network.features else {}
    write_dataset(folder, recordings, maps, name="d")
    return open_dataset(folder)


AROUND = [(0.0, 10.0), (1.5, -8.0), (-30.0, 4.0), (3.0, 120.0), (0.0, 0.0)]
LOOP = [_car("e", 8 * math.cos(k / 3), 8 * math.sin(k / 3), math.remainder(k / 3, math.tau)) for k in range(30)]
WAYS = [
    [_car("e", 0.5, 3.0 * k) for k in range(8)],
    LOOP,
    [_car("e", 2.0, 5.0)] * 3,
    [_car("e", 0.0, 2.0, None)],
    [_car("e", 0.0, 5.0 - 2 * k) for k in range(5)],
]


@pytest.mark.parametrize("network", [street(), Network("none", ())], ids=["street", "nowhere"])
def test_the_columns_are_what_a_query_measures(tmp_path: Path, network: Network) -> None:
    dataset = _written(tmp_path / "d", network, WAYS, AROUND)
    with dataset.connect() as connection:
        rows = connection.sql(
            "SELECT recording, frame, x, y, ego_along, ego_along_less, ego_along_more, ego_beside, ego_beside_less, "
            "ego_beside_more FROM objects ORDER BY recording, timestamp_us, ordinal"
        ).fetchall()
    assert len(rows) == sum(map(len, WAYS)) * len(AROUND)
    unknown = 0
    for recording, frame, x, y, *columns in rows:
        courses = dataset.recorded.of(recording)
        course = courses.course(network, 1.5, EGO, courses.frames[frame])
        assert course is not None
        found = measure([course], np.array([(x, y)]))
        for (value, less, more), (low, high) in zip(
            (columns[:3], columns[3:]), (found.along, found.beside), strict=True
        ):
            unknown += less is None or more is None
            ends = (-math.inf if less is None else value - less), (math.inf if more is None else value + more)
            assert ends == pytest.approx((low[0], high[0]), abs=1e-9)
    assert 0 < unknown < len(rows)


def test_an_ego_that_is_absent_has_no_course(tmp_path: Path) -> None:
    dataset = _written(tmp_path / "d", street(), [[_car("absent", 0.0, 2.0 * k) for k in range(3)]], AROUND[:1])
    with dataset.connect() as connection:
        rows = connection.sql("SELECT ego_along, ego_along_less, ego_along_more, ego_beside FROM objects").fetchall()
    assert set(rows) == {(None, None, None, None)}
