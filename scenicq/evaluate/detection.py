"""Join predictions with the labels of a dataset: what counts by the benchmark's rules, and what was found."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from scenicq.errors import DataError, Diagnostic
from scenicq.evaluate.annotations import Annotations, Frames, read_annotations
from scenicq.evaluate.assignment import Centres, assign, find_pairs
from scenicq.evaluate.ego_poses import EgoPoses
from scenicq.evaluate.frame_of_reference import check_distance, check_fit
from scenicq.evaluate.precision import ERRORS, Errors, box_errors
from scenicq.evaluate.region_of_interest import RegionOfInterest
from scenicq.importers.predictions import THRESHOLDS_M, Predictions, Protocol
from scenicq.number_ranges import expand_ranges
from scenicq.option_values import Distances
from scenicq.store.classes import is_class
from scenicq.store.dataset import Dataset

__all__ = ["DISTANCES", "ERRORS_AT_M", "Detection", "DetectionDistances", "Missing", "detect"]

Reals = NDArray[np.float64]
Bools = NDArray[np.bool_]
Numbers = NDArray[np.int32]
T = TypeVar("T", bound=np.generic)

Missing = Literal["error", "empty", "skip"]
"""What a frame without predictions is: an error, a frame in which nothing was found, or left out."""

ERRORS_AT_M = 2.0
"""Centre distance of the pairs whose errors are told."""

DISTANCES = Distances(THRESHOLDS_M)
"""Centre distances within which objects count as found, as people say them."""
_USUAL_M = 2.0

_AT_ONCE = 200_000
"""Boxes that are compared at once: what lies between takes ten times their memory."""


@dataclass(frozen=True, slots=True)
class DetectionDistances:
    """Centre distances within which objects count as found, metres; each is one of `THRESHOLDS_M`.

    Attributes:
        usual: That of classes that have none of their own.
        of_class: Those of some classes, by their names.
    """

    usual: float
    of_class: Mapping[str, float]

    @classmethod
    def of(cls, said: Mapping[str, float]) -> DetectionDistances:
        """What `DISTANCES` reads."""
        return cls(said.get("", _USUAL_M), {name: value for name, value in said.items() if name})

    def metres(self, category: str) -> float:
        """The distance of a class."""
        return self.of_class.get(category, self.usual)

    def __str__(self) -> str:
        """In words."""
        others = ", ".join(f"{name} {value:g} m" for name, value in self.of_class.items())
        return f"{self.usual:g} m" + (f" ({others})" if others else "")


@dataclass(frozen=True, slots=True, eq=False)
class Detection:
    """Labels and predictions side by side.

    Attributes:
        frames, objects: The labels.
        predictions: Those that count, in the frame of the map, in the order of falling scores.
        covered: Frames that the predictions speak of, shape (frames,).
        classes: The classes that are evaluated.
        object_class: Number of the class of each label object, -1 for those that do not count, shape (objects,).
        prediction_class: The same for predictions, shape (predictions,).
        frame: Number of the dataset's frame of each prediction.
        owner: For each centre distance the label object of each prediction, -1 without.
        errors: Those of predictions that are label objects within `ERRORS_AT_M`, else nan; shape (predictions, 5).
        flat: Whether distances are those in the plane although the benchmark takes those in space, since the dataset
            does not know all heights.
        distance: How far each label object is from the ego, metres.
        score: For each centre distance the score with which each label object was found, -inf where it was not.
    """

    frames: Frames
    objects: Annotations
    predictions: Predictions
    covered: Bools
    classes: list[str]
    object_class: Numbers
    prediction_class: Numbers
    frame: Numbers
    owner: Mapping[float, Numbers]
    errors: Reals
    flat: bool
    distance: Reals
    score: Mapping[float, Reals]

    def found_score(self, within: DetectionDistances) -> Reals:
        """The score with which each label object was found within the distance of its class, -inf where it was not."""
        return self._by_class(within, self.score, self.object_class)

    def is_false(self, within: DetectionDistances) -> Bools:
        """Whether each prediction is no label object within the distance of its class."""
        return self._by_class(within, self.owner, self.prediction_class) < 0

    def _by_class(self, within: DetectionDistances, values: Mapping[float, NDArray[T]], numbers: Numbers) -> NDArray[T]:
        """The values at the centre distance of each thing's class."""
        found = values[within.usual]
        for number, name in enumerate(self.classes):
            if name in within.of_class:
                found = np.where(numbers == number, values[within.of_class[name]], found)
        return found


