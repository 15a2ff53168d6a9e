"""What a program knows of its objects although labels observe it: properties that the program sets to known values.

Objects' positions and the like are held by reference, because a label's value takes their place. Where the course of
the program depends on one, only the program's own value can be meant. Not so in conditions on the scene, which are
about what a label observes (`courses`), nor for how objects move, of which a class's default says nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from scenicq.compiler.builtins import truth
from scenicq.compiler.coerce import kind_of_model
from scenicq.compiler.courses import as_test
from scenicq.compiler.values import ModelValue, is_node
from scenicq.errors import Span
from scenicq.forest import build
from scenicq.forest.condition import condition
from scenicq.forest.nodes import Constant, Feature, Node, Value
from scenicq.forest.unobserved import MOTION
from scenicq.forest.walk import features, postorder

if TYPE_CHECKING:
    from scenicq.compiler.interpreter import Interpreter

__all__ = ["as_constant", "known_truth"]


def as_constant(run: Interpreter, value: ModelValue) -> ModelValue:
    """A value with known properties of objects put in, if that leaves nothing random; else the value itself."""
    if run.course is not None or not is_node(value) or isinstance(value, Constant):
        return value
    reached = list(postorder((value,)))
    todo = list({(node.object, node.property): None for node in reached if isinstance(node, Feature)})
    run.budget.step(value.span, len(reached) if todo else len(reached) // 2)
    if not todo:
        return value
    known = run.lookups.known
    waiting: set[tuple[int, str]] = set()
    while todo:
        key = todo[-1]
        own = _definition(run, key)
        if key in known or own is None:
            todo.pop()
            continue
        missing = [other for other in features(own) if other not in known and _definition(run, other) is not None]
        if missing and key not in waiting:
            waiting.add(key)
            todo += missing
            continue
        known[key] = _put_in(own, known)
        todo.pop()
    return _put_in(value, known) or value


def _definition(run: Interpreter, key: tuple[int, str]) -> Node | None:
    """What the program says of a property, as far as it is an expression or a plain value."""
    if key[0] < 0 or key[1].startswith("#"):
        return None
    instance = run.objects[key[0]]
    if key[1] in MOTION and key[1] not in instance.explicit:
        return None
    own = instance.properties.get(key[1])
    if is_node(own):
        return own
    plain = isinstance(own, int | float | str) and not isinstance(own, bool)
    return build.constant(own) if plain else None


def _put_in(node: Node, known: Mapping[tuple[int, str], Constant | None]) -> Constant | None:
    """The value of an expression with known properties put in; None if it is random."""
    given: dict[tuple[int, str], Value] = {}
    for key in features(node):
        value = known.get(key)
        if value is None:
            return None
        given[key] = value.value
    found = condition(node, given)
    return found if isinstance(found, Constant) else None


def known_truth(run: Interpreter, value: ModelValue, span: Span) -> bool:
    """The truth of a condition on which the program's course depends.

    Raises:
        ScenarioError: random-branch, where it is random, unless a condition on the scene is evaluated.
    """
    if run.course is None:
        return truth(as_constant(run, value), span)
    test = as_test(value, span)
    if is_node(test) and not isinstance(test, Constant) and kind_of_model(test) == "boolean":
        return run.course.decide(test, span)
    return truth(test, span)
