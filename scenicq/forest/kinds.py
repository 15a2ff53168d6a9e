"""What kind of value an expression has."""

from __future__ import annotations

from typing import cast

from scenicq.forest.nodes import Among, Constant, Feature, Kind, Node, Select, Undefined, Value
from scenicq.geometry.regions import Region

__all__ = ["as_kind", "kind_of", "kind_of_value"]


def kind_of_value(value: Value) -> Kind:
    """The kind of a known value."""
    if isinstance(value, bool):
        return "boolean"
    if isinstance(value, float):
        return "scalar"
    if isinstance(value, tuple):
        return "vector"
    if value is None or isinstance(value, str | Undefined):
        return "other"
    return "region" if isinstance(value, Region) else "field"


def as_kind(feature: Feature, value: Value) -> Value:
    """What is observed of a property as a program means it; undefined where a label says something of another kind."""
    given = kind_of_value(value)
    match feature.kind, given:
        case ("scalar", "boolean"):
            return float(cast(bool, value))
        case ("other", _) | ("boolean", "scalar"):
            return value
        case _ if feature.kind == given or isinstance(value, Undefined):
            return value
        case _:
            return Undefined(f"`{feature.property}` is {value!r} in the label, which is no {feature.kind}")


def kind_of(node: Node) -> Kind:
    """The kind of value that an expression has."""
    while isinstance(node, Select):
        node = node.options[0]
    if isinstance(node, Constant):
        return kind_of_value(node.value)
    return node.kind if isinstance(node, Feature | Among) else node.value_kind
