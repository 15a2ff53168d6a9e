"""What is written of a result is read back, in every format, and what is no result is refused with its place."""

from __future__ import annotations

import io
import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenicq.errors import CONTROL, DataError, Source
from scenicq.match.verdict import Cause, Match, NoMatch, Unknown
from scenicq.query.execution.recorded_columns import RecordedColumn, columns_of_records
from scenicq.query.execution.records import FrameRecord, SeriesRecord, decode_record, json_text, read_record, record
from scenicq.query.execution.result_files import read_records
from scenicq.query.execution.result_tables import result_schema, roles_of
from scenicq.query.execution.results import CarriedValue, IntervalSpan, LogDensity, ModeRecord, ProgramPlace, Result
from scenicq_cli.formats import make_writer

texts = st.text(st.characters(codec="utf-8"), max_size=8)
names = texts.filter(bool)
finite = st.floats(allow_nan=False, allow_infinity=False)
numbers = finite | finite.map(np.float64) | st.sampled_from([-0.0, 3, 1e-7, 5e-324, 1e22])
named = st.dictionaries(names, texts, max_size=3)
witnesses = st.dictionaries(texts, numbers | st.tuples(numbers, numbers), max_size=3)
verdicts = (
    st.builds(Match, named, witnesses)
    | st.builds(NoMatch, st.builds(Cause, names, texts), named)
    | st.builds(Unknown, names, st.builds(Cause, texts), named)
)
whole = st.integers(-(2**63), 2**63 - 1)
spans = st.builds(IntervalSpan, names, whole, st.integers(1, 2**40), st.booleans())
densities = st.builds(LogDensity, st.none() | finite, log_weight=st.none() | finite, reason=texts)
cells = st.sampled_from([finite, st.booleans(), texts, st.tuples(finite, finite)])


def recorded_of(values: list[object], reason: str, series: bool) -> CarriedValue:
    missing = values.count(None)
    return CarriedValue(tuple(values if series else values[:1]), series, {reason: missing} if missing else {})


def recordings_of(kind: st.SearchStrategy[object]) -> st.SearchStrategy[CarriedValue]:
    return st.builds(recorded_of, st.lists(st.none() | kind, min_size=1, max_size=4), names, st.booleans())


# a program's names have neither
plain_names = names.filter(lambda each: not CONTROL.search(each) and "\n" not in each)
recorded = st.dictionaries(plain_names, cells.flatmap(recordings_of), min_size=1, max_size=3)
modes = st.builds(
    ModeRecord, st.sampled_from(["behavior", "monitor", "scenario"]), texts,
    st.lists(st.builds(ProgramPlace, texts, texts), max_size=2), whole, whole, st.integers(1, 2**40),
)  # fmt: skip
timelines = st.lists(modes, max_size=3).map(tuple)
results = st.builds(
    Result, names, names, whole, verdicts, named, st.none() | spans, st.none() | densities, st.none() | recorded,
    timeline=st.none() | timelines,
).map(lambda each: each if each.interval is not None else replace(each, timeline=None))  # fmt: skip
"""Results, of which intervals alone have timelines."""


@given(results, texts)
def test_a_line_says_all_and_is_read_back(result, dataset):
    told = record(result, dataset)
    line = json_text(told)
    assert "\n" not in line
    assert decode_record(line) == told
    values = json.loads(line)
    assert list(values) == [name for name in told.__struct_fields__ if name in values]
    assert values["verdict"] == {Match: "match", NoMatch: "no_match", Unknown: "unknown"}[type(result.verdict)]
    if isinstance(result.verdict, Match):
        assert {
            k: tuple(v) if isinstance(v, list) else v for k, v in values["witness"].items()
        } == result.verdict.witness
        assert "cause" not in values
    assert values.get("dataset", "") == dataset
    assert ("log_density" in values) == (result.density is not None)


@given(results.filter(lambda each: not CONTROL.search(repr(each))))
@pytest.mark.parametrize("every", [False, True])
@pytest.mark.parametrize("form", ["jsonl", "csv", "spreadsheet", "parquet"])
def test_every_format_is_read_back(tmp_path_factory, form, every, result):
    told = record(result, "town@1", every=every)
    ranked, over_time = result.density is not None, result.interval is not None
    sink = io.BytesIO()
    roles = lambda: roles_of([told])  # noqa: E731
    columns = lambda: columns_of_records([told])  # noqa: E731
    writer = make_writer(
        form, sink, roles, recorded=columns, origin="town@1", ranked=ranked, over_time=over_time, every=every,
        timelines=lambda: result.timeline is not None,
    )  # fmt: skip
    writer.write(told)
    writer.finish()
    file = tmp_path_factory.mktemp("r") / f"r.{'csv' if form == 'spreadsheet' else form}"
    file.write_bytes(sink.getvalue())
    (found,) = read_records(file)
    for name in told.__struct_fields__:
        mine, its = getattr(told, name), getattr(found, name)
        assert its == mine or (not its and not mine), name


