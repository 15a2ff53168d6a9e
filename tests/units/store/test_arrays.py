"""Arrays made of NumPy's are those that pyarrow makes."""

from __future__ import annotations

from typing import Any
from unittest.mock import patch

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenicq.store import arrays
from scenicq.store.arrays import Texts, lists_at, number_array, repeated_texts

names = st.lists(st.text(st.sampled_from("aü😀"), max_size=3), max_size=4)


@given(values=st.lists(st.floats(), max_size=20))
def test_nan_becomes_null(values: list[float]) -> None:
    found = number_array(np.array(values, dtype=np.float64), pa.float64())
    found.validate(full=True)
    assert found.equals(pa.array(np.array(values, dtype=np.float64), from_pandas=True))


@pytest.mark.parametrize("kind", [pa.int32(), pa.int64(), pa.uint64()])
def test_whole_numbers(kind: Any) -> None:
    values = np.arange(20)[::3]
    found = number_array(values, kind)
    found.validate(full=True)
    assert found.equals(pa.array(values.tolist(), kind))


@given(values=st.lists(st.lists(st.floats(-9, 9), max_size=3), min_size=1, max_size=4), data=st.data())
def test_lists(values: list[list[float]], data: st.DataObject) -> None:
    at = data.draw(st.lists(st.integers(0, len(values) - 1)))
    found = lists_at(values, np.array(at, dtype=np.intp))
    found.validate(full=True)
    assert found.equals(pa.array([values[number] for number in at], pa.list_(pa.float64())))


@given(texts=names, data=st.data())
def test_texts(texts: list[str], data: st.DataObject) -> None:
    table = Texts(texts)
    with patch.object(arrays, "FEW", 10):
        for _ in range(3):
            at = data.draw(st.lists(st.integers(-1, len(texts) - 1), max_size=8))
            found = table.at(np.array(at, dtype=np.int64))
            found.validate(full=True)
            assert found.type == pa.string()
            assert found.to_pylist() == [None if number < 0 else texts[number] for number in at]


@pytest.mark.parametrize("most", [arrays.MOST_BYTES, 1])
@given(pairs=st.lists(st.tuples(st.text(max_size=3).filter(str.isprintable), st.integers(0, 3)), max_size=5))
def test_repeated(most: int, pairs: list[tuple[str, int]]) -> None:
    counts = np.array([count for _, count in pairs], dtype=np.int64)
    with patch.object(arrays, "MOST_BYTES", most):
        found = repeated_texts([text for text, _ in pairs], counts)
    found.validate(full=True)
    assert found.type == pa.string()
    assert found.to_pylist() == [text for text, count in pairs for _ in range(count)]
