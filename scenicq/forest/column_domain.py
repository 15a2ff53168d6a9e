"""The domain of columns: the values of an expression at many places at once, exact but for rounding.

What NumPy computes is computed for all places together, anything else place by place by the node's own meaning
(`compute`), once for equal arguments where these are few.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from scenicq.budget import look
from scenicq.errors import CannotEvaluate
from scenicq.forest.columns import (
    DEFINED,
    UNDEFINED,
    UNKNOWN,
    Array,
    CodedValues,
    Column,
    ColumnPlaces,
    Data,
    PlacedRegions,
    Vectors,
    common_status,
    constant_column,
    distances,
    pack_values,
    truth_of,
    value_reader,
)
from scenicq.forest.compute import FAR_M, compute, directions
from scenicq.forest.interpret import OnMap, RegionNode
from scenicq.forest.kinds import as_kind
from scenicq.forest.nodes import (
    Among,
    Arithmetic,
    ArithmeticOp,
    Bearing,
    Compare,
    CompareOp,
    Constant,
    Contains,
    Coordinate,
    CourseCoordinate,
    DirectionAt,
    DiscAt,
    Distance,
    Encloses,
    Feature,
    Kind,
    Leaf,
    LogicOp,
    Measure,
    Norm,
    RectangleAt,
    Rotate,
    Scale,
    SectorAt,
    Undefined,
    Value,
    VectorOf,
    VectorSum,
)
from scenicq.geometry.angles import azimuth_array, wrap_array
from scenicq.geometry.boxes import box_polygons
from scenicq.geometry.containment import covers_many
from scenicq.geometry.driven_courses import CoursePlace, Measures, measure
from scenicq.geometry.fields import VectorField
from scenicq.geometry.measures import MovingBoxes, time_to_collision
from scenicq.geometry.membership import contains_many, distance_many
from scenicq.geometry.occupancy import ElementAtPoint
from scenicq.geometry.regions import SLACK, PolygonSet, Region

__all__ = ["ColumnDomain", "first_direction"]

_NOTHING = Constant(None)
_MEANT: Mapping[Kind, type] = {"scalar": np.ndarray, "boolean": np.ndarray, "vector": tuple}
_ORDER: Mapping[CompareOp, Callable[[Array, Array], Array]] = {
    CompareOp.LT: np.less,
    CompareOp.LE: np.less_equal,
    CompareOp.GT: np.greater,
    CompareOp.GE: np.greater_equal,
    CompareOp.EQ: np.equal,
    CompareOp.NE: np.not_equal,
}
_UNARY: Mapping[ArithmeticOp, Callable[[Array], Array]] = {
    ArithmeticOp.NEG: np.negative,
    ArithmeticOp.ABS: np.abs,
    ArithmeticOp.SQRT: np.sqrt,
    ArithmeticOp.SIN: np.sin,
    ArithmeticOp.COS: np.cos,
    ArithmeticOp.TAN: np.tan,
    ArithmeticOp.ASIN: np.arcsin,
    ArithmeticOp.ACOS: np.arccos,
    ArithmeticOp.ATAN: np.arctan,
    ArithmeticOp.EXP: np.exp,
    ArithmeticOp.LOG: np.log,
    ArithmeticOp.FLOOR: np.floor,
    ArithmeticOp.CEIL: np.ceil,
    ArithmeticOp.WRAP: wrap_array,
}
_BINARY: Mapping[ArithmeticOp, Callable[[Array, Array], Array]] = {
    ArithmeticOp.ADD: np.add,
    ArithmeticOp.SUB: np.subtract,
    ArithmeticOp.MUL: np.multiply,
    ArithmeticOp.DIV: np.divide,
    ArithmeticOp.FLOORDIV: np.floor_divide,
    ArithmeticOp.MOD: np.mod,
    ArithmeticOp.POW: np.power,
    ArithmeticOp.MIN: np.minimum,
    ArithmeticOp.MAX: np.maximum,
    ArithmeticOp.ATAN2: np.arctan2,
}


@dataclass(frozen=True, slots=True)
class ColumnDomain:
    """Values for many places; undefined ones spread, unknown ones hide what depends on them.

    Attributes:
        observed: The column of a feature.
        drawn: The column of a random variable, given those of its distribution's parameters.
        pick: Which of the headings that a vector field allows to take, given how many it allows at each place: numbers
            that broadcast with these; beyond the last they are the last.
        most: Places at which maps may be asked, or a node be computed place by place.
        others: What holds of label objects at each place; unknown if not given.
    """

    observed: Callable[[Feature], Column]
    drawn: Callable[[Leaf, Sequence[Column]], Column]
    pick: Callable[[DirectionAt, NDArray[np.intp]], NDArray[np.intp]]
    most: float = math.inf
    others: Callable[[Among, Sequence[Column]], Column] | None = None
    _measured: dict[tuple[tuple[int, str, bool], ...], Measures] = field(
        default_factory=dict["tuple[tuple[int, str, bool], ...]", "Measures"], repr=False
    )

    # --- leaves

    def constant(self, value: Value) -> Column:
        """A known value."""
        return constant_column(value)

    def feature(self, node: Feature) -> Column:
        """What is observed, as the kind that it is meant to be."""
        found = self.observed(node)
        meant = _MEANT.get(node.kind)
        if meant is None or isinstance(found.data, meant):
            return found
        return self._each(lambda values: as_kind(node, values[0]), [found])

    def variable(self, node: Leaf, args: Sequence[Column]) -> Column:
        """What is drawn."""
        return self.drawn(node, args)

    def among(self, node: Among, args: Sequence[Column]) -> Column:
        """What holds of label objects."""
        if self.others is None:
            return Column(np.full(1, np.nan), np.full(1, UNKNOWN))
        return self.others(node, args)

    # --- numbers and vectors

    def arithmetic(self, op: ArithmeticOp, args: Sequence[Column]) -> Column:
        """An operation on numbers; undefined where its result is not finite."""
        numbers = [_numbers(arg) for arg in args]
        known = [number for number in numbers if number is not None]
        if len(known) < len(numbers):
            return self._each(partial(compute, Arithmetic(op, ())), args)
        found = _UNARY[op](known[0]) if op in _UNARY else known[0]
        for number in known[1:]:
            found = _BINARY[op](found, number)
        status = common_status(args)
        finite = np.isfinite(found)
        return Column(found, status if finite.all() else np.maximum(status, np.where(finite, DEFINED, UNDEFINED)))

    def vector(self, x: Column, y: Column) -> Column:
        """A vector of two numbers."""
        a, b = _numbers(x), _numbers(y)
        if a is None or b is None:
            return self._each(partial(compute, VectorOf(_NOTHING, _NOTHING)), (x, y))
        return Column((a, b), common_status((x, y)))

    def sum(self, left: Column, right: Column) -> Column:
        """The sum of two vectors."""
        a, b = left.data, right.data
        if not isinstance(a, tuple) or not isinstance(b, tuple):
            return self._each(partial(compute, VectorSum(_NOTHING, _NOTHING)), (left, right))
        return Column((a[0] + b[0], a[1] + b[1]), common_status((left, right)))

    def scale(self, vector: Column, factor: Column) -> Column:
        """A vector times a number."""
        a, by = vector.data, _numbers(factor)
        if not isinstance(a, tuple) or by is None:
            return self._each(partial(compute, Scale(_NOTHING, _NOTHING)), (vector, factor))
        return Column((a[0] * by, a[1] * by), common_status((vector, factor)))

    def rotate(self, vector: Column, angle: Column) -> Column:
        """A vector turned counter-clockwise."""
        a, by = vector.data, _numbers(angle)
        if not isinstance(a, tuple) or by is None:
            return self._each(partial(compute, Rotate(_NOTHING, _NOTHING)), (vector, angle))
        cos, sin = np.cos(by), np.sin(by)
        return Column((a[0] * cos - a[1] * sin, a[0] * sin + a[1] * cos), common_status((vector, angle)))

    def coordinate(self, vector: Column, axis: int) -> Column:
        """One coordinate of a vector."""
        if not isinstance(vector.data, tuple):
            return self._each(partial(compute, Coordinate(_NOTHING, axis)), (vector,))
        return Column(vector.data[axis], vector.status)

    def norm(self, vector: Column) -> Column:
        """The length of a vector."""
        if not isinstance(vector.data, tuple):
            return self._each(partial(compute, Norm(_NOTHING)), (vector,))
        return Column(np.hypot(*vector.data), vector.status)

    def bearing(self, vector: Column) -> Column:
        """The heading of a vector."""
        if not isinstance(vector.data, tuple):
            return self._each(partial(compute, Bearing(_NOTHING)), (vector,))
        return Column(azimuth_array(*vector.data), vector.status)

    # --- truth and choice

    def compare(self, op: CompareOp, left: Column, right: Column) -> Column:
        """A comparison."""
        a, b = left.data, right.data
        if not isinstance(a, np.ndarray) or not isinstance(b, np.ndarray):
            return self._each(partial(compute, Compare(op, _NOTHING, _NOTHING)), (left, right))
        return Column(_ORDER[op](a, b), common_status((left, right)))

    def logic(self, op: LogicOp, args: Sequence[Column]) -> Column:
        """A combination of truth values: known as soon as one of them decides."""
        if op is LogicOp.NOT:
            return Column(np.logical_not(truth_of(args[0].data)), args[0].status)
        decisive = op is LogicOp.OR
        decided: Array = np.zeros(1, dtype=np.bool_)
        for arg in args:
            decided = decided | (np.equal(truth_of(arg.data), decisive) & np.equal(arg.status, DEFINED))
        return Column(decided == decisive, np.where(decided, DEFINED, common_status(args)))

    def select(self, index: Column, options: Sequence[Column]) -> Column:
        """One of some options; the others do not matter."""
        numbers = _numbers(index)
        if numbers is None:
            return Column(np.full(1, np.nan), index.status)
        which = np.where(np.equal(index.status, DEFINED), numbers, 0).astype(np.intp)
        status = np.maximum(index.status, _picked(which, [option.status for option in options]))
        data = _of_one_kind(options)
        arrays = [each for each in data if isinstance(each, np.ndarray)]
        if len(arrays) == len(data):
            return Column(_picked(which, arrays), status)
        pairs = [each for each in data if isinstance(each, tuple)]
        if len(pairs) == len(data):
            x, y = (_picked(which, [pair[axis] for pair in pairs]) for axis in (0, 1))
            return Column((x, y), status)
        coded = [each for each in data if isinstance(each, CodedValues)]
        if len(coded) == len(data):
            starts = np.cumsum([0, *(len(each.options) for each in coded)])
            codes = [each.which + start for each, start in zip(coded, starts[:-1].tolist(), strict=True)]
            return Column(CodedValues(_picked(which, codes), sum((each.options for each in coded), ())), status)
        chosen = [Column(each.data, status) for each in (index, *options)]
        return self._each(lambda values: values[1 + int(cast(float, values[0]))], chosen)

    # --- the map

    def on_map(self, node: OnMap, args: Sequence[Column]) -> Column:
        """What a region or vector field says of points or of other regions."""
        if isinstance(node, DirectionAt):
            return self._direction(node, *args)
        if (
            isinstance(node, CourseCoordinate)
            and isinstance(args[0].data, CodedValues)
            and isinstance(args[1].data, tuple)
        ):
            return self._course_coordinate(node, args[0].data, args)
        if isinstance(node, Measure) and node.measure == "time_to_collision":
            data = [arg.data for arg in args]
            if all(isinstance(each, np.ndarray | tuple) for each in data):
                boxes = [MovingBoxes(*cast("list[Any]", data[first : first + 5])) for first in (0, 5)]
                return Column(time_to_collision(*boxes), common_status(args))
        if isinstance(node, Contains | Distance) and isinstance(args[1].data, tuple):
            shape, point = args[0].data, args[1].data
            if isinstance(shape, PlacedRegions):
                away = distances(shape, *point)
                return Column(away <= SLACK if isinstance(node, Contains) else away, common_status(args))
            if isinstance(shape, CodedValues):
                return self._of_regions(node, shape, args, partial(_of_points, node, point))
        if (
            isinstance(node, Encloses)
            and isinstance(args[0].data, CodedValues)
            and isinstance(args[1].data, PlacedRegions)
        ):
            box = args[1].data
            if isinstance(box.node, RectangleAt):
                return self._of_regions(node, args[0].data, args, partial(_of_boxes, box))
        return self._each(partial(compute, node), args)

    def region(self, node: RegionNode, args: Sequence[Column]) -> Column:
        """A region."""
        center = args[0].data
        numbers = tuple(arg.data for arg in args[1:] if isinstance(arg.data, np.ndarray))
        known = len(numbers) == len(args) - 1
        if isinstance(node, DiscAt | SectorAt | RectangleAt) and isinstance(center, tuple) and known:
            return Column(PlacedRegions(node, center, numbers), common_status(args))
        return self._each(partial(compute, node), args)

    def _of_regions(
        self,
        node: OnMap,
        regions: CodedValues,
        args: Sequence[Column],
        ask: Callable[[Region, ColumnPlaces, NDArray[np.intp]], Array],
    ) -> Column:
        """What regions say of what is at some places, asked once for each region."""
        places = ColumnPlaces((*args,))
        self._check(len(places.defined), "what regions say of them")
        which = places.spread(regions.which)[places.defined]
        found: Array | None = None
        for number in np.unique(which).tolist():
            mine = places.defined[which == number]
            try:
                said = ask(cast(Region, regions.options[number]), places, mine)
            except CannotEvaluate:
                # each place by itself, as geometry cannot answer at some of them
                return self._each(partial(compute, node), args)
            found = np.zeros(places.count, dtype=said.dtype) if found is None else found
            found[mine] = said
        if found is None:
            return Column(np.full(1, np.nan), places.status.reshape(places.shape))
        return Column(found.reshape(places.shape), places.status.reshape(places.shape))

    def _course_coordinate(self, node: CourseCoordinate, courses: CodedValues, args: Sequence[Column]) -> Column:
        places = ColumnPlaces((*args,))
        self._check(len(places.defined), "courses")
        found = self._measures(node, courses, args, places)
        low, high = (found.end(node.axis, end) for end in (0, 1))
        status, data = places.status.copy(), np.full(places.count, np.nan)
        data[places.defined] = np.clip(high if node.end == 1 else low, -FAR_M, FAR_M)
        if node.end is None:
            status[places.defined[low != high]] = UNKNOWN
        return Column(data.reshape(places.shape), status.reshape(places.shape))

    def _measures(
        self, node: CourseCoordinate, courses: CodedValues, args: Sequence[Column], places: ColumnPlaces
    ) -> Measures:
        """Where points are on courses; what is observed is measured once for along, beside and their ends."""
        features = (each for each in (node.course, node.point) if isinstance(each, Feature))
        of = tuple((each.object, each.property, each.current) for each in features)
        if of in self._measured:
            return self._measured[of]
        which: list[int] = places.spread(courses.which)[places.defined].tolist()
        mine = [cast(CoursePlace, courses.options[number]) for number in which]
        found = measure(mine, places.points(args[1].data))
        if len(of) == len(args):
            self._measured[of] = found
        return found

    def _direction(self, node: DirectionAt, of: Column, point: Column, *going: Column) -> Column:
        places = ColumnPlaces((of, point, *going))
        self._check(len(places.defined), "directions")
        allowed = _allowed(places, of.data, point.data, *(each.data for each in going))
        most = max(map(len, allowed), default=1)
        counts = np.zeros(places.count, dtype=np.intp)
        counts[places.defined] = list(map(len, allowed))
        headings = np.full((places.count, max(most, 1)), np.nan)
        if allowed and min(map(len, allowed)) == most:
            headings[places.defined, :most] = allowed
        else:
            for place, each in zip(places.defined.tolist(), allowed, strict=True):
                headings[place, : len(each)] = each
        status = np.where((places.status == DEFINED) & (counts == 0), UNDEFINED, places.status).reshape(places.shape)
        if most <= 1:
            return Column(headings[:, 0].reshape(places.shape), status)
        counts = counts.reshape(places.shape)
        which = np.minimum(self.pick(node, counts), np.maximum(counts, 1) - 1)
        return Column(headings[np.arange(places.count).reshape(places.shape), which], status)

    # --- place by place

    def _check(self, places: int, what: str) -> None:
        if places > self.most:
            raise CannotEvaluate(f"{what} at {places} points")

    def _each(self, meaning: Callable[[tuple[Value, ...]], Value], args: Sequence[Column]) -> Column:
        """The values of a meaning, computed once for each combination of arguments."""
        places = ColumnPlaces(args)
        status = places.status.copy()
        first, number = places.combinations(args)
        self._check(len(first), "values one by one")
        read = [value_reader(arg.data, places.shape) for arg in args]
        values: list[Value] = []
        said: list[np.int8] = []
        for place in first.tolist():
            look()
            try:
                value = meaning(tuple(each(place) for each in read))
                said.append(UNDEFINED if isinstance(value, Undefined) else DEFINED)
            except CannotEvaluate:
                value = None
                said.append(UNKNOWN)
            values.append(value)
        status[places.defined] = np.array(said, dtype=np.int8)[number] if said else DEFINED
        code = np.zeros(places.count, dtype=np.intp)
        code[places.defined] = number
        return Column(pack_values(values, said, code.reshape(places.shape)), status.reshape(places.shape))


def _of_points(
    node: Contains | Distance, point: Vectors, region: Region, places: ColumnPlaces, mine: NDArray[np.intp]
) -> Array:
    xy = np.column_stack([places.spread(axis)[mine] for axis in point])
    return contains_many(region, xy) if isinstance(node, Contains) else distance_many(region, xy)


def _of_boxes(box: PlacedRegions, region: Region, places: ColumnPlaces, mine: NDArray[np.intp]) -> Array:
    if not isinstance(region, PolygonSet):
        raise CannotEvaluate("whether a box lies in it")
    numbers = [places.spread(each)[mine] for each in (*box.center, *box.numbers)]
    return covers_many(region, box_polygons(*numbers))


def first_direction(_node: DirectionAt, _counts: NDArray[np.intp]) -> NDArray[np.intp]:
    """Picks the first heading that a vector field allows, where any of them will do."""
    return np.zeros(1, np.intp)


def _of_one_kind(options: Sequence[Column]) -> list[Data]:
    """The data of options; that of one which is nowhere defined is of the others' kind, as it does not matter."""
    defined = [bool((option.status == DEFINED).any()) for option in options]
    there = [option.data for option, is_there in zip(options, defined, strict=True) if is_there]
    nothing: Data = np.full(1, np.nan)
    if there and isinstance(there[0], CodedValues):
        nothing = CodedValues(np.zeros(1, np.intp), (None,))
    elif there and isinstance(there[0], tuple):
        nothing = (np.full(1, np.nan), np.full(1, np.nan))
    return [option.data if is_there else nothing for option, is_there in zip(options, defined, strict=True)]


