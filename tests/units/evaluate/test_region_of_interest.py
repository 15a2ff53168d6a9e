"""Which boxes lie near the drivable area: the grid of the benchmark, cell by cell."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely
from shapely.geometry import LineString, Polygon
from shapely.geometry.base import BaseGeometry

from scenicq.evaluate.annotations import read_annotations
from scenicq.evaluate.region_of_interest import RegionOfInterest
from scenicq.geometry.features import MapFeature
from scenicq.importers.predictions import ARGOVERSE2, Predictions
from scenicq.store.dataset import Dataset, open_dataset
from scenicq.store.labels import Label, LabelObject, OutOfPlane, Recording
from scenicq.store.writer import write_dataset

REACH_M = 0.7


def town(folder: Path, areas: list[BaseGeometry], pitch: float = 0.0) -> Dataset:
    """One frame, its ego at the origin, looking along +y."""
    ego = LabelObject("ego", "Car", "EGO_VEHICLE", 0.0, 0.0, 0.0, out_of_plane=OutOfPlane(0.0, pitch, 0.0))
    features = tuple(MapFeature(f"a{number}", "drivable", area, {}) for number, area in enumerate(areas))
    write_dataset(
        folder, [Recording("r", "town", (Label("f", "r", 0, "town", ego, ()),))], {"town": features}, name="d"
    )
    return open_dataset(folder)


def boxes(x: np.ndarray, y: np.ndarray, size: float = 1e-9) -> Predictions:
    """Boxes of one size that look along +y."""
    count = len(x)
    none, same = np.full(count, np.nan), np.full(count, size)
    return Predictions("boxes", ARGOVERSE2, ["f"], np.zeros(count, dtype=np.int32), ["REGULAR_VEHICLE"],
                       np.zeros(count, dtype=np.int32), x, y, np.zeros(count), same, same, same, none, none,
                       np.ones(count), np.zeros(count), [], np.full(count, -1, dtype=np.int8))  # fmt: skip


def region(dataset: Dataset, reach_m: float = REACH_M) -> RegionOfInterest:
    return RegionOfInterest(dataset, read_annotations(dataset)[0], reach_m)


def cells(areas: list[BaseGeometry], west: int, south: int, columns: int, rows: int) -> np.ndarray:
    """The cells of polygons, one row after the other, shape (rows, columns)."""
    held = np.zeros((rows, columns), dtype=np.bool_)
    for polygon in shapely.get_parts(areas).tolist():
        rings = [
            [(round((x - west) * 10), round((y - south) * 10)) for x, y in ring.coords]
            for ring in (polygon.exterior, *polygon.interiors)
        ]
        drawn = Polygon(rings[0], rings[1:])
        for row in range(rows):
            crossed = drawn.intersection(LineString([(-10, row), (columns + 10, row)]))
            for part in getattr(crossed, "geoms", [crossed]):
                if not part.is_empty:
                    low, _, high, _ = part.bounds
                    held[row, max(math.floor(low + 0.5), 0) : max(math.ceil(high - 0.5), -1) + 1] = True
    return held


def star(rng: np.random.Generator, x: float, y: float) -> Polygon:
    """A polygon whose corners lie on cells."""
    turns = np.sort(rng.uniform(0, math.tau, int(rng.integers(5, 12))))
    away = rng.uniform(0.4, 2.2, len(turns))
    return Polygon(np.round(np.column_stack((x + away * np.cos(turns), y + away * np.sin(turns))), 1))


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.one_in(2)
def test_cell_by_cell(tmp_path: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    areas: list[BaseGeometry] = [star(rng, 0, 0), star(rng, 3.1, 1.4)]
    if seed % 2:
        ring = Polygon([(-6, -3), (-3, -3), (-3, 2), (-6, 2)], [[(-5.3, -2), (-3.9, -1.2), (-4.4, 1.1)]])
        areas.append(ring)
    areas = [area for area in areas if area.is_valid]
    bounds = np.array([area.bounds for area in areas])
    west, south = (math.floor(value) for value in bounds[:, :2].min(axis=0))
    east, north = (math.ceil(value) for value in bounds[:, 2:].max(axis=0))
    columns, rows = 10 * (east - west + 1), 10 * (north - south + 1)
    drawn = np.argwhere(cells(areas, west, south, columns, rows))
    y, x = np.divmod(np.arange((rows + 10) * (columns + 10)), columns + 10)
    x, y = x - 5, y - 5
    placed = boxes(west + (x + 0.5) / 10, south + (y + 0.5) / 10)
    # what lies less than a cell outside of the grid counts as its first row or column
    x, y = np.where(x == -1, 0, x), np.where(y == -1, 0, y)
    near = (np.square(x[:, None] - drawn[:, 1]) + np.square(y[:, None] - drawn[:, 0])).min(axis=1) <= (
        10 * REACH_M
    ) ** 2
    near &= (x >= 0) & (x < columns) & (y >= 0) & (y < rows)
    assert 0 < near.sum() < len(near)
    found = region(town(tmp_path / "d", areas)).holds(placed, placed.frame)
    # single precision may round the half of a cell either way
    assert np.count_nonzero(found != near) <= 0.002 * len(near)


def test_any_corner_counts_and_upright_is_as_the_ego_stands(tmp_path: Path) -> None:
    """Over an ego whose front is down, a high box leans forward by half of its height times the sine."""
    square = Polygon([(-10, 0), (10, 0), (10, 10), (-10, 10)])
    level, sloping = (region(town(tmp_path / f"{pitch}", [square], pitch), 0.0) for pitch in (0.0, 0.3))
    south = boxes(np.array([0.0, 0.0]), np.array([-0.9, -1.2]), 2.0)
    assert level.holds(south, south.frame).tolist() == [True, False]
    assert sloping.holds(south, south.frame).tolist() == [True, True]
    flat = replace(south, height=np.full(2, np.nan))
    assert sloping.holds(flat, flat.frame).tolist() == [True, False]


def test_without_a_drivable_area_everything_counts(tmp_path: Path) -> None:
    far = boxes(np.array([1e6]), np.array([0.0]))
    assert region(town(tmp_path / "d", [])).holds(far, far.frame).tolist() == [True]
    nothing = boxes(np.zeros(0), np.zeros(0))
    assert (
        region(town(tmp_path / "e", [star(np.random.default_rng(0), 0, 0)])).holds(nothing, nothing.frame).tolist()
        == []
    )
