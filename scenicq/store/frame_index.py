"""The table `frame_index` says where each frame is, sorted by a hash of the frame's name.

Names of frames are often random, so no order of the labels helps to find one; this table does, by its statistics.
"""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Iterable, Sequence

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from scenicq.store.arrays import number_array
from scenicq.store.place import StoreFile, open_parquet
from scenicq.store.schema import SCHEMAS, ArrowTable

__all__ = ["find_rows", "frame_hashes", "index_rows", "repeated_rows"]


def frame_hashes(frames: Iterable[str]) -> NDArray[np.uint64]:
    """A hash of each name, the same on every machine."""
    hashed = [hashlib.blake2b(frame.encode(), digest_size=8).digest() for frame in frames]
    return np.frombuffer(b"".join(hashed), dtype="<u8").astype(np.uint64)


def index_rows(hashes: NDArray[np.uint64]) -> ArrowTable:
    """Make the table from the hashes of all frames, in the order of the labels."""
    order = np.argsort(hashes, kind="stable")
    schema = SCHEMAS["frame_index"]
    columns = [number_array(hashes[order], pa.uint64()), number_array(order, pa.int64())]
    return pa.Table.from_arrays(columns, schema=schema)


def repeated_rows(hashes: NDArray[np.uint64]) -> NDArray[np.int64]:
    """Find the rows whose hash occurs more than once, in order; almost always there are none."""
    order = np.argsort(hashes, kind="stable")
    same = hashes[order][1:] == hashes[order][:-1]
    repeated = np.zeros(len(hashes), dtype=bool)
    repeated[order[1:][same]] = repeated[order[:-1][same]] = True
    return np.flatnonzero(repeated)


def find_rows(files: Sequence[StoreFile], frames: Collection[str]) -> NDArray[np.int64]:
    """Find the rows of some frames, in order: all of them, and hardly ever another one with the same hash.

    Args:
        files: The files of the table `frame_index`.
        frames: Names of frames; those that are not there find nothing.
    """
    wanted = np.sort(frame_hashes(frames))
    found: list[NDArray[np.int64]] = [np.empty(0, np.int64)]
    for path in files if len(wanted) else ():
        with open_parquet(path) as file:
            for group in range(file.num_row_groups):
                known = file.metadata.row_group(group).column(0).statistics
                if known is not None and known.has_min_max:
                    low, high = np.uint64(known.min), np.uint64(known.max)
                    if np.searchsorted(wanted, low) == np.searchsorted(wanted, high, side="right"):
                        continue
                table = file.read_row_group(group)
                hashes = table["hash"].to_numpy()
                places = np.searchsorted(hashes, wanted)
                ends = np.searchsorted(hashes, wanted, side="right")
                rows = table["row"].to_numpy()
                found += [rows[place:end] for place, end in zip(places, ends, strict=True) if place < end]
    return np.sort(np.concatenate(found))
