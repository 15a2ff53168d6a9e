"""A source of each format that has every field that its specification lists, as a document that can be changed.

A document has for each list of `scenicq/importers/specifications` the fields by their paths: dictionaries of fields,
lists of members. `write` makes files of it, without the importers' help.
"""

from __future__ import annotations

import copy
import hashlib
import json
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import pyarrow as pa
import pyarrow.parquet as pq
from pyarrow import feather

from scenicq.importers.opendrive import kept_files
from scenicq.importers.tfrecord import crc32c

SAMPLES = Path(__file__).parents[3] / "sample_data"
LISTS = Path(__file__).parents[3] / "scenicq" / "importers" / "specifications"

Document = dict[str, Any]


def entries(name: str) -> dict[str, str]:
    """The paths of a list, each with what becomes of it."""
    return json.loads((LISTS / f"{name}.json").read_text())


def parents(value: Any, path: list[str]) -> Iterator[tuple[dict[str, Any], str]]:
    """The dictionaries that have, or could have, the field at a path, each with its key there."""
    if isinstance(value, list):
        for each in value:
            yield from parents(each, path)
    elif isinstance(value, dict):
        keys = [key for key in value if not key.startswith("#")] if path[0] == "*" else [path[0]]
        for key in keys:
            if len(path) == 1:
                yield value, key
            elif key in value:
                yield from parents(value[key], path[1:])


def drop(document: Document, name: str, path: str) -> int:
    """Take a field out of a document wherever it is; how often that was."""
    if path.startswith("files/"):
        return document[name]["files"].pop(path.removeprefix("files/"), None) is not None
    found = [(owner, key) for owner, key in parents(document[name], path.split("/")) if key in owner]
    for owner, key in found:
        owner.pop(key, None)  # owners may be one and the same
    return len(found)


def fill(document: Document, name: str) -> Document:
    """Give a document what its list has and it has not, with a value that says something."""
    for path in sorted(entries(name), key=lambda path: path.count("/")):
        if path.startswith("files/"):
            document[name].setdefault("files", {})[path.removeprefix("files/")] = True
            continue
        inner = any(other.startswith(f"{path}/") for other in entries(name))
        owners = list(parents(document[name], path.split("/")))
        for owner, key in owners if not any(key in owner for owner, key in owners) else ():
            if key != "*":
                owner[key] = [{}] if inner else "1"
    return document


def write_files(document: Document, name: str, folder: Path) -> None:
    """The files and folders of a list: those that a document has and no writer has made, and no others."""
    for path in entries(name):
        pattern = path.removeprefix("files/")
        if pattern == path:
            continue
        there = [each for each in folder.rglob("*") if each.relative_to(folder).match(pattern)]
        if pattern in document[name]["files"]:
            place = folder / pattern.replace("*", "x")
            if not there and place.suffix:
                place.parent.mkdir(parents=True, exist_ok=True)
                place.write_text("[]")
            elif not there:
                place.mkdir(parents=True)
        for each in there if pattern not in document[name]["files"] else ():
            if each.is_file():
                each.unlink()
            elif each.is_dir():
                for inner in sorted(each.rglob("*"), reverse=True):
                    inner.unlink() if inner.is_file() else inner.rmdir()
                each.rmdir()


def to_message(fields: dict[str, Any]) -> bytes:
    """Protocol buffers: a key ends in the number of its field."""

    def varint(value: int) -> bytes:
        value &= (1 << 64) - 1
        return bytes([value]) if value < 128 else bytes([value & 127 | 128]) + varint(value >> 7)

    made = b""
    for key, values in fields.items():
        number = int(key.rpartition(":")[2])
        for value in values if isinstance(values, list) else [values]:
            if isinstance(value, float):
                made += varint(number << 3 | 1) + struct.pack("<d", value)
            elif isinstance(value, int):
                made += varint(number << 3) + varint(value)
            else:
                content = to_message(value) if isinstance(value, dict) else value.encode()
                made += varint(number << 3 | 2) + varint(len(content)) + content
    return made


def to_element(name: str, fields: dict[str, Any]) -> Element:
    """XML: `@` begins attributes, `#text` is what stands inside."""
    element = Element(name)
    for key, value in fields.items():
        if key == "#text":
            element.text = value
        elif key.startswith("@"):
            element.set(key[1:], str(value))
        else:
            for each in value if isinstance(value, list) else [value]:
                element.append(to_element(key, each if isinstance(each, dict) else {"#text": str(each)}))
    return element


def of_element(element: Element) -> dict[str, Any]:
    """What `to_element` writes."""
    fields: dict[str, Any] = {f"@{key}": value for key, value in element.attrib.items()}
    for child in element:
        fields.setdefault(child.tag, []).append(of_element(child))
    return fields | ({"#text": element.text} if (element.text or "").strip() else {})