def detect(
    dataset: Dataset, predictions: Predictions, missing: Missing = "error", *, at_once: int = _AT_ONCE
) -> Detection:
    """Find which label objects were detected.

    Args:
        dataset: The labels.
        predictions: The predictions.
        missing: What a frame without predictions is.
        at_once: Boxes that are compared at once.

    Raises:
        DataError: predictions-missing, predictions-unmatched, predictions-frame; unknown-class for a class of the
            predictions that the dataset's classes do not have.
    """
    protocol = predictions.protocol
    frames, objects = read_annotations(dataset, protocol.points, protocol.attributes)
    places = _places(dataset, frames, predictions, missing)
    covered = np.zeros(len(frames.names), dtype=np.bool_)
    covered[places[places >= 0]] = True
    if missing == "empty":
        covered[:] = True
    frame = places[predictions.frame] if len(predictions.frame) else np.zeros(0, dtype=np.int32)
    known = frame >= 0
    if not known.all():
        predictions, frame = predictions.taken(known), frame[known]
    poses = EgoPoses(dataset, frames)
    of_ego = predictions.of_ego
    if of_ego:
        predictions = _on_map(predictions, frame, frames, poses)
    spatial = protocol.spatial and _in_space(predictions, objects, frames)
    check_distance(predictions, frame, frames)
    classes, object_class, prediction_class = _classes(objects, predictions)
    object_class = np.where(covered[objects.frame], object_class, -1).astype(np.int32)
    keep = np.ones(len(frame), dtype=np.bool_)
    racks = _Racks(objects, protocol, classes)
    limits = np.array([*(protocol.ranges_m.get(name, protocol.range_m) for name in classes), math.inf])
    object_class[poses.away(objects, objects.frame, spatial=spatial) >= limits[object_class]] = -1
    object_class[_without_points(objects)] = -1
    object_class[racks.hold(objects.x, objects.y, objects.frame, object_class)] = -1
    keep &= prediction_class >= 0
    keep &= poses.away(predictions, frame, spatial=spatial) < limits[prediction_class]
    keep &= ~racks.hold(predictions.x, predictions.y, frame, prediction_class)
    order = np.flatnonzero(keep)
    order = order[_by_score(predictions.score[order], frame[order], last_first=protocol.last_first)]
    order = order[_first_of_each(frame[order], prediction_class[order], protocol)]
    if math.isfinite(protocol.roi_m):
        roi = RegionOfInterest(dataset, frames, protocol.roi_m)
        object_class[~roi.holds(objects, objects.frame)] = -1
        order = order[roi.holds(predictions.taken(order), frame[order])]
    predictions, frame, prediction_class = predictions.taken(order), frame[order], prediction_class[order]
    owner = _owners(predictions, frame, prediction_class, objects, object_class, spatial=spatial, at_once=at_once)
    counted = np.flatnonzero(object_class >= 0)
    labels = _centres(objects, counted, objects.frame, object_class[counted], spatial=False)
    boxes = Centres(frame, prediction_class, predictions.x, predictions.y)
    check_fit(predictions.name, boxes, owner[max(THRESHOLDS_M)], labels, poses, of_ego=of_ego)
    score: dict[float, Reals] = {}
    for threshold, mine in owner.items():
        score[threshold] = np.full(len(objects.frame), -math.inf)
        score[threshold][mine[mine >= 0]] = predictions.score[mine >= 0]
    turned = np.array([name in protocol.half_turn for name in classes], dtype=np.bool_)
    return Detection(
        frames=frames,
        objects=objects,
        predictions=predictions,
        covered=covered,
        classes=classes,
        object_class=object_class,
        prediction_class=prediction_class,
        frame=frame,
        owner=owner,
        errors=_errors(
            predictions,
            objects,
            owner[ERRORS_AT_M],
            turned[prediction_class],
            frame,
            poses if of_ego else None,
            spatial=spatial,
            at_once=at_once,
        ),
        flat=protocol.spatial and not spatial,
        distance=np.hypot(objects.x - frames.ego_x[objects.frame], objects.y - frames.ego_y[objects.frame]),
        score=score,
    )


