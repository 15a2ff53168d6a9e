"""Two result files of one dataset side by side: which frames came, went and stayed."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any, Literal, cast

from scenicq.errors import DataError, Diagnostic
from scenicq.report.frames import table
from scenicq.report.page import page
from scenicq.report.svg import element, escape

__all__ = ["Change", "changes", "changes_page", "changes_text", "read_results"]

Kind = Literal["came", "went", "recast", "stayed"]
_TOLD: dict[Kind, str] = {
    "came": "match in B only",
    "went": "match in A only",
    "recast": "match in both, with other objects",
    "stayed": "match in both, with the same objects",
}
_MARKS: dict[Kind, str] = {"came": "+", "went": "-", "recast": "~", "stayed": "="}
Record = Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Change:
    """What became of one frame that matches in either file.

    Attributes:
        kind: What became of it.
        frame, recording: Which frame.
        before, after: Label object of each role in A and in B, where it matches there.
        why: What the file in which it does not match says of it, if anything.
    """

    kind: Kind
    frame: str
    recording: str
    before: Mapping[str, str]
    after: Mapping[str, str]
    why: str = ""


def read_results(path: Path) -> dict[str, Record]:
    """The records of a file of JSON lines by frame; of several of one frame the first match counts.

    Raises:
        DataError: file-missing, or file-invalid.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise DataError(Diagnostic("file-missing", f"{path} cannot be read: {error.strerror or error}")) from None
    except UnicodeDecodeError:
        raise _invalid(path, "it is not text in UTF-8") from None
    found: dict[str, Record] = {}
    for number, line in enumerate(text.split("\n"), 1):
        if line.strip():
            each = _record(path, number, line)
            old = found.get(each["frame"])
            if old is None or (each["verdict"] == "match" and old["verdict"] != "match"):
                found[each["frame"]] = each
    return found


def _invalid(path: Path, why: str) -> DataError:
    hint = "`scenicq match ... --format jsonl -o FILE` writes such a file"
    return DataError(Diagnostic("file-invalid", f"{path} holds no results: {why}", hints=(hint,)))


def _record(path: Path, number: int, line: str) -> Record:
    try:
        each: Any = json.loads(line)
    except (ValueError, RecursionError):
        raise _invalid(path, f"line {number} is not JSON") from None
    texts = ("frame", "recording", "verdict")
    if not isinstance(each, dict) or not all(isinstance(cast(Record, each).get(key), str) for key in texts):
        raise _invalid(path, f"line {number} is no result")
    return cast(Record, each)


def _played(record: Record | None) -> dict[str, str] | None:
    if record is None or record["verdict"] != "match":
        return None
    given = record.get("correspondence")
    roles = cast("dict[object, object]", given) if isinstance(given, dict) else {}
    return {str(role): str(thing) for role, thing in roles.items()}


def _why(record: Record | None) -> str:
    if record is None:
        return ""
    given = record.get("cause")
    cause: Record = cast(Record, given) if isinstance(given, dict) else {}
    parts = [record["verdict"].replace("_", " ")]
    parts += [str(cause[key]) for key in ("reason", "what", "detail") if cause.get(key)]
    return ": ".join((parts[0], ", ".join(parts[1:]))) if parts[1:] else parts[0]


def changes(before: Mapping[str, Record], after: Mapping[str, Record]) -> list[Change]:
    """What became of each frame that matches in either, by recording, then time.

    Args:
        before: Records of the first file by frame.
        after: Records of the second.
    """
    found: list[tuple[tuple[str, int, str], Change]] = []
    for frame in before.keys() | after.keys():
        old, new = before.get(frame), after.get(frame)
        was, is_ = _played(old), _played(new)
        if was is None and is_ is None:
            continue
        record = cast(Record, new if is_ is not None else old)
        kind: Kind = "came" if was is None else "went" if is_ is None else "stayed" if was == is_ else "recast"
        why = _why(old if was is None else new if is_ is None else None)
        change = Change(kind, frame, record["recording"], was or {}, is_ or {}, why)
        time = record.get("timestamp_us")
        found.append(((record["recording"], time if isinstance(time, int) else 0, frame), change))
    return [change for _, change in sorted(found, key=lambda each: each[0])]


def _cast(roles: Mapping[str, str]) -> str:
    return " ".join(f"{role}={thing}" for role, thing in roles.items() if (role, thing) != ("ego", "ego"))


def _detail(change: Change) -> str:
    match change.kind:
        case "came" | "went":
            return "; ".join(filter(None, (_cast(change.after or change.before), change.why)))
        case "recast":
            return f"{_cast(change.before)} -> {_cast(change.after)}"
        case "stayed":
            return _cast(change.after)


def _counts(found: Sequence[Change]) -> list[tuple[Kind, int]]:
    return [(kind, sum(change.kind == kind for change in found)) for kind in _TOLD]


def changes_text(found: Sequence[Change], *, every: bool = False) -> str:
    """The changes as text, without a newline at the end.

    Args:
        found: As `changes` gives them.
        every: Whether frames that stayed are listed, too.
    """
    lines = [f"{_MARKS[kind]} {count:6,}  {kind}: {_TOLD[kind]}" for kind, count in _counts(found)]
    shown = [change for change in found if every or change.kind != "stayed"]
    for recording, group in groupby(shown, key=lambda change: change.recording):
        lines += ["", recording]
        lines += [f"  {_MARKS[change.kind]} {change.frame}  {_detail(change)}".rstrip() for change in group]
    return "\n".join(lines)


def changes_page(found: Sequence[Change], names: tuple[str, str]) -> str:
    """The changes as a page that needs nothing but itself.

    Args:
        found: As `changes` gives them.
        names: What the two files are called.
    """
    counts = [(f"{_MARKS[kind]} {kind}", _TOLD[kind], f"{count:,}") for kind, count in _counts(found)]
    parts = [
        element("header", element("h1", "Two results compared"), element("p", escape(f"A: {names[0]}, B: {names[1]}"))),
        table("Frames", ("change", "meaning", "frames"), counts),
    ]
    for kind, meaning in _TOLD.items():
        rows = [
            (escape(change.frame), escape(change.recording), escape(_detail(change)))
            for change in found
            if change.kind == kind
        ]
        if rows:
            title = element("summary", element("b", f"{_MARKS[kind]} {kind}"), f": {escape(meaning)} ({len(rows):,})")
            listed = table(kind, ("frame", "recording", "objects and cause"), rows)
            parts.append(element("details", title, listed, open=kind != "stayed"))
    head, *rest = parts
    return page(f"{names[0]} and {names[1]} compared", [head, element("main", *rest)], script=False)
