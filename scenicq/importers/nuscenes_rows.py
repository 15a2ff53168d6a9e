"""Rows of the tables of nuScenes that are large, as msgspec decodes them where all of a block are sound.

They hold what is used, and `Raw` in place of what means nothing here. Rows that msgspec refuses, as it does where a
field is not one of these, are for `json`, and for what tells what is wrong with them or is not read.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, TypeAlias

from msgspec import DecodeError, Meta, Raw, Struct
from msgspec.json import Decoder, decode

__all__ = ["ANNOTATIONS", "EGO_POSES", "SENSOR_FILES", "Annotation", "EgoPose", "SensorFile", "moment"]

_Text: TypeAlias = Annotated[str, Meta(min_length=1)]
_Length: TypeAlias = Annotated[float, Meta(gt=0)]
_Count: TypeAlias = Annotated[int, Meta(ge=1 - 2**63, le=2**63 - 1)]


_NOTHING = Raw(b"null")


class Annotation(Struct, gc=False, frozen=True, forbid_unknown_fields=True):
    """A row of `sample_annotation`.

    Attributes:
        token, sample_token, instance_token: Of the annotation, its sample and its instance.
        translation: x, y, z in metres.
        size: Width, length, height in metres.
        rotation: Quaternion w, x, y, z.
        attribute_tokens, visibility_token: What else is said of it.
        num_lidar_pts, num_radar_pts: How many points were measured on it.
    """

    token: _Text
    sample_token: _Text
    instance_token: _Text
    translation: tuple[float, float, float]
    size: tuple[_Length, _Length, _Length]
    rotation: tuple[float, float, float, float]
    attribute_tokens: tuple[str, ...] | None = None
    visibility_token: str | None = None
    num_lidar_pts: _Count | None = None
    num_radar_pts: _Count | None = None
    next: Raw = _NOTHING
    prev: Raw = _NOTHING


class _Row(Struct, forbid_unknown_fields=True):
    """A row that is read like a record of `json`."""

    def get(self, key: str) -> Any:
        """The value of a field."""
        return getattr(self, key)

    __getitem__ = get


class SensorFile(_Row):
    """A row of `sample_data`."""

    token: _Text
    sample_token: _Text
    ego_pose_token: _Text
    calibrated_sensor_token: _Text
    filename: _Text
    is_key_frame: bool
    width: _Count | None = None
    height: _Count | None = None
    fileformat: Raw = _NOTHING
    timestamp: Raw = _NOTHING
    next: Raw = _NOTHING
    prev: Raw = _NOTHING


class EgoPose(_Row):
    """A row of `ego_pose`."""

    token: _Text
    translation: Annotated[list[float], Meta(min_length=3, max_length=3)]
    rotation: Annotated[list[float], Meta(min_length=4, max_length=4)]
    timestamp: Raw = _NOTHING


def moment(value: object) -> float:
    """The `timestamp` of a row, in microseconds; inf where it is none."""
    try:
        known = decode(value) if isinstance(value, Raw) else value
        found = float(known) if isinstance(known, int | float) and not isinstance(known, bool) else math.inf
    except (DecodeError, OverflowError):
        return math.inf
    return found if math.isfinite(found) else math.inf


ANNOTATIONS = Decoder(list[Annotation])
"""Decodes rows of `sample_annotation`."""

SENSOR_FILES = Decoder(list[SensorFile])
"""Decodes rows of `sample_data`."""

EGO_POSES = Decoder(list[EgoPose])
"""Decodes rows of `ego_pose`."""
