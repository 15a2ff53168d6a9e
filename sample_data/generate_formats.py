"""Writes the same invented street in further formats next to this file, the same every time.

Run it with `python sample_data/generate_formats.py`.
"""

from __future__ import annotations

import json
import math
import shutil
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
from invented_street import ACTORS, CAR, EGO, LANES, START_NS, STEP_S, STEPS, WALKER, Actor, Point

HERE = Path(__file__).parent


def write(path: Path, content: str | bytes) -> None:
    """Write a file with its folders."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content.encode() if isinstance(content, str) else content)


def feather(path: Path, columns: dict[str, list[Any]]) -> None:
    """Write a feather file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    table = pa.table(columns)
    with pa.OSFile(str(path), "wb") as sink, pa.ipc.new_file(sink, table.schema) as file:
        file.write_table(table)


def archive() -> dict[str, Any]:
    """The street as a vector map of Argoverse 2."""

    def points(line: tuple[Point, ...]) -> list[dict[str, float]]:
        return [{"x": x, "y": y, "z": 0.0} for x, y in line]

    lanes = {
        str(lane.id): {
            "id": lane.id,
            "is_intersection": lane.crossing,
            "lane_type": "VEHICLE",
            "left_lane_boundary": points(lane.left),
            "left_lane_mark_type": "NONE",
            "right_lane_boundary": points(lane.right),
            "right_lane_mark_type": "NONE",
            "successors": list(lane.after),
            "predecessors": list(lane.before),
            "right_neighbor_id": None,
            "left_neighbor_id": lane.beside,
        }
        for lane in LANES
    }
    crossing = {"edge1": points(((38.0, -3.5), (38.0, 3.5))), "edge2": points(((42.0, -3.5), (42.0, 3.5))), "id": 50}
    area = {"area_boundary": points(((0.0, -4.0), (80.0, -4.0), (80.0, 4.0), (0.0, 4.0))), "id": 60}
    return {"pedestrian_crossings": {"50": crossing}, "lane_segments": lanes, "drivable_areas": {"60": area}}


def argoverse2(root: Path) -> None:
    """A sensor log: boxes in the frame of the ego's rear axle."""
    log = root / "val" / "5ce0c0de-0000-4000-8000-000000000001"
    poses: dict[str, list[Any]] = {
        name: [] for name in ("timestamp_ns", "qw", "qx", "qy", "qz", "tx_m", "ty_m", "tz_m")
    }
    names = ("timestamp_ns", "track_uuid", "category", "length_m", "width_m", "height_m", *list(poses)[1:])
    boxes: dict[str, list[Any]] = {name: [] for name in (*names, "num_interior_pts")}
    for step in range(STEPS):
        time = START_NS + round(step * STEP_S * 1e9)
        axle = EGO.at(step)[0] - 1.42, EGO.at(step)[1]
        sign = (-1.0) ** step
        for key, value in zip(poses, (time, sign, 0.0, 0.0, 0.0, *axle, 0.0), strict=True):
            poses[key].append(value)
        for actor, category in ((CAR, "REGULAR_VEHICLE"), (WALKER, "PEDESTRIAN")):
            x, y = actor.at(step)
            turn = (math.cos(actor.yaw / 2), 0.0, 0.0, math.sin(actor.yaw / 2))
            place = (x - axle[0], y - axle[1], actor.size[2] / 2)
            row = (time, f"5ce0c0de-{actor.name}", category, *actor.size, *turn, *place, 40 + step)
            for key, value in zip(boxes, row, strict=True):
                boxes[key].append(value)
    feather(log / "city_SE3_egovehicle.feather", poses)
    feather(log / "annotations.feather", boxes)
    write(log / "map" / f"log_map_archive_{log.name}____TNY_city_1.json", json.dumps(archive(), separators=(",", ":")))


