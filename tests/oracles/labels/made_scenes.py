"""Maps and labels small enough to check with a pencil."""

import json
import math
from pathlib import Path
from typing import Any

import shapely
from five_scenarios import frames

EPS = 1e-6
Item = dict[str, Any]


def feature(kind: str, name: str, box: tuple[float, float, float, float], **properties: Any) -> Item:
    """A rectangular map feature."""
    geometry = shapely.geometry.mapping(shapely.box(*box))
    return {"type": "Feature", "geometry": geometry, "properties": {"id": name, "kind": kind, **properties}}


def street() -> list[Item]:
    """A southbound lane, two northbound ones (`west` has `east` to its right), a crossing at y = 100, a wide road."""
    return [
        feature("lane", "south", (-4, -100, 0, 100), centerline=[[[-2, 100], [-2, -100]]]),
        feature("lane", "west", (0, -100, 4, 100), centerline=[[[2, -100], [2, 0], [2, 0], [2, 100]]], right="east"),
        feature("lane", "east", (4, -100, 8, 100), centerline=[[[6, -100], [6, 100]]], left="west"),
        feature("intersection", "crossing", (-4, 100, 8, 112)),
        feature("lane", "through", (0, 100, 4, 112), centerline=[[[2, 100], [2, 112]]]),
        feature("lane", "across", (-4, 104, 8, 108), centerline=[[[-4, 106], [8, 106]]]),
        feature("road", "wide", (-10, -100, 12, 100)),
    ]


def body(name: str, x: float, y: float, degrees: float = 0.0, kind: str = "vehicle.car", **more: Any) -> Item:
    """A label object; the heading is given in degrees."""
    return {"id": name, "class": kind, "position": [x, y], "heading": math.radians(degrees), **more}


def run(
    folder: Path, number: int, ego: Item, *objects: Item, features: list[Item] | None = None, **options: Any
) -> Any:
    """All correspondences of one hand-made label."""
    (folder / "maps").mkdir(exist_ok=True)
    (folder / "maps" / "m.geojson").write_text(json.dumps({"features": street() if features is None else features}))
    dataset = {"angle": options.pop("angle", "heading"), "classes": options.pop("classes", "nuscenes")}
    (folder / "dataset.json").write_text(json.dumps(dataset))
    label = {"id": "f", "recording": "r", "map": "m", "ego": ego, "objects": list(objects)}
    (folder / "labels.jsonl").write_text(json.dumps(label) + "\n")
    defaults = {"tolerance_x": 0.25, "tolerance_y": 0.25, "heading_tolerance": math.radians(5), "radius": 50.0}
    return frames(folder, number, **{**defaults, **options})["f"]
