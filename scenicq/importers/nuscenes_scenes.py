"""Scenes of nuScenes, joined: what belongs to each, and the labels that it becomes."""

from __future__ import annotations

import hashlib
import math
from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from scenicq.importers.base import ClassNames, Labels
from scenicq.importers.report import Report
from scenicq.store.labels import Label, LabelObject, Recording

__all__ = [
    "AXLE_TO_CENTRE_M",
    "EGO_SIZE_M",
    "LONGEST_STEP_US",
    "POSE_CHANNEL",
    "Box",
    "Instant",
    "SceneContent",
    "SceneReader",
]

EGO_SIZE_M = (1.730, 4.084, 1.562)
"""Width, length and height of the recording car, a Renault Zoe."""

AXLE_TO_CENTRE_M = 1.0
"""How far the centre of the ego's box lies ahead of its rear axle."""

LONGEST_STEP_US = 1_500_000
"""Over longer gaps than this a difference of positions says little about velocity."""

POSE_CHANNEL = "LIDAR_TOP"
"""The sensor whose ego pose is that of the sample."""


@dataclass(frozen=True, slots=True)
class Box:
    """An annotation: position, heading, size; what it belongs to."""

    token: str
    track: str
    x: float
    y: float
    heading: float
    size: tuple[float, ...]
    attributes: Mapping[str, str | float | bool]


@dataclass(frozen=True, slots=True)
class Instant:
    """A sample with all that belongs to it; `pose` is that of the ego: x, y, heading."""

    token: str
    time: int
    place: str
    pose: tuple[float, float, float] | None
    sensors: tuple[tuple[str, str], ...]
    boxes: tuple[Box, ...]


@dataclass(frozen=True, slots=True)
class SceneContent:
    """A scene with all that belongs to it.

    Attributes:
        ahead_s: How far the local clock is ahead of UTC, seconds; None if unknown.
        instants: In order of time.
        classes: Class name of each track.
    """

    name: str
    location: str
    ahead_s: int | None
    params: tuple[tuple[str, str | float | bool], ...]
    instants: tuple[Instant, ...]
    classes: tuple[tuple[str, str], ...]

    @property
    def weight(self) -> int:
        """How many label objects there are."""
        return sum(len(instant.boxes) for instant in self.instants)

    def digest(self) -> str:
        """Changes with anything of the scene."""
        return hashlib.blake2b(repr(self).encode(errors="backslashreplace"), digest_size=16).hexdigest()


@dataclass(frozen=True, slots=True)
class SceneReader:
    """Reads some scenes, which it holds.

    Attributes:
        scenes: In order of their names.
        classes: Class of the tree for each class name.
    """

    scenes: tuple[SceneContent, ...] = field(repr=False)
    classes: Mapping[str, str]

    def recordings(self, labels: Labels, report: Report) -> Iterator[Recording]:
        """The recordings in order of their names."""
        classes = ClassNames(self.classes, report)
        for scene in self.scenes:
            for instant in scene.instants:
                if instant.pose is None:
                    message = f"{instant.place}: sample `{instant.token}` has no sound {POSE_CHANNEL} pose"
                    report.left_out("label", "record-invalid", message)
            found = labels.recording(scene.name, list(_labels(scene, classes)))
            if found is not None:
                yield found


def _labels(scene: SceneContent, classes: ClassNames) -> Iterator[tuple[Label, str]]:
    posed = [(instant, instant.pose) for instant in scene.instants if instant.pose is not None]
    centres = [
        (instant.time, x - AXLE_TO_CENTRE_M * math.sin(heading), y + AXLE_TO_CENTRE_M * math.cos(heading))
        for instant, (x, y, heading) in posed
    ]
    tracks: defaultdict[str, list[tuple[int, float, float]]] = defaultdict(list)
    step: dict[str, int] = {}
    for instant, _ in posed:
        for box in instant.boxes:
            step[box.token] = len(tracks[box.track])
            tracks[box.track].append((instant.time, box.x, box.y))
    width, length, height = EGO_SIZE_M
    names, params = dict(scene.classes), dict(scene.params)
    for number, (instant, pose) in enumerate(posed):
        _, x, y = centres[number]
        ego = LabelObject(
            id="ego",
            category="Car",
            source_class="vehicle.ego",
            x=x,
            y=y,
            heading=pose[2],
            width=width,
            length=length,
            height=height,
            velocity=_velocity(centres, number),
        )
        objects = tuple(
            LabelObject(
                id=box.token,
                category=classes.category(names[box.track]),
                source_class=names[box.track],
                x=box.x,
                y=box.y,
                heading=box.heading,
                width=box.size[0],
                length=box.size[1],
                height=box.size[2],
                velocity=_velocity(tracks[box.track], step[box.token]),
                track=box.track,
                attributes=box.attributes,
            )
            for box in instant.boxes
        )
        sensors = dict(instant.sensors)
        told = params if scene.ahead_s is None else params | {"time": _minutes(instant.time, scene.ahead_s)}
        label = Label(instant.token, scene.name, instant.time, scene.location, ego, objects, told, sensors)
        yield label, instant.place


def _minutes(time_us: int, ahead_s: int) -> float:
    """Minutes since midnight on a local clock, as scenarios count the time of day."""
    return (time_us + ahead_s * 1_000_000) % 86_400_000_000 / 60e6


def _velocity(track: list[tuple[int, float, float]], step: int) -> tuple[float, float] | None:
    """Central difference, at the ends of a track one-sided; None where there is no neighbour close enough in time."""
    here = track[step]
    before = track[step - 1] if step > 0 and here[0] - track[step - 1][0] <= LONGEST_STEP_US else here
    after = track[step + 1] if step + 1 < len(track) and track[step + 1][0] - here[0] <= LONGEST_STEP_US else here
    seconds = (after[0] - before[0]) / 1e6
    return None if seconds <= 0 else ((after[1] - before[1]) / seconds, (after[2] - before[2]) / seconds)