def points(*places: tuple[float, float]) -> list[Document]:
    return [{"x:1": float(x), "y:2": float(y), "z:3": 1.0} for x, y in places]


class Waymo:
    """A scenario of three lanes, two beside each other."""

    importer = "waymo"
    lists = ("waymo",)

    def document(self) -> Document:
        def lane(name: int, y: float, first: float, **more: Any) -> Document:
            line = points(*((first + 10.0 * step, y) for step in range(5)))
            fields = {"type:2": 3, "polyline:8": line} | {key.replace("__", ":"): each for key, each in more.items()}
            return {"id:1": name, "lane:3": fields}

        def beside(name: int, *places: int) -> Document:
            keys = "self_start_index:2", "self_end_index:3", "neighbor_start_index:4", "neighbor_end_index:5"
            return {"feature_id:1": name} | dict(zip(keys, places or (1, 2, 2, 3), strict=True))

        square = {"polygon:1": points((0, -9), (9, -9), (9, -5))}
        state = dict(zip(
            ("center_x:2", "center_y:3", "center_z:4", "length:5", "width:6", "height:7", "heading:8", "velocity_x:9",
             "velocity_y:10"), (5.0, 1.0, 0.5, 4.0, 2.0, 1.5, 0.25, 3.0, 0.5), strict=True,
        ))  # fmt: skip
        track = {"object_type:2": 1, "states:3": [state | {"valid:11": 1}] * 3}
        content = {
            "timestamps_seconds:1": [0.0, 0.5, 1.0],
            "tracks:2": [{"id:1": 8} | track, {"id:1": 7} | track],
            "scenario_id:5": "5ce0c0de",
            "sdc_track_index:6": 1,
            "map_features:8": [
                lane(1, 0.0, 0.0, left_neighbors__11=[beside(2)], exit_lanes__10=[3]),
                lane(2, 3.5, 0.0, left_neighbors__11=[beside(13, 2, 2, 2, 2)]),
                lane(13, 7.0, 0.0),
                lane(3, 0.0, 40.0, interpolating__3=1, entry_lanes__9=[1], right_neighbors__12=[beside(12)]),
                lane(12, -3.5, 40.0, right_neighbors__12=[beside(14, 2, 2, 2, 2)]),
                lane(14, -7.0, 40.0),
                {"id:1": 4, "crosswalk:8": square},
                {"id:1": 5, "speed_bump:9": square},
                {"id:1": 6, "driveway:10": square},
                {"id:1": 9, "road_line:4": {}},
                {"id:1": 10, "road_edge:5": {}},
                {"id:1": 11, "stop_sign:7": {}},
            ],
        }
        document = {"waymo": content}
        for at in ("left_neighbors:11", "right_neighbors:12"):
            for owner, _ in parents(content, ["map_features:8", "lane:3", at, "x"]):
                owner["boundaries:6"] = [{}]
        for owner, _ in parents(content, ["map_features:8", "lane:3", "x"]):
            owner |= {"left_boundaries:13": {}, "right_boundaries:14": {}, "speed_limit_mph:1": 25.0}
        return document | {"waymo": {key: {} for key in entries("waymo") if "/" not in key} | content}

    def write(self, document: Document, folder: Path) -> None:
        content = to_message(document["waymo"])

        def masked(part: bytes) -> bytes:
            crc = crc32c(part)
            return struct.pack("<I", (((crc >> 15) | (crc << 17)) + 0xA282EAD8) & 0xFFFFFFFF)

        length = struct.pack("<Q", len(content))
        (folder / "a.tfrecord").write_bytes(length + masked(length) + content + masked(content))


def table(path: Path) -> Document:
    """The columns of a file of Arrow."""
    read = pq.read_table if path.suffix == ".parquet" else feather.read_table
    return read(path).to_pydict()


