"""Results as they are written: one declaration gives lines of JSON, cells of CSV, columns of Arrow, and the way back.

What does not fit the declaration is refused with its place, as ``Expected `str`, got `int` - at `$.recording` ``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Literal

import msgspec
from msgspec import UNSET, Struct, UnsetType

from scenicq.errors import Source, Span
from scenicq.match.verdict import Cause, Match, NoMatch, Unknown, Verdict, WitnessValue
from scenicq.query.execution.result_summary import ResultSummary
from scenicq.query.execution.results import (
    CarriedValue,
    IntervalSpan,
    LogDensity,
    ModeRecord,
    ObjectLanes,
    RecordedCell,
    Result,
)

__all__ = [
    "DENSITY",
    "RECORDED",
    "CauseRecord",
    "CellRecord",
    "FrameRecord",
    "FramesRecord",
    "IntervalRecord",
    "Record",
    "SeriesRecord",
    "StandingRecord",
    "SummaryRecord",
    "decode_record",
    "json_text",
    "read_record",
    "record",
    "record_of",
    "recorded_fields",
]

Number = int | float
CellRecord = Number | bool | str | tuple[Number, Number] | None
"""A recorded value: a number, a truth value, a text, a vector; null where there is none."""
VerdictName = Literal["match", "unknown", "no_match"]
_NAMES: dict[type[Verdict], VerdictName] = {Match: "match", NoMatch: "no_match", Unknown: "unknown"}


class CauseRecord(Struct, frozen=True, omit_defaults=True):
    """What excludes a match, or leaves it open.

    Attributes:
        what: The feature or requirement, in the words of the program.
        detail: The fact.
        place: `file:line:column`.
        reason: Why it is unknown; "" where the frame does not match.
    """

    what: str = ""
    detail: str = ""
    place: str = ""
    reason: str = ""


class FramesRecord(Struct, frozen=True):
    """The frames of an interval: the first, the last, and how many there are."""

    first: str
    last: str
    count: int


class StandingRecord(Struct, frozen=True):
    """In which lanes a role stands.

    Attributes:
        own: Those that are its own.
        others: Those in which it lies, too.
    """

    own: list[str]
    others: list[str]


class SeriesRecord(Struct, frozen=True):
    """A recorded value over an interval.

    Attributes:
        first, last: At the first and the last sample.
        minimum, maximum, mean: Over the samples at which it is a known number; null where there are none.
        values: At each sample.
    """

    first: CellRecord
    last: CellRecord
    minimum: Number | None
    maximum: Number | None
    mean: Number | None
    values: list[CellRecord]


class FrameRecord(Struct, frozen=True, kw_only=True):
    """The verdict on one frame.

    Attributes:
        frame, recording, timestamp_us: Which frame.
        verdict: `match`, `unknown`, or `no_match`.
        correspondence: The label object of each role.
        witness: A value of each random variable that proves a match, a number or a point, by its place in the program.
        lanes: In which lanes roles stand whose lanes the program asks for; absent where it asks for none.
        cause: What excludes a match, or leaves it open; absent in a match.
        sensors: The sensor file of each channel.
        recorded: What the program records of a match, by name; absent where it records nothing.
        unrecorded: Why a recorded value is null, as a count by the reason, by name; absent where none is.
        log_density, log_density_error, log_weight, no_density: How typical the label is, as
            `scenicq.query.execution.results.LogDensity` has it; absent where that was not asked for.
        all_matches: Whether the file has every correspondence by which the frame matches; absent where it has one.
        dataset: The dataset and its version; absent where it is not known.
        summary: What the file says of itself; with its last result alone.
    """

    frame: str
    recording: str
    timestamp_us: int = 0
    verdict: VerdictName
    correspondence: dict[str, str] = {}
    witness: dict[str, Number | tuple[Number, Number]] = {}
    lanes: dict[str, StandingRecord] | UnsetType = UNSET
    cause: CauseRecord | UnsetType = UNSET
    sensors: dict[str, str] = {}
    recorded: dict[str, CellRecord] | UnsetType = UNSET
    unrecorded: dict[str, dict[str, int]] | UnsetType = UNSET
    log_density: float | UnsetType | None = UNSET
    log_density_error: float | UnsetType | None = UNSET
    log_weight: float | UnsetType | None = UNSET
    no_density: str | UnsetType | None = UNSET
    all_matches: bool | UnsetType = UNSET
    dataset: str | UnsetType = UNSET
    summary: ResultSummary | UnsetType = UNSET

    @property
    def name(self) -> str:
        """What tells it from the other results: the name of the frame."""
        return self.frame


class IntervalRecord(Struct, frozen=True, kw_only=True):
    """The verdict on an interval of a recording.

    Attributes:
        recording: The recording.
        start_us, end_us: Timestamps of the first and the last frame.
        frames: The first and the last frame, and how many there are.
        verdict: `match`, `unknown`, or `no_match`.
        correspondence: The track of each role.
        lanes: As of a frame, at the first.
        witness, cause: As of a frame.
        open_ended: Whether the program does not say when the interval ends.
        timeline: What roles, monitors and scenarios of a match do from when to when; absent where the program has no
            behavior, monitor or scenario that runs others.
        recorded: As of a frame; over all samples of the interval, unless `initial` or `final` is recorded.
        unrecorded: As of a frame, samples counted.
        log_density, log_density_error, log_weight, no_density, dataset, summary: As of a frame.
    """

    recording: str
    start_us: int
    end_us: int
    frames: FramesRecord
    verdict: VerdictName
    correspondence: dict[str, str] = {}
    witness: dict[str, Number | tuple[Number, Number]] = {}
    lanes: dict[str, StandingRecord] | UnsetType = UNSET
    cause: CauseRecord | UnsetType = UNSET
    open_ended: bool = False
    timeline: list[ModeRecord] | UnsetType = UNSET
    recorded: dict[str, CellRecord | SeriesRecord] | UnsetType = UNSET
    unrecorded: dict[str, dict[str, int]] | UnsetType = UNSET
    log_density: float | UnsetType | None = UNSET
    log_density_error: float | UnsetType | None = UNSET
    log_weight: float | UnsetType | None = UNSET
    no_density: str | UnsetType | None = UNSET
    dataset: str | UnsetType = UNSET
    summary: ResultSummary | UnsetType = UNSET

    @property
    def name(self) -> str:
        """What tells it from the other results: its recording and where it starts."""
        return f"{self.recording}@{self.start_us}"


class SummaryRecord(Struct, frozen=True):
    """What stands in the place of results where there are none, and not all was looked at."""

    summary: ResultSummary


Record = FrameRecord | IntervalRecord
RECORDED = ("recorded", "unrecorded")
"""The fields of results of a program that records something."""
DENSITY = ("log_density", "log_density_error", "log_weight", "no_density")
"""The fields of results that are ranked."""

_encode = msgspec.json.Encoder().encode
_fields = msgspec.json.Decoder(dict[str, msgspec.Raw]).decode
_decode = {kind: msgspec.json.Decoder(kind).decode for kind in (FrameRecord, IntervalRecord, SummaryRecord)}


def json_text(value: Any) -> str:
    """A record, or a part of one, as JSON on one line; a number has the fewest digits that read back as it is."""
    return msgspec.json.format(_encode(value), indent=0).decode()


def _kind(names: Mapping[str, object]) -> type[Record | SummaryRecord]:
    if "summary" in names and len(names) == 1:
        return SummaryRecord
    return IntervalRecord if "frames" in names else FrameRecord


def decode_record(line: str | bytes) -> Record | SummaryRecord:
    """The record that a line of JSON holds.

    Raises:
        msgspec.DecodeError: It holds none.
    """
    return _decode[_kind(_fields(line))](line)


def record_of(values: Mapping[str, Any]) -> Record | SummaryRecord:
    """The record that plain values make; numbers and truth values may be texts, as in cells of CSV.

    Raises:
        msgspec.ValidationError: They make none.
    """
    return msgspec.convert(values, _kind(values), strict=False)


def record(result: Result, dataset: str = "", *, every: bool = False) -> Record:
    """A result as it is written.

    Args:
        result: The result.
        dataset: The dataset, as `scenicq.query.execution.result_origin.name_origin` says it; "" where it is not known.
        every: Whether each correspondence by which a frame matches is a result.
    """
    verdict, span = result.verdict, result.interval
    witness: dict[str, Any] = {}
    cause: CauseRecord | UnsetType = UNSET
    if isinstance(verdict, Match):
        roles = verdict.correspondence
        witness = {name: value if type(value) is float else _plain(value) for name, value in verdict.witness.items()}
    elif isinstance(verdict, Unknown):
        roles, cause = verdict.correspondence, _cause(verdict.cause, verdict.reason)
    else:
        roles, cause = verdict.partial, _cause(verdict.cause, "")
    name, origin = _NAMES[type(verdict)], dataset or UNSET
    more = {} if result.density is None else _density(result.density)
    if result.recorded is not None:
        more |= _recorded(result.recorded, series=span is not None)
    if result.lanes is not None:
        more["lanes"] = {role: StandingRecord(list(each.own), list(each.others)) for role, each in result.lanes.items()}
    if span is None:
        return FrameRecord(frame=result.frame, recording=result.recording, timestamp_us=result.timestamp_us,
                           verdict=name, correspondence=_dict(roles), witness=witness, cause=cause,
                           sensors=_dict(result.sensors), all_matches=every or UNSET, dataset=origin,
                           **more)  # fmt: skip
    if result.timeline is not None:
        more["timeline"] = list(result.timeline)
    frames = FramesRecord(result.frame, span.last, span.count)
    return IntervalRecord(recording=result.recording, start_us=result.timestamp_us, end_us=span.end_us, frames=frames,
                          verdict=name, correspondence=_dict(roles), witness=witness, cause=cause,
                          open_ended=span.open_ended, dataset=origin, **more)  # fmt: skip


def recorded_fields(recorded: Mapping[str, CarriedValue], *, series: bool) -> dict[str, CellRecord | SeriesRecord]:
    """What a result carries as it is written.

    Args:
        recorded: What it carries, by name.
        series: Whether the result is of an interval; of a frame the values at each sample are one.
    """
    return {name: _series(each.values) if each.series and series else each.values[0] for name, each in recorded.items()}


def _recorded(recorded: Mapping[str, CarriedValue], *, series: bool) -> dict[str, Any]:
    lacking = {name: dict(each.lacking) for name, each in recorded.items() if each.lacking}
    return {"recorded": recorded_fields(recorded, series=series), "unrecorded": lacking or UNSET}


def _series(values: Sequence[RecordedCell]) -> SeriesRecord:
    numbers = [each for each in values if isinstance(each, float | int) and not isinstance(each, bool)]
    least, most, mean = (min(numbers), max(numbers), math.fsum(numbers) / len(numbers)) if numbers else (None,) * 3
    return SeriesRecord(values[0], values[-1], least, most, mean, list(values))


def _dict(texts: Mapping[str, str]) -> dict[str, str]:
    return texts if isinstance(texts, dict) else dict(texts)


def _density(density: LogDensity) -> dict[str, Any]:
    error = None if density.log is None else density.error
    values = (density.log, error, density.log_weight, density.reason or UNSET)
    return dict(zip(DENSITY, values, strict=True))


def _plain(value: WitnessValue) -> Any:
    """A number, or two, of Python's own types."""
    if isinstance(value, tuple):
        return value if type(value[0]) is type(value[1]) is float else tuple(map(_plain, value))
    return value if type(value) in (float, int) else float(value)


