"""An abstract map: only its traits are known, so that one compiled program serves every map that has them.

`ego.lane` is over an abstract map one element that stands for every lane. What can be said of all lanes alike (where
"in the lane of the ego" is, as a relation between objects and lanes) is said of it. What a lane leads to by the links
of maps (its group, the section to the left of its own) is an element that is looked up at the same place. Whatever
asks for more raises `NeedsMapError`: no list of what depends on a map could be complete.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple, NoReturn

import numpy as np
from numpy.typing import NDArray

from scenicq.errors import Span
from scenicq.geometry.elements import NetworkElement
from scenicq.geometry.links import AHEAD, LINKS, LISTS
from scenicq.geometry.map_traits import MapTraits
from scenicq.geometry.network import Network
from scenicq.geometry.occupancy import Layer, Occupancy
from scenicq.geometry.regions import PolygonSet
from scenicq.geometry.road_direction import DeferredDirection, RoadDirection

__all__ = [
    "AbstractArea",
    "AbstractDirection",
    "AbstractElement",
    "AbstractList",
    "AbstractNetwork",
    "AbstractOccupancy",
    "LinkStep",
    "LinkedFrom",
    "NeedsMapError",
    "led_kind",
]

_RANKS = 2
"""The depth of every abstract look-up: two elements may overlap, so programs ask which one is meant."""


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
    """The unknown element of one kind at one place. It may be the element at another place, too, so it has no hash.

    Attributes:
        found: The look-up that finds it.
    """

    def __init__(self, found: AbstractOccupancy) -> None:
        """Stand for the element that a look-up finds."""
        vars(self).update(found=found, region=AbstractArea(found))

    found: AbstractOccupancy

    @property
    def kind(self) -> str:
        """The kind of the element."""
        return self.found.kind

    @property
    def orientation(self) -> NoReturn:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Raise `NeedsMapError`: each element has its own."""
        raise NeedsMapError

    def __getattr__(self, name: str) -> NoReturn:
        """Raise `NeedsMapError`: every other attribute differs from element to element."""
        # what `copy` and `pickle` look for is not there
        raise AttributeError(name) if name.startswith("__") else NeedsMapError

    def __eq__(self, other: object) -> bool:
        """Whether both are one object. Another element raises `NeedsMapError`, since it may be the same one."""
        if self is not other and isinstance(other, NetworkElement):
            raise NeedsMapError
        return self is other

    def __hash__(self) -> int:
        """Raise `NeedsMapError`: two abstract elements may be the same element, so no hash fits."""
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
    """The unknown area of an abstract element.

    Attributes:
        found: What the elements are at each place.
    """

    def __init__(self, found: AbstractOccupancy, orientation: RoadDirection | None = None) -> None:
        """Stand for the area of what a look-up finds.

        Args:
            found: The look-up.
            orientation: The headings inside; None for the element's own.
        """
        name = f"any {found.kind}"
        own = AbstractDirection(f"orientation of {name}") if orientation is None else orientation
        vars(self).update(name=name, found=found, orientation=own)

    found: AbstractOccupancy

    @property
    def polygons(self) -> NoReturn:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Raise `NeedsMapError`: each element has its own."""
        raise NeedsMapError

    @property
    def is_empty(self) -> bool:
        """Elements have areas."""
        return False

    @property
    def ids(self) -> NoReturn:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Raise `NeedsMapError`: each element has its own."""
        raise NeedsMapError

    def __reduce__(self) -> NoReturn:
        """Refuse to be copied: a scenario over a real map has areas of that map instead."""
        raise TypeError(f"{self.name} is of no map")


