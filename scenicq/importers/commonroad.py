"""CommonRoad scenarios, XML 2018b and 2020a: a file is a recording with its map.

Conventions of the source: metres, orientations counter-clockwise from +x, times in steps of `timeStepSize`. There is no
ego (a planning problem gives a start, no recorded car): see `ego_choice`. What is not exact is left out. What is not
read is counted (`specifications/commonroad.json`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from xml.etree.ElementTree import Element

from scenicq.geometry.angles import direction
from scenicq.geometry.features import MapFeature, ProblemSink
from scenicq.importers.base import ClassNames, ImportOptions, OpenedSource, read_maps
from scenicq.importers.by_file import RecordingFiles, by_file_source, missing, take_map
from scenicq.importers.commonroad_map import lanelet_features
from scenicq.importers.ego_choice import Moment, ego_facts, with_egos
from scenicq.importers.fields import InvalidError
from scenicq.importers.layouts import commonroad_files
from scenicq.importers.motion import heading_of_yaw
from scenicq.importers.recording_checks import radians
from scenicq.importers.report import Report
from scenicq.importers.specification import load_specification
from scenicq.importers.xml_tree import attribute, number, read_xml
from scenicq.store.classes import taxonomy
from scenicq.store.labels import Label, LabelObject

__all__ = ["CommonRoad"]

_LONGEST_STEPS = 100_000
_FRAMES = 100


class CommonRoad:
    """Importer of CommonRoad scenarios."""

    name = "commonroad"
    layout = "`*.xml` files with a root `commonRoad`"

    def recognises(self, path: Path) -> bool:
        """Whether the path is such a file or a folder of them."""
        return bool(commonroad_files(path))

    def read(self, path: Path, options: ImportOptions, report: Report) -> OpenedSource:
        """Open scenarios: their maps are read here, obstacles in turn.

        Raises:
            DataError: `file-missing`; with a strict report whatever is unsound.
        """
        files = commonroad_files(path)
        if not files:
            raise missing(path, "no `*.xml` with a root `commonRoad`")
        maps = read_maps(options.maps, report)
        for file in files:
            take_map(file.stem, file, _read_map, maps, report)
        choice = () if options.ego is None else (options.ego,)
        return by_file_source(
            f"commonroad-{path.resolve().stem}",
            maps,
            [RecordingFiles(file.stem, (file,), path, file.stem, choice) for file in files],
            {**taxonomy("commonroad"), **options.class_map},
            _read_scenario,
            frames=_FRAMES * len(files),
            object_bytes=500,
            facts={**ego_facts(options.ego), "velocity": "the speed of the source, along the heading"},
        )


def _read_map(file: Path, on_problem: ProblemSink, report: Report) -> tuple[MapFeature, ...]:
    del report  # what the file has is counted when its recording is read
    return lanelet_features(read_xml(file), on_problem)


def _read_scenario(place: RecordingFiles, classes: ClassNames, report: Report) -> list[tuple[Label, str]]:
    file = place.files[0]
    root = read_xml(file)
    load_specification("commonroad").count_xml(root, report)
    step_s = _step(root)
    if step_s is None:
        report.leave_out("recording", "record-invalid", f"{file.name}: `timeStepSize` is not a positive number")
        return []
    moving: dict[int, list[LabelObject]] = {}
    standing: list[LabelObject] = []
    for element in _obstacles(root):
        where = f"{file.name}: obstacle `{element.get('id', '')}`"
        try:
            kind = _type(element)
            name, size = attribute(element, "id"), _size(element)
            states = element.findall("initialState") + element.findall("trajectory/state")
        except InvalidError as error:
            report.leave_out("track", "record-invalid", f"{where}: {error}")
            continue
        if sets := element.findall("occupancySet/occupancy"):
            message = f"{where}: where it may be is known only as {len(sets)} areas; it is in no frame after the first"
            report.leave_out("object", "record-invalid", message)
        for index, state in enumerate(states):
            try:
                member = _object(name, kind, size, state, classes, report)
                if _is_static(element):
                    standing.append(member)
                    break
                moving.setdefault(_time(state, index), []).append(member)
            except InvalidError as error:
                report.leave_out("object", "record-invalid", f"{where}: state {index}: {error}")
    params = _params(root)
    moments = [
        Moment(f"{place.name}/{step}", round(step * step_s * 1e6), (*moving.get(step, ()), *standing), params)
        for step in sorted(moving or ({0: []} if standing else {}))
    ]
    return with_egos(moments, next(iter(place.options), None), place.name, place.map, file.name, report)


def _step(root: Element) -> float | None:
    try:
        step = float(root.get("timeStepSize", ""))
    except ValueError:
        return None
    return step if 0 < step < 1e6 else None


def _obstacles(root: Element) -> Iterator[Element]:
    for name in ("dynamicObstacle", "staticObstacle", "obstacle"):
        yield from root.findall(name)


def _is_static(element: Element) -> bool:
    return element.tag == "staticObstacle" or element.findtext("role") == "static"


def _type(element: Element) -> str:
    kind = (element.findtext("type") or "").strip()
    if not kind:
        raise InvalidError("it has no type")
    return kind


def _size(element: Element) -> tuple[float, float] | None:
    """Width and length; None for shapes that have none."""
    rectangle, circle = element.find("shape/rectangle"), element.find("shape/circle")
    if rectangle is not None:
        size = number(rectangle, "width"), number(rectangle, "length")
    elif circle is not None:
        size = 2 * number(circle, "radius"), 2 * number(circle, "radius")
    else:
        return None
    if min(size) <= 0:
        raise InvalidError("its size is not positive")
    return size


def _time(state: Element, index: int) -> int:
    time = int(number(state, "time", "exact")) if state.find("time") is not None else index
    if not 0 <= time <= _LONGEST_STEPS:
        raise InvalidError(f"time step {time} is out of range")
    return time


def _object(
    name: str, kind: str, size: tuple[float, float] | None, state: Element, classes: ClassNames, report: Report
) -> LabelObject:
    x, y = number(state, "position", "point", "x"), number(state, "position", "point", "y")
    heading = None
    if state.find("orientation/exact") is not None:
        heading = heading_of_yaw(radians(number(state, "orientation", "exact"), report))
    velocity = None
    if heading is not None and state.find("velocity/exact") is not None:
        speed, (ahead_x, ahead_y) = number(state, "velocity", "exact"), direction(heading)
        velocity = (speed * ahead_x, speed * ahead_y)
    return LabelObject(
        id=name,
        category=classes.category(kind),
        source_class=kind,
        x=x,
        y=y,
        heading=heading,
        width=None if size is None else size[0],
        length=None if size is None else size[1],
        velocity=velocity,
        track=name,
    )


def _params(root: Element) -> Mapping[str, str | float | bool]:
    """What a 2020a file says of its surroundings."""
    found: dict[str, str | float | bool] = {}
    for name, path in (("weather", "weather"), ("time_of_day", "timeOfDay"), ("underground", "underground")):
        if text := (root.findtext(f"location/environment/{path}") or "").strip():
            found[name] = text
    return found
