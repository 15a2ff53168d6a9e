"""Rows of the tables of nuScenes: their fields, and `Raw` in place of what means nothing here in large tables."""

from __future__ import annotations

import math
from typing import Any

from msgspec import DecodeError, Raw, Struct
from msgspec.json import decode

from scenicq.importers.specification import load_specification
from scenicq.importers.typed_rows import ABSENT, FullText, Length, RowType, Words

__all__ = [
    "ANNOTATIONS",
    "ATTRIBUTES",
    "CATEGORIES",
    "EGO_POSES",
    "INSTANCES",
    "LOGS",
    "MOUNTED_SENSORS",
    "SAMPLES",
    "SCENES",
    "SENSORS",
    "SENSOR_FILES",
    "VISIBILITIES",
    "Annotation",
    "EgoPose",
    "LogRow",
    "SampleRow",
    "SceneRow",
    "SensorFile",
    "TableRow",
    "moment",
]


class TableRow(Struct, kw_only=True, forbid_unknown_fields=True):
    """A row of any table."""

    token: FullText


class LogRow(TableRow):
    """A row of `log`."""

    location: FullText
    logfile: Words | None = None
    date_captured: Words | None = None


class SceneRow(TableRow):
    """A row of `scene`; a description that is no text says nothing."""

    name: FullText
    log_token: FullText
    description: Any = None


class SampleRow(TableRow):
    """A row of `sample`; some datasets in this layout have shares of a microsecond."""

    scene_token: FullText
    timestamp: int | float
    next: Raw = ABSENT
    prev: Raw = ABSENT


class CategoryRow(TableRow):
    """A row of `category` or of `attribute`."""

    name: FullText


class VisibilityRow(TableRow):
    """A row of `visibility`."""

    level: FullText


class InstanceRow(TableRow):
    """A row of `instance`."""

    category_token: FullText
    nbr_annotations: Raw = ABSENT
    first_annotation_token: Raw = ABSENT
    last_annotation_token: Raw = ABSENT


class SensorRow(TableRow):
    """A row of `sensor`."""

    channel: FullText


class MountedSensorRow(TableRow):
    """A row of `calibrated_sensor`, without what says how a camera sees."""

    sensor_token: FullText
    translation: Raw = ABSENT
    rotation: Raw = ABSENT
    camera_intrinsic: Raw = ABSENT


class Annotation(TableRow, kw_only=True, gc=False):
    """A row of `sample_annotation`.

    Attributes:
        sample_token, instance_token: The sample and the instance that it belongs to.
        translation: x, y, z in metres.
        size: Width, length, height in metres.
        rotation: Quaternion w, x, y, z.
        attribute_tokens, visibility_token: What else is said of it.
        num_lidar_pts, num_radar_pts: How many points were measured on it.
    """

    sample_token: FullText
    instance_token: FullText
    translation: tuple[float, float, float]
    size: tuple[Length, Length, Length]
    rotation: tuple[float, float, float, float]
    attribute_tokens: tuple[str, ...] | None = None
    visibility_token: Words | None = None
    num_lidar_pts: int | float | None = None
    num_radar_pts: int | float | None = None
    next: Raw = ABSENT
    prev: Raw = ABSENT


class SensorFile(TableRow):
    """A row of `sample_data`; what is no key frame need not have the rest, and what is no size is none of an image."""

    sample_token: Words | None = None
    ego_pose_token: Words | None = None
    calibrated_sensor_token: Words | None = None
    filename: Words | None = None
    is_key_frame: bool | None = None
    width: Any = None
    height: Any = None
    fileformat: Raw = ABSENT
    timestamp: Raw = ABSENT
    next: Raw = ABSENT
    prev: Raw = ABSENT


class EgoPose(TableRow):
    """A row of `ego_pose`."""

    translation: tuple[float, float, float]
    rotation: tuple[float, float, float, float]
    timestamp: Raw = ABSENT


def moment(value: Raw) -> float:
    """A `timestamp` in microseconds; inf where it is none."""
    try:
        return min(float(decode(value, type=float)), math.inf)
    except DecodeError:
        return math.inf


_KNOWN = load_specification("nuscenes")
LOGS = RowType(LogRow, _KNOWN, "log", "token")
SCENES = RowType(SceneRow, _KNOWN, "scene", "token")
SAMPLES = RowType(SampleRow, _KNOWN, "sample", "token")
CATEGORIES = RowType(CategoryRow, _KNOWN, "category", "token")
ATTRIBUTES = RowType(CategoryRow, _KNOWN, "attribute", "token")
VISIBILITIES = RowType(VisibilityRow, _KNOWN, "visibility", "token")
INSTANCES = RowType(InstanceRow, _KNOWN, "instance", "token")
SENSORS = RowType(SensorRow, _KNOWN, "sensor", "token")
MOUNTED_SENSORS = RowType(MountedSensorRow, _KNOWN, "calibrated_sensor", "token")
ANNOTATIONS = RowType(Annotation, _KNOWN, "sample_annotation", "token")
SENSOR_FILES = RowType(SensorFile, _KNOWN, "sample_data", "token")
EGO_POSES = RowType(EgoPose, _KNOWN, "ego_pose", "token")
