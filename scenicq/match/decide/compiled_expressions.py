"""Compile expressions to functions of what a label observes.

An *exact* function gives the value where everything random is known. A `Form` is a known part plus ranges of random
numbers. Both are for many labels at once: what is observed comes as numbers, or as columns.
"""

from __future__ import annotations

import functools
import math
import operator
from collections.abc import Callable, Mapping, Sequence
from typing import cast

import numpy as np

from scenicq.errors import CannotEvaluate
from scenicq.forest.compute import compute
from scenicq.forest.groups import PARAMS
from scenicq.forest.kinds import as_kind
from scenicq.forest.nodes import (
    GOING,
    LAST_LANE,
    Arithmetic,
    ArithmeticOp,
    Bearing,
    Constant,
    Coordinate,
    DirectionAt,
    Feature,
    Identity,
    Index,
    Node,
    Norm,
    Normal,
    Range,
    Rotate,
    Scale,
    Select,
    TruncatedNormal,
    Undefined,
    Value,
    VectorOf,
    VectorSum,
)
from scenicq.forest.walk import children, is_leaf, postorder
from scenicq.geometry.occupancy import ElementAtPoint
from scenicq.limits import LIMITS
from scenicq.match.decide.range_forms import (
    Columns,
    CompiledVector,
    Exact,
    Form,
    Lookup,
    Scalar,
    cos_sin,
)
from scenicq.match.linear.affine_reach import ends

__all__ = ["VECTORS", "CompiledExpressions", "compile_condition", "element_field"]

_NUMBERS = frozenset({"heading", "width", "length", "height", "speed"})
_LANE_RULE = frozenset({GOING, LAST_LANE})
VECTORS = frozenset({"position", "velocity"})
"""Properties that are numbers and pairs wherever they are observed."""


def compile_condition(root: Node, chosen: Mapping[Identity, float]) -> Callable[[Lookup], bool] | None:
    """Compile a condition on what is observed alone; the function raises `CannotEvaluate` where it has no value.

    Args:
        root: The condition.
        chosen: The number of the option of each choice.

    Returns:
        The function; None if the condition reads anything else that is random, or takes too many steps.
    """
    made: dict[int, Callable[[Lookup], Value]] = {}
    steps: dict[int, int] = {}
    for node in postorder((root,)):
        below = children(node)
        # one option is read, whichever it is
        counted = [steps[id(child)] for child in below]
        steps[id(node)] = 1 + (counted[0] + max(counted[1:]) if isinstance(node, Select) else sum(counted))
        known = isinstance(node, Index) and node.identity in chosen
        if (is_leaf(node) and not known) or (isinstance(node, DirectionAt) and element_field(node) is None):
            return None
        if steps[id(node)] > LIMITS.closed_form_terms:
            return None
        if isinstance(node, Index):
            made[id(node)] = _constant(chosen[node.identity])
            continue
        if isinstance(node, Feature) and node.object == PARAMS:
            return None
        made[id(node)] = _compile_node(node, [made[id(child)] for child in below])
    whole = made[id(root)]
    return lambda get: bool(whole(get))


def element_field(node: Node) -> ElementAtPoint | None:
    """The field of a node that asks which element lies at a point; None for any other node."""
    if isinstance(node, DirectionAt) and isinstance(node.field, Constant):
        return node.field.value if isinstance(node.field.value, ElementAtPoint) else None
    return None


def _constant(value: Value) -> Callable[[Lookup], Value]:
    return lambda _: value


def _compile_element_at(
    field: ElementAtPoint, point: CompiledVector, going: Sequence[Callable[[Lookup], Value]]
) -> Scalar:
    """Compile the look-up of the element that lies at a point; its number comes as an angle.

    Args:
        field: The field.
        point: The point.
        going: The heading of the object there and the last lane of its track, where they matter; None where there is
            none, in columns nan.
    """

    def angle(get: Lookup) -> float:
        x, y = point(get)
        way, last = [each(get) for each in going] or (None, None)
        if isinstance(get, Columns):
            xy = np.column_stack([np.broadcast_to(np.asarray(each), get.size) for each in (x, y)])
            if isinstance(way, np.ndarray):
                before = last if isinstance(last, np.ndarray) else np.full(len(xy), np.nan)
                return cast(float, np.array(field.along_many(xy, way.tolist(), before.tolist())))
            return cast(float, np.array([each for (each,) in field.values_many(xy)]))
        if not isinstance(way, float):
            return field.values(x, y)[0]
        return field.along(x, y, way, last if isinstance(last, float) else math.nan)

    return angle


