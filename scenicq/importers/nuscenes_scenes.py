"""Scenes of nuScenes, joined: what belongs to each, and the recordings that they become."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from scenicq.geometry.camera import Camera
from scenicq.importers.base import ClassNames, LabelChecker
from scenicq.importers.nuscenes_boxes import Boxes
from scenicq.importers.report import Report
from scenicq.store.columns import MemberColumns, RecordingColumns, to_json

__all__ = [
    "AXLE_TO_CENTRE_M",
    "EGO_SIZE_M",
    "LONGEST_STEP_US",
    "POSE_CHANNEL",
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
"""The sensor whose ego pose is that of the sample; without it, it is that of the key frame nearest in time."""


@dataclass(frozen=True, slots=True)
class Instant:
    """A sample with all that belongs to it.

    Attributes:
        place: File and line, for messages.
        pose: x, y, heading and z of the ego.
        sensors: Channel, file and camera, in order of the channels.
        boxes: How many of the scene's boxes are its.
    """

    token: str
    time: int
    place: str
    pose: tuple[float, float, float, float] | None
    sensors: tuple[tuple[str, str, Camera | None], ...]
    boxes: int


@dataclass(frozen=True, slots=True, eq=False)
class SceneContent:
    """A scene with all that belongs to it.

    Attributes:
        ahead_s: How far the local clock is ahead of UTC, seconds; None if unknown.
        instants: In order of time.
        boxes: Boxes of one instant after the other, with the numbers that tracks have in `tracks`.
        tracks: Token and class name of each track.
    """

    name: str
    location: str
    ahead_s: int | None
    params: tuple[tuple[str, str | float | bool], ...]
    instants: tuple[Instant, ...]
    boxes: Boxes
    tracks: tuple[tuple[str, str], ...]

    @property
    def weight(self) -> int:
        """How many label objects there are."""
        return len(self.boxes.tokens)

    def digest(self) -> str:
        """Changes with anything of the scene."""
        instants = [(i.token, i.time, i.place, i.pose, i.sensors, i.boxes) for i in self.instants]
        texts = [self.name, self.location, self.ahead_s, self.params, instants, self.tracks]
        digest = hashlib.blake2b(
            json.dumps([*texts, self.boxes.tokens, self.boxes.attributes]).encode(), digest_size=16
        )
        digest.update(self.boxes.tracks.tobytes())
        digest.update(self.boxes.values.tobytes())
        return digest.hexdigest()


@dataclass(frozen=True, slots=True)
class SceneReader:
    """Reads some scenes, which it holds.

    Attributes:
        scenes: In order of their names.
        classes: Class of the tree for each class name.
    """

    scenes: tuple[SceneContent, ...] = field(repr=False)
    classes: Mapping[str, str]

    def recordings(self, labels: LabelChecker, report: Report) -> Iterator[RecordingColumns]:
        """The recordings in order of their names."""
        classes = ClassNames(self.classes, report)
        for scene in self.scenes:
            for instant in scene.instants:
                if instant.pose is None:
                    message = f"{instant.place}: sample `{instant.token}` has no sound ego pose"
                    report.leave_out("label", "record-invalid", message)
            places = [instant.place for instant in scene.instants if instant.pose is not None]
            if (found := labels.check_columns(_columns(scene, classes), places)) is not None:
                yield found


def _columns(scene: SceneContent, classes: ClassNames) -> RecordingColumns:
    """The columns of the instants that have a pose."""
    posed = [(instant, instant.pose) for instant in scene.instants if instant.pose is not None]
    boxes = scene.boxes
    if len(posed) < len(scene.instants):
        has_pose = np.repeat([i.pose is not None for i in scene.instants], [i.boxes for i in scene.instants])
        boxes = boxes.take(np.flatnonzero(has_pose))
    counts = np.array([instant.boxes for instant, _ in posed], dtype=np.int64)
    # whole numbers of any size where 64 bits might not hold a difference
    times = [instant.time for instant, _ in posed]
    moments = np.array(times, dtype=np.int64 if max(map(abs, times), default=0) < 1 << 62 else object)
    params = dict(scene.params)
    clocks = [{} if scene.ahead_s is None else {"time": _minutes(time, scene.ahead_s)} for time in times]
    return RecordingColumns(
        name=scene.name,
        map=scene.location,
        frames=[instant.token for instant, _ in posed],
        times_us=times,
        params=[to_json(params | clock) for clock in clocks],
        egos=_egos(moments, [pose for _, pose in posed]),
        objects=_objects(scene, classes, boxes, np.repeat(moments, counts)),
        object_counts=counts,
        sensor_counts=np.array([len(instant.sensors) for instant, _ in posed], dtype=np.int64),
        channels=[channel for instant, _ in posed for channel, _, _ in instant.sensors],
        paths=[path for instant, _ in posed for _, path, _ in instant.sensors],
        cameras=[camera for instant, _ in posed for *_, camera in instant.sensors],
    )


def _egos(times: NDArray[np.int64], poses: Sequence[tuple[float, float, float, float]]) -> MemberColumns:
    n = len(poses)
    centres = [(x - AXLE_TO_CENTRE_M * math.sin(h), y + AXLE_TO_CENTRE_M * math.cos(h)) for x, y, h, _ in poses]
    xy = np.array(centres, dtype=np.float64).reshape(-1, 2)
    velocity = _velocities(np.zeros(n, dtype=np.int64), times, xy)
    width, length, height = EGO_SIZE_M
    return MemberColumns(
        id=["ego"] * n,
        category=["Car"] * n,
        source_class=["vehicle.ego"] * n,
        x=xy[:, 0],
        y=xy[:, 1],
        heading=np.array([heading for _, _, heading, _ in poses], dtype=np.float64),
        width=np.full(n, width),
        length=np.full(n, length),
        height=np.full(n, height),
        vx=velocity[:, 0],
        vy=velocity[:, 1],
        track=[None] * n,
        attributes=[None] * n,
        z=np.array([z for *_, z in poses], dtype=np.float64),
    )


def _objects(scene: SceneContent, classes: ClassNames, boxes: Boxes, times: NDArray[np.int64]) -> MemberColumns:
    tracks: list[int] = boxes.tracks.tolist()
    names = [scene.tracks[track][1] for track in tracks]
    velocity = _velocities(boxes.tracks, times, boxes.values[:, :2])
    x, y, heading, width, length, height, z = boxes.values.T
    return MemberColumns(
        id=boxes.tokens,
        category=[classes.known.get(name) or classes.category(name) for name in names],
        source_class=names,
        x=x,
        y=y,
        heading=heading,
        width=width,
        length=length,
        height=height,
        vx=velocity[:, 0],
        vy=velocity[:, 1],
        track=[scene.tracks[track][0] for track in tracks],
        attributes=boxes.attributes,
        z=z,
    )


def _minutes(time_us: int, ahead_s: int) -> float:
    """Minutes since midnight on a local clock, as scenarios count the time of day."""
    return (time_us + ahead_s * 1_000_000) % 86_400_000_000 / 60e6


def _velocities(tracks: NDArray[np.int64], times: NDArray[np.int64], xy: NDArray[np.float64]) -> NDArray[np.float64]:
    """Central differences, at the ends of a track one-sided; nan where there is no neighbour close enough in time.

    Args:
        tracks: Number of the track of each position, shape (n,).
        times: Time of each position, microseconds, in order.
        xy: Positions, shape (n, 2).
    """
    order = np.argsort(tracks, kind="stable")
    tracks, times, xy = tracks[order], times[order], xy[order]
    joins = (np.diff(tracks) == 0) & (np.diff(times) <= LONGEST_STEP_US).astype(bool)
    here = np.arange(len(tracks))
    before, after = here - np.append(False, joins)[: len(here)], here + np.append(joins, False)[: len(here)]
    seconds = ((times[after] - times[before]) / 1e6).astype(np.float64)
    found = np.full(xy.shape, math.nan)
    moves = seconds > 0
    found[order[moves]] = (xy[after[moves]] - xy[before[moves]]) / seconds[moves, None]
    return found
