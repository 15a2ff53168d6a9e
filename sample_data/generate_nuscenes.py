"""Writes `nuscenes_tiny/` next to this file: invented tables and a map in the layout of nuScenes, the same every time.

Run it with `python sample_data/generate_nuscenes.py`.
"""

from __future__ import annotations

import json
import math
import shutil
from collections.abc import Callable, Sequence
from hashlib import sha256
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
Point = tuple[float, float]


def token(name: str) -> str:
    """A token in the style of nuScenes."""
    return sha256(f"scenicq sample {name}".encode()).hexdigest()[:32]


def nuscenes_tables() -> dict[str, list[dict[str, Any]]]:
    """Two scenes of three samples with a car and a pedestrian, on a street of two lanes."""
    names = ["vehicle.car", "human.pedestrian.adult"]
    kinds = ["vehicle.moving", "pedestrian.moving"]
    channels = ["LIDAR_TOP", "CAM_FRONT"]
    tables: dict[str, list[dict[str, Any]]] = {
        "category": [{"token": token(name), "name": name, "description": ""} for name in names],
        "attribute": [{"token": token(name), "name": name, "description": ""} for name in kinds],
        "visibility": [{"token": "4", "level": "v80-100", "description": "visibility of 80 to 100 %"}],
        "sensor": [{"token": token(c), "channel": c, "modality": c[:5].strip("_").lower()} for c in channels],
        "calibrated_sensor": [
            {
                "token": token(f"mounted {channel}"),
                "sensor_token": token(channel),
                "translation": [0.9, 0.0, 1.8],
                "rotation": [1.0, 0.0, 0.0, 0.0],
                "camera_intrinsic": [],
            }
            for channel in channels
        ],
        "map": [{"token": token("map"), "category": "semantic_prior", "filename": "", "log_tokens": [token("log")]}],
        "log": [
            {
                "token": token("log"),
                "logfile": "n000-2020-09-13-20-26-40+0800",
                "vehicle": "tiny",
                "date_captured": "2020-09-13",
                "location": "tiny-town",
            }
        ],
    }
    for table in ("scene", "sample", "sample_data", "ego_pose", "sample_annotation", "instance"):
        tables[table] = []
    for scene, words in (("scene-0001", "Drive east, pedestrian"), ("scene-0002", "Night, rain, drive east")):
        add_scene(tables, scene, words)
    return tables


def add_scene(tables: dict[str, list[dict[str, Any]]], scene: str, words: str) -> None:
    """Fill in the rows of a scene of three samples."""
    samples = [token(f"{scene} {step}") for step in range(3)]
    tables["scene"].append(
        {
            "token": token(scene),
            "log_token": token("log"),
            "nbr_samples": 3,
            "first_sample_token": samples[0],
            "last_sample_token": samples[-1],
            "name": scene,
            "description": words,
        }
    )
    begin = 1_600_000_000_000_000 + int(scene[-1]) * 60_000_000
    actors: dict[str, tuple[int, list[float], list[float], Callable[[float], list[float]]]] = {
        # Class, attribute, size (width, length, height), rotation, position after some seconds.
        "car": (0, [1.9, 4.5, 1.6], [0.0, 0.0, 0.0, 1.0], lambda s: [80.0 - 8 * s, 1.75, 0.8]),
        "walker": (1, [0.6, 0.7, 1.75], [0.5**0.5, 0.0, 0.0, 0.5**0.5], lambda s: [50.0, -4 + s, 0.9]),
    }
    for step, sample in enumerate(samples):
        seconds = step * 0.5
        time = begin + int(seconds * 1e6)
        links = {"prev": samples[step - 1] if step else "", "next": samples[step + 1] if step < 2 else ""}
        tables["sample"].append({"token": sample, "timestamp": time, **links, "scene_token": token(scene)})
        for channel in ("LIDAR_TOP", "CAM_FRONT"):
            id = token(f"{scene} {step} {channel}")
            tables["ego_pose"].append(
                {
                    "token": id,
                    "timestamp": time,
                    "rotation": [1.0, 0.0, 0.0, 0.0],
                    "translation": [10.0 + 10 * seconds, -1.75, 0.0],
                }
            )
            tables["sample_data"].append(
                {
                    "token": id,
                    "sample_token": sample,
                    "ego_pose_token": id,
                    "calibrated_sensor_token": token(f"mounted {channel}"),
                    "timestamp": time,
                    "fileformat": "jpg" if channel == "CAM_FRONT" else "pcd",
                    "is_key_frame": True,
                    "height": 0,
                    "width": 0,
                    "filename": f"samples/{channel}/{scene}-{step}",
                    "prev": "",
                    "next": "",
                }
            )
        for name, (kind, size, rotation, position) in actors.items():
            ids = [token(f"{scene} {name} {other}") for other in range(3)]
            tables["sample_annotation"].append(
                {
                    "token": ids[step],
                    "sample_token": sample,
                    "instance_token": token(f"{scene} {name}"),
                    "visibility_token": "4",
                    "attribute_tokens": [tables["attribute"][kind]["token"]],
                    "translation": position(seconds),
                    "size": size,
                    "rotation": rotation,
                    "prev": ids[step - 1] if step else "",
                    "next": ids[step + 1] if step < 2 else "",
                    "num_lidar_pts": 10,
                    "num_radar_pts": 0,
                }
            )
    for name, (kind, *_) in actors.items():
        ids = [token(f"{scene} {name} {step}") for step in (0, 2)]
        tables["instance"].append(
            {
                "token": token(f"{scene} {name}"),
                "category_token": tables["category"][kind]["token"],
                "nbr_annotations": 3,
                "first_annotation_token": ids[0],
                "last_annotation_token": ids[1],
            }
        )


