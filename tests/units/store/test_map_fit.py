"""Maps that do not fit their labels are told, with what most likely is wrong: on the installed command's own path."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scenicq.importers.ingest import ingest
from scenicq.store import map_fit
from scenicq.store.dataset import open_dataset
from scenicq.store.map_fit import MapFit, fit_of, map_fits, misfits

SAMPLES = Path(__file__).parents[3] / "sample_data"
REAL = Path(__file__).parents[4] / "shared" / "data"
BOSTON = {"maps": [f"boston-seaport={REAL / 'boston' / 'maps' / 'boston-seaport.geojson'}"]}

Place = Callable[[float, float], tuple[float, float]]
MIRROR_X: Place = lambda x, y: (-x, y)  # noqa: E731
MIRROR_Y: Place = lambda x, y: (x, -y)  # noqa: E731
SWAP: Place = lambda x, y: (y, x)  # noqa: E731
TURN: Place = lambda x, y: (-y, x)  # noqa: E731
HALF: Place = lambda x, y: (-x, -y)  # noqa: E731
SHIFT: Place = lambda x, y: (x + 400, y + 90)  # noqa: E731


def lane(name: str, line: list[list[float]], width: float, **more: Any) -> dict[str, Any]:
    (x, y), (u, v) = line
    length = math.hypot(u - x, v - y)
    across = (-(v - y) / length * width / 2, (u - x) / length * width / 2)
    ring = [[x + across[0], y + across[1]], [u + across[0], v + across[1]], [u - across[0], v - across[1]]]
    ring += [[x - across[0], y - across[1]], [x + across[0], y + across[1]]]
    return {
        "type": "Feature",
        "properties": {"id": name, "kind": "lane", "centerline": [line], **more},
        "geometry": {"type": "Polygon", "coordinates": [ring]},
    }


def streets() -> list[dict[str, Any]]:
    """Two-way streets of two lanes each way, none of which is another's mirror image."""
    found: list[dict[str, Any]] = []
    for number, (x, y, u, v) in enumerate([(20, 50, 320, 170), (40, 300, 260, 430), (150, 20, 190, 280)]):
        length = math.hypot(u - x, v - y)
        dx, dy = (u - x) / length, (v - y) / length
        for place in range(4):  # from right to left of the street's direction
            off = 3.5 * (place - 1.5)
            line = [[x - dy * off, y + dx * off], [u - dy * off, v + dx * off]]
            beside = {} if place in (0, 3) else {"right": f"{number}.{place - 1 if place == 1 else 3}"}
            left = {0: 1, 1: 2, 2: 1, 3: 2}[place]
            line = line if place < 2 else line[::-1]
            found.append(lane(f"{number}.{place}", line, 3.5, left=f"{number}.{left}", **beside))
    return found


