"""The functions and names that every program sees: distributions, regions, mathematics, a safe part of Python.

Nothing here reads files, starts processes or reaches Python's own objects.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, cast

from scenicq.compiler import operators
from scenicq.compiler.arithmetic import check_hashable, is_random
from scenicq.compiler.coerce import kind_of_model, to_scalar, to_vector
from scenicq.compiler.comparisons import binary
from scenicq.compiler.courses import as_test
from scenicq.compiler.distributions import DISTRIBUTIONS
from scenicq.compiler.random_values import is_choice
from scenicq.compiler.region_functions import REGION_FUNCTIONS
from scenicq.compiler.rounding import round_number, truncate_number
from scenicq.compiler.values import (
    Builtin,
    Choice,
    DelayedValue,
    Instance,
    ModelValue,
    ScenicClass,
    describe,
    fail,
    is_node,
)
from scenicq.errors import Span
from scenicq.forest import build
from scenicq.forest.nodes import ArithmeticOp, Constant
from scenicq.geometry.regions import Everywhere, Nowhere, PolylineSet
from scenicq.limits import LIMITS

__all__ = ["extreme", "language_names", "mathematics", "truth"]


def _sequence(value: ModelValue, span: Span) -> list[ModelValue]:
    if is_random(value):
        raise fail("random-branch", "a program cannot loop over a random list", span, "random here",
                   ("use `Uniform(*list)` to pick one of its items",))  # fmt: skip
    if isinstance(value, list | tuple | set | range | dict | str):
        return list(cast("list[ModelValue]", value))
    raise fail("wrong-type", "a list is needed here", span, f"this is {describe(value)}")


def _vector(span: Span, x: ModelValue, y: ModelValue, z: ModelValue = 0) -> ModelValue:
    return to_vector((x, y), span) if z in (0, 0.0) else (x, y, z)


def _local_path(span: Span, path: ModelValue) -> ModelValue:
    if not isinstance(path, str):
        raise fail("wrong-type", "a path must be a string", span)
    return path


def _scalar_function(op: ArithmeticOp, plain: Callable[..., float]) -> Callable[..., ModelValue]:
    def call(span: Span, *args: ModelValue) -> ModelValue:
        if any(is_node(arg) or isinstance(arg, Choice) for arg in args):
            return build.arithmetic(op, *(to_scalar(arg, span) for arg in args), span=span)
        for arg in args:
            if not isinstance(arg, int | float):
                raise fail("wrong-type", f"`{op.value}` needs numbers", span, f"one is {describe(arg)}")
        try:
            return plain(*args)
        except (ValueError, OverflowError, ZeroDivisionError) as error:
            raise fail("runtime-error", f"`{op.value}` failed: {error}", span) from None

    return call


def extreme(name: str) -> Callable[..., ModelValue]:
    """`min` or `max` of numbers, known or random."""
    return _scalar_function(ArithmeticOp(name), min if name == "min" else max)


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


_KNOWN_MATH: dict[str, Callable[..., Any]] = {
    "trunc": math.trunc, "copysign": math.copysign, "fmod": math.fmod, "log10": math.log10, "log2": math.log2,
    "log1p": math.log1p, "gcd": math.gcd, "isclose": math.isclose, "isfinite": math.isfinite, "isinf": math.isinf,
    "isnan": math.isnan, "sinh": math.sinh, "cosh": math.cosh, "tanh": math.tanh, "dist": math.dist,
}  # fmt: skip
"""Functions of known numbers only."""


def _power(span: Span, base: ModelValue, exponent: ModelValue) -> ModelValue:
    return binary("**", base, exponent, span)


def mathematics() -> dict[str, ModelValue]:
    """The names of the module `math`, over known and random numbers alike."""
    names: dict[str, Any] = {name: Builtin(name, _scalar_function(*pair)) for name, pair in _OPS.items()}
    names["fabs"] = Builtin("fabs", _scalar_function(ArithmeticOp.ABS, cast("Callable[..., float]", abs)))
    names["hypot"] = Builtin("hypot", _hypot)
    names["pow"] = Builtin("pow", lambda span, x, y: _power(span, float(x) if isinstance(x, int) else x, y))
    names |= {name: _plain(name, function) for name, function in _KNOWN_MATH.items()}
    names["radians"] = Builtin("radians", lambda span, x: operators.degrees(x, span))
    names["degrees"] = Builtin(
        "degrees", lambda span, x: operators.binary("*", to_scalar(x, span), 180 / math.pi, span)
    )
    return names | {"pi": math.pi, "tau": math.tau, "e": math.e, "inf": math.inf}


_KINDS: dict[str, type] = {
    "int": int, "float": float, "str": str, "bool": bool, "list": list, "tuple": tuple, "dict": dict, "set": set,
}  # fmt: skip


def _is_instance(span: Span, value: ModelValue, classes: ModelValue) -> ModelValue:
    wanted = cast("tuple[ModelValue, ...]", classes) if isinstance(classes, tuple) else (classes,)
    return any(_has_class(value, each, span) for each in wanted)


def _has_class(value: ModelValue, wanted: ModelValue, span: Span) -> bool:
    if isinstance(wanted, ScenicClass):
        return isinstance(value, Instance) and wanted in value.cls.ancestry()
    if isinstance(wanted, type):
        return isinstance(value, wanted)
    if isinstance(wanted, Builtin) and wanted.name in _KINDS:
        return isinstance(value, _KINDS[wanted.name])
    raise fail("wrong-type", "`isinstance` needs a class", span, f"this is {describe(wanted)}")


_OF_NUMBERS = frozenset({"int", "float", "round"})
_SHOWN = "choose between known strings with `Uniform(...)`"


def _of_random(name: str, span: Span, value: ModelValue, digits: ModelValue = None, **named: ModelValue) -> ModelValue:
    """`int`, `float` or `round` of a random number."""
    digits = named.pop("ndigits", digits)
    if named or (digits is not None and (name != "round" or not isinstance(digits, int) or abs(digits) > 15)):
        raise fail("wrong-value", f"`{name}` of a random number cannot take this", span, "not a small known number")
    number = to_scalar(value, span)
    if name == "float":
        return number
    return truncate_number(number, span) if name == "int" else round_number(number, digits or 0, span)


def _plain(name: str, function: Callable[..., Any]) -> Builtin:
    """A function of Python that only ever sees known values: each outcome of a random choice by itself."""

    def call(span: Span, *args: ModelValue, **named: ModelValue) -> ModelValue:
        if name in _OF_NUMBERS and args and is_node(args[0]) and is_random(args[0]):
            return _of_random(name, span, *args, **named)
        for arg in args:
            if is_random(arg):
                hint = _SHOWN if name == "str" else "use arithmetic, which works on random values too"
                raise fail("random-branch", f"`{name}` cannot be applied to a random value", span, "random here",
                           (hint,))  # fmt: skip
        known = [arg.value if isinstance(arg, Constant) else arg for arg in args]
        try:
            return function(*known, **named)
        except (ValueError, OverflowError, KeyError):
            raise fail("runtime-error", f"`{name}` cannot be applied to this", span, "failed here") from None

    return Builtin(name, call, known=True, spread=is_choice)


def _text(value: ModelValue = "") -> str:
    if not isinstance(value, str | int | float | bool | type(None)):
        raise TypeError(f"shows {describe(value)}: only numbers and strings have a text")
    return str(value)


def _whole(value: ModelValue = 0) -> int:
    if not isinstance(value, str | int | float):
        raise TypeError(f"needs a number or string, not {describe(value)}")
    return int(value)


def _real(value: ModelValue = 0.0) -> float:
    if not isinstance(value, str | int | float):
        raise TypeError(f"needs a number or string, not {describe(value)}")
    return float(value)


def _rounded(value: float, digits: int | None = None) -> float:
    if digits is not None and abs(digits) > 300:
        raise ValueError
    return round(value, digits)


def _set(span: Span, values: ModelValue = ()) -> ModelValue:
    return {check_hashable(value, span) for value in _sequence(values, span)}


def _dict(span: Span, pairs: ModelValue = (), **named: ModelValue) -> ModelValue:
    if isinstance(pairs, dict):
        return {**cast("dict[ModelValue, ModelValue]", pairs), **named}
    found = [_sequence(pair, span) for pair in _sequence(pairs, span)]
    if any(len(pair) != 2 for pair in found):
        raise fail("wrong-value", "`dict` needs pairs", span)
    return {**{check_hashable(key, span): value for key, value in found}, **named}


def _truth_value(span: Span, value: ModelValue = False) -> ModelValue:
    test = as_test(value, span)
    return test if is_node(test) and kind_of_model(test) == "boolean" else truth(test, span)


def _abs(span: Span, value: ModelValue) -> ModelValue:
    return _scalar_function(ArithmeticOp.ABS, cast("Callable[..., float]", abs))(span, value)


def _sum(span: Span, values: ModelValue, start: ModelValue = 0) -> ModelValue:
    total = start
    for value in _sequence(values, span):
        if isinstance(value, list | tuple | str):
            raise fail("wrong-type", "`sum` adds numbers", span, f"one is {describe(value)}")
        total = binary("+", total, value, span)
    return total


def _length(values: Any) -> int:
    if isinstance(values, PolylineSet):
        return sum(len(line.coords) for line in values.pieces)
    if isinstance(values, str | list | tuple | dict | set | range):
        return len(cast("list[Any]", values))
    raise TypeError(f"needs a list, not {describe(values)}")


def _whole_numbers(span: Span, *args: ModelValue) -> ModelValue:
    if any(is_random(arg) for arg in args):
        raise fail("random-branch", "a loop must run a known number of times", span, "random here",
                   ("write one program per number of objects",))  # fmt: skip
    if any(not isinstance(arg, int) for arg in args):
        raise fail("wrong-type", "`range` needs whole numbers", span)
    if not 1 <= len(args) <= 3:
        raise fail("wrong-arity", "`range` takes one to three numbers", span)
    if len(args) == 3 and args[2] == 0:
        raise fail("wrong-value", "the step of a `range` must not be zero", span)
    numbers = range(*args)
    first, last, step = numbers.start, numbers.stop, numbers.step
    if (last - first) // step > LIMITS.value_items:  # `len` cannot count so far
        raise fail("budget-exceeded", f"more than {LIMITS.value_items:,} numbers", span, "counts too far")
    return numbers


def _ignore(span: Span, *_: ModelValue, **__: ModelValue) -> ModelValue:
    return None


_KNOWN = frozenset({"bool", "range"})
"""Functions on whose result the program's course usually depends."""


