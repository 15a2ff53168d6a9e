"""Canonical text of expressions: the same forest always shows the same way.

Random variables are numbered in order of first use, so that two expressions of the same shape show alike.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import cast

from scenicq.forest.nodes import (
    Arithmetic,
    Bearing,
    Compare,
    Constant,
    Coordinate,
    CourseCoordinate,
    DirectionAt,
    Feature,
    Identity,
    Index,
    Leaf,
    Logic,
    Measure,
    Node,
    Select,
    Undefined,
    Value,
)
from scenicq.forest.scenario import Scenario
from scenicq.forest.walk import children, is_leaf, postorder

__all__ = ["show", "show_forest"]


def _show_constant(value: Value) -> str:
    """A known value as text; regions and fields by their name."""
    if isinstance(value, float):
        return f"{value:.12g}"
    if isinstance(value, tuple):
        return f"({value[0]:.12g}, {value[1]:.12g})"
    if isinstance(value, str):
        return repr(value)
    if value is None or isinstance(value, bool):
        return str(value)
    if isinstance(value, Undefined):
        return f"undefined ({value.reason})"
    name = getattr(value, "name", None)
    parts = [
        f"{key}={getattr(value, key)!r}" for key in getattr(value, "__slots__", ()) if key not in ("name", "parts")
    ]
    return f"<{name or type(value).__name__}{' ' + ' '.join(parts) if parts and not name else ''}>"


def show(root: Node, objects: Mapping[int, int | str] | None = None, numbers: dict[Identity, int] | None = None) -> str:
    """An expression as one line of text.

    Args:
        root: The expression.
        objects: How to show the indices of objects.
        numbers: Numbers of random variables, extended as new ones are met; share it between expressions.
    """
    numbers = {} if numbers is None else numbers
    seen: set[Identity] = set()
    texts: dict[int, str] = {}
    for node in postorder((root,)):
        args = [texts[id(child)] for child in children(node)]
        texts[id(node)] = _show(node, args, objects or {}, numbers, seen)
    return texts[id(root)]


def _show(
    node: Node, args: list[str], objects: Mapping[int, int | str], numbers: dict[Identity, int], seen: set[Identity]
) -> str:
    match node:
        case Constant():
            return _show_constant(node.value)
        case Feature():
            return f"{objects.get(node.object, node.object)}.{node.property}"
        case Arithmetic() if len(args) == 2 and not node.op.value[0].isalpha():
            return f"({args[0]} {node.op.value} {args[1]})"
        case Arithmetic():
            return f"{node.op.value}({', '.join(args)})"
        case Compare():
            return f"({args[0]} {node.op.value} {args[1]})"
        case Logic():
            return f"(not {args[0]})" if len(args) == 1 else "(" + f" {node.op.value} ".join(args) + ")"
        case Coordinate():
            return f"{args[0]}.{'xy'[node.axis]}"
        case CourseCoordinate() | Measure():
            name = node.measure if isinstance(node, Measure) else ("along", "beside")[node.axis]
            seconds = f", {node.seconds:g}" if isinstance(node, Measure) and node.seconds else ""
            end = "" if node.end is None else (", at least", ", at most")[node.end]
            return f"{name}({', '.join(args)}{seconds}{end})"
        case Select():
            return f"{args[0]} of [{', '.join(args[1:])}]"
        case Bearing() | DirectionAt():
            return f"{type(node).__name__}({', '.join(args)})"
        case _ if is_leaf(node):
            identity = cast(Leaf, node).identity
            number = numbers.setdefault(identity, len(numbers) + 1)
            if identity in seen:
                return f"#{number}"
            seen.add(identity)
            shown = f"weights {node.weights}" if isinstance(node, Index) else ", ".join(args)
            return f"#{number}:{type(node).__name__}({shown})"
        case _:
            return f"{type(node).__name__}({', '.join(args)})"


def show_forest(scenario: Scenario) -> list[str]:
    """The whole forest as lines: what is random or set by the program of each object, requirements, parameters."""
    numbers: dict[Identity, int] = {}
    names = {owner.index: owner.name for owner in scenario.objects}
    lines: list[str] = []
    for owner in scenario.objects:
        for name, given in owner.properties.items():
            if given.explicit or not isinstance(given.value, Constant):
                lines.append(f"{owner.name}.{name} = {show(given.value, names, numbers)}")
    lines += [f"param {name} = {show(given.value, names, numbers)}" for name, given in scenario.params.items()]
    for requirement in scenario.requirements:
        kind = f" ({requirement.built_in.value})" if requirement.built_in else ""
        lines.append(f"require{kind} {show(requirement.condition, names, numbers)}")
    return lines
