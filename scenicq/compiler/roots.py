"""The three classes that every object derives from: `Point`, `OrientedPoint`, `Object` (language paper, table 6)."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from scenicq.compiler.coerce import property_node, to_heading, to_scalar
from scenicq.compiler.values import Instance, ModelValue, PropertyDefinition, ScenicClass
from scenicq.forest import build
from scenicq.forest.nodes import Node

__all__ = ["oriented_point", "root_classes"]


def _constants(**values: ModelValue) -> dict[str, PropertyDefinition]:
    return {name: _property(name, lambda _, value=value: value) for name, value in values.items()}


def _property(name: str, computed: Callable[[Instance], ModelValue], *needs: str) -> PropertyDefinition:
    return PropertyDefinition(name, None, computed, frozenset(needs), (), None, True, None)


def _velocity(instance: Instance) -> Node:
    ahead = build.vector(build.constant(0.0), to_scalar(property_node(instance, "speed", None), None))
    return build.rotate(ahead, to_heading(instance, None))


def _heading(instance: Instance) -> Node:
    parent, yaw = (to_heading(instance.properties[name], None) for name in ("parentOrientation", "yaw"))
    return build.add(parent, yaw)


POINT = ScenicClass(
    "Point",
    None,
    _constants(
        position=build.constant((0.0, 0.0)), visibleDistance=50.0, width=0.0, length=0.0,
        mutationScale=0.0, positionStdDev=1.0,
    ),
    {},
    "Point",
)  # fmt: skip

_ORIENTED = _constants(heading=0.0, viewAngle=math.tau, headingStdDev=math.radians(5))
_YAWED = {
    **_ORIENTED,
    **_constants(parentOrientation=0.0, yaw=0.0),
    "heading": _property("heading", _heading, "parentOrientation", "yaw"),
}
ORIENTED_POINT = ScenicClass("OrientedPoint", POINT, _ORIENTED, {}, "OrientedPoint")
_ORIENTED_POINT_3 = ScenicClass("OrientedPoint", POINT, _YAWED, {}, "OrientedPoint")


def _object(base: ScenicClass, require_visible: bool) -> ScenicClass:
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
        acceleration=0.0,
        behavior=None,
    )
    own["velocity"] = _property("velocity", _velocity, "speed", "heading")
    return ScenicClass("Object", base, own, {}, "Object")


_ROOTS = {
    1: (POINT, ORIENTED_POINT, _object(ORIENTED_POINT, require_visible=True)),
    3: (POINT, _ORIENTED_POINT_3, _object(_ORIENTED_POINT_3, require_visible=False)),
}


def root_classes(version: int) -> dict[str, ScenicClass]:
    """`Point`, `OrientedPoint` and `Object` as a version of Scenic has them.

    Objects must be visible from the ego up to Scenic 2; in Scenic 3 a heading is made of `parentOrientation` and `yaw`.
    """
    return {cls.name: cls for cls in _ROOTS[3 if version == 3 else 1]}


def oriented_point(properties: Mapping[str, ModelValue]) -> Instance:
    """An oriented point with the defaults of its class, but for the properties given."""
    instance = Instance(ORIENTED_POINT, None, None)
    for cls in reversed(ORIENTED_POINT.ancestry()):
        for definition in cls.definitions.values():
            instance.properties[definition.name] = definition.computed(instance)
    instance.properties.update(properties)
    return instance
