"""The region of a kind of map elements, which are read when somebody asks where it is."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

from scenicq.geometry.fields import VectorField
from scenicq.geometry.regions import DeferredPolygons, PolygonSet

__all__ = ["MapArea"]


class MapArea(DeferredPolygons):
    """All elements of some kinds of a map, of which it is known without reading them whether there are any."""

    def __init__(
        self,
        name: str,
        make: Callable[[], PolygonSet],
        orientation: Callable[[], VectorField | None],
        empty: bool | None,
    ) -> None:
        """Take what can be said before, and what makes the rest.

        Args:
            name: What messages call the region.
            make: What reads the polygons with their ids.
            orientation: What gives the preferred heading of what is placed in the region.
            empty: Whether there is none; None where that must be read, too.
        """
        vars(self).update(name=name, _make=make, _orientation=orientation, _empty=empty)

    @property
    def is_empty(self) -> bool:
        """Whether there is nothing in it."""
        empty: bool | None = vars(self)["_empty"]
        return not self.pieces if empty is None else empty

    @cached_property
    def orientation(self) -> VectorField | None:  # pyright: ignore[reportIncompatibleVariableOverride]
        """The preferred heading of what is placed in the region."""
        return vars(self)["_orientation"]()

    @property
    def ids(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        """The map's identifiers of the polygons, in their order."""
        return self._made.ids
