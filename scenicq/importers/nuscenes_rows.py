"""Rows of the tables of nuScenes that are large, as msgspec decodes them where all of a block are sound.

They hold what is used. Rows that msgspec refuses are for `json`, and for what tells what is wrong with them.
"""

from __future__ import annotations

from typing import Annotated, NotRequired, TypeAlias, TypedDict

from msgspec import Meta, Struct
from msgspec.json import Decoder

__all__ = ["ANNOTATIONS", "EGO_POSES", "SENSOR_FILES", "Annotation", "EgoPose", "SensorFile"]

_Text: TypeAlias = Annotated[str, Meta(min_length=1)]
_Length: TypeAlias = Annotated[float, Meta(gt=0)]
_Count: TypeAlias = Annotated[int, Meta(ge=1 - 2**63, le=2**63 - 1)]


class Annotation(Struct, gc=False, frozen=True):
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


class SensorFile(TypedDict):
    """What is used of a row of `sample_data`."""

    token: _Text
    sample_token: _Text
    ego_pose_token: _Text
    calibrated_sensor_token: _Text
    filename: _Text
    is_key_frame: bool
    width: NotRequired[_Count | None]
    height: NotRequired[_Count | None]


class EgoPose(TypedDict):
    """What is used of a row of `ego_pose`."""

    token: _Text
    translation: Annotated[list[float], Meta(min_length=3, max_length=3)]
    rotation: Annotated[list[float], Meta(min_length=4, max_length=4)]


ANNOTATIONS = Decoder(list[Annotation])
"""Decodes rows of `sample_annotation`."""

SENSOR_FILES = Decoder(list[SensorFile])
"""Decodes rows of `sample_data`."""

EGO_POSES = Decoder(list[EgoPose])
"""Decodes rows of `ego_pose`."""
