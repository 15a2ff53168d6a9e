"""Check well-known binary before a geometry library sees it: kinds, nesting, counts and coordinates.

A library may read a hostile text recursively, or allocate what a count announces; what passes here it can read safely.
"""

from __future__ import annotations

import struct

import numpy as np

__all__ = ["FARTHEST_M", "wkb_problem"]

FARTHEST_M = 1e7
"""Metres from the origin of a map beyond which nothing on earth lies: half of its circumference, about."""

_LINE, _POLYGON, _MULTI_LINE, _MULTI_POLYGON = 2, 3, 5, 6
_MEMBER = {_MULTI_LINE: _LINE, _MULTI_POLYGON: _POLYGON}
_LINES, _AREAS = frozenset({_LINE, _MULTI_LINE}), frozenset({_POLYGON, _MULTI_POLYGON})
_FEWEST = {_LINE: 2, _POLYGON: 4}
"""Points of a line and of a ring."""


def wkb_problem(data: bytes, *, lines: bool) -> str | None:
    """Say why a text is not lines or polygons in the plane; None where it is.

    Args:
        data: The text.
        lines: Whether a LineString or MultiLineString is expected, else a Polygon or MultiPolygon.
    """
    try:
        kind, at = _header(data, 0)
        if kind not in (_LINES if lines else _AREAS):
            return f"is not a {'line' if lines else 'polygon'} in the plane"
        count, member = 1, kind
        if kind in _MEMBER:
            count, member, at = _count(data, at), _MEMBER[kind], at + 4
        else:
            at = 0
        for _ in range(count):
            found, at = _header(data, at)
            if found != member:
                return "holds a member of another kind"
            at = _simple(data, at, member)
    except (_UnsoundError, struct.error) as error:
        return str(error) if isinstance(error, _UnsoundError) else "ends too early"
    return None if at == len(data) else "goes on behind its end"


class _UnsoundError(Exception):
    """The text is no geometry that can be used."""


def _header(data: bytes, at: int) -> tuple[int, int]:
    """The kind of the geometry that begins at a byte, and where its content does."""
    order, kind = struct.unpack_from("<BI", data, at)
    if order != 1:
        raise _UnsoundError("is not little-endian")
    return kind, at + 5


def _count(data: bytes, at: int) -> int:
    count: int = struct.unpack_from("<I", data, at)[0]
    return count


def _simple(data: bytes, at: int, kind: int) -> int:
    """Look at a line or polygon; where it ends."""
    rings = 1
    if kind == _POLYGON:
        rings, at = _count(data, at), at + 4
        if not rings:
            raise _UnsoundError("is empty")
    for _ in range(rings):
        points, at = _count(data, at), at + 4
        end = at + 16 * points
        if end > len(data):
            raise _UnsoundError("ends too early")
        if points < _FEWEST[kind]:
            raise _UnsoundError("has a line or ring of too few points")
        corners = np.frombuffer(data, "<f8", 2 * points, at)
        if not (np.abs(corners) <= FARTHEST_M).all():  # so that nan is none, either
            raise _UnsoundError("has a coordinate that is no place on a map")
        if kind == _POLYGON and (corners[:2] != corners[-2:]).any():
            raise _UnsoundError("has a ring that is not closed")
        at = end
    return at