class Argoverse2:
    """The sample log, with a camera."""

    importer = "argoverse2"
    lists = ("argoverse2", "argoverse2-map")
    _log = SAMPLES / "argoverse2_tiny" / "val" / "5ce0c0de-0000-4000-8000-000000000001"

    def document(self) -> Document:
        boxes, poses = table(self._log / "annotations.feather"), table(self._log / "city_SE3_egovehicle.feather")
        # what is turned and raised shows each number
        turn = dict(zip(("qw", "qx", "qy", "qz"), (0.9, 0.1, 0.2, 0.3742), strict=True))
        for columns in (boxes, poses):
            columns |= {key: [value] * len(columns["qw"]) for key, value in turn.items()}
            columns["tz_m"] = [1.5] * len(columns["qw"])
        mount = turn | {"tx_m": 1.0, "ty_m": 0.5, "tz_m": 1.5}
        seen = {"fx_px": 900.0, "fy_px": 901.0, "cx_px": 640.0, "cy_px": 360.0, "k1": 0.1, "k2": 0.1, "k3": 0.1}
        name = {"sensor_name": ["ring_front_center"]}
        archive = json.loads(next((self._log / "map").glob("log_map_archive_*.json")).read_text())
        lane = next(iter(archive["lane_segments"].values()))
        lane["right_neighbor_id"] = lane["left_neighbor_id"]
        for each in archive["lane_segments"].values():
            each["centerline"] = each["left_lane_boundary"]
        return {
            "argoverse2": {
                "annotations.feather": boxes,
                "city_SE3_egovehicle.feather": poses,
                "calibration": {
                    "intrinsics.feather": name
                    | {key: [value] for key, value in seen.items()}
                    | {"width_px": [1280], "height_px": [720]},
                    "egovehicle_SE3_sensor.feather": name | {key: [value] for key, value in mount.items()},
                },
            },
            "argoverse2-map": archive,
        }

    def write(self, document: Document, folder: Path) -> None:
        log = folder / "log"
        tables = document["argoverse2"]
        camera = log / "sensors" / "cameras" / "ring_front_center"
        camera.mkdir(parents=True)
        (log / "sensors" / "lidar").mkdir()
        time = table(self._log / "annotations.feather")["timestamp_ns"][0]
        (camera / f"{time}.jpg").touch()
        for name, columns in [*tables.items(), *((f"calibration/{k}", v) for k, v in tables["calibration"].items())]:
            if name.endswith(".feather"):
                (log / name).parent.mkdir(exist_ok=True)
                feather.write_feather(pa.table(columns), log / name)
        (log / "map").mkdir()
        (log / "map" / "log_map_archive_x____PIT_city_1.json").write_text(json.dumps(document["argoverse2-map"]))
        write_files(document, "argoverse2", log)


class Forecasting:
    """The sample scenario."""

    importer = "argoverse2-forecasting"
    lists = ("argoverse2-forecasting",)

    def document(self) -> Document:
        (file,) = SAMPLES.glob("forecasting_tiny/*/*/scenario_*.parquet")
        columns = table(file)
        for path in entries("argoverse2-forecasting"):
            owner, _, name = path.rpartition("/")
            if owner == "scenario_*.parquet":
                columns.setdefault(name, [1] * len(columns["track_id"]))
        columns["heading"] = [0.25] * len(columns["heading"])
        columns["velocity_y"] = [0.25] * len(columns["heading"])
        return {"argoverse2-forecasting": {"scenario_*.parquet": columns}}

    def write(self, document: Document, folder: Path) -> None:
        inner = folder / "s"
        inner.mkdir()
        columns = document["argoverse2-forecasting"]["scenario_*.parquet"]
        pq.write_table(pa.table(columns), inner / "scenario_x.parquet")
        (archive,) = SAMPLES.glob("forecasting_tiny/*/*/log_map_archive_*.json")
        (inner / "log_map_archive_x.json").write_bytes(archive.read_bytes())
        write_files(document, "argoverse2-forecasting", inner)


WIDTHS = {"bbox": 4, "dimensions": 3, "location": 3, "acceleration": 6, "turn_rate": 6, "accuracy": 2,
          "status": 5}  # fmt: skip


class Kitti:
    """A sequence of two frames; its columns have places, not names, so one that is dropped is zero."""

    importer = "kitti"
    lists = ("kitti",)
    positional = ("label_02", "oxts")
    _label = ("frame", "track_id", "type", "truncated", "occluded", "alpha", "bbox", "dimensions", "location",
              "rotation_y", "score")  # fmt: skip
    _oxts = ("lat", "lon", "alt", "roll", "pitch", "yaw", "vn", "ve", "vf", "vl", "vu", "acceleration", "turn_rate",
             "accuracy", "status")  # fmt: skip

    def document(self) -> Document:
        values = ("1", "2", "Car", "1", "2", "0.5", "1 2 3 4", "1.5 1.8 4", "1 2 9", "0.5", "0.9")
        rows = [dict(zip(self._label, (frame, *values[1:]), strict=True)) for frame in ("0", "1")]
        some = {name: " ".join(["0.1"] * WIDTHS.get(name, 1)) for name in self._oxts}
        poses = [some | {"lat": f"0.00{step}", "lon": f"0.00{step}"} for step in (1, 2)]
        names = [path.partition("/")[2] for path in entries("kitti") if path.startswith("calib/")]
        calibration = dict.fromkeys(names, " ".join(["0"] * 12)) | {
            "R_rect": "1 0 0 0 1 0 0 0 1",
            "Tr_velo_cam": "0 -1 0 0 0 0 -1 -0.1 1 0 0 -0.3",
            "Tr_imu_velo": "1 0 0 -0.8 0 1 0 0.3 0 0 1 -0.8",
        }
        return {"kitti": {"label_02": rows, "oxts": poses, "calib": calibration}}

    def write(self, document: Document, folder: Path) -> None:
        def line(row: Document, names: Any) -> str:
            zeros = {name: " ".join(["0"] * WIDTHS.get(name, 1)) for name in names} | {"frame": "5"}
            return " ".join(row.get(name, "" if name == "score" else zeros[name]) for name in names)

        content = document["kitti"]
        areas = ["0 -1 DontCare" + " -1" * 14] if any("DontCare" in row for row in content["label_02"]) else []
        texts = {
            "label_02": [*areas, *(line(row, self._label) for row in content["label_02"])],
            "oxts": [line(row, self._oxts) for row in content["oxts"]],
            "calib": [f"{name}: {row}" for name, row in content["calib"].items()],
        }
        for name, lines in texts.items():
            (folder / name).mkdir()
            (folder / name / "0000.txt").write_text("\n".join(filter(None, lines)))
        (folder / "image_02").mkdir()
        write_files(document, "kitti", folder)


