"""Where in a lane each segment of its centreline is the nearest one, as convex cells.

The distance to a segment is the distance to its line beside it, and to an end point before and behind it. Where the
same kind of distance is compared for two segments, the border is straight; where a line is compared with a point that
isn't on it (a parabola, which takes segments that don't touch) the cell keeps both sides and a guard tells them apart.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenicq.geometry import shapes
from scenicq.geometry.cell_guards import NearestSegment, segment_distances
from scenicq.geometry.cells import convex_parts
from scenicq.geometry.fields import FieldCell
from scenicq.geometry.shapes import Shape

__all__ = ["Outline", "convex_outlines", "segment_cells"]

_SMALLEST = 1e-10
"""Square metres below which a cell is a rounding error."""
_ON_LINE = 1e-9
_LOST = 1e-5
"""Square metres that joining cells may lose or gain by rounding coordinates."""

Outline = list[tuple[float, float]]
"""Corners of a convex piece, counter-clockwise."""
_HalfPlane = tuple[float, float, float]  # a x + b y >= c


def convex_outlines(area: Shape) -> list[Outline]:
    """The polygon of a lane in convex pieces."""
    return [_outline(part) for piece in shapes.polygonal_part(area) for part in convex_parts(piece)]


def segment_cells(
    whole: Sequence[Outline],
    segments: NDArray[np.float64],
    headings: NDArray[np.float64],
    index: int,
) -> list[FieldCell]:
    """The cells of a lane in which one segment is the nearest.

    Args:
        whole: The lane in convex pieces.
        segments: Its centreline, (n, 4) rows x0, y0, x1, y1 of positive length.
        headings: Of the segments, (n,).
        index: Which segment.
    """
    # near segments cut most
    order = np.argsort(np.abs(np.arange(len(segments)) - index), kind="stable")
    others = order[headings[order] != headings[index]]
    pieces = [part for outline in whole for part in _nearest(_Piece(outline), segments, index, others)]
    rivals = sorted({rival for piece in pieces for rival in piece.rivals})
    cells: list[FieldCell] = []
    for exact in (True, False):
        outlines = [piece.outline for piece in pieces if (not piece.rivals) == exact]
        guards = () if exact else (NearestSegment(segments[index][None], segments[rivals]),)
        for part in _joined(outlines):
            cells.append(FieldCell(part, float(headings[index]), guards))
    return cells


@dataclass(frozen=True, slots=True)
class _Piece:
    """A convex outline, and the segments against which it covers too much."""

    outline: Outline
    rivals: frozenset[int] = frozenset()


def _joined(outlines: list[Outline]) -> list[NDArray[np.float64]]:
    """The same area in fewer pieces."""
    plain = [np.array(outline) for outline in outlines]
    if len(outlines) <= 1:
        return plain
    merged = shapes.snapped_union([shapes.polygon(outline) for outline in outlines])
    joined = [part for piece in shapes.polygonal_part(merged) for part in convex_parts(piece)]
    lost = sum(map(_area, outlines)) - sum(_area(_outline(part)) for part in joined)
    # cuts that nearly coincide leave slivers: nothing is gained by joining across them
    return joined if abs(lost) < _LOST and len(joined) < len(plain) else plain


def _nearest(whole: _Piece, segments: NDArray[np.float64], index: int, others: NDArray[np.intp]) -> Iterator[_Piece]:
    """The parts of a piece that are at least as near to one segment as to some others."""
    todo = [(whole, others)]
    while todo:
        piece, rivals = todo.pop()
        corners = np.array(piece.outline)
        own = segment_distances(corners, segments[index])
        away = segment_distances(corners[:, None], segments[rivals])
        # the distance to a convex set is convex, with slope 1: greatest at a corner, not much less than at a corner
        span = float(np.hypot(*(corners.max(axis=0) - corners.min(axis=0))))
        if (own.min() - span > away.max(axis=0)).any():
            continue
        left = rivals[own.max() > away.min(axis=0) - span]
        if len(left):
            parts = list(_nearer(piece, segments[index], segments[left[0]], int(left[0])))
            todo += [(part, left[1:]) for part in reversed(parts)]
        else:
            yield piece


def _nearer(piece: _Piece, segment: NDArray[np.float64], rival: NDArray[np.float64], number: int) -> Iterator[_Piece]:
    """The parts of a piece that are at least as near to the segment as to the rival of a number."""
    for zone, near in _zones(piece.outline, segment):
        for part, far in _zones(zone, rival):
            found, sharp = _compared(part, near, far)
            rivals = piece.rivals if sharp else piece.rivals | {number}
            yield from (_Piece(cut, rivals) for cut in found if _area(cut) > _SMALLEST)


def _zones(piece: Outline, segment: NDArray[np.float64]) -> Iterator[tuple[Outline, tuple[float, ...]]]:
    """A piece cut into what lies before, beside and behind a segment, each with the end point or line to measure to.

    A point is (x, y); a line is (a, b, c) with distance |a x + b y - c|.
    """
    x0, y0, x1, y1 = segment.tolist()
    length = float(np.hypot(x1 - x0, y1 - y0))
    ux, uy = (x1 - x0) / length, (y1 - y0) / length
    first, last = ux * x0 + uy * y0, ux * x1 + uy * y1
    for planes, target in (
        ([(-ux, -uy, -first)], (x0, y0)),
        ([(ux, uy, first), (-ux, -uy, -last)], (-uy, ux, -uy * x0 + ux * y0)),
        ([(ux, uy, last)], (x1, y1)),
    ):
        part = _clip(piece, planes)
        if _area(part) > _SMALLEST:
            yield part, target


def _compared(piece: Outline, near: tuple[float, ...], far: tuple[float, ...]) -> tuple[list[Outline], bool]:
    """The parts of a piece at least as near to one point or line as to another, and whether exactly these."""
    if len(near) == 2 and len(far) == 2:
        dx, dy = near[0] - far[0], near[1] - far[1]
        if dx == 0 and dy == 0:
            return [piece], True
        middle = (near[0] + far[0]) / 2 * dx + (near[1] + far[1]) / 2 * dy
        return [_clip(piece, [(dx, dy, middle)])], True
    if len(near) == 3 and len(far) == 3:
        found: list[Outline] = []
        (a, b, c), (d, e, f) = near, far
        for sign in (1.0, -1.0):
            side = (sign * d, sign * e, sign * f)
            closer = [(side[0] - s * a, side[1] - s * b, side[2] - s * c) for s in (1.0, -1.0)]
            found.append(_clip(piece, [side, *closer]))
        return found, True
    point, line = (near, far) if len(near) == 2 else (far, near)
    if abs(line[0] * point[0] + line[1] * point[1] - line[2]) <= _ON_LINE:
        # a line is never farther away than a point on it
        return ([] if len(near) == 2 else [piece]), True
    own, other = _range(piece, near), _range(piece, far)
    if own[0] > other[1]:
        return [], True
    return [piece], own[1] <= other[0]


def _range(piece: Outline, target: tuple[float, ...]) -> tuple[float, float]:
    """Least and greatest distance from a piece to a point or a line."""
    if len(target) == 2:
        away = [math.dist(corner, target) for corner in piece]
        x, y = target
        return shapes.distance(shapes.polygon(piece), shapes.point(x, y)), max(away)
    signed = [target[0] * x + target[1] * y - target[2] for x, y in piece]
    return max(min(signed), -max(signed), 0.0), max(map(abs, signed))


def _clip(piece: Outline, planes: list[_HalfPlane]) -> Outline:
    """A convex outline cut by half planes."""
    for a, b, c in planes:
        # what misses by rounding alone counts as on the border: segments that coincide tie everywhere
        depths = [0.0 if abs(depth := a * x + b * y - c) <= _ON_LINE else depth for x, y in piece]
        if min(depths, default=0.0) >= 0.0:
            continue
        kept: Outline = []
        for index, (x, y) in enumerate(piece):
            before = depths[index - 1]
            if before * depths[index] < 0.0:
                share = before / (before - depths[index])
                px, py = piece[index - 1]
                kept.append((px + share * (x - px), py + share * (y - py)))
            if depths[index] >= 0.0:
                kept.append((x, y))
        piece = kept
    return piece


def _outline(corners: NDArray[np.float64]) -> Outline:
    return [(float(x), float(y)) for x, y in corners]


def _area(piece: Outline) -> float:
    return 0.5 * sum(piece[i - 1][0] * y - piece[i - 1][1] * x for i, (x, y) in enumerate(piece))