def _places(dataset: Dataset, frames: Frames, predictions: Predictions, missing: Missing) -> Numbers:
    """The number of the dataset's frame of each frame of the predictions, -1 for none."""
    places = np.array([frames.numbers.get(name, -1) for name in predictions.frames], dtype=np.int32)
    name = predictions.name
    if missing == "skip":
        if not (places >= 0).any():
            message = f"{name} and {dataset.name} have no frame in common"
            raise DataError(Diagnostic("predictions-unmatched", message))
        return places
    unmatched = np.flatnonzero(places < 0)
    if len(unmatched):
        first = predictions.frames[int(unmatched[0])]
        raise DataError(
            Diagnostic(
                "predictions-unmatched",
                f"{name} has frames that {dataset.name} does not have: {len(unmatched)}, the first {first}",
                hints=("`--missing skip` evaluates the frames that both have",),
            )
        )
    without = len(frames.names) - len(places)
    if without and missing == "error":
        there = set(places.tolist())
        first = next(frame for number, frame in enumerate(frames.names) if number not in there)
        raise DataError(
            Diagnostic(
                "predictions-missing",
                f"{name} has no predictions for {without} of {len(frames.names)} frames, the first {first}",
                hints=(
                    "`--missing empty` takes them for frames in which nothing was found, `--missing skip` leaves them "
                    "out",
                ),
            )
        )
    return places


def _on_map(predictions: Predictions, frame: Numbers, frames: Frames, poses: EgoPoses) -> Predictions:
    """Boxes of the ego's frame in that of the map."""
    heading = frames.ego_heading[frame]
    if np.isnan(heading).any():
        number = int(frame[int(np.argmax(np.isnan(heading)))])
        message = f"{predictions.name}: boxes lie in the ego's frame, and the ego of {frames.names[number]} has none"
        raise DataError(Diagnostic("predictions-frame", message))
    x, y, z = poses.on_map(frame, predictions.x, predictions.y, np.nan_to_num(predictions.z))
    z[np.isnan(predictions.z) | np.isnan(frames.ego_z[frame])] = np.nan
    return replace(predictions, x=x, y=y, z=z, heading=poses.heading_on_map(frame, predictions.heading), of_ego=False)


def _in_space(predictions: Predictions, objects: Annotations, frames: Frames) -> bool:
    """Whether all heights are known."""
    columns = (predictions.z, objects.z, frames.ego_z, frames.ego_pitch, frames.ego_roll)
    return all(bool(np.isfinite(values).all()) for values in columns)


