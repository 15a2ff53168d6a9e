"""What a label observes: values of the features of its objects, in the scenario's terms."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cache

from scenicq.forest.nodes import Value
from scenicq.store.labels import Label, LabelObject

__all__ = ["observe", "observe_params", "observed_names"]


def observe(thing: LabelObject) -> Mapping[str, Value]:
    """The properties that a label object has, by Scenic's names; what the source lacks is left out."""
    seen: dict[str, Value] = {"position": (thing.x, thing.y)}
    for name in ("heading", "width", "length", "height"):
        value = getattr(thing, name)
        if value is not None:
            seen[name] = float(value)
    if thing.velocity is not None:
        seen["velocity"] = (float(thing.velocity[0]), float(thing.velocity[1]))
        seen["speed"] = math.hypot(*thing.velocity)
    for name, value in thing.attributes.items():
        seen.setdefault(name, value if isinstance(value, str | bool) else float(value))
    return seen


def observed_names(thing: LabelObject) -> frozenset[str]:
    """The names of the properties that a label object has."""
    if thing.attributes:
        return frozenset(observe(thing))
    present = (thing.heading, thing.width, thing.length, thing.height, thing.velocity)
    return _names(tuple([value is not None for value in present]))


@cache
def _names(present: tuple[bool, ...]) -> frozenset[str]:
    parts = (("heading",), ("width",), ("length",), ("height",), ("velocity", "speed"))
    return frozenset(
        ("position", *(name for names, there in zip(parts, present, strict=True) if there for name in names))
    )


def observe_params(label: Label) -> Mapping[str, Value]:
    """The global parameters of a label."""
    return {name: value if isinstance(value, str | bool) else float(value) for name, value in label.params.items()}
