"""Properties that Scenic 3 spells with one number an axis: the noise that `mutate` adds, and angles of view."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

from scenicq.compiler.values import ModelValue, fail, is_node
from scenicq.errors import Span
from scenicq.forest.nodes import Constant

__all__ = ["DEVIATIONS", "IN_SPACE", "deviation", "is_zero", "leaves_the_plane"]

IN_SPACE = frozenset({"pitch", "roll", "orientation", "shape", "contactTolerance"})
"""Properties that a box in the plane does not have."""

DEVIATIONS = {"positionStdDev": "positionStdDev", "orientationStdDev": "headingStdDev", "viewAngles": "viewAngle"}
"""Properties of Scenic 3 that hold one number an axis, and the name of the one that counts in the plane."""


def leaves_the_plane(name: str, value: ModelValue) -> bool:
    """Whether a property says what a box in the plane does not have: a tilt, a shape, a base beside its centre."""
    if name == "baseOffset" and isinstance(value, tuple | list):
        return not all(map(is_zero, cast(Sequence[ModelValue], value)[:2]))
    return name in IN_SPACE and value != 0


def deviation(name: str, value: ModelValue, span: Span | None) -> ModelValue:
    """The one number in the plane that `(1, 1, 0)` of a position, or `(5 deg, 0, 0)` of an orientation, stands for.

    For `viewAngles` it is the first: the second one is the height of what is seen.

    Raises:
        ScenarioError: unsupported-construct, for different deviations along the axes, or out of the plane; wrong-type.
    """
    if name == "viewAngles" and not isinstance(value, tuple | list):
        raise fail("wrong-type", "`viewAngles` needs two angles", span, "one value",
                   ("write `with viewAngle` for one angle",))  # fmt: skip
    if is_node(value) and isinstance(value, Constant) and isinstance(value.value, tuple):
        value = value.value
    if name in ("viewAngles", "viewAngle") and isinstance(value, tuple | list) and len(value) == 2:
        return cast(Sequence[ModelValue], value)[0]
    if name not in DEVIATIONS or not isinstance(value, tuple | list):
        return value
    parts = list(cast(Sequence[ModelValue], value))
    even = (
        name == "positionStdDev"
        and len(parts) in (2, 3)
        and parts[0] == parts[1]
        and not any(map(_is_other_than_zero, parts[2:]))
    )
    turned = name == "orientationStdDev" and len(parts) == 3 and not any(map(_is_other_than_zero, parts[1:]))
    if not even and not turned:
        raise fail("unsupported-construct", f"this `{name}` is not supported: labels are matched in 2D", span,
                   "not the same in all directions of the plane",
                   ("write one number for x and y, and none for the rest",))  # fmt: skip
    return parts[0]


def _is_other_than_zero(value: ModelValue) -> bool:
    return not is_zero(value)


def is_zero(value: ModelValue) -> bool:
    """Whether a value is known to be 0."""
    known = value.value if isinstance(value, Constant) else value
    return isinstance(known, int | float) and known == 0
