"""Rows of a table that come in however small pieces: the file of one piece, in bounded memory."""

import random

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from scenicq.store.parquet import TableWriter
from scenicq.store.schema import SEGMENT_TABLES

ROWS = 4000


def first_rows(dataset, table):
    (path,) = (dataset / table).iterdir()
    return pq.read_table(path).slice(0, ROWS).replace_schema_metadata()


def pieces_of(rows, sizes):
    """Rows in pieces, each in memory of its own."""
    done = 0
    while done < len(rows):
        size = sizes()
        yield pa.Table.from_pylist(rows.slice(done, size).to_pylist(), schema=rows.schema)
        done += size


@pytest.mark.parametrize("table", SEGMENT_TABLES)
def test_however_small_pieces_make_the_same_file_in_bounded_memory(table, crossroads, tmp_path):
    rows, chance = first_rows(crossroads, table), random.Random(table)
    parts = []
    for sizes in (lambda: ROWS, lambda: 1, lambda: chance.randint(1, 900)):
        writer = TableWriter(tmp_path, table, row_group=700)
        for piece in pieces_of(rows, sizes):
            writer.add(piece)
        parts.append(writer.finish())
    assert parts[1:] == parts[:-1]


@pytest.mark.parametrize("table", SEGMENT_TABLES)
@pytest.mark.one_in(8)
@pytest.mark.slow
def test_pieces_that_wait_take_as_much_memory_as_their_values(table, crossroads, tmp_path):
    some = first_rows(crossroads, table)
    rows = pa.concat_tables([some] * (ROWS // len(some) + 1)).combine_chunks()
    before = pa.total_allocated_bytes()
    (one,) = pieces_of(rows.slice(0, 1), lambda: 1)
    of_one = pa.total_allocated_bytes() - before
    writer, most = TableWriter(tmp_path, table), 0
    for piece in pieces_of(rows, lambda: 1):
        writer.add(piece)
        most = max(most, pa.total_allocated_bytes() - before)
    writer.abandon()
    assert len(one) == 1
    assert most < 300 * of_one + 3 * rows.nbytes < ROWS * of_one
