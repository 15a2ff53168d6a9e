"""Nodes of the forest as terms and formulas over the variables of a problem (query paper, appendix A.2).

Where a node has cases (a pick from a list, the direction of a road, an angle that wraps) an auxiliary variable takes
the value and a disjunction says which. Regions become disjunctions of convex cells, those near the point only.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import cast

from scenicq.errors import CannotEvaluate
from scenicq.forest.bounds import Box, scalar_bounds, vector_bounds
from scenicq.forest.nodes import (
    AheadInLanes,
    Among,
    Arithmetic,
    ArithmeticOp,
    Bearing,
    Compare,
    Constant,
    Contains,
    Coordinate,
    Corridor,
    CourseCoordinate,
    DirectionAt,
    DiscAt,
    DiscreteRange,
    Distance,
    Encloses,
    Feature,
    Identity,
    Index,
    Intersects,
    LaneCourse,
    Logic,
    Measure,
    Node,
    Norm,
    Normal,
    PointIn,
    Range,
    RectangleAt,
    RegionDifference,
    RegionIntersection,
    RegionUnion,
    Rotate,
    Scale,
    SectorAt,
    Select,
    TruncatedNormal,
    Undefined,
    VectorOf,
    VectorSum,
)
from scenicq.forest.walk import children, postorder
from scenicq.geometry.fields import VectorField
from scenicq.geometry.membership import bounds as region_bounds
from scenicq.geometry.regions import Rectangle
from scenicq.limits import LIMITS
from scenicq.smt.distance_terms import BoxTerms, box_meets, boxes_meet, disc_meets, distance_term, length, minus
from scenicq.smt.enclosing import box_holds
from scenicq.smt.field import field_cells
from scenicq.smt.problem import Formula, Term, is_formula, is_term
from scenicq.smt.region_membership import TermVector, index_equals, inside_region
from scenicq.smt.terms import FALSE, apply, compare, conjunction, disjunction, negation, number
from scenicq.smt.unknowns import Unknowns
from scenicq.smt.value_codes import (
    CodeChoice,
    cases,
    compare_codes,
    connect,
    constant_code,
    equal,
    is_box,
    known_region,
    rotate_vector,
)

__all__ = ["Expressions"]

_AS_IT_IS = frozenset(ArithmeticOp) - {
    ArithmeticOp.POW, ArithmeticOp.WRAP, ArithmeticOp.FLOOR, ArithmeticOp.CEIL, ArithmeticOp.FLOORDIV, ArithmeticOp.MOD,
}  # fmt: skip
"""Operations that solvers have."""
EVERYWHERE: Box = ((-math.inf, math.inf), (-math.inf, math.inf))


class Expressions:
    """Makes the code (see `codes`) of each node once."""

    def __init__(self, unknowns: Unknowns, boxes: Mapping[Identity, Box], *, borders: bool) -> None:
        """Take the variables of the problem, where each random point can lie, and whether to encode curved borders."""
        self._borders = borders
        self.unknowns = unknowns
        self._boxes = boxes
        self._terms: dict[int, object] = {}
        self._keep: list[Node] = []

    def code(self, root: Node) -> object:
        """The code of a node.

        Raises:
            CannotEvaluate: A construct has no formula.
        """
        self._keep.append(root)
        for node in postorder((root,)):
            if id(node) not in self._terms:
                args = [self._terms[id(child)] for child in children(node)]
                lost = next((arg for arg in args if isinstance(arg, Undefined)), None)
                decided = isinstance(node, Logic | Select)
                self._terms[id(node)] = lost if lost is not None and not decided else self._of(node, args)
        return self._terms[id(root)]

    def _of(self, node: Node, args: list[object]) -> object:
        terms = cast("list[Term]", args)
        match node:
            case Constant():
                return constant_code(node.value)
            case Feature():
                raise CannotEvaluate("a feature that was not conditioned")
            case Range() | Normal() | TruncatedNormal() | DiscreteRange() | Index():
                return self.unknowns.number(node, terms)
            case PointIn():
                return self._point(node)
            case Select():
                return self._select(node, args)
            case Arithmetic():
                return self._arithmetic(node, terms)
            case Coordinate():
                return cast(TermVector, args[0])[node.axis]
            case VectorOf():
                return (terms[0], terms[1])
            case VectorSum():
                (a, b), (c, d) = cast("list[TermVector]", args)
                return (apply(ArithmeticOp.ADD, a, c), apply(ArithmeticOp.ADD, b, d))
            case Scale():
                x, y = cast(TermVector, args[0])
                return (apply(ArithmeticOp.MUL, x, terms[1]), apply(ArithmeticOp.MUL, y, terms[1]))
            case Rotate():
                return rotate_vector(cast(TermVector, args[0]), terms[1])
            case Norm():
                x, y = cast(TermVector, args[0])
                return apply(
                    ArithmeticOp.SQRT,
                    apply(ArithmeticOp.ADD, apply(ArithmeticOp.POW, x, 2.0), apply(ArithmeticOp.POW, y, 2.0)),
                )
            case Bearing():
                x, y = cast(TermVector, args[0])
                return apply(ArithmeticOp.ATAN2, apply(ArithmeticOp.NEG, x), y)
            case CourseCoordinate() | Measure() | LaneCourse() | Corridor() | AheadInLanes():
                raise CannotEvaluate("a course that depends on what no label shows")
            case Among():
                raise CannotEvaluate("a condition on other label objects that depends on what no label shows")
            case DirectionAt():
                return self._direction(node, cast(TermVector, args[1]))
            case Compare():
                return compare_codes(node.op, args[0], args[1])
            case Logic():
                return connect(node.op, args)
            case Contains():
                return inside_region(node.region, cast(TermVector, args[1]), self._around(node.point), self.code)
            case DiscAt() | SectorAt() | RectangleAt() | RegionUnion() | RegionIntersection() | RegionDifference():
                return None
            case Distance():
                return self._distance(node, cast(TermVector, args[1]))
            case Intersects():
                return self._meeting(node)
            case Encloses():
                return box_holds(self._frame(node.inner), known_region(node.outer), self._extent(node.inner))

    def _around(self, point: Node) -> Box:
        return vector_bounds(point, self._boxes)

    def _extent(self, box: Node) -> Box:
        """Where the corners of a box can be."""
        match box:
            case RectangleAt():
                sizes = [scalar_bounds(part, self._boxes) for part in (box.width, box.length)]
                reach = math.hypot(*(max(abs(low), abs(high)) for low, high in sizes)) / 2
                (x0, x1), (y0, y1) = self._around(box.center)
                return (x0 - reach, x1 + reach), (y0 - reach, y1 + reach)
            case Constant(value=Rectangle() as known):
                west, south, east, north = region_bounds(known)
                return (west, east), (south, north)
            case _:
                return EVERYWHERE

    def _point(self, node: PointIn) -> TermVector:
        if node.identity in self.unknowns.made:
            x, y = self.unknowns.made[node.identity]
            return (x.leaf, y.leaf)
        (x0, x1), (y0, y1) = around = self._around(node)
        if x0 > x1 or y0 > y1:
            self.unknowns.side.append(FALSE)
            (x0, x1), (y0, y1) = around = ((0.0, 0.0), (0.0, 0.0))
        made = self.unknowns.add("x", x0, x1), self.unknowns.add("y", y0, y1)
        self.unknowns.made[node.identity] = made
        point = made[0].leaf, made[1].leaf
        self.unknowns.side.append(inside_region(node.region, point, around, self.code))
        return point

    def _select(self, node: Select, args: list[object]) -> object:
        index, options = args[0], args[1:]
        if not (is_term(index) or is_formula(index)):
            return index
        defined = [option for option in options if not isinstance(option, Undefined)]
        if not defined:
            return options[0]
        if all(is_term(option) for option in defined):
            chosen = self.unknowns.fresh("pick")
            self.unknowns.side.append(cases(index, [equal(chosen, option) for option in options]))
            return chosen
        if all(isinstance(option, tuple) for option in defined):
            pair = (self.unknowns.fresh("pick"), self.unknowns.fresh("pick"))
            both = [
                FALSE
                if isinstance(option, Undefined)
                else conjunction(
                    [equal(mine, theirs) for mine, theirs in zip(pair, cast(TermVector, option), strict=True)]
                )
                for option in options
            ]
            self.unknowns.side.append(cases(index, both))
            return pair
        if all(is_formula(option) for option in defined):
            return cases(index, [option if is_formula(option) else FALSE for option in options])
        return CodeChoice(tuple((index_equals(index, n), option) for n, option in enumerate(options)))

    def _distance(self, node: Distance, point: TermVector) -> Term:
        outside, inner = distance_term(known_region(node.region), point, self._around(node.point))
        if not inner:
            return outside
        result = self.unknowns.fresh("distance", 0.0)
        inside = [conjunction([where, compare("==", result, term)]) for where, term in inner]
        away = conjunction([*(negation(where) for where, _ in inner), compare("==", result, outside)])
        self.unknowns.side.append(disjunction([*inside, away]))
        return result

    def _meeting(self, node: Intersects) -> Formula:
        for disc, other in ((node.left, node.right), (node.right, node.left)):
            if isinstance(disc, DiscAt):
                return self._disc_meets(disc, other)
        boxes = [side for side in (node.left, node.right) if is_box(side)]
        if len(boxes) == 2:
            return boxes_meet(self._frame(boxes[0]), self._frame(boxes[1]))
        if not boxes:
            raise CannotEvaluate("whether two random regions meet")
        other = node.right if boxes[0] is node.left else node.left
        return box_meets(self._frame(boxes[0]), known_region(other))

    def _disc_meets(self, disc: DiscAt, other: Node) -> Formula:
        center, radius = cast(TermVector, self.code(disc.center)), cast(Term, self.code(disc.radius))
        if is_box(other):
            return disc_meets(self._frame(other), center, radius)
        reach = compare(">=", radius, 0.0)
        if isinstance(other, DiscAt):
            size = cast(Term, self.code(other.radius))
            other_center = cast(TermVector, self.code(other.center))
            away = length(minus(center, other_center))
            sizes = compare(">=", size, 0.0), compare("<=", away, apply(ArithmeticOp.ADD, radius, size))
            return conjunction([reach, *sizes])
        return conjunction([reach, compare("<=", self._distance(Distance(other, disc.center), center), radius)])

    def _frame(self, node: Node) -> BoxTerms:
        """A box whose place may be random."""
        match node:
            case RectangleAt():
                center = cast(TermVector, self.code(node.center))
                sizes = [cast(Term, self.code(part)) for part in (node.heading, node.width, node.length)]
                return BoxTerms.of(center, *sizes)
            case Constant(value=Rectangle() as box):
                return BoxTerms.of(
                    (number(box.center[0]), number(box.center[1])),
                    number(box.heading),
                    number(box.width),
                    number(box.length),
                )
            case _:
                raise CannotEvaluate("whether a random region lies in another")

    def _arithmetic(self, node: Arithmetic, args: list[Term]) -> Term:
        op = node.op
        if op in _AS_IT_IS:
            return apply(op, *args)
        if op is ArithmeticOp.POW and isinstance(args[1], Constant):
            exponent = cast(float, args[1].value)
            if exponent == 0.5:
                return apply(ArithmeticOp.SQRT, args[0])
            if exponent == int(exponent):
                return apply(ArithmeticOp.POW, args[0], exponent)
        if op is ArithmeticOp.WRAP:
            return self._wrapped(args[0], scalar_bounds(node.args[0], self._boxes))
        whole = self._floored(node, args)
        if whole is not None:
            return whole
        raise CannotEvaluate(f"`{op.value}` of random values")

    def _floored(self, node: Arithmetic, args: list[Term]) -> Term | None:
        """Rounding down or up, division and remainder by it: one case for each whole number within the bounds."""
        limits = [scalar_bounds(arg, self._boxes) for arg in node.args]
        match node.op:
            case ArithmeticOp.FLOOR:
                value, (low, high) = args[0], limits[0]
            case ArithmeticOp.CEIL:
                value, (low, high) = apply(ArithmeticOp.NEG, args[0]), (-limits[0][1], -limits[0][0])
            case ArithmeticOp.FLOORDIV | ArithmeticOp.MOD if limits[1][0] > 0 or limits[1][1] < 0:
                value = apply(ArithmeticOp.DIV, args[0], args[1])
                ends = [a / b for a in limits[0] for b in limits[1]]
                low, high = min(ends), max(ends)
            case _:
                return None
        if not high - low <= LIMITS.rounded_values:
            return None
        numbers = range(math.floor(low), math.floor(high) + 1)
        whole = self.unknowns.fresh("whole", float(numbers[0]), float(numbers[-1]))
        self.unknowns.side.append(
            disjunction(
                conjunction(
                    [compare("==", whole, float(n)), compare("<=", float(n), value), compare("<", value, n + 1.0)]
                )
                for n in numbers
            )
        )
        if node.op is ArithmeticOp.CEIL:
            return apply(ArithmeticOp.NEG, whole)
        if node.op is not ArithmeticOp.MOD:
            return whole
        return apply(ArithmeticOp.SUB, args[0], apply(ArithmeticOp.MUL, args[1], whole))

    def _wrapped(self, angle: Term, limits: tuple[float, float]) -> Term:
        low, high = limits
        if not (math.isfinite(low) and math.isfinite(high)):
            return apply(ArithmeticOp.ATAN2, apply(ArithmeticOp.SIN, angle), apply(ArithmeticOp.COS, angle))
        turns = range(math.ceil((low - math.pi) / math.tau), math.floor((high + math.pi) / math.tau) + 1)
        result = self.unknowns.fresh("angle", -math.pi, math.pi)
        self.unknowns.side.append(
            disjunction(equal(result, apply(ArithmeticOp.SUB, angle, math.tau * k)) for k in turns)
        )
        return result

    def _direction(self, node: DirectionAt, point: TermVector) -> Term:
        """The direction of a field at a random point: one case per cell near it."""
        if isinstance(node.field, Select):
            # the direction of a field chosen at random is a choice of directions
            options = tuple(
                each
                if isinstance(each, Constant) and isinstance(each.value, Undefined)
                else DirectionAt(each, node.point, span=node.span)
                for each in node.field.options
            )
            return cast(Term, self.code(Select(node.field.index, options, span=node.span)))
        if not isinstance(node.field, Constant):
            raise CannotEvaluate("a random vector field at a random point")
        (x0, x1), (y0, y1) = self._around(node.point)
        if not all(map(math.isfinite, (x0, x1, y0, y1))):
            raise CannotEvaluate("the direction of a field at an unbounded point")
        heading = self.unknowns.fresh("heading", -math.pi, math.pi)
        cells = field_cells(cast(VectorField, node.field.value), point, (x0, y0, x1, y1), borders=self._borders)
        self.unknowns.side.append(
            disjunction(conjunction([compare("==", heading, value), where]) for value, where in cells)
        )
        return heading
