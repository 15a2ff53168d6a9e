"""From the forest to a formula (query paper, appendix A.2, figures 17-19).

Every random variable becomes a real variable (a random point two), every node a term over them. Where a node has
cases (a pick from a list, the direction of a road, an angle that wraps) an auxiliary variable takes the value and a
disjunction says which. Regions become disjunctions of convex cells, those near the point only.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, cast

from scenicq.forest.bounds import Box, leaf_boxes, scalar_bounds, vector_bounds
from scenicq.forest.nodes import (
    Arithmetic,
    ArithmeticOp,
    Bearing,
    Compare,
    Constant,
    Contains,
    Coordinate,
    DirectionAt,
    DiscAt,
    DiscreteRange,
    Distance,
    Encloses,
    Feature,
    Identity,
    Index,
    Intersects,
    Logic,
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
    Value,
    VectorOf,
    VectorSum,
)
from scenicq.forest.walk import children, postorder
from scenicq.geometry.fields import VectorField
from scenicq.geometry.regions import Rectangle
from scenicq.smt.codes import (
    Choice,
    between,
    cases,
    compare_codes,
    connect,
    constant_code,
    equal,
    is_box,
    known_region,
    rotated,
    same,
    truth,
)
from scenicq.smt.formula import (
    FALSE,
    Formula,
    Num,
    Operator,
    Problem,
    Term,
    Var,
    Variable,
    apply,
    compare,
    conjunction,
    disjunction,
    negation,
)
from scenicq.smt.inside import UnsupportedError, Vector, convex_cell, disc, inside_region, picked
from scenicq.smt.measure import Frame, box_holds, box_meets, boxes_meet, distance_term

__all__ = ["Encoding", "Item", "Target", "UnsupportedError", "encode"]


@dataclass(frozen=True, slots=True)
class Target:
    """How the value of an expression is compared with the label's: None for a requirement.

    Attributes:
        shape: "box" with half extents `a` and `b`, "disc" or interval of radius `a`, "angle" of half width `a`.
    """

    shape: Literal["box", "disc", "angle"] | None
    a: float = 0.0
    b: float = 0.0


Item = tuple[Target, Node, Value]
"""What an expression must equal: its target, the expression after conditioning, the label's value."""


@dataclass(frozen=True, slots=True)
class Encoding:
    """A problem for a solver, and how to read its witness.

    Attributes:
        problem: The problem.
        names: The names of the variables of each random variable: one, or two for a point.
        whole: The random variables that are whole numbers.
    """

    problem: Problem
    names: Mapping[Identity, tuple[str, ...]]
    whole: frozenset[Identity] = frozenset()

    def values(self, witness: Mapping[str, float]) -> dict[Identity, Value]:
        """The values of the random variables in a witness."""
        found: dict[Identity, Value] = {}
        for identity, names in self.names.items():
            numbers = [float(witness[name]) for name in names]
            if identity in self.whole:
                numbers = [float(round(number)) for number in numbers]
            found[identity] = (numbers[0], numbers[1]) if len(numbers) == 2 else numbers[0]
        return found


def encode(groups: Sequence[Sequence[Item]]) -> Encoding:
    """Encode groups of constraints as one problem.

    Args:
        groups: Per group, the constraints that are left after conditioning. Random variables are shared between
            groups by identity; what a group shares otherwise (the direction at one point) it shares alone.

    Raises:
        UnsupportedError: A construct has no formula.
    """
    encoder = _Encoder()
    parts = [encoder.group(items) for items in groups]
    constraint = conjunction([*parts, *encoder.side])
    return Encoding(Problem(tuple(encoder.variables), constraint), encoder.names, frozenset(encoder.whole))