def _compile_node(node: Node, args: Sequence[Callable[[Lookup], Value]]) -> Callable[[Lookup], Value]:
    """Compile a node by its plain meaning, from the functions of its children."""
    match node:
        case Constant():
            return _constant(node.value)
        case DirectionAt() if (field := element_field(node)) is not None:
            return cast(
                "Callable[[Lookup], Value]", _compile_element_at(field, cast(CompiledVector, args[1]), args[2:])
            )
        case Select():
            which, *options = args
            return lambda get: options[int(cast(float, which(get)))](get)
        case Feature(object=index, property=name) if name in VECTORS | _NUMBERS | _LANE_RULE:
            return lambda get: get(index, name)
        case Feature(object=index, property=name):

            def observed(get: Lookup) -> Value:
                found = as_kind(node, get(index, name))
                if isinstance(found, Undefined):
                    raise CannotEvaluate("what a closed form does not say")
                return found

            return observed
        case _:

            def computed(get: Lookup) -> Value:
                if isinstance(get, Columns):
                    raise CannotEvaluate("what a closed form does not say")
                found = compute(node, tuple([arg(get) for arg in args]))
                if isinstance(found, Undefined):
                    raise CannotEvaluate("what a closed form does not say")
                return found

            return computed


class CompiledExpressions:
    """Compiles expressions, each once, for one outcome of the discrete choices."""

    def __init__(self, chosen: Mapping[Identity, float]) -> None:
        """Take the number of the option of each choice."""
        self._chosen = chosen
        self._exact: dict[int, Exact | None] = {}
        self._steps: dict[int, int] = {}
        self._forms: dict[int, Form | None] = {}

    def exact(self, root: Node) -> Exact | None:
        """Compile a scalar or vector; None if it depends on more than what is observed."""
        for node in postorder((root,)):
            if id(node) not in self._exact:
                below = children(node)
                steps = self._steps[id(node)] = 1 + sum([self._steps[id(child)] for child in below])
                args = [self._exact[id(child)] for child in below]
                self._exact[id(node)] = self._compile_exact(node, args) if steps <= LIMITS.closed_form_terms else None
        return self._exact[id(root)]

    def _compile_exact(self, node: Node, args: list[Exact | None]) -> Exact | None:
        match node:
            case Index():
                return cast(Exact, _constant(self._chosen[node.identity])) if node.identity in self._chosen else None
            case Select(index=Index() as index):
                return args[1 + int(self._chosen[index.identity])] if index.identity in self._chosen else None
            case _:
                return _exact_operation(node, args)

    def form(self, root: Node) -> Form | None:
        """Compile a scalar to a form; None if it has none."""
        self.exact(root)
        for node in postorder((root,)):
            if id(node) not in self._forms:
                self._forms[id(node)] = self._form(node, [self._forms[id(child)] for child in children(node)])
        return self._forms[id(root)]

    def _form(self, node: Node, args: list[Form | None]) -> Form | None:
        match node:
            case Constant():
                return Form(constant=node.value) if isinstance(node.value, float) else None
            case Index():
                return Form(constant=self._chosen[node.identity]) if node.identity in self._chosen else None
            case Select():
                index = self._chosen.get(node.index.identity) if isinstance(node.index, Index) else None
                return None if index is None else args[1 + int(index)]
            case Range() | TruncatedNormal():
                limits = ends(node)
                known = all(isinstance(part, Constant) for part in children(node))
                if limits is None or not known or not all(map(math.isfinite, limits)) or limits[0] > limits[1]:
                    return None
                return Form(terms={node.identity: (1.0, *limits)})
            case Normal():
                fixed = isinstance(node.mean, Constant) and isinstance(node.deviation, Constant)
                return Form(terms={node.identity: (1.0, -math.inf, math.inf)}) if fixed else None
            case DirectionAt() if element_field(node) is None:
                return Form(fields=(node,))
            case Arithmetic() if all(arg is not None for arg in args):
                found = _combine_forms(node.op, cast("list[Form]", args))
                if found is not None:
                    return found
            case _:
                pass
        exact = self._exact[id(node)]
        is_scalar = isinstance(node, Arithmetic | Coordinate | Norm | Bearing | DirectionAt) or (
            isinstance(node, Feature) and node.kind == "scalar"
        )
        return Form(parts=((1.0, cast(Scalar, exact)),)) if exact is not None and is_scalar else None


