"""Waymo Open Motion: `Scenario` messages in TFRecord files, read without TensorFlow.

Conventions of the source: metres in a frame of each scenario, positions of box centres, headings counter-clockwise from
+x, 10 Hz. The ego is the track `sdc_track_index`. Steps at which a track is not valid are zeros: no object there. What
is not read is counted (`specifications/waymo.json`).
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping
from pathlib import Path

from scenicq.errors import DataError
from scenicq.geometry.features import MapFeature
from scenicq.importers.base import ClassNames, ImportOptions, OpenedSource, read_maps
from scenicq.importers.by_file import RecordingFiles, by_file_source, map_sink, missing
from scenicq.importers.fields import InvalidError
from scenicq.importers.layouts import waymo_files
from scenicq.importers.motion import heading_of_yaw
from scenicq.importers.protobuf import Message, parse, to_signed
from scenicq.importers.recording_checks import radians
from scenicq.importers.report import Report
from scenicq.importers.specification import load_specification
from scenicq.importers.tfrecord import read_record, records
from scenicq.importers.waymo_map import LANE_WIDTH_M, scenario_features
from scenicq.store.classes import taxonomy
from scenicq.store.labels import Label, LabelObject, OutOfPlane

__all__ = ["Waymo"]

_KINDS = {1: "vehicle", 2: "pedestrian", 3: "cyclist", 4: "other"}
_REALS = {"x": 2, "y": 3, "z": 4, "length": 5, "width": 6, "height": 7, "heading": 8, "vx": 9, "vy": 10}
_TIMESTAMPS, _TRACKS, _ID, _EGO, _MAP = 1, 2, 5, 6, 8
_AT_TRACK, _AT_STATE = "tracks:2", "tracks:2/states:3"
"""Where their fields stand in the list of the specification."""

_FRAMES = 91
_OBJECT_BYTES = 80


class Waymo:
    """Importer of Waymo Open Motion scenarios."""

    name = "waymo"
    layout = "`*.tfrecord` files, also called `*.tfrecord-00000-of-01000`"

    def recognises(self, path: Path) -> bool:
        """Whether the path is such a file or a folder of them."""
        return bool(waymo_files(path))

    def read(self, path: Path, options: ImportOptions, report: Report) -> OpenedSource:
        """Open files: their scenarios are listed and their maps are read; tracks are read in turn.

        Raises:
            DataError: `file-missing`; with a strict report whatever is unsound.
        """
        files = waymo_files(path)
        if not files:
            raise missing(path, "no `*.tfrecord`")
        maps = read_maps(options.maps, report)
        places: dict[str, RecordingFiles] = {}
        for file in files:
            try:
                _list_scenarios(file, path, maps, places, report)
            except DataError as error:
                for diagnostic in error.diagnostics:
                    report.leave_out("file", diagnostic.code, diagnostic.message)
        return by_file_source(
            f"waymo-{path.resolve().name}",
            maps,
            list(places.values()),
            {**taxonomy("waymo"), **options.class_map},
            _read_scenario,
            frames=_FRAMES * len(places),
            object_bytes=_OBJECT_BYTES,
            facts={
                "lane_width_m": f"nominal, {LANE_WIDTH_M}: the source has centrelines only",
                "intersections": "unions of `interpolating` lanes that touch",
            },
        )


def _list_scenarios(
    file: Path, root: Path, maps: dict[str, tuple[MapFeature, ...]], places: dict[str, RecordingFiles], report: Report
) -> None:
    for offset, content in records(file):
        where = f"{file.name}: the record at byte {offset}"
        try:
            if content is None:
                raise InvalidError("has changed: its checksum is wrong")
            scenario = parse(content)
            name = _text(scenario, _ID)
            if name in places:
                raise InvalidError(f"has the scenario `{name}` again")
        except InvalidError as error:
            hints = () if content is None else _other_messages(content)
            report.leave_out("recording", "record-invalid", f"{where}: {error}", hints=hints)
            continue
        digest = hashlib.blake2b(content, digest_size=16).hexdigest()
        weight = len(content) // _OBJECT_BYTES
        places[name] = RecordingFiles(name, (file,), root, name, (str(offset),), weight, digest)
        if name not in maps:
            sink = map_sink(f"{file.name}: scenario {name}", report)
            maps[name] = scenario_features(scenario.get(_MAP, []), sink, report)
            kinds = {feature.kind for feature in maps[name]}
            if "lane" in kinds and "intersection" not in kinds:
                message = f"{file.name}: scenario {name}: no lane is `interpolating`: its map has no intersection"
                report.assume("map", "no intersections", message)


def _other_messages(content: bytes) -> tuple[str, ...]:
    """What to take instead of records that are messages of another kind: examples, or frames of the perception data."""
    if b"state/current/x" in content or b"roadgraph_samples" in content:
        return ("these are examples for TensorFlow: the folder `scenario` of the same data holds scenarios",)
    return ()


def _read_scenario(place: RecordingFiles, classes: ClassNames, report: Report) -> list[tuple[Label, str]]:
    where = f"{place.files[0].name}: scenario {place.name}"
    try:
        scenario = parse(read_record(place.files[0], int(place.options[0])))
        times = [_real(value) for value in scenario.get(_TIMESTAMPS, [])]
        ego_index = to_signed(scenario.get(_EGO, [-1])[0])
        tracks = scenario.get(_TRACKS, [])
        if not 0 <= ego_index < len(tracks):
            raise InvalidError("`sdc_track_index` names no track")
    except InvalidError as error:
        report.leave_out("recording", "record-invalid", f"{where}: {error}")
        return []
    load_specification("waymo").count_message(scenario, report)
    members: list[dict[int, LabelObject]] = []
    for number, value in enumerate(tracks):
        try:
            if not isinstance(value, memoryview):
                raise InvalidError("it is not a message")
            members.append(_track(parse(value), number == ego_index, classes, report, f"{where}: track {number}"))
        except InvalidError as error:
            report.leave_out("track", "record-invalid", f"{where}: track {number}: {error}")
            members.append({})
    made: list[tuple[Label, str]] = []
    for step, time in enumerate(times):
        ego = members[ego_index].get(step)
        if ego is None:
            report.leave_out("label", "record-invalid", f"{where}: the ego is not valid at step {step}")
            continue
        others = tuple(track[step] for track in members if step in track and track[step] is not ego)
        frame = f"{place.name}/{step}"
        made.append((Label(frame, place.name, round(time * 1e6), place.map, ego, others), where))
    return made


def _track(track: Message, is_ego: bool, classes: ClassNames, report: Report, where: str) -> dict[int, LabelObject]:
    known = load_specification("waymo")
    known.count_message(track, report, _AT_TRACK)
    kind = to_signed(track.get(2, [0])[0])
    name = str(to_signed(track.get(1, [0])[0]))
    source_class = _KINDS.get(kind, "unset")
    found: dict[int, LabelObject] = {}
    for step, value in enumerate(track.get(3, [])):
        try:
            if not isinstance(value, memoryview):
                raise InvalidError("it is not a message")
            state = parse(value)
            known.count_message(state, report, _AT_STATE)
            if state.get(11, [0])[0] != 1:
                continue
            at = {key: _real(state.get(number, [0.0])[0]) for key, number in _REALS.items()}
            if any(at[key] <= 0 for key in ("length", "width", "height")):
                raise InvalidError("its size is not positive")
        except InvalidError as error:
            report.leave_out("object", "record-invalid", f"{where}: step {step}: {error}")
            continue
        radians(at["heading"], report)
        found[step] = _object(name, source_class, is_ego, at, classes)
    return found


def _object(name: str, source_class: str, is_ego: bool, at: Mapping[str, float], classes: ClassNames) -> LabelObject:
    return LabelObject(
        id="ego" if is_ego else name,
        category="Car" if is_ego else classes.category(source_class),
        source_class="sdc" if is_ego else source_class,
        x=at["x"],
        y=at["y"],
        heading=heading_of_yaw(math.remainder(at["heading"], 2 * math.pi)),
        width=at["width"],
        length=at["length"],
        height=at["height"],
        velocity=(at["vx"], at["vy"]),
        track=name,
        out_of_plane=OutOfPlane(at["z"], None, None),
    )


def _real(value: object) -> float:
    if not isinstance(value, float) or not abs(value) < 1e9:
        raise InvalidError("a number is not finite")
    return value


def _text(message: Message, number: int) -> str:
    value = message.get(number, [b""])[0]
    try:
        text = bytes(value).decode() if isinstance(value, memoryview) else ""
    except UnicodeDecodeError as error:
        raise InvalidError("`scenario_id` is not text") from error
    if not text:
        raise InvalidError("`scenario_id` is missing")
    return text
