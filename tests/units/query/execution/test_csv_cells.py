"""Whatever a text is, its cell moves no cursor, is no formula for a spreadsheet, and the text comes back."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenicq.query.execution.csv_cells import quote_cell, unquote_cell
from scenicq.query.execution.records import json_text, record_of
from scenicq.query.execution.result_files import read_records
from scenicq_cli.formats import make_writer

EVIL = ["-1", "=1+1", "+1", "@x", "'x", "''", "'=x", "\tx", "x\r", "\x1b[31m", "\u202ex", "-\\n\\u202e", "\\", "'\\t"]


@pytest.mark.parametrize("spreadsheet", [False, True])
@given(text=st.one_of(st.text(), st.text("=+-@'\\tnrxu0123\t\r\n\x1b\x9b\u202e\ufeff,\"")))
def test_texts_come_back(text: str, spreadsheet: bool) -> None:
    cell = quote_cell(text, spreadsheet=spreadsheet)
    assert not (spreadsheet and cell.startswith(("=", "+", "-", "@", "\t", "\r")))
    assert spreadsheet or cell == text or text.startswith("'") or not text.isprintable()
    assert not {"\x1b", "\x9b", "\u202e", "\r", "\t"} & set(cell)
    assert unquote_cell(cell) == text
    lines = io.StringIO(newline="")
    csv.writer(lines, lineterminator="\n").writerow([cell, "x"])
    assert next(csv.reader(io.StringIO(lines.getvalue(), newline="")))[0] == cell


@pytest.mark.parametrize("name", EVIL)
def test_records_come_back(tmp_path: Path, name: str) -> None:
    record = {
        "frame": name,
        "recording": name,
        "timestamp_us": 0,
        "verdict": "match",
        "dataset": f"{name}@1",
        "correspondence": {"ego": "ego", "other": name},
        "witness": {name: 1.0},
        "sensors": {name: name},
    }
    read = {}
    for form, suffix in (("csv", "csv"), ("spreadsheet", "csv"), ("jsonl", "jsonl")):
        sink = io.BytesIO()
        writer = make_writer(form, sink, lambda: ("ego", "other"), origin=f"{name}@1")
        writer.write(record_of(record))
        writer.finish()
        (tmp_path / f"r.{suffix}").write_bytes(sink.getvalue())
        (found,) = read_records(tmp_path / f"r.{suffix}")
        read[form] = json.loads(json_text(found))
    assert read["csv"] == read["spreadsheet"] == read["jsonl"] == json.loads(json.dumps(record))
