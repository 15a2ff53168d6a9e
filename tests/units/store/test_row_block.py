"""Some rows are those of the whole file, as a table and column by column, in groups of any sizes."""

import random

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from scenicq.store.row_block import RowBlock


def _table(draw: random.Random, size: int) -> pa.Table:
    texts = [draw.choice([None, "", "a", "b", "ü"]) for _ in range(size)]
    # whole groups without a value, or with one alone
    for first in range(0, size, 7):
        kind = draw.choice(["none", "one", "some", "some"])
        if kind != "some":
            texts[first : first + 7] = [None if kind == "none" else "one"] * len(texts[first : first + 7])
    reals = [None if text is None else draw.choice([0.0, -0.0, 1.5, draw.random()]) for text in texts]
    columns = {"text": pa.array(texts, pa.string()), "real": pa.array(reals, pa.float64())}
    columns["list"] = pa.array([[1.0, 2.0]] * size, pa.list_(pa.float64()))
    columns["whole"] = pa.array([draw.randrange(1 << 50) for _ in range(size)], pa.int64())
    return pa.table(columns)


@pytest.mark.parametrize("seed", range(30))
def test_some_rows_are_those_of_the_whole(tmp_path, seed):
    draw = random.Random(seed)
    size = draw.choice([0, 1, 7, 50])
    table, file = _table(draw, size), tmp_path / "t.parquet"
    pq.write_table(table, file, row_group_size=draw.choice([1, 7, 20, 100]))
    columns = RowBlock(file, ["real", "text", "list"], texts=["text"])
    for _ in range(5):
        rows = np.array([row for row in range(size) if draw.random() < draw.choice([0.05, 0.5, 1.0])], np.int64)
        codes, texts = columns.codes("text", rows)
        assert len(set(texts)) == len(texts)
        expected = table.take(pa.array(rows)).to_pydict()
        assert [[*texts, None][code] for code in codes.tolist()] == expected["text"]
        taken = columns.take(rows)
        assert taken.to_pydict() == {name: expected[name] for name in ("real", "text", "list")}
        reals = np.array([np.nan if each is None else each for each in expected["real"]], np.float64)
        assert columns.numbers("real", rows).tobytes() == reals.tobytes()
        assert columns.integers("whole", rows).tolist() == expected["whole"]
        assert columns.texts("text", rows) == expected["text"]
        mixed = draw.choices(range(len(rows)), k=2 * len(rows)) if len(rows) else []
        assert columns.texts("text", rows[np.array(mixed, np.int64)]) == [expected["text"][place] for place in mixed]
    assert len(columns) == size
    assert ("real" in columns, "class" in columns) == (True, False)
    columns.close()
