"""Classes and functions of a program: their definitions, and what a call gives to parameters."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, cast

from scenicq.compiler.deviations import DEVIATIONS, IN_SPACE
from scenicq.compiler.environment import FIRST_NAMES, Environment
from scenicq.compiler.expressions import evaluate
from scenicq.compiler.values import Function, ModelValue, PropertyDefinition, ScenicClass, describe, fail
from scenicq.errors import Span
from scenicq.store.classes import is_class
from scenicq.syntax import ast, phrases

if TYPE_CHECKING:
    from scenicq.compiler.interpreter import Interpreter

__all__ = ["bind_arguments", "define_class", "refuse_decorators"]


def refuse_decorators(decorators: tuple[ast.Expression, ...]) -> None:
    """Refuse decorators.

    Raises:
        ScenarioError: unsupported-construct.
    """
    if decorators:
        raise fail("unsupported-construct", "decorators are not supported", decorators[0].span, "a decorator",
                   ("leave it out: a scenario only needs plain functions",))  # fmt: skip


def define_class(run: Interpreter, node: ast.ClassDef, scope: Environment) -> ScenicClass:
    """The class that a definition makes.

    Raises:
        ScenarioError: Several bases, a base that is no class, or what a class cannot hold.
    """
    refuse_decorators(node.decorators)
    first = next(iter(node.bases), None)
    if len(node.bases) > 1:
        raise fail("unsupported-construct", "a class with several bases is not supported", node.bases[1].span,
                   "a second base", ("derive from one class and repeat the property lines of the other",))  # fmt: skip
    base = evaluate(run, first.value, scope) if first is not None else scope.get("Object", node.name_span)
    if not isinstance(base, ScenicClass):
        place = first.span if first is not None else node.name_span
        raise fail("wrong-type", "a class must derive from a class of objects", place,
                   f"this is {describe(base)}", ("scenarios have classes of points and objects only",))  # fmt: skip
    definitions: dict[str, PropertyDefinition] = {}
    inner = Environment({}, scope)
    for line in node.body:
        match line:
            case ast.PropertyDefault():
                name = _property_name(run.version, line, scope)
                _check_final(base, name, line.name_span)
                needs = frozenset(_first_names(run.version, needed) for needed in _needs(line.value))
                definitions[name] = PropertyDefinition(
                    name, line.value, lambda _: None, needs, line.modifiers, scope, scope.library, line.span
                )
            case ast.ExpressionStatement(value=ast.LiteralValue()) | ast.Pass():
                continue
            case ast.FunctionDef(name="__init__"):
                raise fail("unsupported-construct", "a constructor is not supported", line.name_span, "runs Python",
                           ("give properties their defaults, as in `width: 2`",))  # fmt: skip
            case ast.FunctionDef():
                # a method does not see the names of its class
                refuse_decorators(line.decorators)
                inner.set(line.name, run.make_function(line.name, line.parameters, line.body, scope, line.span))
            case ast.Assign():
                run.run((line,), inner)
            case _:
                raise fail("unsupported-construct", "this cannot stand in a class", line.span, "not a property line",
                           ("give properties their defaults, as in `width: 2`",))  # fmt: skip
    # a class of the class tree is that class, whatever the program derives it from
    category = node.name if is_class(node.name) else base.category
    return ScenicClass(node.name, base, definitions, inner.names, category, node.span)


def _check_final(base: ScenicClass, name: str, span: Span) -> None:
    for ancestor in base.ancestry():
        definition = ancestor.definitions.get(name)
        if definition is not None and "final" in definition.modifiers:
            raise fail("specifier-conflict", f"`{name}` is final in `{ancestor.name}`", span, "cannot be overridden",
                       ("remove this line",))  # fmt: skip


def _first_names(version: int, name: str) -> str:
    return FIRST_NAMES.get(name, name) if version == 1 else name


def _property_name(version: int, line: ast.PropertyDefault, scope: Environment) -> str:
    if line.name in IN_SPACE:
        raise fail("unsupported-construct", f"`{line.name}` is not supported", line.name_span,
                   "labels are matched in 2D", ("state the heading",))  # fmt: skip
    if line.name == "heading" and version == 3:
        return "parentOrientation"
    name = line.name if scope.library else _first_names(version, line.name)
    return DEVIATIONS.get(name, name)


def _needs(value: ast.Expression) -> frozenset[str]:
    """The properties of `self` that a default uses, and `position` where a field is taken at the object."""
    found: set[str] = set()
    stack: list[Any] = [value]
    while stack:
        node = stack.pop()
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "self":
            found.add(node.name)
        if ast.is_phrase(node, phrases.RELATION):
            found.add("position")
        if isinstance(node, tuple):
            stack.extend(cast("tuple[Any, ...]", node))
        elif isinstance(node, ast.SyntaxNode):
            stack.extend(getattr(node, name) for name in node.__dataclass_fields__ if name != "span")
    return frozenset(found)


def bind_arguments(
    function: Function, args: list[ModelValue], named: Mapping[str, ModelValue], span: Span
) -> dict[str, ModelValue]:
    """The names that a call gives to a function's parameters.

    Raises:
        ScenarioError: wrong-arity.
    """
    names: dict[str, ModelValue] = {}
    rest = list(args)
    given = dict(named)
    for parameter in function.parameters:
        if parameter.kind == "*":
            names[parameter.name], rest = tuple(rest), []
        elif parameter.kind == "**":
            names[parameter.name], given = given, {}
        elif parameter.kind != "keyword-only" and rest:
            names[parameter.name] = rest.pop(0)
        elif parameter.kind != "positional-only" and parameter.name in given:
            names[parameter.name] = given.pop(parameter.name)
        elif parameter.name in function.defaults:
            names[parameter.name] = function.defaults[parameter.name]
        else:
            raise fail("wrong-arity", f"`{function.name}` needs a value for `{parameter.name}`", span, "called here")
    if rest or given:
        extra = f"`{next(iter(given))}`" if given else f"{len(rest)} more value{'s' * (len(rest) > 1)}"
        raise fail("wrong-arity", f"`{function.name}` cannot take {extra}", span, "called here")
    return names