class NuScenes:
    """The sample dataset."""

    importer = "nuscenes"
    lists = ("nuscenes", "nuscenes-map")
    _root = SAMPLES / "nuscenes_tiny"

    def document(self) -> Document:
        tables = {file.stem: json.loads(file.read_text()) for file in (self._root / "v1.0-tiny").glob("*.json")}
        (expansion,) = (self._root / "maps" / "expansion").glob("*.json")
        content = json.loads(expansion.read_text())
        content["arcline_path_3"] = {
            key: [piece | {"shape": "LSR", "radius": 30.0, "segment_length": [5.0, 90.0, 5.0]} for piece in path]
            for key, path in content["arcline_path_3"].items()
        }
        content["lane"][0] |= {f"{side}_lane_divider_segments": [{"node_token": "x"}] for side in ("left", "right")}
        places = {node["token"]: (node["x"], node["y"]) for node in content["node"]}
        whole = next(
            each for each in content["polygon"] if each["token"] in content["drivable_area"][0]["polygon_tokens"]
        )
        x, y = (sum(axis) / len(axis) for axis in zip(*(places[t] for t in whole["exterior_node_tokens"]), strict=True))
        content["node"] += [{"token": f"h{n}", "x": x + (n == 1), "y": y + (n == 2)} for n in range(3)]
        whole["holes"] = [{"node_tokens": ["h0", "h1", "h2"]}]
        # what is not level shows each number of a pose
        for row in (*tables["ego_pose"], *tables["sample_annotation"]):
            row["translation"][2] = 1.0
        for row in tables["sample_data"]:
            row |= {"height": 900, "width": 1600}
        for number, row in enumerate(tables["calibrated_sensor"]):
            row["camera_intrinsic"] = [[1200.0, 0, 800], [0, 1200.0, 450], [0, 0, 1]] if number else []
            row["rotation"], row["translation"] = [0.5, -0.5, 0.5, -0.5], [1.5, 0.0, 1.5]
        tables.pop("map")
        return {"nuscenes": tables, "nuscenes-map": content}

    def write(self, document: Document, folder: Path) -> None:
        tables = folder / "v1.0-x"
        tables.mkdir()
        for name, rows in document["nuscenes"].items():
            if name == "sample_data" and any(row.pop("sweeps", False) for row in rows):
                sweep = {"token": "sweep", "filename": "s", "is_key_frame": False}
                rows.append({**rows[0], **sweep})
            if name != "files":
                (tables / f"{name}.json").write_text(json.dumps(rows))
        for name in document["nuscenes"]["files"]:
            if name.endswith(".json") and "/" not in name and not (tables / name).exists():
                (tables / name).write_text("[]")
        for path in entries("nuscenes"):
            name = path.removeprefix("files/")
            if path.startswith("files/") and name.endswith(".json") and name not in document["nuscenes"]["files"]:
                (tables / name).unlink(missing_ok=True)
        expansion = folder / "maps" / "expansion"
        expansion.mkdir(parents=True)
        (expansion / "tiny-town.json").write_text(json.dumps(document["nuscenes-map"]))
        files = {name: True for name in document["nuscenes"]["files"] if not name.endswith(".json")}
        for name in files:
            place = folder / name.replace("*", "x")
            place.parent.mkdir(parents=True, exist_ok=True)
            place.touch() if place.suffix else place.mkdir(exist_ok=True)
        if "maps/expansion" not in files:
            (expansion / "tiny-town.json").unlink()


