"""The three classes that every object derives from: `Point`, `OrientedPoint`, `Object` (language paper, table 6)."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from scenicq.compiler.coerce import property_node, to_heading, to_scalar
from scenicq.compiler.values import Instance, ModelValue, PropertyDefinition, ScenicClass
from scenicq.forest import build
from scenicq.forest.nodes import Node

__all__ = ["OBJECT", "OBJECT_VISIBLE", "ORIENTED_POINT", "POINT", "oriented_point"]


def _constants(**values: ModelValue) -> dict[str, PropertyDefinition]:
    return {name: _property(name, lambda _, value=value: value) for name, value in values.items()}


def _property(name: str, computed: Callable[[Instance], ModelValue], *needs: str) -> PropertyDefinition:
    return PropertyDefinition(name, None, computed, frozenset(needs), (), None, True, None)


def _velocity(instance: Instance) -> Node:
    ahead = build.vector(build.constant(0.0), to_scalar(property_node(instance, "speed", None), None))
    return build.rotate(ahead, to_heading(instance, None))


POINT = ScenicClass(
    "Point",
    None,
    _constants(position=build.constant((0.0, 0.0)), visibleDistance=50.0, width=0.0, length=0.0),
    {},
    "Point",
)

ORIENTED_POINT = ScenicClass("OrientedPoint", POINT, _constants(heading=0.0, viewAngle=math.tau), {}, "OrientedPoint")


def _object(require_visible: bool) -> ScenicClass:
    own = _constants(
        width=1.0,
        length=1.0,
        height=1.0,
        allowCollisions=False,
        requireVisible=require_visible,
        regionContainedIn=None,
        cameraOffset=build.constant((0.0, 0.0)),
        speed=0.0,
        angularSpeed=0.0,
        behavior=None,
    )
    own["velocity"] = _property("velocity", _velocity, "speed", "heading")
    return ScenicClass("Object", ORIENTED_POINT, own, {}, "Object")


OBJECT = _object(require_visible=False)
"""`Object` of Scenic 3."""

OBJECT_VISIBLE = _object(require_visible=True)
"""`Object` of Scenic 1 and 2, which must be visible from the ego."""


def oriented_point(properties: Mapping[str, ModelValue]) -> Instance:
    """An oriented point with the defaults of its class, but for the properties given."""
    instance = Instance(ORIENTED_POINT, None, None)
    for cls in reversed(ORIENTED_POINT.ancestry()):
        for definition in cls.definitions.values():
            instance.properties[definition.name] = definition.computed(instance)
    instance.properties.update(properties)
    return instance
