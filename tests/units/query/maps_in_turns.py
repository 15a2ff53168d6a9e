"""A dataset whose recordings are of several maps by turns, so that the order of maps is not that of names."""

from __future__ import annotations

import json
from collections.abc import Container
from pathlib import Path
from typing import Any

from scenicq.importers.ingest import ingest
from scenicq.store.dataset import Dataset, open_dataset

__all__ = ["MAPS", "maps_in_turns"]

MAPS = "abc"
_CORNERS = [[-99, -99], [99, -99], [99, 99], [-99, 99], [-99, -99]]


def maps_in_turns(folder: Path, maps: Container[str] = MAPS) -> Dataset:
    """Nine recordings of two to five frames, of a car some 10 m ahead, or those of them on some maps.

    Args:
        folder: Where source and dataset are made.
        maps: Names of maps.
    """
    (folder / "maps").mkdir(parents=True)
    header = {"name": "town", "interchange": 1, "angle": "heading", "classes": "scenic"}
    (folder / "dataset.json").write_text(json.dumps(header))
    square = {"type": "Polygon", "coordinates": [_CORNERS]}
    land = {"type": "Feature", "properties": {"id": "all", "kind": "drivable"}, "geometry": square}
    for name in MAPS:
        (folder / "maps" / f"{name}.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": [land]}))
    lines = [
        json.dumps(_label(recording, number))
        for recording in range(9)
        for number in range(2 + recording % 4)
        if MAPS[recording % 3] in maps
    ]
    (folder / "labels.jsonl").write_text("\n".join(lines) + "\n")
    ingest(folder, folder / "dataset")
    return open_dataset(folder / "dataset")


def _label(recording: int, number: int) -> dict[str, Any]:
    box = {"class": "Car", "heading": 0, "width": 2, "length": 4}
    ahead = 9 + (number + recording) % 3 + recording % 2
    return {
        "id": f"r{recording}/{number}",
        "recording": f"r{recording}",
        "timestamp_us": number * 500_000,
        "map": MAPS[recording % 3],
        "ego": {**box, "position": [recording, number]},
        "objects": [{**box, "position": [3, ahead], "id": "o", "track": f"o{recording % 2}"}],
    }