def forecasting(root: Path) -> None:
    """A motion forecasting scenario: no sizes."""
    name = "5ce0c0de-0000-4000-8000-000000000002"
    rows: list[dict[str, Any]] = []
    for actor, track, kind in ((EGO, "AV", "vehicle"), (CAR, "1001", "vehicle"), (WALKER, "1002", "pedestrian")):
        for step in range(STEPS):
            (x, y), (vx, vy) = actor.at(step), actor.velocity
            rows.append(
                {
                    "observed": step < 5,
                    "track_id": track,
                    "object_type": kind,
                    "object_category": 2,
                    "timestep": step,
                    "position_x": x,
                    "position_y": y,
                    "heading": actor.yaw,
                    "velocity_x": vx,
                    "velocity_y": vy,
                    "scenario_id": name,
                    "start_timestamp": START_NS / 1e9,
                    "end_timestamp": START_NS / 1e9 + 10.9,
                    "num_timestamps": 110,
                    "focal_track_id": "1001",
                    "city": "tiny-town",
                }
            )
    folder = root / "val" / name
    folder.mkdir(parents=True)
    pq.write_table(pa.Table.from_pylist(rows), folder / f"scenario_{name}.parquet", compression="none")
    write(folder / f"log_map_archive_{name}.json", json.dumps(archive(), separators=(",", ":")))


def varint(number: int) -> bytes:
    """A whole number in the wire format of protocol buffers."""
    number &= (1 << 64) - 1
    found = bytearray()
    while number > 127:
        found.append(number & 127 | 128)
        number >>= 7
    return bytes([*found, number])


def message(*fields: tuple[int, object]) -> bytes:
    """A message: whole numbers, doubles, bytes; floats of four bytes are given as one-element tuples."""
    found = b""
    for number, value in fields:
        match value:
            case int():
                found += varint(number << 3) + varint(value)
            case float():
                found += varint(number << 3 | 1) + struct.pack("<d", value)
            case (float() as short,):
                found += varint(number << 3 | 5) + struct.pack("<f", short)
            case bytes():
                found += varint(number << 3 | 2) + varint(len(value)) + value
            case _:
                raise TypeError(value)
    return found


def masked_crc(content: bytes) -> bytes:
    """The checksum of TFRecord: CRC-32C, turned and moved."""
    state = 0xFFFFFFFF
    for byte in content:
        state ^= byte
        for _ in range(8):
            state = state >> 1 ^ (0x82F63B78 if state & 1 else 0)
    state ^= 0xFFFFFFFF
    return ((state >> 15 | state << 17) + 0xA282EAD8 & 0xFFFFFFFF).to_bytes(4, "little")


def record(content: bytes) -> bytes:
    """A record of TFRecord."""
    length = len(content).to_bytes(8, "little")
    return length + masked_crc(length) + content + masked_crc(content)


def scenario(name: str) -> bytes:
    """A `Scenario` of Waymo Open Motion."""

    def point(place: Point) -> bytes:
        return message((1, place[0]), (2, place[1]), (3, 0.0))

    def state(actor: Actor, step: int) -> bytes:
        if actor is WALKER and step == 0:
            return message((2, 0.0), (3, 0.0), (11, 0))
        (x, y), (vx, vy), (length, width, height) = actor.at(step), actor.velocity, actor.size
        size = ((5, (length,)), (6, (width,)), (7, (height,)))
        return message((2, x), (3, y), (4, 0.0), *size, (8, (actor.yaw,)), (9, (vx,)), (10, (vy,)), (11, 1))

    fields: list[tuple[int, object]] = [(5, name.encode())]
    fields += [(1, step * STEP_S) for step in range(STEPS)]
    for number, (actor, kind) in enumerate(((CAR, 1), (EGO, 1), (WALKER, 2))):
        states = [(3, state(actor, step)) for step in range(STEPS)]
        fields.append((2, message((1, 100 + number), (2, kind), *states)))
    fields += [(6, 1), (10, 5)]
    for lane in LANES:
        middle = [((a[0] + b[0]) / 2, (a[1] + b[1]) / 2) for a, b in zip(lane.left, lane.right, strict=True)]
        line = [(8, point(place)) for place in middle]
        links = [(9, other) for other in lane.before] + [(10, other) for other in lane.after]
        fields.append((8, message((1, lane.id), (3, message((2, 2), (3, int(lane.crossing)), *line, *links)))))
    corners = ((38.0, -3.5), (42.0, -3.5), (42.0, 3.5), (38.0, 3.5))
    fields.append((8, message((1, 50), (8, message(*[(1, point(corner)) for corner in corners])))))
    return message(*fields)