def language_names() -> dict[str, ModelValue]:
    """The names that every program sees, whatever its model."""
    own: dict[str, Callable[..., ModelValue]] = {
        **DISTRIBUTIONS,
        **REGION_FUNCTIONS,
        "Vector": _vector,
        "localPath": _local_path,
        "print": _ignore,
        "verbosePrint": _ignore,
        "abs": _abs,
        "sum": _sum,
        "set": _set,
        "frozenset": _set,
        "dict": _dict,
        "bool": _truth_value,
        "range": _whole_numbers,
        "sin": _scalar_function(*_OPS["sin"]),
        "cos": _scalar_function(*_OPS["cos"]),
        "hypot": _hypot,
        "pow": _power,
    }
    names: dict[str, ModelValue] = {name: Builtin(name, call, known=name in _KNOWN) for name, call in own.items()}
    python: dict[str, Callable[..., Any]] = {
        "len": _length, "int": _whole, "float": _real, "str": _text, "round": _rounded,
    }  # fmt: skip
    names |= {name: _plain(name, function) for name, function in python.items()}
    names["isinstance"] = Builtin("isinstance", _is_instance, spread=is_choice)
    lists: dict[str, Callable[..., Any]] = {
        "list": lambda v=(): v, "tuple": lambda v=(): tuple(v), "reversed": lambda v: v[::-1],
        "enumerate": lambda v, start=0: list(enumerate(v, start)), "zip": lambda *v: list(zip(*v, strict=False)),
    }  # fmt: skip
    names |= {name: _over_lists(name, function) for name, function in lists.items()}
    names["everywhere"] = build.constant(Everywhere())
    names["nowhere"] = build.constant(Nowhere())
    names["workspace"] = names["everywhere"]
    names["__file__"] = ""
    return names


def _over_lists(name: str, function: Callable[..., Any]) -> Builtin:
    def call(span: Span, *args: ModelValue, **named: ModelValue) -> ModelValue:
        first = args[:1] if name == "enumerate" else args
        return function(*(_sequence(arg, span) for arg in first), *args[len(first) :], **named)

    return Builtin(name, call)


def truth(value: ModelValue, span: Span) -> bool:
    """The truth of a known value.

    Raises:
        ScenarioError: random-branch, where the value is random.
    """
    if is_node(value):
        if isinstance(value, Constant):
            return bool(value.value)
        raise fail("random-branch", "`if` and loops cannot depend on a random value", span, "random here",
                   ("use `require` to state a condition on random values",
                    "use `Uniform(...)` or `Discrete({...})` to choose between values"))  # fmt: skip
    if isinstance(value, Choice):
        raise fail("random-branch", "`if` and loops cannot depend on a random choice", span, "random here")
    if isinstance(value, DelayedValue):
        raise fail("wrong-type", "`if` and loops cannot depend on an object that is not there yet", span,
                   "depends on an object's position", ("write `F at V`",))  # fmt: skip
    return bool(value)