class AbstractList:
    """A list attribute of an abstract element, such as the successors of a lane.

    What a program does with it other than to look for an element there, or to draw one, needs a map.

    Attributes:
        found: The elements in it.
        draw: Gives one of them, at random; there is no scene where there is none.
        some: Gives what is equal to an element where it is in the list.
    """

    def __init__(
        self, found: AbstractOccupancy, draw: Callable[[Span], object], some: Callable[[Span], object]
    ) -> None:
        """Take what is in it."""
        self.found, self.draw, self.some = found, draw, some

    def __bool__(self) -> bool:
        """Whether it has elements depends on the map."""
        raise NeedsMapError

    def __len__(self) -> int:
        """As many as the map says."""
        raise NeedsMapError

    def __iter__(self) -> Iterator[object]:
        """The elements are the map's."""
        raise NeedsMapError

    def __eq__(self, other: object) -> bool:
        """Lists are equal by their elements."""
        raise NeedsMapError

    def __hash__(self) -> int:
        """None: lists have none."""
        raise NeedsMapError


class LinkStep(NamedTuple):
    """A step from elements to others.

    Attributes:
        link: The link, or the list.
        within: How many metres behind the end of the first a lane ahead begins at most.
    """

    link: str
    within: float | None = None


@dataclass(frozen=True, slots=True)
class LinkedFrom:
    """A way to find an element: begin at an element whose area holds the place, then follow links.

    Attributes:
        kind: The kind of the elements in whose areas the place is.
        links: The steps from one of these, one after the other, to what is found.
    """

    kind: str
    links: tuple[LinkStep, ...] = ()


class AbstractOccupancy(Occupancy):
    """A look-up over an abstract map. Option 0 is the element at a point, option 1 is none.

    Attributes:
        kind: The kind.
        starts: From what elements at the point it is found: a later one counts only where there are none of the
            earlier.
        is_drawn: Whether it is one of several to which these lead, at random.
    """

    def __init__(self, name: str, kind: str, starts: tuple[LinkedFrom, ...], *, is_drawn: bool = False) -> None:
        """Take the kind.

        Args:
            name: What messages call the look-up.
            kind: As of features; `lane_section` of what lanes consist of, whether or not the map cuts them.
            starts: From what elements.
            is_drawn: Whether it is drawn from what they lead to.
        """
        vars(self).update(name=name, kind=kind, starts=starts, nothing=1, is_drawn=is_drawn)

    kind: str
    starts: tuple[LinkedFrom, ...]
    is_drawn: bool

    @property
    def is_found_itself(self) -> bool:
        """Whether the element is found by its own area alone; false for sections, as an uncut lane is one, too."""
        return self.starts == (LinkedFrom(self.kind),) and self.kind != "lane_section"

    def through(self, link: str, *, within: float | None = None, is_drawn: bool = False) -> AbstractOccupancy:
        """What the elements lead to by one of their links or lists.

        Args:
            link: The link.
            within: How far lanes ahead begin at most.
            is_drawn: Whether it is one of a list, at random.
        """
        step = LinkStep(link, within)
        starts = tuple(LinkedFrom(each.kind, (*each.links, step)) for each in self.starts)
        kind = led_kind(self.kind, link)
        return AbstractOccupancy(f"{self.name}.{link}", kind, starts, is_drawn=is_drawn or self.is_drawn)

    def leads_to(self, other: AbstractOccupancy) -> bool:
        """Whether another look-up is this one, followed by more links or by none."""
        pairs = list(zip(self.starts, other.starts, strict=False))
        same = len(self.starts) == len(other.starts) and all(one.kind == two.kind for one, two in pairs)
        return same and all(two.links[: len(one.links)] == one.links for one, two in pairs)

    @property
    def layers(self) -> tuple[Layer, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Raise `NeedsMapError`: each map has its own."""
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
        """Pair each box with option 0 (the element) and option 1 (none); both arrays have shape (2 n,)."""
        numbers = np.arange(len(boxes), dtype=np.intp)
        return np.concatenate((numbers, numbers)), np.repeat([0.0, 1.0], len(boxes))

    def __reduce__(self) -> NoReturn:
        """Refuse to be copied: a scenario over a real map has look-ups of that map instead."""
        raise TypeError(f"{self.name} is of no map")


def led_kind(kind: str, link: str) -> str:
    """The kind of the elements that a link leads to, given the kind that it starts from."""
    return kind if link == AHEAD else {**LINKS.get(kind, {}), **LISTS.get(kind, {})}[link]


def _read() -> NoReturn:
    raise NeedsMapError
