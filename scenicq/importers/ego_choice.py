"""An ego for sources that have none: a track that the user names, or in each frame the vehicle in the middle.

Nothing is invented: the ego is one of the objects, with its own features. With `none` it is stored the same way, since
a frame needs a point of view, but the dataset's facts say that it is no recording car; `--ego any` at matching then
lets every object be it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from scenicq.importers.report import Report
from scenicq.store.classes import is_subclass
from scenicq.store.labels import Label, LabelObject

__all__ = ["Moment", "ego_facts", "with_egos"]


@dataclass(frozen=True, slots=True)
class Moment:
    """A frame without an ego; fields as those of `Label`."""

    frame: str
    timestamp_us: int
    objects: tuple[LabelObject, ...]
    params: Mapping[str, str | float | bool] = field(default_factory=dict[str, str | float | bool])


def ego_facts(choice: str | None) -> dict[str, Any]:
    """What a dataset's provenance says of its egos."""
    said = {
        "nearest": "the vehicle nearest to the middle of all objects, in each frame; the source has no ego",
        "none": "none: the source has no ego; match with `--ego any`",
    }
    return {"ego": said.get(choice or "nearest", f"track `{choice}`; the source has no ego")}


def with_egos(
    moments: Sequence[Moment], choice: str | None, recording: str, map_name: str, place: str, report: Report
) -> list[tuple[Label, str]]:
    """Labels with one of their objects as ego; frames that have none that could be it are left out and told.

    Args:
        moments: The frames.
        choice: `Options.ego`.
        recording: Name of the recording.
        map_name: Name of its map.
        place: Of the recording in the source, for messages.
        report: Takes what is left out.
    """
    if choice is None:
        message = (
            f"{place}: the source has no ego; in each frame it is the vehicle nearest to the middle of all objects"
        )
        hint = "`--ego ID`, `--ego nearest` or `--ego none` says what it is to be"
        report.kept("recording", "record-invalid", message, name="no ego", hints=(hint,))
    made: list[tuple[Label, str]] = []
    for moment in moments:
        ego = _ego(moment.objects, choice)
        if ego is None:
            what = f"track `{choice}`" if choice not in (None, "nearest", "none") else "object"
            report.left_out("label", "record-invalid", f"{place}: frame `{moment.frame}` has no {what} to be the ego")
            continue
        others = tuple(member for member in moment.objects if member is not ego)
        named = replace(ego, id="ego", track=ego.track or ego.id)
        label = Label(moment.frame, recording, moment.timestamp_us, map_name, named, others, moment.params)
        made.append((label, place))
    return made


def _ego(objects: Sequence[LabelObject], choice: str | None) -> LabelObject | None:
    if choice not in (None, "nearest", "none"):
        return next((member for member in objects if choice in (member.track, member.id)), None)
    vehicles = [member for member in objects if is_subclass(member.category, "Vehicle") and member.heading is not None]
    candidates = vehicles or (objects if choice == "none" else ())
    if not candidates:
        return None
    x = sum(member.x for member in objects) / len(objects)
    y = sum(member.y for member in objects) / len(objects)
    return min(candidates, key=lambda member: ((member.x - x) ** 2 + (member.y - y) ** 2, member.id))