def waymo(root: Path) -> None:
    """Two scenarios in a file."""
    content = b"".join(record(scenario(f"5ce0c0de0000000{number}")) for number in (1, 2))
    write(root / "tiny.tfrecord-00000-of-00001", content)


def commonroad(root: Path) -> None:
    """The same scenario as XML 2018b and 2020a."""

    def exact(name: str, value: float) -> str:
        return f"<{name}><exact>{value!r}</exact></{name}>"

    def bound(name: str, line: tuple[Point, ...]) -> str:
        return f"<{name}>" + "".join(f"<point><x>{x}</x><y>{y}</y></point>" for x, y in line) + f"</{name}>"

    def state(name: str, actor: Actor, step: int) -> str:
        x, y = actor.at(step)
        place = f"<position><point><x>{x!r}</x><y>{y!r}</y></point></position>"
        speed = exact("velocity", math.hypot(*actor.velocity))
        return f"<{name}>{place}{exact('orientation', actor.yaw)}<time><exact>{step}</exact></time>{speed}</{name}>"

    def obstacle(number: int, actor: Actor, version: str) -> str:
        length, width, _ = actor.size
        shape = f"<shape><rectangle><length>{length}</length><width>{width}</width></rectangle></shape>"
        states = state("initialState", actor, 0)
        states += "<trajectory>" + "".join(state("state", actor, step) for step in range(1, STEPS)) + "</trajectory>"
        role, tag = ("<role>dynamic</role>", "obstacle") if version == "2018b" else ("", "dynamicObstacle")
        return f'<{tag} id="{number}">{role}<type>{actor.kind}</type>{shape}{states}</{tag}>\n'

    for version in ("2018b", "2020a"):
        text = f"""<?xml version='1.0' encoding='UTF-8'?>
<commonRoad timeStepSize="{STEP_S}" commonRoadVersion="{version}" benchmarkID="ZAM_Tiny-1_1_T-1" date="2026-01-02">
"""
        if version == "2020a":
            text += (
                "<location><geoNameId>-999</geoNameId><environment><weather>sunny</weather></environment></location>"
            )
        for lane in LANES:
            links = "".join(f'<predecessor ref="{other}"/>' for other in lane.before)
            links += "".join(f'<successor ref="{other}"/>' for other in lane.after)
            links += f'<adjacentLeft ref="{lane.beside}" drivingDir="opposite"/>'
            kind = "<laneletType>urban</laneletType>" if version == "2020a" else ""
            bounds = bound("leftBound", lane.left) + bound("rightBound", lane.right)
            text += f'<lanelet id="{lane.id}">{bounds}{links}{kind}</lanelet>\n'
        if version == "2020a":
            edges = bound("leftBound", ((38.0, -3.5), (38.0, 3.5))) + bound("rightBound", ((42.0, -3.5), (42.0, 3.5)))
            text += f'<lanelet id="50">{edges}<laneletType>crosswalk</laneletType></lanelet>\n'
            ways = "".join(
                f'<incoming id="{70 + a}"><incomingLanelet ref="{a}"/><successorsStraight ref="{b}"/></incoming>'
                for a, b in ((1, 3), (9, 4))
            )
            text += f'<intersection id="70">{ways}</intersection>\n'
        text += "".join(obstacle(100 + number, actor, version) for number, actor in enumerate(ACTORS))
        write(root / f"ZAM_Tiny-1_1_T-1_{version}.xml", text + "</commonRoad>\n")