def _cause(cause: Cause, reason: str) -> CauseRecord:
    return CauseRecord(cause.what, cause.detail, cause.place, reason)


def read_record(record: Record, source: Source) -> Result:
    """The result that a record was made of, but for how typical it is.

    Args:
        record: The record.
        source: The program, in which causes have their place.
    """
    verdict = _verdict(record, source)
    lacking, told = record.unrecorded or {}, record.recorded
    recorded = None if told is UNSET else {
        name: CarriedValue(tuple(each.values), series=True, lacking=lacking.get(name, {}))
        if isinstance(each, SeriesRecord)
        else CarriedValue((each,), series=False, lacking=lacking.get(name, {}))
        for name, each in told.items()
    }  # fmt: skip
    standing = None
    if record.lanes is not UNSET:
        standing = {role: ObjectLanes(tuple(each.own), tuple(each.others)) for role, each in record.lanes.items()}
    if isinstance(record, FrameRecord):
        return Result(
            record.frame, record.recording, record.timestamp_us, verdict, record.sensors, recorded=recorded,
            lanes=standing,
        )  # fmt: skip
    frames = record.frames
    span = IntervalSpan(frames.last, record.end_us, frames.count, record.open_ended)
    timeline = None if record.timeline is UNSET else tuple(record.timeline)
    return Result(frames.first, record.recording, record.start_us, verdict, interval=span, recorded=recorded,
                  lanes=standing, timeline=timeline)  # fmt: skip


def _verdict(record: Record, source: Source) -> Verdict:
    roles = record.correspondence
    if record.verdict == "match":
        return Match(roles, record.witness)
    told = record.cause or CauseRecord()
    cause = Cause(told.what, told.detail, _span(told.place, source))
    return Unknown(told.reason, cause, roles) if record.verdict == "unknown" else NoMatch(cause, roles)


def _span(place: str, source: Source) -> Span | None:
    name, *numbers = place.rsplit(":", 2)
    if name != source.file_name or len(numbers) != 2 or not all(map(str.isdecimal, numbers)):
        return None
    line, column = map(int, numbers)
    if not 1 <= line <= len(source.line_starts):
        return None
    start = source.line_starts[line - 1] + column - 1
    return Span(source, start, min(start + 1, len(source.text)))
