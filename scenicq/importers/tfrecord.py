"""TFRecord files: records with a length and checksums (CRC-32C, masked), read without TensorFlow.

A record is: length (8 bytes, little-endian), checksum of these bytes, content, checksum of the content.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenicq.errors import DataError, Diagnostic

__all__ = ["crc32c", "read_record", "records"]

_POLYNOMIAL = 0x82F63B78
_MASK = 0xA282EAD8
_LARGEST = 1 << 28
_LANES = 1024


def records(path: Path) -> Iterator[tuple[int, bytes | None]]:
    """The records of a file, each with its offset; None in place of one whose content has changed.

    Raises:
        DataError: `file-missing`, or `file-invalid` where a length is wrong: nothing after it can be found.
    """
    try:
        size = path.stat().st_size
        offset = 0
        with path.open("rb") as file:
            while offset < size:
                head = file.read(12)
                length = int.from_bytes(head[:8], "little")
                if len(head) < 12 or _masked(head[:8]) != int.from_bytes(head[8:], "little"):
                    raise _invalid(path, offset, "has a wrong length")
                if length > _LARGEST or offset + 16 + length > size:
                    raise _invalid(path, offset, f"claims {length} bytes, more than there are")
                content, end = file.read(length), file.read(4)
                yield offset, content if _masked(content) == int.from_bytes(end, "little") else None
                offset += 16 + length
    except OSError as error:
        raise DataError(Diagnostic("file-missing", f"{path} cannot be read: {error.strerror}")) from error


def read_record(path: Path, offset: int) -> bytes:
    """The content of the record at an offset that `records` gave.

    Raises:
        DataError: `file-missing` or `file-invalid`.
    """
    try:
        with path.open("rb") as file:
            file.seek(offset)
            length = int.from_bytes(file.read(12)[:8], "little")
            if length > _LARGEST:
                raise _invalid(path, offset, "has a wrong length")
            return file.read(length)
    except OSError as error:
        raise DataError(Diagnostic("file-missing", f"{path} cannot be read: {error.strerror}")) from error


def crc32c(content: bytes) -> int:
    """The CRC-32C of some bytes.

    Long contents are cut into lanes of equal length whose checksums are computed side by side and then joined: a
    checksum is linear, so what follows a lane only moves its bits.
    """
    share = len(content) // _LANES
    state = 0xFFFFFFFF
    done = 0
    if share >= 16:
        done = share * _LANES
        lanes: NDArray[np.uint8] = np.frombuffer(content, np.uint8, done).reshape(_LANES, share).T.copy()
        states = np.zeros(_LANES, np.uint32)
        states[0] = state
        table = _table()
        for column in lanes:
            states = (states >> np.uint32(8)) ^ table[(states ^ column) & np.uint32(0xFF)]
        moves = _moves(share)
        state = 0
        for lane in states.tolist():
            state = _moved(moves, state) ^ lane
    plain = _plain_table()
    for byte in content[done:]:
        state = (state >> 8) ^ plain[(state ^ byte) & 0xFF]
    return state ^ 0xFFFFFFFF


def _masked(content: bytes) -> int:
    crc = crc32c(content)
    return (((crc >> 15) | (crc << 17)) + _MASK) & 0xFFFFFFFF


@cache
def _plain_table() -> list[int]:
    table: list[int] = []
    for byte in range(256):
        for _ in range(8):
            byte = (byte >> 1) ^ (_POLYNOMIAL if byte & 1 else 0)  # noqa: PLW2901
        table.append(byte)
    return table


@cache
def _table() -> Any:
    return np.array(_plain_table(), np.uint32)


def _moves(count: int) -> list[list[int]]:
    """Tables, by byte, of what a state becomes after `count` zero bytes."""
    columns = [1 << bit for bit in range(32)]
    power = [_plain_table()[column & 0xFF] ^ (column >> 8) for column in columns]
    while count:
        if count & 1:
            columns = [_applied(power, column) for column in columns]
        power = [_applied(power, column) for column in power]
        count >>= 1
    return [[_applied(columns[8 * byte : 8 * byte + 8], value) for value in range(256)] for byte in range(4)]


def _applied(columns: list[int], value: int) -> int:
    result = 0
    for column in columns:
        if value & 1:
            result ^= column
        value >>= 1
    return result


def _moved(moves: list[list[int]], state: int) -> int:
    return moves[0][state & 255] ^ moves[1][state >> 8 & 255] ^ moves[2][state >> 16 & 255] ^ moves[3][state >> 24]


def _invalid(path: Path, offset: int, what: str) -> DataError:
    return DataError(Diagnostic("file-invalid", f"{path}: the record at byte {offset} {what}"))
