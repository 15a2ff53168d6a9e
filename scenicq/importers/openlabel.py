"""ASAM OpenLABEL 1.0 JSON with cuboids: a file is a recording, a frame of it a label. There is no map.

Files of one frame each that lie in one folder are one recording, in order of their times. A cuboid lies in its own
coordinate system, or else in its object's (`openlabel_systems`). Data of an object that no frame gives hold for all
frames of the object. The map frame is the system without a parent. The ego is an object that is called so, with its
box, or else a system of a vehicle, at its origin; files that have neither have no ego: see `ego_choice`. What is not
read is counted (`specifications/openlabel.json`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from scenicq.errors import DataError, Diagnostic
from scenicq.importers import fields
from scenicq.importers.base import ClassNames, ImportOptions, OpenedSource, read_maps
from scenicq.importers.by_file import RecordingFiles, by_file_source, missing
from scenicq.importers.ego_choice import Moment, ego_facts, with_egos
from scenicq.importers.fields import NO_MAP, InvalidError, Record
from scenicq.importers.layouts import openlabel_files
from scenicq.importers.openlabel_objects import FrameContext, objects_of
from scenicq.importers.openlabel_systems import CoordinateSystems, first_vehicle
from scenicq.importers.recording_checks import check_order
from scenicq.importers.report import Report
from scenicq.importers.specification import load_specification
from scenicq.importers.timestamps import microseconds
from scenicq.store.classes import taxonomy
from scenicq.store.labels import Label, LabelObject

__all__ = ["OpenLabel"]

_STEP_US = 100_000
_LARGEST_BYTES = 1 << 30
_LARGEST_OF_ONE_FRAME = 16 << 20


class OpenLabel:
    """Importer of ASAM OpenLABEL."""

    name = "openlabel"
    layout = "`*.json` files that begin with `openlabel`"

    def recognises(self, path: Path) -> bool:
        """Whether the path is such a file or a folder of them."""
        return bool(openlabel_files(path))

    def read(self, path: Path, options: ImportOptions, report: Report) -> OpenedSource:
        """Open files.

        Raises:
            DataError: `file-missing`; with a strict report whatever is unsound.
        """
        files = openlabel_files(path)
        if not files:
            raise missing(path, "no `*.json` of OpenLABEL")
        maps = read_maps(options.maps, report)
        choice = () if options.ego is None else (options.ego,)
        map_name = next(iter(maps), NO_MAP)
        if len(files) > 1 and all(_has_one_frame(file) for file in files):
            places = [RecordingFiles(path.resolve().stem, tuple(files), path, map_name, choice)]
        else:
            places = [RecordingFiles(file.stem, (file,), path, map_name, choice) for file in files]
        return by_file_source(
            f"openlabel-{path.resolve().stem}",
            maps,
            places,
            {**taxonomy("scenic"), **taxonomy("openlabel"), **options.class_map},
            _read_recording,
            frames=0,
            object_bytes=400,
            facts={
                **{key: f"{value}, where a file has none" for key, value in ego_facts(options.ego).items()},
                "ego_by_system": "an object that is called so, else the origin of a vehicle's coordinate system",
                "time": "of the frame, else of its streams, else steps of 0.1 s",
            },
        )


def _has_one_frame(file: Path) -> bool:
    try:
        if file.stat().st_size > _LARGEST_OF_ONE_FRAME:
            return False
        return len(_frames_of(_content(file))) == 1
    except DataError:
        return False


def _content(file: Path) -> Record:
    try:
        if file.stat().st_size > _LARGEST_BYTES:
            raise InvalidError("it is too large")
        whole = fields.record(fields.parse_json(file.read_bytes()), "the file")
        content = fields.record(whole.get("openlabel"), "`openlabel`")
        fields.optional_record(content, "coordinate_systems")
        _frames_of(content)
    except OSError as error:
        raise DataError(Diagnostic("file-missing", f"{file} cannot be read: {error.strerror}")) from error
    except InvalidError as error:
        raise DataError(Diagnostic("file-invalid", f"{file}: {error}")) from error
    return content


def _frames_of(content: Record) -> Record:
    """The frames; a file without any whose objects have data of their own is one.

    Raises:
        InvalidError: There is neither.
    """
    if frames := fields.optional_record(content, "frames"):
        return frames
    objects = fields.optional_record(content, "objects").values()
    if not any(fields.optional_record(fields.record(each, "an object"), "object_data") for each in objects):
        raise InvalidError("it has no frames")
    return {"0": {}}


@dataclass(frozen=True, slots=True)
class _Frame:
    """A frame of a file.

    Attributes:
        name: Unique in the recording.
        number: Its key.
        time: Microseconds; None where nothing says so.
    """

    name: str
    number: int
    time: int | None
    objects: tuple[LabelObject, ...]
    ego: LabelObject | None
    where: str


def _read_recording(place: RecordingFiles, classes: ClassNames, report: Report) -> list[tuple[Label, str]]:
    frames: list[_Frame] = []
    for file in place.files:
        content = _content(file)
        load_specification("openlabel").count_json(content, report)
        prefix = place.name if len(place.files) == 1 else f"{place.name}/{file.stem}"
        frames += _read_frames(content, file.name, prefix, classes, report)
    timed = _timed(frames, len(place.files) > 1, place.files[0].name, report)
    made: list[tuple[Label, str]] = []
    lacking: list[Moment] = []
    for frame, time in timed:
        if frame.ego is None:
            lacking.append(Moment(frame.name, time, frame.objects))
        else:
            made.append((Label(frame.name, place.name, time, place.map, frame.ego, frame.objects), frame.where))
    choice = next(iter(place.options), None)
    file_name = place.files[0].name
    if lacking:
        made += with_egos(lacking, choice, place.name, place.map, file_name, report)
    return sorted(made, key=lambda each: each[0].timestamp_us)


def _read_frames(content: Record, file: str, prefix: str, classes: ClassNames, report: Report) -> Iterator[_Frame]:
    systems = fields.optional_record(content, "coordinate_systems")
    vehicle = first_vehicle(systems)
    frames = _frames_of(content)
    moved = vehicle is None or len(frames) < 2
    for key in sorted(frames, key=lambda key: (len(key), key)):
        where = f"{file}: frame `{key}`"
        try:
            if not (key.isascii() and key.isdigit() and len(key) < 10):
                raise InvalidError("its key is not a number")
            frame = fields.record(frames[key], "it")
            properties = fields.optional_record(frame, "frame_properties")
            at_frame = CoordinateSystems(systems, fields.optional_record(properties, "transforms"))
            report.count_unread("frames/*/frame_properties/transforms/* of no coordinate system", len(at_frame.unknown))
            boxes = FrameContext(at_frame, classes, report, where)
            members = objects_of(content, frame, int(key), boxes)
            time = _time(properties)
            ego = next((each for each in members if each.id == "ego"), None)
            if ego is None and vehicle is not None:
                pose = at_frame.pose(vehicle)
                ego = LabelObject("ego", "Car", "", pose.origin[0], pose.origin[1], pose.heading)
            moved = moved or vehicle in at_frame.used
        except InvalidError as error:
            report.leave_out("label", "record-invalid", f"{where}: {error}")
            continue
        others = tuple(each for each in members if each.id != "ego")
        yield _Frame(f"{prefix}/{key}", int(key), time, others, ego, where)
    if not moved:
        message = f"{file}: no frame says where `{vehicle}` is; what is given in it seems to move as the ego does"
        report.assume("recording", "an ego at rest", message)


def _timed(frames: Sequence[_Frame], by_file: bool, file: str, report: Report) -> list[tuple[_Frame, int]]:
    """The frames with their times, in order; one without a time among others that have one is left out."""
    if all(frame.time is None for frame in frames):
        message = f"{file}: no frame has a time; frames are taken to be 0.1 s apart"
        if len(frames) > 1:
            report.assume("recording", "steps of 0.1 s", message)
        return [(frame, (place if by_file else frame.number) * _STEP_US) for place, frame in enumerate(frames)]
    timed: list[tuple[_Frame, int]] = []
    for frame in frames:
        if frame.time is None:
            report.leave_out("label", "record-invalid", f"{frame.where}: it has no time, as others have")
        else:
            timed.append((frame, frame.time))
    check_order(file, [time for _, time in timed], report, numbered=True)
    return sorted(timed, key=lambda each: each[1])


def _time(properties: Record) -> int | None:
    """Microseconds of a frame: its own, or else of the first of its streams that has a time."""
    if properties.get("timestamp") is not None:
        return microseconds(properties["timestamp"], "timestamp")
    streams = fields.optional_record(properties, "streams")
    for name in sorted(streams):
        stream = fields.optional_record(fields.record(streams[name], f"stream `{name}`"), "stream_properties")
        sync = fields.optional_record(stream, "sync")
        if sync.get("timestamp") is not None:
            return microseconds(sync["timestamp"], f"sync/timestamp of stream {name}")
    return None