def test_the_columns_are_the_fields():
    columns = (RecordedColumn("gap", "number", series=False), RecordedColumn("place", "vector", series=True))
    schema = result_schema(("ego", "car"), ranked=True, every=True, recorded=columns)
    assert schema.names == [name for name in FrameRecord.__struct_fields__ if name not in ("dataset", "summary")]
    assert str(schema.field("witness").type) == "map<string, list<item: double>>"
    assert str(schema.field("cause").type) == "struct<what: string, detail: string, place: string, reason: string>"
    assert str(schema.field("correspondence").type) == "struct<ego: string, car: string>"
    parts = "minimum: double, maximum: double, mean: double"
    place = "list<item: double>"
    series = f"struct<first: {place}, last: {place}, {parts}, values: list<item: {place}>>"
    assert str(schema.field("recorded").type) == f"struct<gap: double, place: {series}>"
    assert str(schema.field("unrecorded").type) == "map<string, map<string, int64>>"
    assert not {"recorded", "unrecorded"} & {*result_schema(("ego",)).names}
    times = result_schema(("ego",), over_time=True)
    assert str(times.field("frames").type) == "struct<first: string, last: string, count: int64>"
    assert [str(times.field(name).type) for name in ("end_us", "open_ended")] == ["int64", "bool"]
    assert "timeline" not in times.names
    told = result_schema(("ego",), over_time=True, timelines=True).field("timeline").type
    place = "list<item: struct<what: string, place: string>>"
    parts = f"kind: string, of: string, mode: {place}, start_us: int64, end_us: int64, frames: int64"
    assert str(told) == f"list<item: struct<{parts}>>"


LINE = '{"frame": "a", "recording": "r", "verdict": "match"%s}'
TIME = '{"recording": "r", "start_us": 1, "end_us": 2, "verdict": "match", "frames": {"first": "a", "last": "b"%s}}'


@pytest.mark.parametrize(
    ("line", "place"),
    [
        (LINE % ', "correspondence": {"ego": 3}', r"`\$\.correspondence\[\.\.\.\]`"),
        (LINE % ', "witness": {"x": "1"}', r"`\$\.witness\[\.\.\.\]`"),
        (LINE % ', "timestamp_us": 1.5', r"`\$\.timestamp_us`"),
        (LINE.replace("match", "yes") % "", r"`\$\.verdict`"),
        (TIME % ', "count": "9"', r"`\$\.frames\.count`"),
        (TIME % "", r"`count` - at `\$\.frames`"),
        ("[1]", "Expected `object`, got `array`"),
        ("{", "truncated"),
        ("[" * 100_000, "RecursionError|nesting|recursion|Expected `object`"),
    ],
)
def test_what_is_no_result_is_refused_with_its_place(tmp_path: Path, line: str, place: str):
    (tmp_path / "a.jsonl").write_text(LINE % "" + "\n" + line + "\n")
    with pytest.raises(DataError, match=rf"a\.jsonl holds no results: line 2 is no result: .*({place})"):
        list(read_records(tmp_path / "a.jsonl"))


def test_columns_may_be_missing(tmp_path: Path):
    (tmp_path / "a.csv").write_text("frame,recording,verdict\na,r,match\n")
    (found,) = read_records(tmp_path / "a.csv")
    assert found == FrameRecord(frame="a", recording="r", verdict="match")


def test_numbers_have_the_fewest_digits():
    values = (0.1, 1e-7, 3.0, math.pi)
    told = record(Result("f", "r", 1, Match({}, {str(n): value for n, value in enumerate(values)})))
    assert [json.loads(json_text(told))["witness"][str(n)] for n in range(4)] == list(values)


@given(results)
def test_a_result_is_made_again(result):
    again = read_record(decode_record(json_text(record(result))), Source("p.scenic", ""))
    assert (again.recorded is None) == (result.recorded is None)
    told, own = record(again), record(result)
    assert (told.recorded, told.unrecorded) == (own.recorded, own.unrecorded)


def test_a_series_has_its_ends_and_what_lies_between():
    values = (3.0, None, -1.0, 7.5)
    recorded = {"gap": CarriedValue(values, series=True, lacking={"not observed": 1})}
    span = IntervalSpan("f3", 3, 4, open_ended=False)
    told = record(Result("f", "r", 1, Match({}, {}), interval=span, recorded=recorded))
    assert told.recorded["gap"] == SeriesRecord(3.0, 7.5, -1.0, 7.5, (3.0 - 1.0 + 7.5) / 3, list(values))
    of_frame = record(Result("f", "r", 1, Match({}, {}), recorded={"gap": CarriedValue((3.0,), series=True)}))
    assert of_frame.recorded == {"gap": 3.0}