def kitti(root: Path) -> None:
    """A sequence of KITTI tracking; the map frame begins at the ego's first position."""
    unit_to_velodyne, velodyne_to_camera = (-0.8, 0.3, -0.8), (0.0, -0.1, -0.3)
    labels, poses = "", ""
    earth = 6378137.0
    for step in range(STEPS):
        at = EGO.at(step)
        east, north = at[0] - EGO.start[0], at[1] - EGO.start[1]
        longitude, latitude = math.degrees(east / earth), math.degrees(2 * math.atan(math.exp(north / earth))) - 90
        poses += (
            f"{latitude!r} {longitude!r} 100.0 0 0 0.0 {EGO.velocity[1]!r} {EGO.velocity[0]!r} {EGO.velocity[0]!r} 0 0 "
            + "0 " * 18
            + "0\n"
        )
        labels += f"{step} -1 DontCare -1 -1 -10 1 1 2 2 -1000 -1000 -1000 -10 -1 -1 -1\n"
        for number, (actor, kind) in enumerate(((CAR, "Car"), (WALKER, "Pedestrian"))):
            length, width, height = actor.size
            x, y = (a - b for a, b in zip(actor.at(step), at, strict=True))
            seen = [a + b for a, b in zip((x, y, 0.0), unit_to_velodyne, strict=True)]
            place = [a + b for a, b in zip((-seen[1], -seen[2], seen[0]), velodyne_to_camera, strict=True)]
            turn = math.atan2(-math.cos(actor.yaw), -math.sin(actor.yaw))
            labels += f"{step} {number} {kind} 0 0 0.1 1 1 2 2 {height} {width} {length} "
            labels += f"{place[0]!r} {place[1] + height / 2!r} {place[2]!r} {turn!r}\n"
    calibration = "P0: " + "0 " * 11 + "0\nR_rect 1 0 0 0 1 0 0 0 1\n"
    calibration += "Tr_velo_cam 0 -1 0 {} 0 0 -1 {} 1 0 0 {}\n".format(*velodyne_to_camera)
    calibration += "Tr_imu_velo 1 0 0 {} 0 1 0 {} 0 0 1 {}\n".format(*unit_to_velodyne)
    for folder, content in (("label_02", labels), ("oxts", poses), ("calib", calibration)):
        write(root / "training" / folder / "0000.txt", content)


def openlabel(root: Path) -> None:
    """OpenLABEL with cuboids in the frame of a camera that a moving vehicle carries."""
    down = [0.0, 0.0, 1.0, 1.5, -1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.6, 0.0, 0.0, 0.0, 1.0]
    systems = {
        "odom": {"type": "scene_cs", "parent": "", "children": ["vehicle-iso8855"]},
        "vehicle-iso8855": {"type": "local_cs", "parent": "odom", "children": ["CAM_LEFT"]},
        "CAM_LEFT": {
            "type": "sensor_cs",
            "parent": "vehicle-iso8855",
            "children": [],
            "pose_wrt_parent": {"matrix4x4": down},
        },
    }
    objects = {
        "0": {"name": "oncoming", "type": "Car"},
        "1": {"name": "walker", "type": "Pedestrian"},
        "2": {"name": "", "type": "DontCare"},
        "3": {"name": "Egocar", "type": "Egocar"},
    }
    frames: dict[str, Any] = {}
    for step in range(STEPS):
        at = EGO.at(step)
        pose = [1.0, 0.0, 0.0, at[0], 0.0, 1.0, 0.0, at[1], 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]
        moved = {"src": "vehicle-iso8855", "dst": "odom", "transform_src_to_dst": {"matrix4x4": pose}}
        members: dict[str, Any] = {"3": {}, "2": {"object_data": {"cuboid": [{"name": "", "val": [-1000.0] * 9}]}}}
        for number, actor in enumerate((CAR, WALKER)):
            length, width, height = actor.size
            x, y = (a - b for a, b in zip(actor.at(step), at, strict=True))
            turn = math.atan2(-math.cos(actor.yaw), -math.sin(actor.yaw))
            place = [-y, 1.6 - height / 2, x - 1.5]
            turned = [0.0, math.sin(turn / 2), 0.0, math.cos(turn / 2)] if actor is WALKER else [0.0, turn, 0.0]
            value = [*place, *turned, length, height, width]
            cuboid = {"name": "shape", "val": value, "coordinate_system": "CAM_LEFT"}
            members[str(number)] = {"object_data": {"cuboid": [cuboid]}}
        frames[str(step)] = {
            "objects": members,
            "frame_properties": {"timestamp": f"{step * STEP_S:.1f}", "transforms": {"vehicle_to_odom": moved}},
        }
    content = {
        "openlabel": {
            "metadata": {"schema_version": "1.0.0"},
            "coordinate_systems": systems,
            "objects": objects,
            "frames": frames,
            "frame_intervals": [{"frame_start": 0, "frame_end": STEPS - 1}],
        }
    }
    write(root / "tiny.json", json.dumps(content, separators=(",", ":")))


