"""Attributes that labels of a dataset have and a program does not give its objects: conditions read what labels say.

Scenic itself has no such property, and refuses a program that reads it; one that says `with NAME VALUE` is for both.
Only a dataset tells which attributes there are. Where a label lacks one, what depends on it is unknown.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, TypeAlias

from scenicq.compiler.coerce import observed_property
from scenicq.compiler.elements import MISSING
from scenicq.compiler.other_objects import of_nearest
from scenicq.compiler.values import Instance, ModelValue, Nearest, fail
from scenicq.errors import Span
from scenicq.forest.nodes import Kind

if TYPE_CHECKING:
    from scenicq.compiler.interpreter import Interpreter

__all__ = ["LabelAttributes", "label_attribute"]

LabelAttributes: TypeAlias = Callable[[], Mapping[str, frozenset[type]]]
"""Gives the types of the values of each attribute: `float`, `bool` and `str`."""

_KINDS: Mapping[frozenset[type], Kind] = {frozenset({float}): "scalar", frozenset({bool}): "boolean"}


def label_attribute(run: Interpreter, value: Instance, name: str, span: Span) -> ModelValue:
    """An attribute of an object that labels tell; MISSING where no label has it.

    Raises:
        ScenarioError: unsupported-construct, outside of conditions.
    """
    is_nearest = isinstance(value, Nearest)
    if run.label_attributes is None or (value.index is None and not is_nearest):
        return MISSING
    types = run.label_attributes().get(name)
    if types is None:
        return MISSING
    if run.course is None:
        raise fail("unsupported-construct", f"labels give `{name}`, so only conditions can read it", span,
                   "not in a condition", ("read it in `require`, `terminate when`, a monitor, or `record` it",
                                          f"`with {name} VALUE` compares it"))  # fmt: skip
    # what is of several kinds is only ever compared for equality
    kind = _KINDS.get(types, "other")
    return of_nearest(value, name, kind, span) if is_nearest else observed_property(value, name, kind, span)