def _combine_forms(op: ArithmeticOp, args: list[Form]) -> Form | None:
    match op:
        case ArithmeticOp.ADD:
            total: Form | None = args[0]
            for other in args[1:]:
                total = None if total is None else total.plus(other)
            return total
        case ArithmeticOp.SUB:
            minus = args[1].times(-1.0)
            return None if minus is None else args[0].plus(minus)
        case ArithmeticOp.NEG:
            return args[0].times(-1.0)
        case ArithmeticOp.MUL:
            for one, other in ((args[0], args[1]), (args[1], args[0])):
                if one.number is not None:
                    return other.times(one.number)
            return None
        case ArithmeticOp.DIV if args[1].number:
            return args[0].times(1 / args[1].number)
        case _:
            return None


def _exact_operation(node: Node, args: list[Exact | None]) -> Exact | None:
    match node:
        case Constant():
            value = node.value
            return (lambda _: value) if isinstance(value, float | tuple) else None
        case Feature():
            index, name = node.object, node.property
            fits = name in (VECTORS if node.kind == "vector" else _NUMBERS) or name in _LANE_RULE

            def observed(get: Lookup) -> Value:
                return get(index, name)

            return cast(Exact, observed) if fits else None
        case DirectionAt() if (field := element_field(node)) is not None and None not in args[1:]:
            ways = cast("list[Callable[[Lookup], Value]]", args[2:])
            return cast(Exact, _compile_element_at(field, cast(CompiledVector, args[1]), ways))
        case _ if any(arg is None for arg in args):
            return None
        case Arithmetic():
            own = _scalar_operation(node.op, cast("list[Scalar]", args))
            return own or cast(Exact, _compile_node(node, cast("list[Callable[[Lookup], Value]]", args)))
        case VectorOf():
            x, y = cast("list[Scalar]", args)
            return lambda get: (x(get), y(get))
        case VectorSum():
            one, other = cast("list[CompiledVector]", args)

            def added(get: Lookup) -> tuple[float, float]:
                (a, b), (c, d) = one(get), other(get)
                return (a + c, b + d)

            return added
        case Scale():
            vector, by = cast(CompiledVector, args[0]), cast(Scalar, args[1])

            def scaled(get: Lookup) -> tuple[float, float]:
                (a, b), factor = vector(get), by(get)
                return (a * factor, b * factor)

            return scaled
        case Rotate():
            whole, angle = cast(CompiledVector, args[0]), cast(Scalar, args[1])

            def rotated(get: Lookup) -> tuple[float, float]:
                (a, b), (c, s) = whole(get), cos_sin(angle(get))
                return (a * c - b * s, a * s + b * c)

            return rotated
        case Coordinate():
            vector, axis = cast(CompiledVector, args[0]), node.axis
            return lambda get: vector(get)[axis]
        case Norm() | Bearing():
            return cast(Exact, _compile_node(node, cast("list[Callable[[Lookup], Value]]", args)))
        case _:
            return None


def _scalar_operation(op: ArithmeticOp, args: list[Scalar]) -> Scalar | None:
    match op:
        case ArithmeticOp.ADD:
            # `sum` of floats is not plain addition in every Python
            return lambda get: functools.reduce(operator.add, [arg(get) for arg in args])
        case ArithmeticOp.SUB:
            one, other = args
            return lambda get: one(get) - other(get)
        case ArithmeticOp.MUL:
            left, right = args
            return lambda get: left(get) * right(get)
        case ArithmeticOp.NEG:
            (only,) = args
            return lambda get: -only(get)
        case _:
            return None
