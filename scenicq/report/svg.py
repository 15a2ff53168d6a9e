"""SVG and HTML as text: escaped elements, and geometry of the map as paths.

A picture's unit is the centimetre and its y axis points down; `Plane` translates. Everything that comes from data goes
through `escape`: an identifier that looks like markup is shown as text.
"""

# shapely has no type annotations.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely
from numpy.typing import NDArray

from scenicq.geometry.shapes import XY, Coordinates, Shape

__all__ = ["Plane", "area_path", "element", "escape", "line_path", "points_path"]

_FORBIDDEN = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_ENTITIES = {"&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;", "'": "&#39;"}
_TABLE = str.maketrans(_ENTITIES)
_POLYGON = 3
_LINES = (1, 2)
"""The type numbers of geometries, as shapely counts them."""


def escape(text: object) -> str:
    """A text that is safe as content and between the quotes of an attribute, in HTML as in XML."""
    return _FORBIDDEN.sub("\ufffd", str(text)).translate(_TABLE)


def element(name: str, *content: str, **attributes: object) -> str:
    """An element of SVG or HTML.

    Args:
        name: Its name.
        content: Markup inside, already escaped.
        attributes: Values, escaped here; None leaves one out, True gives only its name. An underscore at the end of a
            name is dropped (`class_`), others become hyphens.
    """
    given: list[str] = []
    for key, value in attributes.items():
        if value is not None and value is not False:
            shown = key.rstrip("_").replace("_", "-")
            given.append(f" {shown}" if value is True else f' {shown}="{escape(value)}"')
    return f"<{name}{''.join(given)}>{''.join(content)}</{name}>"


@dataclass(frozen=True, slots=True)
class Plane:
    """Translates between the map (metres, y up) and a picture (whole centimetres, y down).

    Attributes:
        origin: The point of the map at the picture's (0, 0), in metres.
    """

    origin: XY

    def to_picture(self, xy: Coordinates) -> NDArray[np.int64]:
        """Points (n, 2) of the map as points of the picture, rounded to a centimetre."""
        return np.rint((xy - np.array(self.origin)) * (100.0, -100.0)).astype(np.int64)

    def at(self, x: float, y: float) -> tuple[int, int]:
        """One point of the map as a point of the picture."""
        (found,) = self.to_picture(np.array([(x, y)])).tolist()
        return found[0], found[1]


def points_path(points: Sequence[Sequence[int]], *, closed: bool) -> str:
    """Points of the picture as path data, relative after the first; corners that coincide are merged."""
    x, y = first = tuple(points[0])
    steps: list[str] = []
    for right, down in points:
        if right != x or down != y:
            steps.append(f"{right - x} {down - y}")
            x, y = right, down
    start = f"M{first[0]} {first[1]}"
    return f"{start}l{' '.join(steps)}{'z' if closed else ''}" if steps else f"{start}h0"


def _pieces(shapes: Iterable[Shape], plane: Plane, *, closed: bool) -> str:
    parts = np.array(list(shapes), dtype=object)
    lines = shapely.get_rings(parts) if closed else parts
    corners, owner = shapely.get_coordinates(lines, return_index=True)
    if not len(corners):
        return ""
    picture: list[list[int]] = plane.to_picture(corners).tolist()
    ends = [0, *(np.flatnonzero(np.diff(owner)) + 1).tolist(), len(picture)]
    return "".join(points_path(picture[start:end], closed=closed) for start, end in pairwise(ends))


def area_path(shapes: Iterable[Shape], plane: Plane) -> str:
    """The outlines of polygons as path data; parts that are no polygons are left out."""
    parts = shapely.get_parts(shapely.get_parts(np.array(list(shapes), dtype=object)))
    # holes must run the other way round for the picture's fill rule
    areas = shapely.orient_polygons(parts[shapely.get_type_id(parts) == _POLYGON])
    return _pieces(areas, plane, closed=True)


def line_path(shapes: Iterable[Shape], plane: Plane) -> str:
    """Polylines as path data; parts that are no lines are left out."""
    parts = shapely.get_parts(shapely.get_parts(np.array(list(shapes), dtype=object)))
    return _pieces(parts[np.isin(shapely.get_type_id(parts), _LINES)], plane, closed=False)