class Interaction:
    """The sample recording with its map of lanelets."""

    importer = "interaction"
    lists = ("interaction", "lanelet2")
    _root = SAMPLES / "interaction_tiny"

    def document(self) -> Document:
        header, *lines = (self._root / "recorded_trackfiles/TINY_Street/vehicle_tracks_000.csv").read_text().split()
        rows = [dict(zip(header.split(","), line.split(","), strict=True)) for line in lines]
        columns = {name: [row.get(name, "1") for row in rows] for name in entries("interaction")}
        columns["psi_rad"] = ["0.25"] * len(rows)
        columns["vy"] = ["0.25"] * len(rows)
        content = of_element(ElementTree.parse(self._root / "maps" / "TINY_Street.osm").getroot())
        for way in content["way"]:
            way["tag"] = {"type": "line_thin"}
        way = {"@id": "9", "tag": {"type": "curbstone"}}
        relations = content.pop("relation")
        for relation in relations:
            relation["tag"] = {tag["@k"]: tag["@v"] for tag in relation["tag"]} | {"one_way": "yes"}
            relation["member"] = {member["@role"]: member["@ref"] for member in relation["member"]}
        for node in content["node"]:
            node["tag"] = {"ele": "1"}
        content |= {
            "way_of_no_lanelet": [way],
            "relation": {"lanelet": relations, "regulatory_element": [{"@id": "7"}], "multipolygon": [{"@id": "8"}]},
        }
        return {"interaction": columns, "lanelet2": content}

    def write(self, document: Document, folder: Path) -> None:
        columns = {key: each for key, each in document["interaction"].items() if key != "files"}
        rows = zip(*columns.values(), strict=True)
        scene = folder / "recorded_trackfiles" / "TINY"
        scene.mkdir(parents=True)
        lines = [",".join(columns), *(",".join(row) for row in rows)]
        (scene / "vehicle_tracks_000.csv").write_text("\n".join(lines) + "\n")
        (folder / "maps").mkdir()
        ElementTree.ElementTree(self._osm(document["lanelet2"])).write(folder / "maps" / "TINY.osm")

    def _osm(self, content: Document) -> Element:
        root = Element("osm", {key[1:]: str(value) for key, value in content.items() if key.startswith("@")})
        members = [("node", each) for each in content.get("node", [])]
        members += [("way", each) for each in (*content.get("way", []), *content.get("way_of_no_lanelet", []))]
        for kind, found in content.get("relation", {}).items():
            members += [("relation", {**each, "tag": {"type": kind} | each.get("tag", {})}) for each in found]
            if kind == "lanelet":
                for _, relation in members[-len(found) :]:
                    kept = found[0].get("tag", {})
                    if "type" not in kept:
                        relation["tag"].pop("type")
        members += [(kind, {}) for kind in ("bounds", "MetaInfo") if kind in content]
        for kind, fields in members:
            element = SubElement(root, kind, {key[1:]: str(v) for key, v in fields.items() if key.startswith("@")})
            for nd in fields.get("nd", []):
                SubElement(element, "nd", {key[1:]: value for key, value in nd.items()})
            for role, ref in fields.get("member", {}).items():
                SubElement(element, "member", {"type": "way", "role": role, "ref": ref})
            for key, value in fields.get("tag", {}).items():
                SubElement(element, "tag", {"k": key, "v": value})
        return root


class Interchange:
    """A folder of two labels."""

    importer = "interchange"
    lists = ("interchange", "geojson")

    def document(self) -> Document:
        camera = {"path": "a.jpg", "width": 1600, "height": 900, "intrinsics": [1200.0, 1200.0, 800.0, 450.0],
                  "position": [0.0, 0.0, 1.5], "rotation": [0.5, -0.5, 0.5, -0.5]}  # fmt: skip
        entry = {"class": "Truck", "position": [1.0, 2.0], "heading": 0.5, "width": 2.0, "length": 4.5, "height": 1.5,
                 "velocity": [1.0, 2.0], "track": "t", "attributes": {"a": 1}, "z": 1.0, "pitch": 0.1, "roll": 0.1,
                 }  # fmt: skip
        labels = [
            {
                "id": f"f{step}", "recording": "r", "timestamp_us": step * 100_000, "map": "town",
                "ego": {**entry, "track": "e"}, "objects": [{**entry, "id": "o"}], "params": {"weather": "rain"},
                "sensors": {"CAM": camera},
            }
            for step in (0, 1)
        ]  # fmt: skip
        square = [[0.0, 0.0], [9.0, 0.0], [9.0, 9.0], [0.0, 9.0], [0.0, 0.0]]
        header = {"name": "n", "interchange": 1, "angle": "heading", "classes": "scenic", "source": "s", "ego": "none"}
        feature = {
            "type": "Feature",
            "geometry": {"type": "Polygon", "coordinates": [square]},
            "properties": {"id": "a", "kind": "plaza", "more": 1},
        }
        return {
            "interchange": {"dataset.json": header, "labels": labels},
            "geojson": {
                "type": "FeatureCollection",
                "features": [feature],
                "crs": {"properties": {"name": "EPSG:32633"}},
            },
        }

    def write(self, document: Document, folder: Path) -> None:
        content = document["interchange"]
        (folder / "dataset.json").write_text(json.dumps(content.get("dataset.json", {})))
        if "labels" in content:
            (folder / "labels.jsonl").write_text("".join(json.dumps(each) + "\n" for each in content["labels"]))
        (folder / "maps").mkdir()
        (folder / "maps" / "town.geojson").write_text(json.dumps(document["geojson"]))


