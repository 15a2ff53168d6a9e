"""The functions and names that every program sees: distributions, regions, mathematics, a safe part of Python.

Nothing here reads files, starts processes or reaches Python's own objects.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, cast

import shapely

from scenicq.compiler import operators
from scenicq.compiler.coerce import to_heading, to_region, to_scalar, to_vector
from scenicq.compiler.values import Builtin, Choice, Instance, ModelValue, describe, fail, is_node
from scenicq.errors import Span
from scenicq.forest import build
from scenicq.forest.compute import fold
from scenicq.forest.nodes import (
    ArithmeticOp,
    Constant,
    DiscAt,
    DiscreteRange,
    Index,
    Normal,
    Range,
    RectangleAt,
    SectorAt,
    TruncatedNormal,
)
from scenicq.geometry.regions import Everywhere, Nowhere, PointSet, PolygonSet, PolylineSet

LARGEST = 1_000_000
"""Items of the longest list, characters of the longest string, that a program may make."""

__all__ = ["LARGEST", "interval", "language_names", "mathematics", "truth", "uniform"]


def interval(low: ModelValue, high: ModelValue, span: Span) -> Range:
    """`Range(low, high)`."""
    return Range(to_scalar(low, span), to_scalar(high, span), span=span)


def uniform(options: list[ModelValue], weights: list[float] | None, span: Span) -> ModelValue:
    """`Uniform(a, b, ...)` and `Discrete({a: weight, ...})`: options of positive weight."""
    if not options:
        raise fail("map-lacks", "there is nothing to choose from", span, "an empty list",
                   ("if the list comes from the map, the map has no such element",))  # fmt: skip
    weights = weights or [1.0] * len(options)
    if any(not math.isfinite(weight) or weight < 0 for weight in weights):
        raise fail("wrong-value", "a weight must be a number that is not negative", span)
    kept = [(option, weight) for option, weight in zip(options, weights, strict=True) if weight > 0]
    if not kept:
        raise fail("wrong-value", "there is nothing to choose from", span, "no option of positive weight")
    if len(kept) == 1:
        return kept[0][0]
    index = Index(tuple(weight for _, weight in kept), span=span)
    return operators.make_choice(index, [option for option, _ in kept], span)


def _uniform(span: Span, *options: ModelValue) -> ModelValue:
    return uniform(list(options), None, span)


def _discrete(span: Span, options: ModelValue) -> ModelValue:
    if not isinstance(options, dict):
        raise fail("wrong-type", "`Discrete` needs a dictionary of options and weights", span,
                   f"this is {describe(options)}", ("write `Discrete({option: weight, ...})`",))  # fmt: skip
    table = cast("dict[ModelValue, ModelValue]", options)
    weights: list[float] = []
    for weight in table.values():
        if not isinstance(weight, int | float):
            raise fail("wrong-type", "a weight must be a known number", span)
        weights.append(float(weight))
    return uniform(list(table), weights, span)


def _options(span: Span, options: ModelValue) -> ModelValue:
    return _discrete(span, options) if isinstance(options, dict) else _uniform(span, *_sequence(options, span))


def _sequence(value: ModelValue, span: Span) -> list[ModelValue]:
    if isinstance(value, list | tuple | set | range | dict):
        return list(cast("list[ModelValue]", value))
    raise fail("wrong-type", "a list is needed here", span, f"this is {describe(value)}")


def _range(span: Span, low: ModelValue, high: ModelValue) -> ModelValue:
    return interval(low, high, span)


def _normal(span: Span, mean: ModelValue, std: ModelValue) -> ModelValue:
    return Normal(to_scalar(mean, span), to_scalar(std, span), span=span)


def _truncated_normal(span: Span, mean: ModelValue, std: ModelValue, low: ModelValue, high: ModelValue) -> ModelValue:
    mean, std, low, high = (to_scalar(value, span) for value in (mean, std, low, high))
    return TruncatedNormal(mean, std, low, high, span=span)


def _discrete_range(span: Span, low: ModelValue, high: ModelValue, weights: ModelValue = None) -> ModelValue:
    if weights is not None:
        if not (isinstance(low, int) and isinstance(high, int)):
            raise fail("wrong-type", "`DiscreteRange` with weights needs known whole numbers", span)
        return uniform([float(n) for n in range(low, high + 1)], [float(w) for w in _sequence(weights, span)], span)
    return DiscreteRange(to_scalar(low, span), to_scalar(high, span), span=span)


def _vector(span: Span, x: ModelValue, y: ModelValue, z: ModelValue = 0) -> ModelValue:
    return to_vector((x, y, z), span)


def _circular(span: Span, center: ModelValue, radius: ModelValue, **_: ModelValue) -> ModelValue:
    return fold(DiscAt(to_vector(center, span), to_scalar(radius, span), span=span))


def _sector(span: Span, center: ModelValue, radius: ModelValue, heading: ModelValue, angle: ModelValue, **_: ModelValue) -> ModelValue:
    return fold(
        SectorAt(to_vector(center, span), to_scalar(radius, span), to_heading(heading, span), to_scalar(angle, span), span=span)
    )


def _rectangular(span: Span, position: ModelValue, heading: ModelValue, width: ModelValue, length: ModelValue, **_: ModelValue) -> ModelValue:
    return fold(
        RectangleAt(to_vector(position, span), to_heading(heading, span), to_scalar(width, span), to_scalar(length, span), span=span)
    )


def _points(values: ModelValue, span: Span, least: int) -> list[tuple[float, float]]:
    points: list[tuple[float, float]] = []
    for value in _sequence(values, span):
        node = to_vector(value, span)
        if not isinstance(node, Constant):
            raise fail("unsupported-region", "the corners of this region must be known", span, "a random corner")
        points.append(cast("tuple[float, float]", node.value))
    if len(points) < least:
        raise fail("wrong-value", f"at least {least} points are needed here", span)
    return points


def _polygonal(span: Span, points: ModelValue, **_: ModelValue) -> ModelValue:
    polygon = shapely.Polygon(_points(points, span, 3))
    if not polygon.is_valid or polygon.area == 0:
        raise fail("wrong-value", "this polygon is not simple", span, "it crosses itself or has no area",
                   ("list the corners in order around the region",))  # fmt: skip
    return build.constant(PolygonSet((polygon,), "PolygonalRegion"), span)


def _polyline(span: Span, points: ModelValue, **_: ModelValue) -> ModelValue:
    return build.constant(PolylineSet((shapely.LineString(_points(points, span, 2)),), "PolylineRegion"), span)


def _point_set(span: Span, name: ModelValue, points: ModelValue, **_: ModelValue) -> ModelValue:
    return build.constant(PointSet(tuple(_points(points, span, 1)), str(name)), span)


def _resample(span: Span, value: ModelValue) -> ModelValue:
    match value:
        case Range() | Normal() | TruncatedNormal() | DiscreteRange():
            return type(value)(*(getattr(value, name) for name in value.__dataclass_fields__ if name not in ("span", "identity")), span=span)
        case Choice():
            return Choice(Index(value.index.weights, span=span), value.options)
        case _ if is_node(value) and type(value).__name__ == "Select":
            return type(value)(Index(value.index.weights, span=span), value.options, span=span)
        case _:
            raise fail("wrong-type", "`resample` needs a distribution", span, f"this is {describe(value)}")


def _workspace(span: Span, region: ModelValue = None, **_: ModelValue) -> ModelValue:
    return to_region(region, span)


def _local_path(span: Span, path: ModelValue) -> ModelValue:
    if not isinstance(path, str):
        raise fail("wrong-type", "a path must be a string", span)
    return path


def _scalar_function(op: ArithmeticOp, plain: Callable[..., float]) -> Callable[..., ModelValue]:
    def call(span: Span, *args: ModelValue) -> ModelValue:
        if len(args) == 1 and op in (ArithmeticOp.MIN, ArithmeticOp.MAX) and not is_node(args[0]):
            args = tuple(_sequence(args[0], span))
        if any(is_node(arg) or isinstance(arg, Choice) for arg in args):
            return build.arithmetic(op, *(to_scalar(arg, span) for arg in args), span=span)
        try:
            return plain(*args)
        except (ValueError, TypeError, OverflowError, ZeroDivisionError) as error:
            raise fail("runtime-error", f"`{op.value}` failed: {error}", span) from None

    return call


def _hypot(span: Span, *args: ModelValue) -> ModelValue:
    if any(is_node(arg) for arg in args):
        return build.norm(to_vector(args, span), span)
    return math.hypot(*args)


_OPS: dict[str, tuple[ArithmeticOp, Callable[..., float]]] = {
    "sin": (ArithmeticOp.SIN, math.sin),
    "cos": (ArithmeticOp.COS, math.cos),
    "tan": (ArithmeticOp.TAN, math.tan),
    "asin": (ArithmeticOp.ASIN, math.asin),
    "acos": (ArithmeticOp.ACOS, math.acos),
    "atan": (ArithmeticOp.ATAN, math.atan),
    "atan2": (ArithmeticOp.ATAN2, math.atan2),
    "sqrt": (ArithmeticOp.SQRT, math.sqrt),
    "exp": (ArithmeticOp.EXP, math.exp),
    "log": (ArithmeticOp.LOG, math.log),
    "floor": (ArithmeticOp.FLOOR, math.floor),
    "ceil": (ArithmeticOp.CEIL, math.ceil),
}


def mathematics() -> Mapping[str, ModelValue]:
    """The names of the module `math`, over known and random numbers alike."""
    names: dict[str, Any] = {name: Builtin(name, _scalar_function(*pair)) for name, pair in _OPS.items()}
    names["fabs"] = Builtin("fabs", _scalar_function(ArithmeticOp.ABS, abs))
    names["hypot"] = Builtin("hypot", _hypot)
    names["radians"] = Builtin("radians", lambda span, x: operators.degrees(x, span))
    names["degrees"] = Builtin("degrees", lambda span, x: operators.binary("*", to_scalar(x, span), 180 / math.pi, span))
    return names | {"pi": math.pi, "tau": math.tau, "e": math.e, "inf": math.inf}


def _attribute_of_instance(span: Span, value: ModelValue, *classes: ModelValue) -> ModelValue:
    kinds = {"int": int, "float": float, "str": str, "bool": bool, "list": list, "tuple": tuple, "dict": dict}
    for wanted in classes[0] if classes and isinstance(classes[0], tuple) else classes:
        name = getattr(wanted, "name", "")
        if isinstance(value, Instance) and value.cls.derives_from(name):
            return True
        if name in kinds and isinstance(value, kinds[name]):
            return True
    return False


def _plain(name: str, function: Callable[..., Any]) -> Builtin:
    """A function of Python that only ever sees known values."""

    def call(span: Span, *args: ModelValue, **named: ModelValue) -> ModelValue:
        for arg in args:
            if is_node(arg) or isinstance(arg, Choice):
                raise fail("random-branch", f"`{name}` cannot be applied to a random value", span, "random here",
                           ("use arithmetic, which works on random values too",))  # fmt: skip
        try:
            return function(*args, **named)
        except (ValueError, TypeError, OverflowError, KeyError) as error:
            raise fail("runtime-error", f"`{name}` failed: {error}", span) from None

    return Builtin(name, call)


def _abs(span: Span, value: ModelValue) -> ModelValue:
    return _scalar_function(ArithmeticOp.ABS, abs)(span, value)


def _sum(span: Span, values: ModelValue, start: ModelValue = 0) -> ModelValue:
    total = start
    for value in _sequence(values, span):
        random = is_node(value) or is_node(total)
        total = operators.binary("+", total, value, span) if random else total + value
    return total


def _length(values: Any) -> int:
    return len(values)


def _bounded_range(*args: int) -> range:
    numbers = range(*args)
    if len(numbers) > LARGEST:
        raise ValueError(f"more than {LARGEST:,} numbers")
    return numbers


def _ignore(span: Span, *_: ModelValue, **__: ModelValue) -> ModelValue:
    return None


def language_names() -> dict[str, ModelValue]:
    """The names that every program sees, whatever its model."""
    scenic: dict[str, Callable[..., ModelValue]] = {
        "Range": _range,
        "Normal": _normal,
        "TruncatedNormal": _truncated_normal,
        "DiscreteRange": _discrete_range,
        "Uniform": _uniform,
        "Discrete": _discrete,
        "Options": _options,
        "resample": _resample,
        "Vector": _vector,
        "CircularRegion": _circular,
        "SectorRegion": _sector,
        "RectangularRegion": _rectangular,
        "PolygonalRegion": _polygonal,
        "PolylineRegion": _polyline,
        "PointSetRegion": _point_set,
        "Workspace": _workspace,
        "localPath": _local_path,
        "print": _ignore,
        "abs": _abs,
        "sum": _sum,
        "isinstance": _attribute_of_instance,
        "min": _scalar_function(ArithmeticOp.MIN, min),
        "max": _scalar_function(ArithmeticOp.MAX, max),
        "sin": _scalar_function(*_OPS["sin"]),
        "cos": _scalar_function(*_OPS["cos"]),
        "hypot": _hypot,
    }
    names: dict[str, ModelValue] = {name: Builtin(name, call) for name, call in scenic.items()}
    python: dict[str, Callable[..., Any]] = {
        "len": _length, "range": _bounded_range, "int": int, "float": float, "str": str, "bool": bool, "list": list,
        "tuple": tuple, "dict": dict, "set": set, "round": round, "reversed": lambda v: list(reversed(v)),
        "enumerate": lambda v, start=0: list(enumerate(v, start)), "zip": lambda *v: list(zip(*v, strict=False)),
    }  # fmt: skip
    names |= {name: _plain(name, function) for name, function in python.items()}
    names["everywhere"] = build.constant(Everywhere())
    names["nowhere"] = build.constant(Nowhere())
    return names


def truth(value: ModelValue, span: Span) -> bool:
    """The truth of a known value.

    Raises:
        ScenarioError: random-branch, where the value is random.
    """
    if is_node(value):
        if isinstance(value, Constant):
            return bool(value.value)
        raise fail("random-branch", "the program's course depends on a random value", span, "random here",
                   ("use `require` to state a condition on random values",
                    "use `Uniform(...)` or `Discrete({...})` to choose between values"))  # fmt: skip
    if isinstance(value, Choice):
        raise fail("random-branch", "the program's course depends on a random choice", span, "random here")
    return bool(value)

