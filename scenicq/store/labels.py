"""A label as the matcher sees it: plain values, no files.

Units: metres, radians, seconds; positions in the frame of the label's map; heading 0 along +y, counter-clockwise.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from scenicq.geometry.camera import Camera

if TYPE_CHECKING:
    from scenicq.store.recorded_tracks import RecordedTracks

__all__ = ["Label", "LabelObject", "Motion", "OutOfPlane", "Recording"]


@dataclass(frozen=True, slots=True)
class Motion:
    """What the store knows of a label object's motion; None where nothing is observed.

    Attributes:
        velocity: (vx, vy) in metres per second, map frame: the label's own, else that of its track.
        acceleration: Along the heading, metres per second squared; of the track.
        yaw_rate: Radians per second, counter-clockwise; of the track.
        derived: Whether the velocity is the track's.
    """

    velocity: tuple[float, float] | None
    acceleration: float | None
    yaw_rate: float | None
    derived: bool


@dataclass(frozen=True, slots=True)
class OutOfPlane:
    """How an object lies in space, beyond what the map's plane shows; None where it is not known.

    Attributes:
        z: Height of the centre of the box, metres, map frame; of the ego that of the point by which its source places
            it, such as the rear axle.
        pitch: Radians about the axis to the left, positive with the front down.
        roll: Radians about the axis ahead, positive with the left side up.
    """

    z: float | None = None
    pitch: float | None = None
    roll: float | None = None


@dataclass(frozen=True, slots=True)
class LabelObject:
    """One annotated object of a label.

    A property that the source does not have is None: it is unobserved, never invented.

    Attributes:
        id: The source's own identifier, unique within the label; "ego" for the ego.
        category: The class of the class tree (`scenicq.store.classes`), such as "Car".
        source_class: What the source calls the class, verbatim.
        x, y: Position of the centre, metres, map frame.
        heading: Radians in (-pi, pi], 0 along +y, counter-clockwise; None if unknown.
        width, length, height: Extents, metres.
        velocity: (vx, vy) in metres per second, map frame.
        track: Identifier of the same physical object along the recording.
        attributes: Everything else that the source says of the object.
        motion: What the store has computed of its track; None for what was not read from a store. It is no part of the
            label, and does not count where labels are compared.
        out_of_plane: Height and tilt; None where nothing of them is known, or was read.
        last_lane: The number of the last lane of its track among the map's elements, where that tells more of its lanes
            than its heading does (`scenicq.store.last_lanes`); computed as the motion is.
        on_ego_course: Between which ends it is along and beside the ego's course (`scenicq.store.ego_courses`): low,
            high, right, left; None for what was not read from a store, or what nobody asks for.
    """

    id: str
    category: str
    source_class: str
    x: float
    y: float
    heading: float | None = None
    width: float | None = None
    length: float | None = None
    height: float | None = None
    velocity: tuple[float, float] | None = None
    track: str | None = None
    attributes: Mapping[str, str | float | bool] = field(default_factory=dict[str, str | float | bool])
    motion: Motion | None = field(default=None, compare=False)
    out_of_plane: OutOfPlane | None = None
    last_lane: float | None = field(default=None, compare=False)
    on_ego_course: tuple[float, float, float, float] | None = field(default=None, compare=False)


@dataclass(frozen=True, slots=True)
class Label:
    """The annotated scene of one frame.

    Attributes:
        frame: Identifier of the frame, the source's own, unique in the dataset.
        recording: The series of labels that the frame belongs to.
        timestamp_us: Microseconds.
        map: Name of the map in the dataset.
        ego: The vehicle that records. Where a source has none it is only a point to look from, without a class: it
            plays no role; see `has_ego`.
        objects: The other annotated objects, in the order of the source.
        params: Global parameters (weather, time of day ...).
        sensors: Path of the sensor file of each channel, as the source gives it.
        cameras: Where the camera was and how it sees, of those channels for which the source says it.
        recorded: What has the tracks of its recording; None for what was not read from a store. It is no part of the
            label, and does not count where labels are compared.
    """

    frame: str
    recording: str
    timestamp_us: int
    map: str
    ego: LabelObject
    objects: tuple[LabelObject, ...] = ()
    params: Mapping[str, str | float | bool] = field(default_factory=dict[str, str | float | bool])
    sensors: Mapping[str, str] = field(default_factory=dict[str, str])
    cameras: Mapping[str, Camera] = field(default_factory=dict[str, Camera])
    recorded: RecordedTracks | None = field(default=None, compare=False, repr=False)

    @property
    def has_ego(self) -> bool:
        """Whether the source has an ego in this frame."""
        return self.ego.category != ""


@dataclass(frozen=True, slots=True)
class Recording:
    """A series of labels with one ego and one map.

    Attributes:
        name: Unique in the dataset.
        map: Name of the map that all its labels refer to.
        labels: In order of time, then of frame.
    """

    name: str
    map: str
    labels: tuple[Label, ...]
