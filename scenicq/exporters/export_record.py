"""A matching frame as exports need it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

__all__ = ["MatchedFrame"]


@dataclass(frozen=True, slots=True)
class MatchedFrame:
    """A frame that matches.

    Attributes:
        frame, recording: Which frame.
        roles: Label object id of each object of the scenario, by the object's name.
        sensors: Path of the sensor file of each channel.
    """

    frame: str
    recording: str
    roles: Mapping[str, str]
    sensors: Mapping[str, str] = field(default_factory=dict[str, str])
