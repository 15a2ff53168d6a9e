"""Any map of some traits: what a program says of the element at a place, whichever that is.

`ego.lane` is over an abstract map one element that stands for every lane. What can be said of all lanes alike (where
"in the lane of the ego" is, as a relation between objects and lanes) is said of it. What a lane leads to by the links
of maps (its group, the section to the left of its own) is an element that is looked up at the same place. Whatever
asks for more raises `NeedsMapError`: no list of what depends on a map could be complete.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from scenicq.geometry.elements import NetworkElement
from scenicq.geometry.links import LINKS
from scenicq.geometry.map_traits import MapTraits
from scenicq.geometry.network import Network
from scenicq.geometry.occupancy import Layer, Occupancy
from scenicq.geometry.regions import PolygonSet
from scenicq.geometry.road_direction import DeferredDirection

__all__ = [
    "AbstractArea",
    "AbstractDirection",
    "AbstractElement",
    "AbstractNetwork",
    "AbstractOccupancy",
    "LinkedFrom",
    "NeedsMapError",
]

_RANKS = 2
"""Elements that overlap somewhere: as many as make a program ask which of them is meant."""


class NeedsMapError(Exception):
    """Something asks for more than what all maps of some traits have in common."""


class AbstractNetwork(Network):
    """Any map of some traits."""

    def __init__(self, traits: MapTraits) -> None:
        """Take what all these maps have in common.

        Args:
            traits: That.
        """
        super().__init__("", _read, traits)


class AbstractElement(NetworkElement):
    """The element of a kind that lies at one place, whichever it is.

    Whether it is that at another place is not known, so that it has no hash.

    Attributes:
        found: What the elements are at each place.
    """

    def __init__(self, found: AbstractOccupancy) -> None:
        """Take what they are."""
        vars(self).update(found=found, region=AbstractArea(found))

    found: AbstractOccupancy

    @property
    def kind(self) -> str:
        """The kind of all of them."""
        return self.found.kind

    @property
    def orientation(self) -> NoReturn:  # pyright: ignore[reportIncompatibleVariableOverride]
        """That of one element."""
        raise NeedsMapError

    def __getattr__(self, name: str) -> NoReturn:
        """Whatever else a program asks for is that of one element."""
        # what `copy` and `pickle` look for is not there
        raise AttributeError(name) if name.startswith("__") else NeedsMapError

    def __eq__(self, other: object) -> bool:
        """Only itself is surely the same, and nothing that is no element."""
        if self is not other and isinstance(other, NetworkElement):
            raise NeedsMapError
        return self is other

    def __hash__(self) -> int:
        """None: two may be one."""
        raise NeedsMapError

    def __repr__(self) -> str:
        """The kind."""
        return f"AbstractElement({self.kind!r})"


class AbstractDirection(DeferredDirection):
    """The direction of any element of a kind, if it has one."""

    def __init__(self, name: str) -> None:
        """Take what messages call it."""
        super().__init__(name, _read, nowhere=False, has_beside=False)


class AbstractArea(PolygonSet):
    """The area of any element of a kind.

    Attributes:
        found: What the elements are at each place.
    """

    def __init__(self, found: AbstractOccupancy) -> None:
        """Take what they are."""
        name = f"any {found.kind}"
        vars(self).update(name=name, found=found, orientation=AbstractDirection(f"orientation of {name}"))

    found: AbstractOccupancy

    @property
    def polygons(self) -> NoReturn:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Those of one element."""
        raise NeedsMapError

    @property
    def is_empty(self) -> bool:
        """Elements have areas."""
        return False

    @property
    def ids(self) -> NoReturn:  # pyright: ignore[reportIncompatibleVariableOverride]
        """That of one element."""
        raise NeedsMapError

    def __reduce__(self) -> NoReturn:
        """No copy over a map has it: there is an area of each element."""
        raise TypeError(f"{self.name} is of no map")


@dataclass(frozen=True, slots=True)
class LinkedFrom:
    """What is found at a place, as what its elements lead to.

    Attributes:
        kind: The kind of the elements in whose areas the place is.
        links: The links from one of these, one after the other, to what is found.
    """

    kind: str
    links: tuple[str, ...] = ()


class AbstractOccupancy(Occupancy):
    """Any element of a kind at each point, or none.

    Attributes:
        kind: The kind.
        starts: From what elements at the point it is found: a later one counts only where there are none of the
            earlier.
    """

    def __init__(self, name: str, kind: str, starts: tuple[LinkedFrom, ...]) -> None:
        """Take the kind.

        Args:
            name: What messages call the look-up.
            kind: As of features; `lane_section` of what lanes consist of, whether or not the map cuts them.
            starts: From what elements.
        """
        vars(self).update(name=name, kind=kind, starts=starts, nothing=1)

    kind: str
    starts: tuple[LinkedFrom, ...]

    @property
    def is_found_itself(self) -> bool:
        """Whether the elements are found in areas that the map calls their own, and nowhere else."""
        return self.starts == (LinkedFrom(self.kind),) and self.kind != "lane_section"

    def through(self, link: str) -> AbstractOccupancy:
        """What the elements lead to by one of their links."""
        starts = tuple(LinkedFrom(each.kind, (*each.links, link)) for each in self.starts)
        return AbstractOccupancy(f"{self.name}.{link}", LINKS[self.kind][link], starts)

    def leads_to(self, other: AbstractOccupancy) -> bool:
        """Whether what this finds leads to what another one finds."""
        pairs = list(zip(self.starts, other.starts, strict=False))
        same = len(self.starts) == len(other.starts) and all(one.kind == two.kind for one, two in pairs)
        return same and all(two.links[: len(one.links)] == one.links for one, two in pairs)

    @property
    def layers(self) -> tuple[Layer, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Those of one map."""
        raise NeedsMapError

    @property
    def depth(self) -> int:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Several elements may overlap."""
        return _RANKS

    @property
    def is_of_lanes(self) -> bool:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Whether they are found where lanes are."""
        return self.starts[0].kind in ("lane", "lane_section")

    def near(self, boxes: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
        """Anything may lie in a box."""
        numbers = np.arange(len(boxes), dtype=np.intp)
        return np.concatenate((numbers, numbers)), np.repeat([0.0, 1.0], len(boxes))

    def __reduce__(self) -> NoReturn:
        """No copy over a map has it."""
        raise TypeError(f"{self.name} is of no map")


def _read() -> NoReturn:
    raise NeedsMapError