def interaction(root: Path) -> None:
    """Tracks with a Lanelet2 map; places on the map are metres east and north of latitude and longitude 0."""
    scene = "TINY_Street"
    vehicles = "track_id,frame_id,timestamp_ms,agent_type,x,y,vx,vy,psi_rad,length,width\n"
    people = "track_id,frame_id,timestamp_ms,agent_type,x,y,vx,vy\n"
    for number, actor in enumerate((EGO, CAR), start=1):
        for step in range(STEPS):
            (x, y), (vx, vy), (length, width, _) = actor.at(step), actor.velocity, actor.size
            yaw = f"{actor.yaw:.3f},{length},{width}"
            vehicles += f"{number},{step + 1},{100 * (step + 1)},car,{x:.3f},{y:.3f},{vx},{vy},{yaw}\n"
    for step in range(STEPS):
        (x, y), (vx, vy) = WALKER.at(step), WALKER.velocity
        people += f"P1,{step + 1},{100 * (step + 1)},pedestrian/bicycle,{x:.3f},{y:.3f},{vx},{vy}\n"
    folder = root / "recorded_trackfiles" / scene
    write(folder / "vehicle_tracks_000.csv", vehicles)
    write(folder / "pedestrian_tracks_000.csv", people)
    # Near the origin a metre is nearly the same share of a degree everywhere; the grid of the zone is turned and
    # scaled a little, which is less than the width of a line on a street of 80 m.
    scale = 0.9996 * (1 + (math.radians(3) * 6378137 / 6356752) ** 2 / 2)
    nodes: dict[Point, int] = {}

    def node(place: Point) -> int:
        return nodes.setdefault(place, 1000 + len(nodes))

    ways: dict[frozenset[int], tuple[int, tuple[int, ...]]] = {}
    relations = ""
    for lane in LANES:
        members = ""
        for role, line in (("left", lane.left), ("right", lane.right)):
            ends = tuple(node(place) for place in line)
            # A line that two lanes share is there once, so for one of them it runs the wrong way.
            way, _ = ways.setdefault(frozenset(ends), (2000 + len(ways), ends))
            members += f'<member type="way" ref="{way}" role="{role}"/>'
        tags = "".join(f'<tag k="{k}" v="{v}"/>' for k, v in (("type", "lanelet"), ("subtype", "road")))
        tags += '<tag k="turn_direction" v="straight"/>' if lane.crossing else ""
        relations += f'<relation id="{lane.id}">{members}{tags}</relation>\n'
    text = "<?xml version='1.0' encoding='UTF-8'?>\n<osm version=\"0.6\">\n"
    for (x, y), number in nodes.items():
        latitude = math.degrees(y / scale / 6335439.3)
        longitude = math.degrees(x / scale / 6378137.0)
        text += f'<node id="{number}" lat="{latitude!r}" lon="{longitude!r}"/>\n'
    for number, ends in ways.values():
        text += f'<way id="{number}">' + "".join(f'<nd ref="{end}"/>' for end in ends) + "</way>\n"
    write(root / "maps" / f"{scene}.osm", text + relations + "</osm>\n")


WRITERS: dict[str, Callable[[Path], None]] = {
    "argoverse2_tiny": argoverse2,
    "forecasting_tiny": forecasting,
    "waymo_tiny": waymo,
    "commonroad_tiny": commonroad,
    "kitti_tiny": kitti,
    "openlabel_tiny": openlabel,
    "interaction_tiny": interaction,
}


def main(target: Path = HERE) -> None:
    """Write all folders into a folder."""
    for name, writer in WRITERS.items():
        shutil.rmtree(target / name, ignore_errors=True)
        writer(target / name)


if __name__ == "__main__":
    main()