def write(folder: Path, change_label: Place | None = None, turn: float = 0.0, flip: float = 1.0) -> Path:
    """A source: cars that drive along all lanes."""
    (folder / "maps").mkdir(parents=True)
    features = streets()
    (folder / "maps" / "m.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    header = {"name": "m", "interchange": 1, "angle": "heading", "classes": "scenic"}
    (folder / "dataset.json").write_text(json.dumps(header))
    rows: list[str] = []
    for step in range(10):
        cars: list[dict[str, Any]] = []
        for feature in features:
            (x, y), (u, v) = feature["properties"]["centerline"][0]
            share = 0.1 + 0.07 * step
            at = [x + share * (u - x), y + share * (v - y)]
            to = [at[0] + (u - x) / 100, at[1] + (v - y) / 100]
            if change_label is not None:
                at, to = list(change_label(*at)), list(change_label(*to))
            heading = math.remainder(flip * math.atan2(-(to[0] - at[0]), to[1] - at[1]) + turn, 2 * math.pi)
            name = feature["properties"]["id"]
            velocity = [10 * (to[0] - at[0]) / math.dist(at, to), 10 * (to[1] - at[1]) / math.dist(at, to)]
            cars.append({"id": name, "track": name, "class": "Car", "position": at, "heading": heading,
                         "velocity": velocity})  # fmt: skip
        row = {"id": f"f{step}", "recording": "r", "timestamp_us": 500_000 * step, "map": "m"}
        rows.append(json.dumps({**row, "ego": cars[0], "objects": cars[1:]}))
    (folder / "labels.jsonl").write_text("\n".join(rows))
    return folder


def told(source: Path, target: Path) -> list[str]:
    summary = ingest(source, target, force=True)
    found = [diagnostic for diagnostic in summary.diagnostics if diagnostic.code == "map-does-not-fit"]
    assert [diagnostic.message for diagnostic in misfits(map_fits(open_dataset(target)))] == [
        diagnostic.message for diagnostic in found
    ]
    assert all(diagnostic.hints and diagnostic.hints[0] for diagnostic in found)
    return [diagnostic.message for diagnostic in found]


def test_what_fits_is_not_told(tmp_path: Path) -> None:
    assert told(write(tmp_path / "s"), tmp_path / "d") == []
    (fit,) = map_fits(open_dataset(tmp_path / "d"))
    assert (fit.on_lanes, fit.wrong_side, fit.outside, fit.against) == (1.0, 0.0, 0.0, 0.0)
    assert fit.width_m == pytest.approx(3.5)
    assert fit.deviation == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize(
    ("change", "cause"),
    [
        ((MIRROR_X,), "x points the other way"),
        ((MIRROR_Y,), "y points the other way"),
        ((SWAP,), "x and y are swapped"),
        ((TURN,), "turned by 270 degrees"),
        ((HALF,), "turned by 180 degrees"),
        ((SHIFT,), "do not lie in one place"),
        ((None, math.pi / 2), "headings are 90 degrees too large"),
        ((None, -math.pi / 2), "headings are 90 degrees too small"),
        ((None, math.pi), "traffic keeps to the other side"),
        ((None, 0.0, -1.0), "headings grow clockwise"),
    ],
)
@pytest.mark.one_in(3)
def test_labels_that_are_changed_are_told(change: tuple[Any, ...], cause: str, tmp_path: Path) -> None:
    (message,) = told(write(tmp_path / "s", *change), tmp_path / "d")
    assert cause in message


def edited(folder: Path, edit: Callable[[dict[str, Any]], None]) -> Path:
    source = write(folder)
    file = source / "maps" / "m.geojson"
    content = json.loads(file.read_text())
    for feature in content["features"]:
        edit(feature)
    file.write_text(json.dumps(content))
    return source


def test_a_map_in_degrees_is_told(tmp_path: Path) -> None:
    def edit(feature: dict[str, Any]) -> None:
        scale = 1 / 111_320
        for line in (*feature["geometry"]["coordinates"], *feature["properties"]["centerline"]):
            line[:] = [[x * scale, y * scale] for x, y in line]

    (message,) = told(edited(tmp_path / "s", edit), tmp_path / "d")
    assert "degrees, not metres" in message


def test_neighbours_on_the_other_side_are_told(tmp_path: Path) -> None:
    def edit(feature: dict[str, Any]) -> None:
        properties = feature["properties"]
        sides = {key: properties.pop(key) for key in ("left", "right") if key in properties}
        properties.update({"left" if key == "right" else "right": value for key, value in sides.items()})

    (message,) = told(edited(tmp_path / "s", edit), tmp_path / "d")
    assert "100% of neighbours lie on the other side" in message


def change_vehicles(vehicles: map_fit.Vehicles, change: Place) -> map_fit.Vehicles:
    """Vehicles elsewhere, with the headings that they have there."""
    x, y = change(vehicles.x, vehicles.y)  # type: ignore[arg-type]
    ahead = change(vehicles.x - np.sin(vehicles.heading), vehicles.y + np.cos(vehicles.heading))  # type: ignore[arg-type]
    return map_fit.Vehicles(x, y, np.arctan2(-(ahead[0] - x), ahead[1] - y), vehicles.moves)  # type: ignore[arg-type]


NEAR: Place = lambda x, y: (x + 10, y + 8)  # noqa: E731
CHANGES: dict[str, Callable[[map_fit.Vehicles], map_fit.Vehicles]] = {
    "mirror x": lambda v: change_vehicles(v, MIRROR_X),
    "mirror y": lambda v: change_vehicles(v, MIRROR_Y),
    "swap": lambda v: change_vehicles(v, SWAP),
    "turn": lambda v: change_vehicles(v, TURN),
    "half a turn": lambda v: change_vehicles(v, HALF),
    "shift": lambda v: change_vehicles(v, SHIFT),
    "shift by 13 m": lambda v: change_vehicles(v, NEAR),
    "heading + 90": lambda v: replace(v, heading=v.heading + math.pi / 2),
    "heading - 90": lambda v: replace(v, heading=v.heading - math.pi / 2),
    "heading + 180": lambda v: replace(v, heading=v.heading + math.pi),
    "clockwise": lambda v: replace(v, heading=-v.heading),
}


def silent(target: Path) -> dict[str, list[str]]:
    """The changes of a dataset's vehicles that are not told, for each of its maps with enough of them."""
    dataset = open_dataset(target)
    assert misfits(map_fits(dataset)) == ()
    found: dict[str, list[str]] = {}
    with dataset.connect() as connection:
        for name in dataset.maps:
            features, vehicles = dataset.features(name), map_fit._vehicles(connection, name)
            if features and len(vehicles.x) >= 20:
                found[name] = [
                    told for told, change in CHANGES.items() if not fit_of(name, features, change(vehicles)).cause
                ]
    return found


def test_changed_copies_of_our_own_recordings_are_told(tmp_path: Path) -> None:
    ingest(SAMPLES / "crossroads", tmp_path / "d")
    # the crossroads are their own image after half a turn
    assert silent(tmp_path / "d") == {"crossroads": ["half a turn"]}


@pytest.mark.slow
@pytest.mark.parametrize(("name", "options"), [("boston", {}), ("nuscenes-mini", BOSTON), ("argoverse2", {})])
def test_real_recordings_fit_and_their_changed_copies_do_not(
    name: str, options: dict[str, Any], tmp_path: Path
) -> None:
    if not (REAL / name).exists():
        pytest.skip(f"{name} is not on this machine")
    ingest(REAL / name, tmp_path / "d", **options)
    found = silent(tmp_path / "d")
    assert found
    assert not any(found.values())


def test_a_map_without_labels_says_nothing() -> None:
    none = map_fit_of_nothing()
    assert (none.on_lanes, none.cause) == (None, "")


def map_fit_of_nothing() -> MapFit:
    nothing = np.empty(0)
    return fit_of("m", (), map_fit.Vehicles(nothing, nothing, nothing, np.empty(0, dtype=bool)))