def nuscenes_map() -> dict[str, Any]:
    """A street of two lanes from west to east, that ends in an intersection with a connecting lane to the left."""
    layers: dict[str, Any] = {"version": "1.3", "node": [], "polygon": [], "line": []}

    def polygon(name: str, corners: Sequence[Point]) -> str:
        nodes = [token(f"{name} {number}") for number in range(len(corners))]
        layers["node"] += [{"token": node, "x": x, "y": y} for node, (x, y) in zip(nodes, corners, strict=True)]
        layers["polygon"].append({"token": token(f"{name} polygon"), "exterior_node_tokens": nodes, "holes": []})
        return token(f"{name} polygon")

    def line(name: str, *points: Point) -> str:
        nodes = [token(f"{name} {number}") for number in range(len(points))]
        layers["node"] += [{"token": node, "x": x, "y": y} for node, (x, y) in zip(nodes, points, strict=True)]
        layers["line"].append({"token": token(f"{name} line"), "node_tokens": nodes})
        return token(f"{name} line")

    def box(west: float, south: float, east: float, north: float) -> list[Point]:
        return [(west, south), (east, south), (east, north), (west, north)]

    def layer(name: str, entries: dict[str, tuple[list[Point], dict[str, Any]]]) -> None:
        layers[name] = [
            {"token": token(id), "polygon_token": polygon(id, corners), **more}
            for id, (corners, more) in entries.items()
        ]

    street, square = box(0, -3.5, 100, 3.5), box(100, -10, 120, 10)
    layers["drivable_area"] = [{"token": token("drivable"), "polygon_tokens": [polygon("drivable", street)]}]
    layer(
        "road_segment", {"street": (street, {"is_intersection": False}), "square": (square, {"is_intersection": True})}
    )
    east = {
        "from_edge_line_token": line("east begins", (0, -3.5), (0, 0)),
        "to_edge_line_token": line("east ends", (100, -3.5), (100, 0)),
    }
    west = {
        "from_edge_line_token": line("west begins", (100, 3.5), (100, 0)),
        "to_edge_line_token": line("west ends", (0, 3.5), (0, 0)),
    }
    inside = {"road_segment_token": token("street")}
    areas = {"east": box(0, -3.5, 100, 0), "west": box(0, 0, 100, 3.5)}
    layer("road_block", {"eastward": (areas["east"], east | inside), "westward": (areas["west"], west | inside)})
    kind = {"lane_type": "CAR", "left_lane_divider_segments": [], "right_lane_divider_segments": []}
    layer("lane", {"lane east": (areas["east"], kind | east), "lane west": (areas["west"], kind | west)})
    layers["road_divider"] = [{"token": token("divider"), "line_token": line("divider", (0, 0), (100, 0)), **inside}]
    layer("lane_connector", {"turn": (box(100, -3.5, 115, 10), {})})
    layer("ped_crossing", {"crossing": (box(46, -3.5, 54, 3.5), {"road_segment_token": token("street")})})
    layer("walkway", {"walkway": (box(0, -6, 100, -3.5), {})})
    layer("stop_line", {"stop": (box(98, -3.5, 100, 0), {})})
    layer("carpark_area", {"park": (box(0, 3.5, 100, 6), {})})
    turn, radius = 11.75, 11.75

    def path(start: list[float], shape: str, lengths: list[float], end: list[float]) -> list[dict[str, Any]]:
        return [{"start_pose": start, "end_pose": end, "shape": shape, "radius": radius, "segment_length": lengths}]

    layers["arcline_path_3"] = {
        token("lane east"): path([0.0, -1.75, 0.0], "LSR", [0.0, 100.0, 0.0], [100.0, -1.75, 0.0]),
        token("lane west"): path([100.0, 1.75, math.pi], "RSR", [0.0, 100.0, 0.0], [0.0, 1.75, math.pi]),
        token("turn"): path([100.0, -1.75, 0.0], "LSL", [turn * math.pi / 2, 0.0, 0.0], [111.75, 10.0, math.pi / 2]),
    }
    layers["connectivity"] = {
        token("lane east"): {"incoming": [], "outgoing": [token("turn")]},
        token("turn"): {"incoming": [token("lane east")], "outgoing": []},
    }
    return layers


def write(path: Path, content: object) -> None:
    """Write a JSON file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(spelled(content) + "\n", encoding="utf-8", newline="\n")


def spelled(content: object) -> str:
    """JSON with a row of a table, or a layer of a map, on each line."""
    if isinstance(content, dict):
        rows = [f"{json.dumps(key)}: {json.dumps(value)}" for key, value in content.items()]
        return "{\n" + ",\n".join(rows) + "\n}"
    rows = [json.dumps(row) for row in content] if isinstance(content, list) else [json.dumps(content)]
    return "[\n" + ",\n".join(rows) + "\n]"


def main(folder: Path = HERE) -> None:
    """Write the dataset into a folder, in place of what is there under its name."""
    target = folder / "nuscenes_tiny"
    shutil.rmtree(target, ignore_errors=True)
    for name, rows in nuscenes_tables().items():
        write(target / "v1.0-tiny" / f"{name}.json", rows)
    write(target / "maps" / "expansion" / "tiny-town.json", nuscenes_map())


if __name__ == "__main__":
    main()