_SCALAR: dict[ArithmeticOp, Operator] = {
    ArithmeticOp.ADD: Operator.ADD,
    ArithmeticOp.SUB: Operator.SUB,
    ArithmeticOp.MUL: Operator.MUL,
    ArithmeticOp.DIV: Operator.DIV,
    ArithmeticOp.NEG: Operator.NEG,
    ArithmeticOp.ABS: Operator.ABS,
    ArithmeticOp.MIN: Operator.MIN,
    ArithmeticOp.MAX: Operator.MAX,
    ArithmeticOp.SQRT: Operator.SQRT,
    ArithmeticOp.SIN: Operator.SIN,
    ArithmeticOp.COS: Operator.COS,
    ArithmeticOp.TAN: Operator.TAN,
    ArithmeticOp.ASIN: Operator.ASIN,
    ArithmeticOp.ACOS: Operator.ACOS,
    ArithmeticOp.ATAN: Operator.ATAN,
    ArithmeticOp.ATAN2: Operator.ATAN2,
    ArithmeticOp.EXP: Operator.EXP,
    ArithmeticOp.LOG: Operator.LOG,
}
_MOST_INTEGERS = 1000


class _Encoder:
    """Builds one problem: variables, side conditions, and the code of each node."""

    def __init__(self) -> None:
        self.variables: list[Variable] = []
        self.side: list[Formula] = []
        self.names: dict[Identity, tuple[str, ...]] = {}
        self.whole: set[Identity] = set()
        self.terms: dict[int, object] = {}
        self.boxes: Mapping[Identity, Box] = {}
        self.keep: list[Node] = []

    def group(self, items: Sequence[Item]) -> Formula:
        """The formula of one group."""
        targets: list[tuple[Node, Box]] = []
        for target, node, observed in items:
            if target.shape in ("box", "disc") and isinstance(observed, tuple):
                rx, ry = (target.a, target.b) if target.shape == "box" else (target.a, target.a)
                x, y = observed
                targets.append((node, ((x - rx, x + rx), (y - ry, y + ry))))
        self.boxes = leaf_boxes(targets)
        self.terms = {}
        return conjunction([self._item(item) for item in items])

    def _item(self, item: Item) -> Formula:
        target, node, observed = item
        code = self._code(node)
        if isinstance(code, Undefined):
            return FALSE
        if target.shape is None:
            return truth(code)
        if isinstance(observed, tuple):
            x, y = cast(Vector, code)
            dx, dy = apply(Operator.SUB, x, observed[0]), apply(Operator.SUB, y, observed[1])
            if target.shape == "box":
                return conjunction([*between(dx, -target.a, target.a), *between(dy, -target.b, target.b)])
            return disc(dx, dy, target.a)
        if not isinstance(observed, float):
            return same(code, observed)
        if not isinstance(code, Term):
            return FALSE
        off = apply(Operator.SUB, code, observed)
        if target.shape == "angle":
            return self._near_angle(off, scalar_bounds(node, self.boxes), observed, target.a)
        return conjunction(between(off, -target.a, target.a))

    def _near_angle(self, off: Term, limits: tuple[float, float], observed: float, width: float) -> Formula:
        """An angle within `width` of a multiple of 2 pi: one case per turn, or by sine where it is unbounded."""
        low, high = limits[0] - observed, limits[1] - observed
        if math.isfinite(low) and math.isfinite(high):
            turns = range(math.ceil((low - width) / math.tau), math.floor((high + width) / math.tau) + 1)
            return disjunction(conjunction(between(off, math.tau * k - width, math.tau * k + width)) for k in turns)
        if width >= math.pi / 2:
            return compare(">=", apply(Operator.COS, off), math.cos(min(width, math.pi)))
        sine = apply(Operator.SIN, off)
        return conjunction(
            [*between(sine, -math.sin(width), math.sin(width)), compare(">", apply(Operator.COS, off), 0.0)]
        )

    def _fresh(self, prefix: str, low: float = -math.inf, high: float = math.inf) -> Var:
        name = f"{prefix}{len(self.variables)}"
        self.variables.append(Variable(name, low, high))
        return Var(name)

    # --- nodes

    def _code(self, root: Node) -> object:
        self.keep.append(root)
        for node in postorder((root,)):
            if id(node) not in self.terms:
                args = [self.terms[id(child)] for child in children(node)]
                lost = next((arg for arg in args if isinstance(arg, Undefined)), None)
                decided = isinstance(node, Logic | Select)
                self.terms[id(node)] = lost if lost is not None and not decided else self._node(node, args)
        return self.terms[id(root)]

    def _node(self, node: Node, args: list[object]) -> object:
        terms = cast("list[Term]", args)
        match node:
            case Constant():
                return constant_code(node.value)
            case Feature():
                raise UnsupportedError("a feature that was not conditioned")
            case Range() | Normal() | TruncatedNormal() | DiscreteRange() | Index():
                return self._scalar_leaf(node, terms)
            case PointIn():
                return self._point(node)
            case Select():
                return self._select(node, args)
            case Arithmetic():
                return self._arithmetic(node, terms)
            case Coordinate():
                return cast(Vector, args[0])[node.axis]
            case VectorOf():
                return (terms[0], terms[1])
            case VectorSum():
                (a, b), (c, d) = cast("list[Vector]", args)
                return (apply(Operator.ADD, a, c), apply(Operator.ADD, b, d))
            case Scale():
                x, y = cast(Vector, args[0])
                return (apply(Operator.MUL, x, terms[1]), apply(Operator.MUL, y, terms[1]))
            case Rotate():
                return rotated(cast(Vector, args[0]), terms[1])
            case Norm():
                x, y = cast(Vector, args[0])
                return apply(
                    Operator.SQRT, apply(Operator.ADD, apply(Operator.POW, x, 2.0), apply(Operator.POW, y, 2.0))
                )
            case Bearing():
                x, y = cast(Vector, args[0])
                return apply(Operator.ATAN2, apply(Operator.NEG, x), y)
            case DirectionAt():
                return self._direction(node, cast(Vector, args[1]))
            case Compare():
                return compare_codes(node.op, args[0], args[1])
            case Logic():
                return connect(node.op, args)
            case Contains():
                return inside_region(node.region, cast(Vector, args[1]), self._around(node.point), self._code)
            case DiscAt() | SectorAt() | RectangleAt() | RegionUnion() | RegionIntersection() | RegionDifference():
                return None
            case Distance():
                return self._distance(node, cast(Vector, args[1]))
            case Intersects():
                return self._meeting(node)
            case Encloses():
                return box_holds(self._frame(node.inner).corners(), known_region(node.outer))

    def _around(self, point: Node) -> Box:
        return vector_bounds(point, self.boxes)

    def _scalar_leaf(self, node: Range | Normal | TruncatedNormal | DiscreteRange | Index, args: list[Term]) -> Term:
        if node.identity in self.names:
            return Var(self.names[node.identity][0])
        low, high = scalar_bounds(node)
        variable = self._fresh(type(node).__name__.lower(), low, high)
        self.names[node.identity] = (variable.name,)
        match node:
            case Range() if not all(isinstance(arg, Num) for arg in args):
                ends = apply(Operator.MIN, *args), apply(Operator.MAX, *args)
                self.side += [compare("<=", ends[0], variable), compare("<=", variable, ends[1])]
            case TruncatedNormal() if not all(isinstance(arg, Num) for arg in args):
                self.side += [compare("<=", args[2], variable), compare("<=", variable, args[3])]
            case DiscreteRange() | Index():
                if not math.isfinite(high - low) or high - low > _MOST_INTEGERS:
                    raise UnsupportedError("an integer from a random or very long range")
                numbers = range(math.ceil(low), math.floor(high) + 1)
                self.whole.add(node.identity)
                self.side.append(disjunction(compare("==", variable, float(n)) for n in numbers))
            case _:
                pass
        return variable

    def _point(self, node: PointIn) -> Vector:
        if node.identity in self.names:
            x, y = self.names[node.identity]
            return (Var(x), Var(y))
        (x0, x1), (y0, y1) = around = self._around(node)
        if x0 > x1 or y0 > y1:
            self.side.append(FALSE)
            (x0, x1), (y0, y1) = around = ((0.0, 0.0), (0.0, 0.0))
        point = (self._fresh("x", x0, x1), self._fresh("y", y0, y1))
        self.names[node.identity] = (point[0].name, point[1].name)
        self.side.append(inside_region(node.region, point, around, self._code))
        return point

    def _select(self, node: Select, args: list[object]) -> object:
        index, options = args[0], args[1:]
        if not isinstance(index, Term):
            return index
        defined = [option for option in options if not isinstance(option, Undefined)]
        if not defined:
            return options[0]
        if all(isinstance(option, Term) for option in defined):
            chosen = self._fresh("pick")
            self.side.append(cases(index, [equal(chosen, option) for option in options]))
            return chosen
        if all(isinstance(option, tuple) for option in defined):
            pair = (self._fresh("pick"), self._fresh("pick"))
            both = [
                FALSE
                if isinstance(option, Undefined)
                else conjunction([equal(mine, theirs) for mine, theirs in zip(pair, cast(Vector, option), strict=True)])
                for option in options
            ]
            self.side.append(cases(index, both))
            return pair
        if all(isinstance(option, Formula) for option in defined):
            return cases(index, [option if isinstance(option, Formula) else FALSE for option in options])
        return Choice(tuple((picked(index, n), option) for n, option in enumerate(options)))

    def _distance(self, node: Distance, point: Vector) -> Term:
        outside, inner = distance_term(known_region(node.region), point, self._around(node.point))
        if not inner:
            return outside
        result = self._fresh("distance", 0.0)
        inside = [conjunction([where, compare("==", result, term)]) for where, term in inner]
        away = conjunction([*(negation(where) for where, _ in inner), compare("==", result, outside)])
        self.side.append(disjunction([*inside, away]))
        return result

    def _meeting(self, node: Intersects) -> Formula:
        boxes = [side for side in (node.left, node.right) if is_box(side)]
        if len(boxes) == 2:
            return boxes_meet(self._frame(boxes[0]), self._frame(boxes[1]))
        if not boxes:
            raise UnsupportedError("whether two random regions meet")
        other = node.right if boxes[0] is node.left else node.left
        return box_meets(self._frame(boxes[0]), known_region(other))

    def _frame(self, node: Node) -> Frame:
        """A box whose place may be random."""
        match node:
            case RectangleAt():
                center = cast(Vector, self._code(node.center))
                sizes = [cast(Term, self._code(part)) for part in (node.heading, node.width, node.length)]
                return Frame.of(center, *sizes)
            case Constant(value=Rectangle() as box):
                return Frame.of(
                    (Num(box.center[0]), Num(box.center[1])), Num(box.heading), Num(box.width), Num(box.length)
                )
            case _:
                raise UnsupportedError("whether a random region lies in another")

    def _arithmetic(self, node: Arithmetic, args: list[Term]) -> Term:
        op = node.op
        if op in _SCALAR:
            return apply(_SCALAR[op], *args)
        if op is ArithmeticOp.POW and isinstance(args[1], Num):
            exponent = args[1].value
            if exponent == 0.5:
                return apply(Operator.SQRT, args[0])
            if exponent == int(exponent):
                return apply(Operator.POW, args[0], exponent)
        if op is ArithmeticOp.WRAP:
            return self._wrapped(args[0], scalar_bounds(node.args[0], self.boxes))
        raise UnsupportedError(f"`{op.value}` of random values")

    def _wrapped(self, angle: Term, limits: tuple[float, float]) -> Term:
        low, high = limits
        if not (math.isfinite(low) and math.isfinite(high)):
            return apply(Operator.ATAN2, apply(Operator.SIN, angle), apply(Operator.COS, angle))
        turns = range(math.ceil((low - math.pi) / math.tau), math.floor((high + math.pi) / math.tau) + 1)
        result = self._fresh("angle", -math.pi, math.pi)
        self.side.append(disjunction(equal(result, apply(Operator.SUB, angle, math.tau * k)) for k in turns))
        return result

    def _direction(self, node: DirectionAt, point: Vector) -> Term:
        """The direction of a field at a random point: one case per cell near it."""
        if not isinstance(node.field, Constant):
            raise UnsupportedError("a random vector field at a random point")
        (x0, x1), (y0, y1) = self._around(node.point)
        if not all(map(math.isfinite, (x0, x1, y0, y1))):
            raise UnsupportedError("the direction of a field at an unbounded point")
        heading = self._fresh("heading", -math.pi, math.pi)
        cells = cast(VectorField, node.field.value).cells((x0, y0, x1, y1))
        self.side.append(
            disjunction(
                conjunction([compare("==", heading, cell.heading), convex_cell(point, cell.polygon)]) for cell in cells
            )
        )
        return heading