def _numbers(column: Column) -> Array | None:
    data = column.data
    if not isinstance(data, np.ndarray):
        return None
    return data.astype(np.float64) if data.dtype == np.bool_ else data


def _picked(which: Array, options: Sequence[Array]) -> Array:
    if all(option.size == 1 for option in options):
        return np.concatenate([option.ravel() for option in options])[which]
    found = options[0]
    for number, option in enumerate(options[1:], start=1):
        found = np.where(which == number, option, found)
    return found


def _allowed(
    places: ColumnPlaces, field: Data, point: Data, going: Data | None = None, last: Data | None = None
) -> Sequence[tuple[float, ...]]:
    """The headings that a field allows at each defined place."""
    if not len(places.defined):
        return ()
    xy, fields = places.points(point), cast(CodedValues, field)
    only = fields.options[0] if len(fields.options) == 1 else None
    if only is not None and not isinstance(only, Undefined):
        if isinstance(only, ElementAtPoint) and isinstance(going, np.ndarray):
            # where there is no heading or no lane, it is nan
            before = last if isinstance(last, np.ndarray) else np.full(1, np.nan)
            ways, lanes = (places.spread(each)[places.defined].tolist() for each in (going, before))
            return [(each,) for each in only.along_many(xy, ways, lanes)]
        return cast(VectorField, only).values_many(xy)
    which: list[int] = places.spread(fields.which)[places.defined].tolist()
    found = [directions(fields.options[one], (x, y)) for one, (x, y) in zip(which, xy.tolist(), strict=True)]
    return [() if isinstance(each, Undefined) else each for each in found]
