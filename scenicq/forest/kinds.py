"""What kind of value an expression has."""

from __future__ import annotations

from typing import assert_never, cast

from scenicq.forest.nodes import (
    Arithmetic,
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
    Index,
    Intersects,
    Kind,
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
    match node:
        case Constant():
            return kind_of_value(node.value)
        case Feature():
            return node.kind
        case Range() | Normal() | TruncatedNormal() | DiscreteRange() | Index() | Arithmetic() | Coordinate():
            return "scalar"
        case Norm() | Bearing() | Distance() | DirectionAt():
            return "scalar"
        case PointIn() | VectorOf() | VectorSum() | Scale() | Rotate():
            return "vector"
        case DiscAt() | SectorAt() | RectangleAt() | RegionUnion() | RegionIntersection() | RegionDifference():
            return "region"
        case Compare() | Logic() | Contains() | Intersects() | Encloses():
            return "boolean"
        case _:
            assert_never(node)
