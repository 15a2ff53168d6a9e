"""Reading a JSON list piece by piece is the same as reading it at once."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from msgspec.json import Decoder

from scenicq.errors import DataError
from scenicq.importers import json_tables
from scenicq.importers.json_tables import ElementBlock, read_list

ROWS = Decoder(list[dict[str, Any]])

values = st.recursive(
    st.none() | st.booleans() | st.integers(-999, 999) | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=5,
)
objects = st.lists(st.dictionaries(st.text(), values, max_size=3), max_size=6)


def elements(file: Path) -> list[tuple[object, int]]:
    """All elements with their lines."""
    return [each for block in read_list(file, ROWS) for each in values_of(block)]


def values_of(block: ElementBlock[dict[str, Any]]) -> list[tuple[object, int]]:
    """The elements of a block with their lines; what is told of all of them at once is what is told of each."""
    found = [json.loads(bytes(element)) for element in block.elements]
    assert block.rows is None or repr(block.rows) == repr(found)
    return [(value, block.line(number)) for number, value in enumerate(found)]


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(content=objects, indent=st.none() | st.integers(0, 2), chunk=st.integers(1, 40) | st.just(1 << 20))
def test_same_as_reading_at_once(tmp_path: Path, content: list[object], indent: int | None, chunk: int) -> None:
    file = tmp_path / "list.json"
    text = json.dumps(content, indent=indent)
    file.write_text(text, encoding="utf-8")
    with patch.object(json_tables, "_CHUNK", chunk):
        found = elements(file)
    assert [value for value, _ in found] == content
    if indent is None:
        assert {line for _, line in found} <= {1}


def test_lines(tmp_path: Path) -> None:
    file = tmp_path / "list.json"
    file.write_text('\n[\n{"a":\n1},\n\n{"b": 2}\n]')
    assert elements(file) == [({"a": 1}, 3), ({"b": 2}, 6)]


@pytest.mark.parametrize(
    ("content", "place"),
    [(b"", 1), (b"{}", 1), (b'[\n{"a": 1},\n{"b": ', 3), (b"[\n1\n", 3), (b"[1, nope]", 1), (b"[", 1)],
)
def test_cut_off_or_not_json(tmp_path: Path, content: bytes, place: int) -> None:
    file = tmp_path / "list.json"
    file.write_bytes(content)
    with pytest.raises(DataError, match=f"list.json:{place} "):
        list(read_list(file, ROWS))


def test_no_text_and_no_file(tmp_path: Path) -> None:
    (tmp_path / "list.json").write_bytes(b"[\xff]")
    with pytest.raises(DataError) as error:
        list(read_list(tmp_path / "list.json", ROWS))
    assert error.value.diagnostics[0].code == "file-invalid"
    with pytest.raises(DataError) as error:
        list(read_list(tmp_path / "nowhere.json", ROWS))
    assert error.value.diagnostics[0].code == "file-missing"


def read_or_told(file: Path) -> tuple[list[tuple[object, int]], str]:
    """All elements before the first that is unsound, and what is said of that."""
    found: list[tuple[object, int]] = []
    try:
        for block in read_list(file, ROWS):
            found += values_of(block)
    except DataError as error:
        return found, error.diagnostics[0].message
    return found, ""


JUNK = ["", "[", "]", "{", "}", '"', ",", "},\n{", "\n", "\\", " ", "1", "NaN", "\x00"]


@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    content=objects, indent=st.none() | st.integers(0, 2), chunk=st.integers(1, 60) | st.just(1 << 20), data=st.data()
)
def test_at_once_is_as_one_by_one(
    tmp_path: Path, content: list[object], indent: int | None, chunk: int, data: st.DataObject
) -> None:
    file = tmp_path / "list.json"
    text = json.dumps(content, indent=indent)
    at = data.draw(st.integers(0, len(text)))
    text = text[:at] + data.draw(st.sampled_from(JUNK)) + text[at + data.draw(st.integers(0, 2)) :]
    file.write_text(text, encoding="utf-8")
    with patch.object(json_tables, "_CHUNK", chunk):
        found = read_or_told(file)
        with patch.object(json_tables, "_TAIL", 0):
            expected = read_or_told(file)
    assert repr(found) == repr(expected)


def test_many_elements_are_read_at_once(tmp_path: Path) -> None:
    file = tmp_path / "list.json"
    file.write_text(json.dumps([{"a": n} for n in range(1000)], indent=0))
    assert [len(block.elements) for block in read_list(file, ROWS)] == [999, 1]
