"""What a model has detected, and by which rules its kind of file is evaluated.

Predictions are boxes with a score in the frame of the map. `prediction_files` reads them, `prediction_checks` refuses
what makes no sense, `scenicq.evaluate` compares them with labels.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace

import numpy as np
from numpy.typing import NDArray

__all__ = ["ARGOVERSE2", "NUSCENES", "PLAIN", "THRESHOLDS_M", "Predictions", "Protocol"]

Reals = NDArray[np.float64]

THRESHOLDS_M = (0.5, 1.0, 2.0, 4.0)
"""Centre distances up to which a prediction counts as that of a label object."""


@dataclass(frozen=True, slots=True)
class Protocol:
    """The rules of a benchmark's own evaluation, as far as they can be followed in the plane.

    Attributes:
        name: What messages call it.
        classes: The class that is evaluated for each class of the source; None for the source's own classes, or those
            of the class tree where `tree` is set.
        tree: Whether classes are those of the class tree.
        ranges_m: Distance from the ego up to which each class is evaluated; `range_m` for the others.
        range_m: The same for classes without a range of their own.
        points: Attributes that count the points in a label object's box; those without any point are left out.
        racks: Class of the source that marks places where none of `racked` is evaluated.
        racked: Classes that are not evaluated inside a rack.
        most: Predictions of a frame that count, those with the highest scores; of each class if `most_of_class`.
        most_of_class: See `most`.
        nearest_only: Whether a prediction can only be that of the nearest label object, even if another prediction is
            that one's already.
        clipped: Whether precision and recall below 10 % do not count in the average precision, and errors are averaged
            over recall; else precision is made monotone, and errors are averaged over what was found.
        hull: Whether the scale error takes the box around two aligned boxes for their union.
        half_turn: Classes whose two directions are the same.
        no_orientation, no_velocity: Classes for which these errors mean nothing.
        last_first: Whether of boxes with one score the later one comes first.
        velocity: Whether velocities are predicted.
        attributes: Groups of attributes, of which an object has one, that are predicted: `vehicle.parked`.
        no_attribute: Classes for which that error means nothing.
        attribute_names: The attributes that the benchmark knows; any where it names none.
        spatial: Whether distances are those in space, not in the plane.
        roi_m: Metres from the drivable area up to which a corner of a box must lie for it to be evaluated, where the
            map has such an area.
        scored: Classes over which the benchmark's own means go, with label objects or without; none where no benchmark
            is meant.
        measure: What the benchmark calls its score.
        largest_errors: The error of a class of which nothing was found, by the name of the error, for those that count.
    """

    name: str
    classes: Mapping[str, str] | None = None
    tree: bool = False
    ranges_m: Mapping[str, float] = field(default_factory=dict[str, float])
    range_m: float = math.inf
    points: tuple[str, ...] = ()
    racks: str = ""
    racked: frozenset[str] = frozenset()
    most: int = 0
    most_of_class: bool = False
    nearest_only: bool = False
    clipped: bool = True
    hull: bool = False
    half_turn: frozenset[str] = frozenset()
    no_orientation: frozenset[str] = frozenset()
    no_velocity: frozenset[str] = frozenset()
    last_first: bool = True
    velocity: bool = True
    attributes: tuple[str, ...] = ()
    no_attribute: frozenset[str] = frozenset()
    attribute_names: frozenset[str] = frozenset()
    spatial: bool = False
    roi_m: float = math.inf
    scored: tuple[str, ...] = ()
    measure: str = ""
    largest_errors: Mapping[str, float] = field(default_factory=dict[str, float])

    def has_error(self, name: str, category: str) -> bool:
        """Whether an error, by its name, means something for a class."""
        silent = {
            "orientation": self.no_orientation, "velocity": self.no_velocity, "attribute": self.no_attribute,
        }  # fmt: skip
        return category not in silent.get(name, ()) and (name != "velocity" or self.velocity)


_NUSCENES_CLASSES = {
    "human.pedestrian.adult": "pedestrian",
    "human.pedestrian.child": "pedestrian",
    "human.pedestrian.construction_worker": "pedestrian",
    "human.pedestrian.police_officer": "pedestrian",
    "movable_object.barrier": "barrier",
    "movable_object.trafficcone": "traffic_cone",
    "vehicle.bicycle": "bicycle",
    "vehicle.bus.bendy": "bus",
    "vehicle.bus.rigid": "bus",
    "vehicle.car": "car",
    "vehicle.construction": "construction_vehicle",
    "vehicle.motorcycle": "motorcycle",
    "vehicle.trailer": "trailer",
    "vehicle.truck": "truck",
}
"""The class that nuScenes evaluates for each class of its labels."""

NUSCENES = Protocol(
    "nuscenes",
    classes=_NUSCENES_CLASSES,
    ranges_m={"pedestrian": 40, "motorcycle": 40, "bicycle": 40, "traffic_cone": 30, "barrier": 30},
    range_m=50,
    points=("num_lidar_pts", "num_radar_pts"),
    racks="static_object.bicycle_rack",
    racked=frozenset({"bicycle", "motorcycle"}),
    most=500,
    half_turn=frozenset({"barrier"}),
    no_orientation=frozenset({"traffic_cone"}),
    no_velocity=frozenset({"traffic_cone", "barrier"}),
    attributes=("cycle", "pedestrian", "vehicle"),
    no_attribute=frozenset({"traffic_cone", "barrier"}),
    attribute_names=frozenset({
        "cycle.with_rider", "cycle.without_rider", "pedestrian.moving", "pedestrian.sitting_lying_down",
        "pedestrian.standing", "vehicle.moving", "vehicle.parked", "vehicle.stopped",
    }),
    scored=tuple(sorted(set(_NUSCENES_CLASSES.values()))),
    measure="NDS",
    largest_errors=dict.fromkeys(("translation", "scale", "orientation", "velocity", "attribute"), 1.0),
)  # fmt: skip
"""The nuScenes detection task (configuration `detection_cvpr_2019`)."""

ARGOVERSE2 = Protocol(
    "argoverse2",
    range_m=150,
    points=("num_interior_pts",),
    most=100,
    most_of_class=True,
    nearest_only=True,
    clipped=False,
    hull=True,
    last_first=False,
    velocity=False,
    spatial=True,
    roi_m=5.0,
    scored=(
        "ARTICULATED_BUS", "BICYCLE", "BICYCLIST", "BOLLARD", "BOX_TRUCK", "BUS", "CONSTRUCTION_BARREL",
        "CONSTRUCTION_CONE", "DOG", "LARGE_VEHICLE", "MESSAGE_BOARD_TRAILER", "MOBILE_PEDESTRIAN_CROSSING_SIGN",
        "MOTORCYCLE", "MOTORCYCLIST", "PEDESTRIAN", "REGULAR_VEHICLE", "SCHOOL_BUS", "SIGN", "STOP_SIGN", "STROLLER",
        "TRUCK", "TRUCK_CAB", "VEHICULAR_TRAILER", "WHEELCHAIR", "WHEELED_DEVICE", "WHEELED_RIDER",
    ),
    measure="CDS",
    largest_errors={"translation": 2.0, "scale": 1.0, "orientation": math.pi},
)  # fmt: skip
"""The Argoverse 2 detection task."""

PLAIN = Protocol("interchange", tree=True)
"""Predictions in the interchange format: everything counts, classes are those of the class tree."""


@dataclass(frozen=True, slots=True, eq=False)
class Predictions:
    """Detected boxes, in the order of their file.

    Attributes:
        name: Name of the file.
        protocol: The rules that go with the format.
        frames: Names of the frames that the file speaks of, those without any box too.
        frame: Number of the frame of each box, shape (n,).
        classes: Names of the classes.
        category: Number of the class of each box, shape (n,).
        x, y: Centres in metres, shape (n,); in the frame of the map unless `of_ego`.
        heading: Radians, 0 along +y, counter-clockwise; shape (n,).
        width, length, height: Metres, shape (n,); a height of nan is not known.
        vx, vy: Metres per second, shape (n,); nan where unknown.
        score: Confidence, shape (n,).
        z: Height of the centre, metres, shape (n,); nan where unknown.
        attributes: Names of attributes that are predicted.
        attribute: Number of the attribute of each box, -1 without, shape (n,).
        of_ego: Whether boxes lie in the ego's own frame: x ahead, y to the left, z up, from the middle of the rear
            axle, and `heading` counts from the ego's.
        has_meta: Whether the file says what the benchmark wants to know of the model, where it wants to.
    """

    name: str
    protocol: Protocol
    frames: list[str]
    frame: NDArray[np.int32]
    classes: list[str]
    category: NDArray[np.int32]
    x: Reals
    y: Reals
    heading: Reals
    width: Reals
    length: Reals
    height: Reals
    vx: Reals
    vy: Reals
    score: Reals
    z: Reals
    attributes: list[str]
    attribute: NDArray[np.int8]
    of_ego: bool = False
    has_meta: bool = True

    def taken(self, which: NDArray[np.bool_] | NDArray[np.int64]) -> Predictions:
        """Some of the boxes.

        Args:
            which: Whether to take each, or the numbers of those to take.
        """
        columns = {each.name: getattr(self, each.name) for each in fields(self)}
        return replace(self, **{name: of[which] for name, of in columns.items() if isinstance(of, np.ndarray)})