class OpenLabel:
    """Boxes in systems of each spelling, and objects that are named in each place where writers do."""

    importer = "openlabel"
    lists = ("openlabel",)

    def document(self) -> Document:
        def box(x: float, system: str, **more: Any) -> Document:
            return {"val": [x, 1.0, 0.8, 0.1, 0.2, 0.3, 4.5, 1.9, 1.6], "coordinate_system": system, **more}

        def shift(x: float) -> Document:
            return {"matrix4x4": [1, 0, 0, x, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]}

        said = {"attributes": {kind: [{"name": f"inner {kind}", "val": value}] for kind, value in SAID.items()}}
        more = {kind: [{"name": kind, "val": value}] for kind, value in SAID.items()}
        inside = {"frame_start": 0, "frame_end": 0}
        objects = {
            "1": {"name": "a", "type": "car", "object_data": more | {"cuboid": [box(20.0, "vehicle-iso8855", **said)]}},
            "2": {
                "name": "b", "type": "car", "frame_intervals": [inside], "object_data": {"cuboid": [box(9.0, "lidar")]},
            },
            "3": {"object_data": {"name": "DontCare", "cuboid": [box(8.0, "vehicle-iso8855")]}},
            "4": {"object_data": {"type": "pedestrian", "cuboid": [box(7.0, "camera")]}},
            "5": {"name": "egocar", "type": "car", "object_data": {"cuboid": [box(0.0, "vehicle-iso8855")]}},
            "6": {
                "name": "c", "type": "car", "coordinate_system": "lidar",
                "object_data": {"cuboid": [{"val": box(6.0, "")["val"]}]},
            },
        }  # fmt: skip
        turned = {"translation": [1.0, 2.0, 0.5]}
        vehicle = {"type": "local_cs", "parent": "odom", "children": ["lidar", "camera"]}
        systems = {
            "odom": {"type": "scene_cs", "parent": "", "children": ["vehicle-iso8855"]},
            "vehicle-iso8855": vehicle | {"pose_wrt_parent": shift(5.0)},
            "lidar": {"parent": "vehicle-iso8855", "pose_wrt_parent": turned | {"quaternion": [0.0, 0.0, 0.6, 0.8]}},
            "camera": {
                "parent": "vehicle-iso8855",
                "pose_wrt_parent": turned | {"euler_angles": [0.3, 0.2, 0.1], "sequence": "XYZ"},
            },
        }
        moved = {"src": "vehicle-iso8855", "dst": "odom", "transform_src_to_dst": shift(15.0)}
        frames = {
            str(number): {
                "objects": {"7": {"object_data": {"type": "car", "cuboid": [box(30.0, "odom")]}}},
                "frame_properties": {
                    "timestamp": "0.5",
                    "transforms": {"moved": moved},
                    "streams": {"cam": {"stream_properties": {"sync": {"timestamp": 0.1 + number}}}},
                },
            }
            for number in (0, 1)
        }
        frames["1"]["frame_properties"].pop("timestamp")
        frames["1"]["frame_properties"].pop("transforms")
        return {
            "openlabel": {
                "streams": {"cam": {"type": "camera"}},
                "coordinate_systems": systems,
                "objects": objects,
                "frames": frames,
            }
        }

    def write(self, document: Document, folder: Path) -> None:
        (folder / "openlabel.json").write_text(json.dumps({"openlabel": document["openlabel"]}))


SAID = {"boolean": True, "num": 1.5, "text": "x", "vec": [1.0]}


