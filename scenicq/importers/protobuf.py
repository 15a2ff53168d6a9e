"""The wire format of protocol buffers: enough to read messages whose fields are known by number."""

from __future__ import annotations

import struct
from collections.abc import Iterator

from scenicq.importers.fields import InvalidError

__all__ = ["Message", "integers", "parse", "to_signed"]

Value = int | float | memoryview
Message = dict[int, list[Value]]
"""Values of each field in their order: numbers, or the bytes of texts, messages and packed lists."""


def parse(content: bytes | memoryview) -> Message:
    """The fields of a message.

    Fixed values of 8 bytes are taken for doubles, of 4 for floats.

    Raises:
        InvalidError: The bytes are cut off or are no message.
    """
    view = memoryview(content)
    found: Message = {}
    position = 0
    while position < len(view):
        key, position = _varint(view, position)
        kind, number = key & 7, key >> 3
        value: Value
        if kind == 0:
            value, position = _varint(view, position)
        elif kind == 2:
            length, position = _varint(view, position)
            value = view[position : position + length]
            if len(value) < length:
                raise InvalidError("a field is longer than its message")
            position += length
        elif kind in (1, 5):
            width = 8 if kind == 1 else 4
            if position + width > len(view):
                raise InvalidError("a field is cut off")
            value = struct.unpack_from("<d" if kind == 1 else "<f", view, position)[0]
            position += width
        else:
            raise InvalidError(f"a field has the unknown kind {kind}")
        found.setdefault(number, []).append(value)
    return found


def to_signed(value: Value) -> int:
    """A whole number; negative ones are in 64 bits."""
    if not isinstance(value, int):
        raise InvalidError("a field is not a whole number")
    return value - (1 << 64) if value >> 63 else value


def integers(values: list[Value]) -> Iterator[int]:
    """The whole numbers of a repeated field, packed or not."""
    for value in values:
        if isinstance(value, memoryview):
            position = 0
            while position < len(value):
                number, position = _varint(value, position)
                yield to_signed(number)
        else:
            yield to_signed(value)


def _varint(view: memoryview, position: int) -> tuple[int, int]:
    result = shift = 0
    while True:
        if position >= len(view) or shift > 63:
            raise InvalidError("a number is cut off or too long")
        byte = view[position]
        position += 1
        result |= (byte & 0x7F) << shift
        if byte < 0x80:
            return result & 0xFFFFFFFFFFFFFFFF, position
        shift += 7
