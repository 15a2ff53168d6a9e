"""An ego for sources that have none: a track that the user names, or in each frame the vehicle in the middle.

Nothing is invented: the ego is one of the objects, with its own features. With `none` there is none, only a point to
look from; `--ego any` at matching then lets every object be the scenario's ego.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from scenicq.importers.folders import readable
from scenicq.importers.report import Report
from scenicq.store.classes import is_subclass
from scenicq.store.labels import Label, LabelObject

__all__ = ["WITHOUT_EGO", "Moment", "ego_facts", "middle", "viewpoint", "with_egos"]

WITHOUT_EGO = frozenset({"commonroad", "interaction", "openlabel"})
"""The importers of formats whose files may have no ego."""


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
    name = readable(choice or "nearest")
    return {"ego": said.get(name, f"track `{name}`; the source has no ego")}


def with_egos(
    moments: Sequence[Moment], choice: str | None, recording: str, map_name: str, place: str, report: Report
) -> list[tuple[Label, str]]:
    """Labels with one of their objects as ego; frames that have none that could be it are left out and told.

    Args:
        moments: The frames.
        choice: `ImportOptions.ego`.
        recording: Name of the recording.
        map_name: Name of its map.
        place: File and line of the recording in the source, for messages.
        report: Takes what is left out.
    """
    if choice is None:
        message = (
            f"{place}: the source has no ego; in each frame it is the vehicle nearest to the middle of all objects"
        )
        hint = "`--ego ID`, `--ego nearest` or `--ego none` says what it is to be"
        report.keep("recording", "record-invalid", message, name="no ego", hints=(hint,))
    made: list[tuple[Label, str]] = []
    for moment in moments:
        ego = viewpoint(moment.objects) if choice == "none" else _ego(moment.objects, choice)
        if ego is None:
            what = f"track `{choice}`" if choice not in (None, "nearest", "none") else "object"
            report.leave_out("label", "record-invalid", f"{place}: frame `{moment.frame}` has no {what} to be the ego")
            continue
        others = tuple(member for member in moment.objects if member is not ego)
        named = ego if ego.id == "ego" else replace(ego, id="ego", track=ego.track or ego.id)
        label = Label(moment.frame, recording, moment.timestamp_us, map_name, named, others, moment.params)
        made.append((label, place))
    return made


def viewpoint(objects: Sequence[LabelObject]) -> LabelObject | None:
    """What stands for the ego in a frame that has none: the middle of all objects, without class, heading or size.

    None where there are no objects.
    """
    return LabelObject("ego", "", "", *_middle_of(objects)) if objects else None


def middle(places: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """The middle of one or more places."""
    return sum(x for x, _ in places) / len(places), sum(y for _, y in places) / len(places)


def _ego(objects: Sequence[LabelObject], choice: str | None) -> LabelObject | None:
    if choice not in (None, "nearest"):
        return next((member for member in objects if choice in (member.track, member.id)), None)
    vehicles = [member for member in objects if is_subclass(member.category, "Vehicle") and member.heading is not None]
    if not vehicles:
        return None
    x, y = _middle_of(objects)
    return min(vehicles, key=lambda member: ((member.x - x) ** 2 + (member.y - y) ** 2, member.id))


def _middle_of(objects: Sequence[LabelObject]) -> tuple[float, float]:
    return middle([(member.x, member.y) for member in objects])