class CommonRoad:
    """A street with obstacles of each spelling; lanelets lie in the intersection by one word each."""

    importer = "commonroad"
    lists = ("commonroad",)

    def document(self) -> Document:
        def bound(first: float, last: float, y: float) -> Document:
            return {"point": [{"x": first, "y": y}, {"x": last, "y": y}]}

        def lanelet(name: int, first: float, last: float, y: float, kind: str = "urban", **links: Document) -> Document:
            sides = {"leftBound": [bound(first, last, y)], "rightBound": [bound(first, last, y - 3.5)]}
            return {"@id": str(name), **sides, "laneletType": [{"#text": kind}], **{k: [v] for k, v in links.items()}}

        def to(name: int, way: str = "") -> Document:
            return {"@ref": str(name)} | ({"@drivingDir": way} if way else {})

        def state(step: int, x: float) -> Document:
            said = {
                name: [{"exact": value}] for name, value in (("orientation", 0.1), ("velocity", 3.0), ("time", step))
            }
            return {"position": [{"point": [{"x": x, "y": -1.0}]}], **said}

        def obstacle(name: int, shape: Document, *more: Document, **fields: Any) -> Document:
            return {
                "@id": str(name), "type": [{"#text": "car"}], "shape": [shape], "initialState": [state(1, 9.0 + name)],
                **({"trajectory": [{"state": list(more)}]} if more else {}), **fields,
            }  # fmt: skip

        rectangle = {"rectangle": [{"length": 4.5, "width": 1.9}]}
        moving = obstacle(1, rectangle, state(2, 11.0), state(3, 12.0))
        straight = {"successorsRight": to(3), "successorsStraight": to(4), "successorsLeft": to(5)}
        return {
            "commonroad": {
                "@timeStepSize": "0.1",
                "location": [{"environment": [{"timeOfDay": "day", "weather": "sunny", "underground": "wet"}]}],
                "lanelet": [
                    lanelet(1, 0, 60, 0, successor=to(3), adjacentRight=to(2, "same")),
                    lanelet(2, 0, 60, -3.5, adjacentLeft=to(1, "same")),
                    lanelet(3, 60, 80, 0, predecessor=to(1)),
                    lanelet(4, 90, 99, 0),
                    lanelet(5, 110, 120, 0),
                    lanelet(6, 30, 33, 0, "crosswalk"),
                ],
                "intersection": [{"@id": "70", "incoming": [{"@id": "71", **straight}]}],
                "dynamicObstacle": [
                    moving,
                    obstacle(2, {"circle": [{"radius": 0.4}]}, role="static"),
                    obstacle(3, {"polygon": [{}]}, occupancySet=[{"occupancy": [{}]}]),
                ],
                "staticObstacle": [obstacle(4, rectangle)],
                "obstacle": [obstacle(5, rectangle)],
            }
        }

    def write(self, document: Document, folder: Path) -> None:
        root = to_element("commonRoad", document["commonroad"])
        ElementTree.ElementTree(root).write(folder / "tiny.xml")