def _classes(objects: Annotations, predictions: Predictions) -> tuple[list[str], Numbers, Numbers]:
    """The classes that are evaluated, and their numbers for label objects and predictions; -1 for those without."""
    protocol = predictions.protocol
    sources, first = np.unique(objects.source_category, return_index=True)
    tree_of: dict[str, str] = {
        objects.source_classes[int(source)]: objects.classes[int(objects.category[row])]
        for source, row in zip(sources, first, strict=True)
    }
    if protocol.classes is not None:
        known = sorted(set(protocol.classes.values()))
        of_source = protocol.classes
    elif protocol.tree:
        of_source = tree_of
        known = sorted(set(tree_of.values()))
    else:
        of_source = {name: name for name in objects.source_classes}
        known = sorted(of_source)
    numbers = {name: number for number, name in enumerate(known)}
    of_objects = np.array([numbers.get(of_source.get(name, ""), -1) for name in objects.source_classes], dtype=np.int32)
    of_predictions: list[int] = []
    for name in predictions.classes:
        evaluated = tree_of.get(name, name) if protocol.tree else name
        if evaluated not in numbers:
            if protocol.classes is not None or (protocol.tree and not is_class(evaluated)):
                message = f"{predictions.name}: `{name}` is no class of {protocol.name} predictions"
                hint = f"known are {', '.join(known)}" + (", and the others of the class tree" if protocol.tree else "")
                raise DataError(Diagnostic("unknown-class", message, hints=(hint,)))
            # a class without any label object
            numbers[evaluated] = len(known)
            known.append(evaluated)
        of_predictions.append(numbers[evaluated])
    object_class = of_objects[objects.source_category] if len(of_objects) else np.zeros(0, dtype=np.int32)
    prediction_class = np.array([*of_predictions, -1], dtype=np.int32)[predictions.category]
    return known, object_class, prediction_class


def _without_points(objects: Annotations) -> Bools:
    """Label objects whose points are counted, and are none."""
    if not objects.points:
        return np.zeros(len(objects.frame), dtype=np.bool_)
    counts = np.stack(list(objects.points.values()))
    return (counts >= 0).any(axis=0) & (np.maximum(counts, 0).sum(axis=0) == 0)


class _Racks:
    """Boxes inside which some classes are not evaluated."""

    def __init__(self, objects: Annotations, protocol: Protocol, classes: list[str]) -> None:
        number = objects.source_classes.index(protocol.racks) if protocol.racks in objects.source_classes else -1
        racks = np.flatnonzero(objects.source_category == number)
        self._racks = racks[np.isfinite(objects.heading[racks]) & np.isfinite(objects.width[racks])]
        self._objects = objects
        self._racked = np.array([*(name in protocol.racked for name in classes), False], dtype=np.bool_)

    def hold(self, x: Reals, y: Reals, frame: Numbers, category: Numbers) -> Bools:
        """Which boxes lie inside, shape (n,)."""
        held = np.zeros(len(x), dtype=np.bool_)
        if not len(self._racks):
            return held
        of, order = np.flatnonzero(self._racked[category]), self._objects
        of = of[np.isin(frame[of], order.frame[self._racks])]
        for rack in self._racks.tolist():
            mine = of[frame[of] == order.frame[rack]]
            dx, dy = x[mine] - order.x[rack], y[mine] - order.y[rack]
            sine, cosine = math.sin(order.heading[rack]), math.cos(order.heading[rack])
            ahead, right = -sine * dx + cosine * dy, cosine * dx + sine * dy
            held[mine] |= (np.abs(ahead) <= order.length[rack] / 2) & (np.abs(right) <= order.width[rack] / 2)
        return held


def _by_score(score: Reals, frame: Numbers, *, last_first: bool) -> NDArray[np.int64]:
    """The order of falling scores; equal ones from the last to the first, or frame by frame."""
    if last_first:
        return np.argsort(score, kind="stable")[::-1]
    return np.lexsort((frame, -score))


def _first_of_each(frame: Numbers, category: Numbers, protocol: Protocol) -> NDArray[np.int64]:
    """The first boxes of each frame (and class), as many as count, in their order."""
    if not protocol.most or not len(frame):
        return np.arange(len(frame))
    key = frame.astype(np.int64)
    if protocol.most_of_class:
        key = key * (int(category.max()) + 1) + category
    order = np.argsort(key, kind="stable")
    starts = np.flatnonzero(np.append(True, key[order][1:] != key[order][:-1]))
    sizes = np.diff(np.append(starts, len(order)))
    place = expand_ranges(0, sizes)
    return np.sort(order[place < protocol.most])


