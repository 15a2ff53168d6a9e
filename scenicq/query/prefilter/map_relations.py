"""Look-ups of elements of the map as relations in SQL: what lies where the ego is, and what the program makes of it.

`ego.lane` at an observed place is one of the elements whose areas are there, which are rows of `memberships`. What a
program makes of an element (its own area, the lane to its left, its group, the lanes ahead of it) is a relation between
elements and the regions of a map, so that "in `ego.lane`" is a join. Each relation is asked in two ways: of all
elements that may be meant (necessary), and where one alone lies at the place and is surely meant (sufficient).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from scenicq.forest.nodes import (
    Arithmetic,
    ArithmeticOp,
    Compare,
    CompareOp,
    Constant,
    DirectionAt,
    Feature,
    Index,
    Logic,
    LogicOp,
    Node,
    Select,
)
from scenicq.geometry.occupancy import TOLERANCE, ElementAtPoint, Occupancy
from scenicq.geometry.regions import Region
from scenicq.limits import LIMITS
from scenicq.match.tolerance import SLACK
from scenicq.query.prefilter.regions import RegionNames, region_ids
from scenicq.query.prefilter.sql_ends import number
from scenicq.store.sql import sql_text

__all__ = ["LookUp", "MapRelations", "allowed_elements", "look_up_of"]

_AT = f"distance <= {number(TOLERANCE + SLACK)}"
"""An element that may be found at a place."""


@dataclass(frozen=True, slots=True, eq=False)
class LookUp:
    """The number of the element that lies where an object is.

    Attributes:
        occupancy: The elements.
        object: The object, by index.
    """

    occupancy: Occupancy
    object: int


def look_up_of(node: Node) -> LookUp | None:
    """The look-up whose number an expression is, whichever of several elements at a place is meant."""
    ranked = node.options if isinstance(node, Select) and isinstance(node.index, Index) else (node,)
    found = [_of_rank(each) for each in ranked]
    first = found[0]
    if first is None or any(
        each is None or (each.occupancy, each.object) != (first.occupancy, first.object) for each in found
    ):
        return None
    return first


def _of_rank(node: Node) -> LookUp | None:
    match node:
        case Arithmetic(
            ArithmeticOp.MUL,
            (DirectionAt(Constant(ElementAtPoint() as one), Feature(property="position") as place), Constant()),
        ):
            return LookUp(one.options, place.object)
        case _:
            return None


def allowed_elements(root: Node) -> tuple[LookUp, frozenset[int]] | None:
    """The numbers of elements at one place for which a condition holds, if it asks for nothing else."""
    positive = True
    while isinstance(root, Logic) and root.op is LogicOp.NOT:
        (root,), positive = root.args, not positive
    match root:
        case Select() if (look_up := look_up_of(root.index)) is not None:
            values = [each.value if isinstance(each, Constant) else None for each in root.options]
            if not all(isinstance(value, bool) for value in values):
                return None
            numbers = {place for place, value in enumerate(values) if value}
        case (
            Compare(op=CompareOp.EQ | CompareOp.NE, left=left, right=Constant(value=float(value)))
            | Compare(op=CompareOp.EQ | CompareOp.NE, left=Constant(value=float(value)), right=left)
        ) if (look_up := look_up_of(left)) is not None:
            numbers = {int(value)} if value.is_integer() else set[int]()
            positive = positive == (root.op is CompareOp.EQ)
        case _:
            return None
    every = frozenset(range(look_up.occupancy.nothing + 1))
    return look_up, every & numbers if positive else every - numbers


@dataclass(slots=True)
class MapRelations:
    """The relations that a plan asks for: tables of frames and of regions that are meant there.

    Attributes:
        names: What the map's regions are called in `memberships`.
        ego: Index of the ego.
    """

    names: RegionNames
    ego: int
    _tables: dict[_Table, str] = field(default_factory=dict["_Table", str])

    def queries(self, rows: str, frames: str) -> Iterator[tuple[str, str]]:
        """The tables that conditions ask for, each with its query.

        Args:
            rows: The view of memberships.
            frames: A query of the frames that are wanted, with their numbers `f`.
        """
        there = (
            f"SELECT q.f, m.region, m.distance FROM {rows} m JOIN ({frames}) q ON m.frame = q.frame "
            f"WHERE m.object = 'ego' AND m.{_AT}"
        )
        for table, name in self._tables.items():
            at = there
            if table.alone:
                at = (
                    f"SELECT f, any_value(region) AS region FROM ({there}) WHERE region IN {_set(table.alone)} "
                    "GROUP BY f HAVING count(DISTINCT region) = 1 AND min(distance) = 0"
                )
            sources, regions = (_list([pair[side] for pair in table.pairs]) for side in (0, 1))
            relation = f"SELECT unnest({sources}) AS source, unnest({regions}) AS region"
            yield name, f"SELECT DISTINCT e.f, r.region FROM ({at}) e JOIN ({relation}) r ON r.source = e.region"

    def in_region_of(self, region: Select, reach: float, *, surely: bool) -> str | None:
        """A condition on memberships that an object in a region meets which hangs on what lies where the ego is.

        Args:
            region: The region.
            reach: Metres that the object may be off; at most `MEMBERSHIP_RADIUS_M`.
            surely: Whether the object surely is there; else it may be.

        Returns:
            SQL over the columns of `memberships` and `q.f`; None if the region is not made of elements of the map.
        """
        look_up = look_up_of(region.index)
        if look_up is None or look_up.object != self.ego:
            return None
        meant: dict[int, Sequence[str]] = {}
        for place, option in enumerate(region.options):
            if not isinstance(option, Constant):
                return None
            if isinstance(option.value, Region):
                ids = region_ids(option.value, self.names)
                if ids is None:
                    return None
                meant[place] = ids
        table = self._table(look_up, meant, surely=surely)
        if table is None:
            return None
        return f"((q.f, region) IN (SELECT f, region FROM {table}) AND distance <= {number(reach + SLACK)})"

    def holds(self, root: Node, *, surely: bool) -> tuple[int, str] | None:
        """A condition on memberships that a condition on what lies where an object is amounts to.

        Args:
            root: The condition.
            surely: Whether it surely holds; else it may.

        Returns:
            The object, and SQL over the columns of its memberships; None where it is no such condition, or may hold
            where nothing lies.
        """
        found = allowed_elements(root)
        if found is None:
            return None
        look_up, numbers = found
        if look_up.occupancy.nothing in numbers or (surely and look_up.object != self.ego):
            return None
        if surely:
            table = self._table(look_up, dict.fromkeys(numbers, ("",)), surely=True)
            return None if table is None else (look_up.object, f"(q.f IN (SELECT f FROM {table}))")
        sources = self._sources(look_up.occupancy)
        if sources is None:
            return None
        ids = sorted({each for layer in sources for each, place in layer if place in numbers})
        return look_up.object, f"(region IN {_set(ids)} AND {_AT})"

    def _sources(self, occupancy: Occupancy) -> list[list[tuple[str, int]]] | None:
        """For each layer the regions in which elements are found, with their numbers; None where some has no name."""
        known = self.names.elements
        layers: list[list[tuple[str, int]]] = []
        for layer, ids in zip(occupancy.layers, occupancy.elements, strict=True):
            if not all(each in known for each in ids):
                return None
            pairs = ((known[each], place) for each, (_, place, _) in zip(ids, layer, strict=True))
            layers.append(list(dict.fromkeys(pairs)))
        return layers

    def _table(self, look_up: LookUp, meant: Mapping[int, Sequence[str]], *, surely: bool) -> str | None:
        """The table of a relation: for each frame the regions that are meant where the ego is."""
        layers = self._sources(look_up.occupancy)
        if layers is None:
            return None
        # elsewhere a later layer counts: where one element of the first lies, it is surely meant
        sources = layers[0] if surely else [each for layer in layers for each in layer]
        pairs = sorted({(source, each) for source, place in sources for each in meant.get(place, ())})
        if len(pairs) > LIMITS.related_regions:
            return None
        alone = tuple(sorted({source for source, _ in layers[0]})) if surely else ()
        return self._tables.setdefault(_Table(tuple(pairs), alone), f"meant{len(self._tables)}")


@dataclass(frozen=True, slots=True)
class _Table:
    """A relation between elements where the ego is and regions.

    Attributes:
        pairs: The element, and a region that is meant.
        alone: Elements of which one alone must lie there; empty where any of them will do.
    """

    pairs: tuple[tuple[str, str], ...]
    alone: tuple[str, ...]


def _list(ids: Sequence[str]) -> str:
    return f"[{', '.join(map(sql_text, ids))}]::VARCHAR[]"


def _set(ids: Sequence[str]) -> str:
    # a subquery is hashed, a list is gone through for every row
    return f"(SELECT unnest({_list(ids)}))"
