"""Which element of the map lies at a point, as a vector field: what look-ups at a random place are made of.

An expression that asks for the element at a point is a choice whose index is a function of the point. As a field it
goes wherever fields go: at an observed point it is one known option, and at a random one only the elements near it are
looked at. The field's angles number the options; an angle times `scale` is the number, exactly.

Where elements overlap, Scenic takes the first in the order of its lists, an accident; here each of them is allowed, and
a rank says which (as with the directions of traffic). Who is there and which way it goes may leave only some of them:
those that lead within `ALONG` of its heading or continue the last lane of its track, if any do. A point in none, but
within the map's tolerance of some, counts as in these, as in Scenic; here the border is a polygon, so that the plane
falls into convex pieces.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from shapely import STRtree

from scenicq.geometry import shapes
from scenicq.geometry.angles import leads
from scenicq.geometry.cells import convex_parts
from scenicq.geometry.fields import FieldCell
from scenicq.geometry.network import TOLERANCE
from scenicq.geometry.regions import SLACK
from scenicq.geometry.road_direction import RoadDirection
from scenicq.geometry.shapes import Bounds, Shape

__all__ = ["TOLERANCE", "ElementAtPoint", "Layer", "Occupancy", "OptionArea"]

_OVERLAP = 1e-6
"""Square metres that two elements may share without counting as overlapping."""
_KEPT = 4096
_KEPT_CELLS = 16
_KEPT_TOGETHER = 256

OptionArea: TypeAlias = tuple[Shape, int, int]
"""An area, the number of the option that is found in it, and whose area it is: an owner is found once at a point."""
Layer: TypeAlias = tuple[OptionArea, ...]
Corners: TypeAlias = NDArray[np.float64]
_Point: TypeAlias = tuple[float, float]
"""A point in metres."""
_Owners: TypeAlias = tuple[int, tuple[int, ...]]
"""The number of the layer that counts at a point, and the owners of its areas there."""
_Meant: TypeAlias = tuple[bool, ...]
"""Which of the options at a point may be meant."""


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """A convex piece of the plane in which all points have the same options.

    Attributes:
        corners: In metres, counter-clockwise, shape (k, 2).
        found: The options.
        number: The one of them whose area this is a piece of.
    """

    corners: Corners
    found: tuple[int, ...]
    number: int


@dataclass(frozen=True, eq=False)
class Occupancy:
    """The options at each point.

    Attributes:
        layers: Areas in the order in which they count: those of a later layer only where the earlier ones have none.
        nothing: The number that stands for no option at all.
        name: What messages call it.
        elements: The id of the map element that each area of each layer is, or a part of.
        ways: The direction of each owner of areas of each layer, by its number; None where it has none.
        continued: The numbers of the lanes that each of these continues: itself, and those that lead to it.
        owners: The id of each of these.
    """

    layers: tuple[Layer, ...] = field(repr=False)
    nothing: int
    name: str
    elements: tuple[tuple[str, ...], ...] = field(default=(), repr=False)
    ways: tuple[tuple[RoadDirection | None, ...], ...] = field(default=(), repr=False)
    continued: tuple[tuple[frozenset[int], ...], ...] = field(default=(), repr=False)
    owners: tuple[tuple[str, ...], ...] = field(default=(), repr=False)

    @cached_property
    def is_of_lanes(self) -> bool:
        """Whether all areas of the first layer are those of lanes."""
        return bool(self.continued) and all(self.continued[0])

    @cached_property
    def scale(self) -> int:
        """The power of two by which an angle in (-pi, pi] becomes the number of any option."""
        return 1 << max(0, math.ceil(math.log2((self.nothing + 1) / math.pi)))

    @cached_property
    def depth(self) -> int:
        """At least as many as there are options of one layer at any point."""
        most = 1
        for layer, tree in zip(self.layers, self._trees, strict=True):
            areas = shapes.array([area for area, _, _ in layer])
            first, second = shapes.tree_pairs_within(tree, areas, 0.0)
            owners = np.array([owner for _, _, owner in layer], dtype=np.intp)
            apart = (first < second) & (owners[first] != owners[second])
            first, second = first[apart], second[apart]
            overlap = shapes.shared_areas(areas[first], areas[second]) > _OVERLAP
            shared: dict[int, set[int]] = {}
            pairs: list[tuple[int, int]] = list(zip(first[overlap].tolist(), second[overlap].tolist(), strict=True))
            for one, other in pairs:
                shared.setdefault(one, set()).add(layer[other][2])
                shared.setdefault(other, set()).add(layer[one][2])
            most = max(most, 1 + max(map(len, shared.values()), default=0))
        return most

    def at(self, x: float, y: float) -> tuple[int, ...]:
        """The numbers of the options at a point, at least one."""
        known = self._known.get((x, y))
        return self._find(np.array([[x, y]]), [(x, y)])[0] if known is None else known

    def at_many(self, xy: NDArray[np.float64]) -> list[tuple[int, ...]]:
        """`at` for points of shape (n, 2): the same points are asked for once for each rank, and for each condition."""
        key = xy.tobytes()
        known = self._known_together.get(key)
        if known is None:
            if len(self._known_together) >= _KEPT_TOGETHER:
                self._known_together.clear()
            places = [(x, y) for x, y in xy.tolist()]
            before = [self._known.get(place) for place in places]
            new = [number for number, each in enumerate(before) if each is None]
            found = iter(self._find(xy[new], [places[number] for number in new]))
            known = [next(found) if each is None else each for each in before]
            self._known_together[key] = known
        return known

    def along(
        self,
        found: Sequence[tuple[int, ...]],
        places: Sequence[_Point],
        going: Sequence[float],
        last: Sequence[float],
    ) -> list[_Meant]:
        """Which of the options at places lead the way that somebody goes, or continue the last lane: all, if none does.

        Args:
            found: The options, of which each place has several.
            places: The places.
            going: The headings.
            last: The numbers of the last lanes of their tracks, nan where there is none.
        """
        new = [place for place in dict.fromkeys(places) if place not in self._known_ways]
        if new:
            self._find_ways(new)
        meant: list[_Meant] = []
        for options, place, heading, before in zip(found, places, going, last, strict=True):
            ways, (level, owners) = self._known_ways[place]
            own = tuple(leads(each, heading) for each in ways)
            if not math.isnan(before):
                continuing = (before in self.continued[level][owner] for owner in owners)
                own = tuple(along or further for along, further in zip(own, continuing, strict=True))
            meant.append(own if any(own) else (True,) * len(options))
        return meant

    def owners_at(self, place: _Point, going: float, last: float) -> list[tuple[str, bool]]:
        """Who owns the areas of the first layer at a point, each with whether it may be meant for who is there.

        Args:
            place: The point.
            going: The heading of who is there; nan where each may be meant.
            last: The number of the last lane of its track; nan if there is none.
        """
        owners: dict[_Point, _Owners] = {}
        found = self._find(np.array([place]), [place], owners)
        level, numbers = owners.get(place, (0, ()))
        if level or not numbers:
            return []
        meant = (True,) * len(numbers)
        if len(numbers) > 1 and not math.isnan(going):
            (meant,) = self.along(found, [place], [going], [last])
        return [(self.owners[level][number], each) for number, each in zip(numbers, meant, strict=True)]

    def _find_ways(self, places: Sequence[_Point]) -> None:
        """The headings that each of several options at places leads in, which are kept by their places."""
        if len(self._known_ways) + len(places) > _KEPT:
            self._known_ways.clear()
        owners: dict[_Point, _Owners] = {}
        self._find(np.array(places), places, owners)
        asked: dict[tuple[int, int], list[_Point]] = {}
        for place, (level, numbers) in owners.items():
            for number in numbers:
                asked.setdefault((level, number), []).append(place)
        said: dict[tuple[int, int, _Point], tuple[float, ...]] = {}
        for (level, number), some in asked.items():
            way = self.ways[level][number]
            headings = [()] * len(some) if way is None else way.values_many(np.array(some))
            said.update({(level, number, place): each for place, each in zip(some, headings, strict=True)})
        for place, (level, numbers) in owners.items():
            self._known_ways[place] = tuple(said[level, number, place] for number in numbers), (level, numbers)

    def _find(
        self,
        xy: NDArray[np.float64],
        places: Sequence[_Point],
        owners: dict[_Point, _Owners] | None = None,
    ) -> list[tuple[int, ...]]:
        """`at` for points (n, 2), which are kept by their places.

        Args:
            xy: The points.
            places: The same as pairs.
            owners: Gets for each point the number of the layer that counts there, and whose areas are found.
        """
        found: list[tuple[int, ...]] = [(self.nothing,)] * len(places)
        left: NDArray[np.intp] = np.arange(len(places), dtype=np.intp)
        for turn, (layer, tree) in enumerate(self._in_turn()):
            if not len(left):
                break
            here, hits = shapes.tree_pairs_within(tree, shapes.points(xy[left]), SLACK)
            options: dict[int, dict[int, int]] = {}
            # of several areas of one owner the first counts
            pairs: list[tuple[int, int]] = list(zip(left[here].tolist(), hits.tolist(), strict=True))
            for point, hit in sorted(pairs, reverse=True):
                _, number, owner = layer[hit]
                options.setdefault(point, {})[owner] = number
            for point, numbers in options.items():
                if any(number != self.nothing for number in numbers.values()):
                    found[point] = tuple([numbers[owner] for owner in sorted(numbers)])
                    if owners is not None:
                        owners[places[point]] = turn % len(self.layers), tuple(sorted(numbers))
            left = left[[found[point] == (self.nothing,) for point in left.tolist()]]
        if len(self._known) + len(places) > _KEPT:
            self._known.clear()
        self._known.update(zip(places, found, strict=True))
        return found

    def _in_turn(self) -> Iterator[tuple[Layer, STRtree]]:
        """The layers in the order in which they count, then their surroundings, which most points do not need."""
        yield from zip(self.layers, self._trees, strict=True)
        yield from zip(self.layers, self._wider_trees, strict=True)

    def near(self, boxes: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
        """Pairs (box, number) that hold every option somewhere in each box, and few more; rows of `Bounds`, (n, 4)."""
        areas = shapes.boxes(boxes)
        owners: list[NDArray[np.intp]] = [np.arange(len(boxes), dtype=np.intp)]
        numbers: list[NDArray[np.float64]] = [np.full(len(boxes), float(self.nothing))]
        covered = np.zeros(len(boxes), dtype=bool)
        for layer, tree in zip(self.layers, self._trees, strict=True):
            owner, hit = shapes.tree_pairs_within(tree, areas, TOLERANCE)
            owners.append(owner)
            numbers.append(np.array([number for _, number, _ in layer], dtype=float)[hit])
            covered[owner[shapes.covers_many(shapes.array([area for area, _, _ in layer])[hit], areas[owner])]] = True
        owners[0], numbers[0] = owners[0][~covered], numbers[0][~covered]
        both: NDArray[np.float64] = np.column_stack(
            [np.concatenate(owners).astype(np.float64), np.concatenate(numbers)]
        )
        pairs = np.unique(both, axis=0)
        return pairs[:, 0].astype(np.intp), pairs[:, 1]

    def pieces_near(self, bounds: Bounds, number: int | None = None) -> list[Piece]:
        """Convex pieces of all areas and their borders within a box, each once for each area that it belongs to.

        Args:
            bounds: The box.
            number: The option whose areas are wanted; all if None.
        """
        box = _box(bounds)
        return [
            piece
            for level, tree in enumerate(self._trees)
            for hit in np.sort(shapes.tree_within(tree, box, 2 * TOLERANCE)).tolist()
            if number is None or self.layers[level][hit][1] == number
            for piece in self._pieces_of(level, hit)
        ]

    def outside(self, bounds: Bounds) -> list[Corners]:
        """Convex pieces of what lies in no area within a box."""
        if bounds not in self._outside:
            if len(self._outside) >= _KEPT_CELLS:
                self._outside.clear()
            box = _box(bounds)
            near = [
                wide for tree in self._wider_trees for wide in tree.geometries.take(shapes.tree_within(tree, box, 0.0))
            ]
            left = shapes.difference(box, shapes.union_all(near))
            self._outside[bounds] = [cell for part in shapes.polygonal_part(left) for cell in convex_parts(part)]
        return self._outside[bounds]

    def found_in(self, parts: Sequence[Shape]) -> tuple[int, ...] | None:
        """The numbers of the options that some point of an area has.

        Args:
            parts: The polygons of the area.

        Returns:
            The numbers in order, None where it cannot be told.
        """
        tree, found = STRtree(parts), set[int]()
        for level, layer in enumerate(self.layers):
            for area, number, _ in layer:
                hits: list[int] = shapes.tree_within(tree, area, TOLERANCE).tolist()
                near = [parts[hit] for hit in hits]
                if near and number not in found:
                    known = self._is_found(level, area, number, near)
                    if known is None:
                        return None
                    found |= {number} if known else set()
        if any(self._sticks_out(part) for part in parts):
            found.add(self.nothing)
        return tuple(sorted(found))

    def _is_found(self, level: int, area: Shape, number: int, near: Sequence[Shape]) -> bool | None:
        """Whether an area, or its border, is what counts at some point of others."""
        before = [shape for tree in self._trees[:level] for shape in self._meeting((tree,), area)]
        beside = self._meeting(self._trees, area)
        empty = True
        for part in near:
            inside = shapes.difference(shapes.intersection(area, part), shapes.union_all(before))
            border = shapes.difference(
                shapes.intersection(shapes.band(area, TOLERANCE), part), shapes.union_all(beside)
            )
            for shape in (inside, border):
                if shape.is_empty:
                    continue
                if number in self.at(*shapes.inner_point(shape)):
                    return True
                empty = False
        return False if empty else None

    def _sticks_out(self, part: Shape) -> bool:
        near = [
            wide for tree in self._wider_trees for wide in tree.geometries.take(shapes.tree_within(tree, part, 0.0))
        ]
        return not shapes.difference(part, shapes.union_all(near)).is_empty

    def _pieces_of(self, level: int, hit: int) -> list[Piece]:
        """The pieces of one area and of its border, the first those that lie in it."""
        if (level, hit) not in self._pieces:
            area, number, _ = self.layers[level][hit]
            inside = shapes.divide_polygon(area, self._crossing(self._trees, area))
            rest = shapes.difference(shapes.band(area, TOLERANCE), shapes.union_all(self._meeting(self._trees, area)))
            border = [
                part
                for ring in shapes.polygonal_part(rest)
                for part in shapes.divide_polygon(ring, self._crossing(self._wider_trees, ring))
            ]
            self._pieces[level, hit] = [
                Piece(cell, found, number)
                for part in (*inside, *border)
                if number in (found := self.at(*shapes.inner_point(part)))
                for cell in convex_parts(part)
            ]
        return self._pieces[level, hit]

    def _meeting(self, trees: Sequence[STRtree], area: Shape) -> list[Shape]:
        return [shape for tree in trees for shape in tree.geometries.take(shapes.tree_within(tree, area, TOLERANCE))]

    def _crossing(self, trees: Sequence[STRtree], area: Shape) -> list[Shape]:
        return [shape for shape in self._meeting(trees, area) if shape is not area and self._overlap(area, shape)]

    @cached_property
    def _trees(self) -> tuple[STRtree, ...]:
        return tuple(STRtree([area for area, _, _ in layer]) for layer in self.layers)

    @cached_property
    def _wider_trees(self) -> tuple[STRtree, ...]:
        return tuple(STRtree([shapes.band(area, TOLERANCE) for area, _, _ in layer]) for layer in self.layers)

    @cached_property
    def _pieces(self) -> dict[tuple[int, int], list[Piece]]:
        return {}

    @cached_property
    def _outside(self) -> dict[Bounds, list[Corners]]:
        return {}

    @cached_property
    def _known(self) -> dict[_Point, tuple[int, ...]]:
        return {}

    @cached_property
    def _known_ways(self) -> dict[_Point, tuple[tuple[tuple[float, ...], ...], _Owners]]:
        return {}

    @cached_property
    def _known_together(self) -> dict[bytes, list[tuple[int, ...]]]:
        return {}

    @staticmethod
    def _overlap(one: Shape, other: Shape) -> bool:
        return shapes.intersection(one, other).area > _OVERLAP


@dataclass(frozen=True, eq=False)
class ElementAtPoint:
    """One of the options at each point, by its rank among them: a vector field whose angles number the options.

    Attributes:
        options: The options.
        rank: Which of them; where one that leads another way than who is there, the first that may be meant.
        by_heading: Whether the way somebody goes says which of them may be meant.
    """

    options: Occupancy
    rank: int
    by_heading: bool = False

    @property
    def name(self) -> str:
        """What messages call the field."""
        return self.options.name

    @property
    def reach(self) -> None:
        """That nothing is there is an option, too: the field has a value everywhere."""
        return None

    def values(self, x: float, y: float) -> tuple[float, ...]:
        """The angle that stands for the option at a point."""
        found = self.options.at(x, y)
        return (found[self.rank % len(found)] / self.options.scale,)

    def values_many(self, xy: NDArray[np.float64]) -> list[tuple[float, ...]]:
        """`values` for points of shape (n, 2)."""
        rank, scale = self.rank, self.options.scale
        return [(found[rank % len(found)] / scale,) for found in self.options.at_many(xy)]

    def along(self, x: float, y: float, heading: float, last: float = math.nan) -> float:
        """The angle that stands for the option at a point for who is there.

        Args:
            x: The point.
            y: The point.
            heading: That of who is there; nan if it has none.
            last: The number of the last lane of its track; nan if there is none.
        """
        return self.along_many(np.array([[x, y]]), [heading], [last])[0]

    def along_many(self, xy: NDArray[np.float64], going: Sequence[float], last: Sequence[float]) -> list[float]:
        """`along` for points of shape (n, 2)."""
        options, rank, scale = self.options, self.rank, self.options.scale
        found = options.at_many(xy)
        numbers = [each[rank % len(each)] for each in found]
        several = [place for place, each in enumerate(found) if len(each) > 1 and not math.isnan(going[place])]
        if several:
            some = [found[place] for place in several]
            places: list[_Point] = [(x, y) for x, y in xy[several].tolist()]
            meant = options.along(some, places, [going[place] for place in several], [last[place] for place in several])
            for place, mine, those in zip(several, some, meant, strict=True):
                if not those[rank % len(mine)]:
                    numbers[place] = mine[those.index(True)]
        return [number / scale for number in numbers]

    def headings(self, boxes: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
        """Pairs (box, angle) that hold the angle of every option somewhere in each box, and few more; boxes (n, 4)."""
        owner, number = self.options.near(boxes)
        return owner, number / self.options.scale

    def cells_of(self, heading: float, bounds: Bounds) -> list[FieldCell]:
        """Convex cells that hold every point within the bounds that has the option of an angle.

        Where headings matter, also points that have it only for some.
        """
        number = round(heading * self.options.scale)
        if number == self.options.nothing:
            return self.cells(bounds)
        pieces = self.options.pieces_near(bounds, number)
        return [FieldCell(piece.corners, heading) for piece in pieces if self._is_meant(piece)]

    def cells(self, bounds: Bounds) -> list[FieldCell]:
        """Convex cells that hold every point with its option within the bounds."""
        if bounds not in self._cells:
            if len(self._cells) >= _KEPT_CELLS:
                self._cells.clear()
            self._cells[bounds] = self._make_cells(bounds)
        return self._cells[bounds]

    def _make_cells(self, bounds: Bounds) -> list[FieldCell]:
        options, scale = self.options, self.options.scale
        cells = [
            FieldCell(piece.corners, piece.number / scale)
            for piece in options.pieces_near(bounds)
            if self._is_meant(piece)
        ]
        beside = options.outside(bounds)
        return cells + [FieldCell(corners, options.nothing / scale) for corners in beside]

    def _is_meant(self, piece: Piece) -> bool:
        return self.by_heading or piece.found[self.rank % len(piece.found)] == piece.number

    @cached_property
    def _cells(self) -> dict[Bounds, list[FieldCell]]:
        return {}


def _box(bounds: Bounds) -> Shape:
    """A box grown a little: one without width would meet nothing."""
    west, south, east, north = bounds
    return shapes.box(west - TOLERANCE, south - TOLERANCE, east + TOLERANCE, north + TOLERANCE)
