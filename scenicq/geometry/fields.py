"""Vector fields: headings for every point of the plane where they are defined (the language paper's vector fields)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from scenicq.budget import look
from scenicq.geometry.cell_guards import Guard, narrow_guards
from scenicq.geometry.shapes import Bounds, Shape

__all__ = ["FieldCell", "VectorField"]


@dataclass(frozen=True, slots=True, eq=False)
class FieldCell:
    """A convex piece of the plane on which a field may have a heading.

    Attributes:
        polygon: Corners in metres, counter-clockwise, shape (k, 2).
        heading: Radians.
        guards: Which of its inner points are meant, those that satisfy all; at the others the field does not have
            `heading`.
        bounds: The box around the polygon.
    """

    polygon: NDArray[np.float64]
    heading: float
    guards: tuple[Guard, ...] = ()
    bounds: Bounds = field(init=False)

    def __post_init__(self) -> None:
        """Find the bounds: cells are asked for them more often than they are made."""
        (west, south), (east, north) = self.polygon.min(axis=0).tolist(), self.polygon.max(axis=0).tolist()
        object.__setattr__(self, "bounds", (west, south, east, north))

    def part(self, bounds: Bounds) -> FieldCell | None:
        """The same cell for points of a box only, with fewer guards; None if no point is meant."""
        if not self.guards:
            return self
        look()
        left = narrow_guards(self.guards, bounds)
        return None if left is None else FieldCell(self.polygon, self.heading, left)


@runtime_checkable
class VectorField(Protocol):
    """A field of headings; where several are allowed, each is a choice of its own.

    Attributes:
        name: What messages call the field.
    """

    @property
    def name(self) -> str:
        """What messages call the field."""
        ...

    def values(self, x: float, y: float) -> tuple[float, ...]:
        """The headings allowed at a point, in (-pi, pi]; none where the field is undefined."""
        ...

    def values_many(self, xy: NDArray[np.float64]) -> Sequence[tuple[float, ...]]:
        """`values` for points of shape (n, 2)."""
        ...

    @property
    def reach(self) -> tuple[Sequence[Shape], float] | None:
        """Areas, and how far around them in metres the field surely has a value; None where it has one everywhere."""
        ...

    def cells(self, bounds: Bounds) -> list[FieldCell]:
        """Convex cells that hold every (point, heading) of the field within the bounds."""
        ...

    def headings(self, boxes: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
        """Pairs (box, heading) that hold every heading somewhere in each box, and few more; box by box.

        Args:
            boxes: Rows of `Bounds`, (n, 4).
        """
        ...