def _owners(
    predictions: Predictions, frame: Numbers, category: Numbers, objects: Annotations, object_class: Numbers,
    *, spatial: bool, at_once: int,
) -> dict[float, Numbers]:  # fmt: skip
    """The label object of each prediction at each centre distance, -1 without: some frames at a time."""
    owner = {threshold: np.full(len(frame), -1, dtype=np.int32) for threshold in THRESHOLDS_M}
    nearest_only = predictions.protocol.nearest_only
    by_frame = np.argsort(frame, kind="stable")
    frames = int(frame.max(initial=-1)) + 1
    ends: list[int] = np.searchsorted(frame, np.arange(frames + 1), sorter=by_frame).tolist()
    begin = 0
    while begin < frames:
        end = max(bisect_right(ends, ends[begin] + at_once) - 1, begin + 1)
        # in the order of falling scores again
        mine = np.sort(by_frame[ends[begin] : ends[end]])
        of_frames: NDArray[np.int64] = np.searchsorted(objects.frame, (begin, end))
        counted = of_frames[0] + np.flatnonzero(object_class[of_frames[0] : of_frames[1]] >= 0)
        pairs = find_pairs(
            _centres(predictions, mine, frame, category[mine], spatial=spatial),
            _centres(objects, counted, objects.frame, object_class[counted], spatial=spatial),
            max(THRESHOLDS_M),
            nearest_only=nearest_only,
        )
        for threshold, found in owner.items():
            its = assign(pairs, np.arange(len(mine)), len(counted), threshold, nearest_only=nearest_only)
            found[mine[its >= 0]] = counted[its[its >= 0]]
        begin = end
    return owner


def _centres(
    boxes: Predictions | Annotations, which: NDArray[np.int64], frame: Numbers, category: Numbers, *, spatial: bool
) -> Centres:
    z = boxes.z[which] if spatial else None
    return Centres(frame[which], category, boxes.x[which], boxes.y[which], z)


def _errors(
    predictions: Predictions, objects: Annotations, owner: Numbers, half_turn: Bools, frame: Numbers,
    seen_from: EgoPoses | None, *, spatial: bool, at_once: int,
) -> Reals:  # fmt: skip
    """The errors of predictions that are label objects; headings are compared in the ego's frame, where it is given."""
    errors = np.full((len(owner), len(ERRORS)), np.nan)
    numbers = {name: number for number, name in enumerate(objects.attributes)}
    same = np.array([*(numbers.get(name, -2) for name in predictions.attributes), -2], dtype=np.int32)

    def sizes(of: Predictions | Annotations, which: NDArray[np.int64] | Numbers) -> Reals:
        return np.column_stack((of.width[which], of.length[which], of.height[which]))

    found = np.flatnonzero(owner >= 0)
    for first in range(0, len(found), at_once):
        mine = found[first : first + at_once]
        its = owner[mine]
        headings = predictions.heading[mine], objects.heading[its]
        if seen_from is not None:
            headings = tuple(seen_from.heading_seen(frame[mine], each) for each in headings)
        wanted = objects.attribute[its]
        compared = Errors(
            dx=predictions.x[mine] - objects.x[its],
            dy=predictions.y[mine] - objects.y[its],
            dz=predictions.z[mine] - objects.z[its] if spatial else np.zeros(len(mine)),
            sizes=sizes(predictions, mine),
            other_sizes=sizes(objects, its),
            turn=headings[0] - headings[1],
            dvx=predictions.vx[mine] - objects.vx[its],
            dvy=predictions.vy[mine] - objects.vy[its],
            attribute=np.where(wanted < 0, np.nan, same[predictions.attribute[mine]] != wanted),
        )
        errors[mine] = box_errors(compared, half_turn[mine], hull=predictions.protocol.hull)
    return errors