class OpenDrive:
    """A street that forks, and one more for each type of lane."""

    importer = "interchange"
    lists = ("opendrive",)
    recorded = Path(__file__).with_name("opendrive_parsed.json")
    """What Scenic's parser gives for the whole map: its features, under the SHA-256 of the map."""

    def keep_recorded(self, folder: Path, cache: Path) -> None:
        """Put the recorded result where an ingest finds it that has no Scenic."""
        content = (folder / "town.xodr").read_bytes()
        told = json.loads(self.recorded.read_text(encoding="utf-8"))
        again = "the map is another: `pytest --update-golden -m slow -k parser_gives` records it anew, with Scenic"
        assert told["map"] == hashlib.sha256(content).hexdigest(), again
        made, digest = kept_files(content, cache)
        cache.mkdir(parents=True)
        made.write_text(json.dumps({"type": "FeatureCollection", "features": told["features"]}))
        digest.write_text(hashlib.sha256(made.read_bytes()).hexdigest())

    def document(self) -> Document:
        types = {path.rpartition("/")[2]: True for path in entries("opendrive") if path.startswith("lane/@type/")}

        def lane(number: int, **more: Any) -> Document:
            width = [{"@sOffset": "0", "@a": "3.5", "@b": "0", "@c": "0", "@d": "0"}]
            return {"@id": str(number), "@type": "driving", "@level": "false", "width": width, **more}

        def links(before: int = 0, after: int = 0) -> list[Document]:
            found = {"predecessor": before, "successor": after}
            return [{name: [{"@id": str(number)}] for name, number in found.items() if number}]

        def section(s: float, left: list[Document], right: list[Document]) -> Document:
            sides = {name: [{"lane": lanes}] for name, lanes in (("left", left), ("right", right)) if lanes}
            return {"@s": str(s), "center": [{"lane": [{"@id": "0", "@type": "none"}]}], **sides}

        def to(name: int, kind: str = "road", **more: str) -> Document:
            return {"@elementType": kind, "@elementId": str(name), **{f"@{key}": value for key, value in more.items()}}

        def road(name: int, x: float, y: float, sections: list[Document], **more: Any) -> Document:
            line = {"@s": "0", "@x": str(x), "@y": str(y), "@hdg": "0", "@length": "50", "line": [{}]}
            offset = {"@s": "0", "@a": "0.25", "@b": "0", "@c": "0", "@d": "0"}
            return {
                "@name": "street", "@length": "50", "@id": str(name), "@junction": "-1",
                "planView": [{"geometry": [line]}], "lanes": [{"laneOffset": [offset], "laneSection": sections}],
            } | more  # fmt: skip

        way = {"userData": [{"vectorLane": [{"@travelDir": "forward"}]}]}
        first = section(0, [], [lane(-1, link=links(after=-1)), lane(-2, link=links(after=-2))])
        second = section(25, [], [lane(-1, link=links(-1, -1)), lane(-2, link=links(-2))])
        signal = {
            "@id": "s", "@s": "40", "@t": "-4", "@name": "", "@dynamic": "yes", "@orientation": "+", "@type": "1000001",
            "@subtype": "-1", "@country": "OpenDRIVE", "@zOffset": "0", "@value": "-1",
        }  # fmt: skip
        reference = {"@id": "s", "@s": "45", "@t": "-4", "@orientation": "+"}
        roads = [
            road(
                1, 0, 0, [first, second],
                link=[{"successor": [to(7, "junction")]}], signals=[{"signal": [signal]}],
            ),
            road(
                2, 50, 0, [section(0, [], [lane(-1, link=links(-1, -1))])], **{"@junction": "7"},
                link=[{"predecessor": [to(1, contactPoint="end")], "successor": [to(3, contactPoint="start")]}],
                signals=[{"signalReference": [reference]}],
            ),
            road(
                3, 100, 0, [section(0, [], [lane(-1, link=links(before=-1))])],
                link=[{"predecessor": [to(7, "junction")]}],
            ),
            road(4, 0, 99, [section(0, [lane(1), lane(2, **{"@direction": "reversed"})], [])], **{"@rule": "LHT"}),
            road(
                5, 0, 199,
                [section(0, [lane(1, link=links(after=1), **way)], []), section(25, [lane(1, link=links(1))], [])],
            ),
        ]  # fmt: skip
        connection = {
            "@id": "0", "@type": "default", "@incomingRoad": "1", "@connectingRoad": "2", "@contactPoint": "start",
            "laneLink": [{"@from": "-1", "@to": "-1"}],
        }  # fmt: skip
        return {
            "opendrive": {
                "header": [{"@revMajor": "1", "@revMinor": "7"}],
                "road": roads,
                "junction": [{"@id": "7", "connection": [connection]}],
                "lane": {"@type": types},
            }
        }

    def write(self, document: Document, folder: Path) -> None:
        content = {key: value for key, value in document["opendrive"].items() if key != "lane"}
        root = to_element("OpenDRIVE", content)
        there = document["opendrive"]["lane"]["@type"]
        for number, path in enumerate(path for path in entries("opendrive") if path.startswith("lane/@type/")):
            kind = path.rpartition("/")[2]
            root.append(to_element("road", self._street(100 + number, kind if kind in there else None)))
        ElementTree.ElementTree(root).write(folder / "town.xodr")
        (folder / "dataset.json").write_text('{"interchange": 1, "angle": "heading", "classes": "scenic"}')
        ego = {"position": [10.0, -5.0], "heading": -1.57}
        label = {"id": "f", "recording": "r", "timestamp_us": 0, "map": "town", "objects": [], "ego": ego}
        (folder / "labels.jsonl").write_text(json.dumps(label) + "\n")

    def _street(self, number: int, kind: str | None) -> Document:
        """A street that may have a lane of a type beside the one for vehicles."""
        (road,) = copy.deepcopy([each for each in OpenDrive().document()["opendrive"]["road"] if each["@id"] == "3"])
        lanes = road["lanes"][0]["laneSection"][0]["right"][0]["lane"]
        lanes[0].pop("link")
        lanes += [lanes[0] | {"@id": "-2", "@type": kind}] if kind else []
        road["planView"][0]["geometry"][0]["@y"] = str(10.0 * number)
        road.pop("link")
        return road | {"@id": str(number)}


FORMATS: dict[str, Any] = {
    kind.lists[0]: kind()
    for kind in (
        Waymo, Argoverse2, Forecasting, Kitti, NuScenes, Interaction, Interchange, OpenLabel, CommonRoad, OpenDrive
    )
}  # fmt: skip


def full(format_: str) -> Document:
    """A source of a format that has all that its lists name."""
    document = FORMATS[format_].document()
    for name in FORMATS[format_].lists:
        fill(document, name)
    return document
