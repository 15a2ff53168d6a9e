"""Two result files of one dataset side by side: which frames came, went and stayed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import TYPE_CHECKING, Literal

from scenicq.errors import DataError, Diagnostic
from scenicq.query.execution.records import CauseRecord, FrameRecord, IntervalRecord, Record
from scenicq.query.execution.result_files import ReadResults
from scenicq.query.execution.result_origin import check_origins
from scenicq.report.page import page
from scenicq.report.templates import markup

if TYPE_CHECKING:
    from markupsafe import Markup

__all__ = ["FrameChange", "changes", "changes_page", "changes_text", "check_complete", "check_datasets"]

Kind = Literal["came", "went", "undecided", "recast", "stayed"]
_TOLD: dict[Kind, str] = {
    "came": "match in B only",
    "went": "match in A only",
    "undecided": "match in one, and nobody knows whether in the other",
    "recast": "match in both, with other objects or another end",
    "stayed": "match in both, with the same objects",
}
_MARKS: dict[Kind, str] = {"came": "+", "went": "-", "undecided": "?", "recast": "~", "stayed": "="}
_FOUND: tuple[Kind, ...] = ("undecided",)
"""What is told where there is any."""


@dataclass(frozen=True, slots=True)
class FrameChange:
    """What became of one frame, or one interval, that matches in either file.

    Attributes:
        kind: What became of it.
        frame, recording: Which frame; an interval is called by its recording and where it starts.
        before, after: Label object of each role in A and in B, where it matches there.
        why: What the file in which it does not match, or is undecided, says of it, if anything; of an interval that
            matches in both where it ends, if that differs.
    """

    kind: Kind
    frame: str
    recording: str
    before: Mapping[str, str]
    after: Mapping[str, str]
    why: str = ""


def _played(record: Record | None) -> dict[str, str] | None:
    return None if record is None or record.verdict != "match" else record.correspondence


def _why(record: Record | None) -> str:
    if record is None:
        return ""
    cause = record.cause or CauseRecord()
    verdict, *told = record.verdict.replace("_", " "), cause.reason, cause.what, cause.detail
    return ": ".join(filter(None, (verdict, ", ".join(filter(None, told)))))


def _start_us(record: Record) -> int:
    return record.timestamp_us if isinstance(record, FrameRecord) else record.start_us


def _moved(old: Record | None, new: Record | None) -> str:
    if isinstance(old, IntervalRecord) and isinstance(new, IntervalRecord) and old.end_us != new.end_us:
        return f"ends at {new.end_us}, in A at {old.end_us}"
    return ""


def _silence(record: Record, results: ReadResults) -> str:
    """Why one file does not name a frame that the other does; "" where the frame does not match."""
    first = record.frame if isinstance(record, FrameRecord) else record.frames.first
    return results.completeness.why_silent(record.recording, _start_us(record), first)


def changes(before: ReadResults, after: ReadResults) -> list[FrameChange]:
    """Compare two results: what became of each frame or interval that matches in either, by recording and time.

    Args:
        before: The results of the first file.
        after: Those of the second.
    """
    found: list[tuple[tuple[str, int, str], FrameChange]] = []
    for frame in before.records.keys() | after.records.keys():
        old, new = before.records.get(frame), after.records.get(frame)
        was, is_ = _played(old), _played(new)
        shown = new if is_ is not None else old if was is not None else None
        if shown is None:
            continue
        kind: Kind
        if was is not None and is_ is not None:
            why = _moved(old, new)
            kind = "stayed" if was == is_ and not why else "recast"
        else:
            silent, quiet = (old, before) if was is None else (new, after)
            why = _why(silent) if silent is not None else _silence(shown, quiet)
            open_ = bool(why) if silent is None else silent.verdict == "unknown"
            kind = "undecided" if open_ else "came" if was is None else "went"
        change = FrameChange(kind, frame, shown.recording, was or {}, is_ or {}, why)
        found.append(((shown.recording, _start_us(shown), frame), change))
    return [change for _, change in sorted(found, key=lambda each: each[0])]


def check_complete(found: Sequence[FrameChange], before: ReadResults, after: ReadResults) -> list[Diagnostic]:
    """Warn of results that are incomplete, or may be where it matters.

    Args:
        found: As `changes` gives them.
        before: The results of the first file.
        after: Those of the second.
    """
    told: list[Diagnostic] = []
    sides: tuple[tuple[str, Kind, ReadResults], ...] = (("A", "came", before), ("B", "went", after))
    for side, kind, results in sides:
        hint = f"frames of which {side} does not say whether they match are undecided"
        if results.completeness.summary is None:
            counted = sum(each.kind == kind and not each.why for each in found)
            hint = f"{counted:,} of those that match in the other alone are not named in it: they may match, too"
            if not counted or not results.records:
                continue
        doubt = results.completeness.doubt(side, hint)
        told += [] if doubt is None else [doubt]
    return told


def check_datasets(before: Mapping[str, Record], after: Mapping[str, Record]) -> Diagnostic | None:
    """Refuse results of different datasets: by the names that they give, else as far as recordings and times show it.

    Args:
        before: Records of the first file by frame.
        after: Records of the second.

    Returns:
        A warning where the files are of different versions or have no recording in common, or one of them is empty
        and names no dataset; None where all is well.

    Raises:
        DataError: option-invalid, where the names differ, a frame of both has another recording or time, or one
            file holds frames and the other intervals.
    """
    kinds = [{type(each) for each in records.values()} for records in (before, after)]
    if len(kinds[0] | kinds[1]) > 1:
        raise DataError(Diagnostic("option-invalid", "results that are frames are not comparable with intervals"))
    origins = ([each.dataset or "" for each in records.values()] for records in (before, after))
    doubt = check_origins(*zip("AB", origins, strict=True))
    for frame in sorted(before.keys() & after.keys()):
        old, new = ((each.recording, _start_us(each)) for each in (before[frame], after[frame]))
        if old != new:
            message = f"the files are of different datasets: frame `{frame}` is of {old[0]} at {old[1]} in A, of "
            message += f"{new[0]} at {new[1]} in B"
            raise DataError(Diagnostic("option-invalid", message))
    if bool(before) != bool(after):
        message = f"{'B' if before else 'A'} holds no results: nothing says of which dataset it is"
        return Diagnostic("option-invalid", message, severity="warning")
    recordings = [{each.recording for each in records.values()} for records in (before, after)]
    if doubt is None and before and after and recordings[0].isdisjoint(recordings[1]):
        message = "the files have no recording in common: they may be of different datasets"
        return Diagnostic("option-invalid", message, severity="warning")
    return doubt


def _cast(roles: Mapping[str, str]) -> str:
    return " ".join(f"{role}={played}" for role, played in roles.items() if (role, played) != ("ego", "ego"))


def _objects(change: FrameChange) -> str:
    if change.kind == "recast" and change.before != change.after:
        return f"{_cast(change.before)} -> {_cast(change.after)}"
    return _cast(change.after or change.before)


def _elsewhere(change: FrameChange) -> str:
    """What the file without the match says of a frame; for an interval that matches in both, what B says."""
    missing_in_a = change.kind == "came" or (change.kind == "undecided" and not change.before)
    return change.why and f"in {'A' if missing_in_a else 'B'} {change.why}"


def _counts(found: Sequence[FrameChange]) -> list[tuple[Kind, int]]:
    counts: list[tuple[Kind, int]] = [(kind, sum(change.kind == kind for change in found)) for kind in _TOLD]
    return [(kind, count) for kind, count in counts if count or kind not in _FOUND]


def changes_text(found: Sequence[FrameChange], *, every: bool = False) -> str:
    """The changes as text, without a newline at the end.

    Args:
        found: As `changes` gives them.
        every: Whether frames that stayed are listed, too.
    """
    lines = [f"{_MARKS[kind]} {count:6,}  {kind}: {_TOLD[kind]}" for kind, count in _counts(found)]
    shown = [change for change in found if every or change.kind != "stayed"]
    for recording, group in groupby(shown, key=lambda change: change.recording):
        lines += ["", recording]
        for change in group:
            told = "; ".join(filter(None, (_objects(change), _elsewhere(change))))
            line = f"  {_MARKS[change.kind]} {change.frame}  {told}".rstrip()
            # a name must not look like a line of its own
            lines.append(line.replace("\n", "\\n"))
    return "\n".join(lines)


def _section(kind: Kind, found: Sequence[FrameChange]) -> Markup:
    """A section of frames with the same fate: why, then which; neighbours that are alike share an item."""
    causes = Counter(_elsewhere(change) for change in found if change.why)
    items: list[tuple[str, str, list[str]]] = []
    for (recording, objects, why), group in groupby(found, key=lambda c: (c.recording, _objects(c), _elsewhere(c))):
        frames = [change.frame for change in group]
        number = f"{len(frames):,} {'frame' if len(frames) == 1 else 'frames'}"
        items.append((recording, f", {number}: {'; '.join(filter(None, (objects, why)))}", frames))
    return markup(
        "changes", "section", mark=_MARKS[kind], kind=kind, meaning=_TOLD[kind], number=f"{len(found):,}",
        causes=[(cause, f"{count:,}") for cause, count in causes.most_common()], groups=items,
    )  # fmt: skip


def changes_page(found: Sequence[FrameChange], names: tuple[str, str], doubts: Sequence[Diagnostic] = ()) -> str:
    """The changes as a page that needs nothing but itself.

    Args:
        found: As `changes` gives them.
        names: What the two files are called.
        doubts: What the reader should know of them.
    """
    counts = [(f"{_MARKS[kind]}\N{NO-BREAK SPACE}{kind}", _TOLD[kind], f"{count:,}") for kind, count in _counts(found)]
    of_kind: dict[Kind, list[FrameChange]] = {kind: [each for each in found if each.kind == kind] for kind in _TOLD}
    body = markup(
        "changes", "body", names=list(zip("AB", names, strict=True)), counts=counts,
        doubts=["; ".join((each.message, *each.hints)) for each in doubts],
        sections=[_section(kind, group) for kind, group in of_kind.items() if group],
    )  # fmt: skip
    return page(f"{names[0]} and {names[1]} compared", [body], script=False)
