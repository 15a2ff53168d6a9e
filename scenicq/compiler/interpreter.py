"""Running a program's statements: names, control flow, functions, classes, objects and requirements.

The interpreter collects objects, requirements and parameters; `program` turns them into a scenario.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, assert_never, cast

from scenicq.compiler import operators
from scenicq.compiler.builtins import truth
from scenicq.compiler.coerce import to_boolean, to_region, to_scalar
from scenicq.compiler.environment import Budget, Environment
from scenicq.compiler.expressions import assign, evaluate, iterate, plain_binary
from scenicq.compiler.placing import Surroundings, bind
from scenicq.compiler.specifiers import construct
from scenicq.compiler.values import (
    Choice,
    Delayed,
    Function,
    Instance,
    ModelValue,
    Module,
    PropertyDefinition,
    ScenicClass,
    describe,
    fail,
    is_node,
    lift,
)
from scenicq.errors import Diagnostic, ScenarioError, Span
from scenicq.forest import build
from scenicq.forest.nodes import Constant, Node
from scenicq.geometry.regions import Everywhere
from scenicq.syntax import ast

__all__ = ["Interpreter", "Requirement"]


class _Break(Exception):
    pass


class _Continue(Exception):
    pass


class _Return(Exception):
    def __init__(self, value: ModelValue) -> None:
        super().__init__()
        self.value = value


@dataclass(frozen=True, slots=True, eq=False)
class Requirement:
    """A `require` statement: its condition, or what computes it once the ego is known."""

    condition: Callable[[], Node]
    span: Span


@dataclass(eq=False)
class Interpreter:
    """One run of a program.

    Attributes:
        version: The version of Scenic.
        initial: Whether dynamic parts are ignored rather than refused.
        load: Resolves an import or model: its dotted name and place to a module.
        object_class: The root class of objects.
    """

    version: int
    initial: bool
    load: Callable[[str, int, Span], Module]
    budget: Budget = field(default_factory=Budget)
    objects: list[Instance] = field(default_factory=list[Instance])
    requirements: list[Requirement] = field(default_factory=list[Requirement])
    soft: list[Span] = field(default_factory=list[Span])
    params: dict[str, tuple[ModelValue, Span, bool]] = field(default_factory=dict[str, Any])
    ignored: list[Diagnostic] = field(default_factory=list[Diagnostic])
    current_ego: Instance | None = None
    workspace: Node = field(default_factory=lambda: build.constant(Everywhere()))

    # --- what expressions ask for

    def ego(self, span: Span) -> Instance:
        """The ego; see `Runner`."""
        if self.current_ego is None:
            raise fail("no-ego", "the ego is used before it is defined", span, "refers to the ego",
                       ("define it first, as in `ego = new Car`",))  # fmt: skip
        return self.current_ego

    def name_value(self, name: str, value: ModelValue, scope: Environment, span: Span) -> None:
        """Give a name a value; see `Runner`."""
        if isinstance(value, Delayed):
            raise fail("wrong-type", "this needs the position of an object", span, "no object here",
                       ("use it in a specifier, or write `F at V`",))  # fmt: skip
        if isinstance(value, Instance) and value.index is not None and not value.label and not scope.library:
            value.label = name
        if name == "ego":
            self._set_ego(value, scope, span)
            return
        if name == "workspace":
            self.workspace = to_region(value, span)
        scope.set(name, value)

    def _set_ego(self, value: ModelValue, scope: Environment, span: Span) -> None:
        if isinstance(value, ScenicClass):
            value = self._make(value, (), scope, span)
            value.label = "ego"
        if not (isinstance(value, Instance) and value.index is not None):
            raise fail("wrong-type", "the ego must be an object", span, f"this is {describe(value)}")
        self.current_ego = value

    def call_function(
        self, function: Function, args: list[ModelValue], named: Mapping[str, ModelValue], span: Span
    ) -> ModelValue:
        """Call a function; see `Runner`."""
        scope = Environment(_bind(function, args, named, span), cast(Environment, function.environment))
        self.budget.enter(span)
        try:
            if not isinstance(function.body, tuple):
                return evaluate(self, function.body, scope)
            self.run(function.body, scope)
        except _Return as result:
            return result.value
        finally:
            self.budget.leave()
        return None

    def make_function(
        self,
        name: str,
        parameters: tuple[ast.Parameter, ...],
        body: tuple[ast.Statement, ...] | ast.Expression,
        scope: Environment,
        span: Span,
    ) -> Function:
        """Make a function; see `Runner`."""
        given = {p.name: evaluate(self, p.default, scope) for p in parameters if p.default is not None}
        return Function(name, parameters, given, body, scope, span)

    def make_instance(self, node: ast.New, scope: Environment) -> Instance:
        """Make a point, oriented point or object; see `Runner`."""
        cls = evaluate(self, node.cls, scope)
        if isinstance(cls, Choice):
            raise fail("unsupported-construct", "an object of a random class is not supported", node.cls.span,
                       "which class is random", ("write one program per class",))  # fmt: skip
        if not isinstance(cls, ScenicClass):
            raise fail("wrong-type", "an object needs a class", node.cls.span, f"this is {describe(cls)}")
        return self._make(cls, node.specifiers, scope, node.span)

    def _make(
        self, cls: ScenicClass, specifiers: tuple[ast.Specifier, ...], scope: Environment, span: Span
    ) -> Instance:
        around = Surroundings(self.version, self.ego, lambda: self.workspace)
        kept = [node for node in specifiers if not self._is_dynamic(node)]
        bound = tuple(bind(node, lambda part: evaluate(self, part, scope), around) for node in kept)
        is_object = cls.derives_from("Object")
        instance = Instance(cls, len(self.objects) if is_object else None, span)
        if is_object:
            self.objects.append(instance)
        construct(instance, bound, self)
        return instance

    def _is_dynamic(self, node: ast.Specifier) -> bool:
        if not (isinstance(node, ast.WithSpecifier) and node.property == "behavior"):
            return False
        self._dynamic("with behavior", node.span)
        return True

    def default(self, definition: PropertyDefinition, instance: Instance) -> ModelValue:
        """The default of a property for an instance; see `specifiers.Evaluator`."""
        if definition.default is None:
            return definition.computed(instance)
        scope = Environment({"self": instance}, cast(Environment, definition.environment))
        value = evaluate(self, definition.default, scope)
        while isinstance(value, Delayed):
            value = value.evaluate(instance)
        return value

    # --- statements

    def run(self, body: tuple[ast.Statement, ...], scope: Environment) -> None:
        """Run statements in order."""
        for statement in body:
            self._execute(statement, scope)

    def _execute(self, node: ast.Statement, scope: Environment) -> None:  # noqa: PLR0912
        self.budget.step(node.span)
        match node:
            case ast.ExpressionStatement():
                evaluate(self, node.value, scope)
            case ast.Assign():
                value = evaluate(self, node.value, scope)
                for target in node.targets:
                    assign(self, target, value, scope)
            case ast.AugmentedAssign():
                self._augment(node, scope)
            case ast.AnnotatedAssign():
                if node.value is not None:
                    assign(self, node.target, evaluate(self, node.value, scope), scope)
            case ast.If():
                self._branch(node, scope)
            case ast.For():
                self._loop(node, ((item,) for item in iterate(evaluate(self, node.iterable, scope), node.span)), scope)
            case ast.While():
                test = node.test
                self._loop(node, iter(lambda: truth(evaluate(self, test, scope), test.span), False), scope)
            case ast.Break():
                raise _Break
            case ast.Continue():
                raise _Continue
            case ast.Pass():
                pass
            case ast.FunctionDef():
                self._refuse_decorators(node.decorators)
                scope.set(node.name, self.make_function(node.name, node.parameters, node.body, scope, node.span))
            case ast.Return():
                raise _Return(None if node.value is None else evaluate(self, node.value, scope))
            case ast.ClassDef():
                scope.set(node.name, self._class(node, scope))
            case ast.Import() | ast.ImportFrom() | ast.Model():
                self._import(node, scope)
            case ast.Param():
                for item in node.items:
                    self.params[item.name] = (evaluate(self, item.value, scope), item.span, scope.library)
            case ast.Require():
                self._require(node, scope)
            case ast.Mutate():
                self._mutate(node, scope)
            case ast.Assert():
                if not truth(evaluate(self, node.test, scope), node.test.span):
                    raise fail("runtime-error", "the assertion does not hold", node.span)
            case ast.Global() | ast.Nonlocal():
                self._share(node, scope)
            case ast.Simulator():
                self._dynamic("simulator", node.span)
            case ast.DynamicStatement() | ast.DynamicDefinition():
                self._dynamic(node.kind, node.span)
                if isinstance(node, ast.DynamicDefinition) and node.name:
                    scope.set(node.name, None)
            case ast.RequireMonitor():
                self._dynamic("require monitor", node.span)
            case ast.Delete() | ast.Raise() | ast.Try() | ast.WithStatement() | ast.UnsupportedStatement():
                word = node.span.text.split()[0].rstrip(":")
                raise fail("unsupported-construct", f"`{word}` is not supported", node.span, "not needed for a scene")
            case ast.PropertyDefault():
                raise fail("parse-error", "a property line belongs in a class", node.span)
            case _:
                assert_never(node)

    def _dynamic(self, kind: str, span: Span) -> None:
        found = Diagnostic(
            "unsupported-construct",
            f"`{kind}` is not supported",
            span,
            "does not describe one instant",
            hints=("a scene is matched at one instant: remove this, or use `--initial` to ignore it",),
            severity="warning" if self.initial else "error",
        )
        if not self.initial:
            raise ScenarioError(found)
        self.ignored.append(found)

    def _augment(self, node: ast.AugmentedAssign, scope: Environment) -> None:
        old, new = evaluate(self, node.target, scope), evaluate(self, node.value, scope)
        if node.operator == "+" and isinstance(old, list):
            cast("list[ModelValue]", old).extend(iterate(new, node.span))
            return
        if is_node(old) or is_node(new) or isinstance(old, Instance):
            assign(self, node.target, operators.binary(node.operator, old, new, node.span), scope)
            return
        value = lift(lambda a, b: plain_binary(node.operator, a, b, node.span), old, new)
        assign(self, node.target, value, scope)

    def _branch(self, node: ast.If, scope: Environment) -> None:
        for branch in node.branches:
            if truth(evaluate(self, branch.test, scope), branch.test.span):
                self.run(branch.body, scope)
                return
        self.run(node.orelse, scope)

    def _loop(self, node: ast.For | ast.While, rounds: Any, scope: Environment) -> None:
        for item in rounds:
            self.budget.step(node.span)
            if isinstance(node, ast.For):
                assign(self, node.target, item[0], scope)
            try:
                self.run(node.body, scope)
            except _Continue:
                continue
            except _Break:
                return
        self.run(node.orelse, scope)

    def _refuse_decorators(self, decorators: tuple[ast.Expression, ...]) -> None:
        if decorators:
            raise fail("unsupported-construct", "decorators are not supported", decorators[0].span, "a decorator")

    def _share(self, node: ast.Global | ast.Nonlocal, scope: Environment) -> None:
        for name in node.names:
            outer = scope.parent
            while isinstance(node, ast.Global) and outer is not None and outer.parent is not None and outer.parent.parent:
                outer = outer.parent
            found = outer.find(name.id) if outer is not None else None
            if found is None:
                raise fail("unknown-name", f"`{name.id}` is not defined outside", name.span)
            scope.shared[name.id] = found

    def _class(self, node: ast.ClassDef, scope: Environment) -> ScenicClass:
        self._refuse_decorators(node.decorators)
        if len(node.bases) > 1:
            raise fail("unsupported-construct", "a class with several bases is not supported", node.bases[1].span)
        base = evaluate(self, node.bases[0].value, scope) if node.bases else scope.get("Object", node.name_span)
        if not isinstance(base, ScenicClass):
            raise fail("wrong-type", "a class must derive from a class of objects", node.bases[0].span,
                       f"this is {describe(base)}")  # fmt: skip
        definitions: dict[str, PropertyDefinition] = {}
        inner = Environment({}, scope)
        for line in node.body:
            if isinstance(line, ast.PropertyDefault):
                definitions[line.name] = PropertyDefinition(
                    line.name, line.value, lambda _: None, self._needs(line.value), line.modifiers, scope,
                    scope.library, line.span,
                )  # fmt: skip
            elif isinstance(line, ast.ExpressionStatement) and isinstance(line.value, ast.Constant):
                continue
            else:
                self._execute(line, inner)
        category = base.category if not scope.library or node.name.startswith("_") else node.name
        return ScenicClass(node.name, base, definitions, inner.names, category, node.span)

    @staticmethod
    def _needs(value: ast.Expression) -> frozenset[str]:
        """The properties of `self` that a default uses, and `position` where a field is taken at the object."""
        found: set[str] = set()
        stack: list[Any] = [value]
        while stack:
            node = stack.pop()
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "self":
                found.add(node.name)
            if isinstance(node, ast.RelativeTo):
                found.add("position")
            if isinstance(node, tuple):
                stack.extend(cast("tuple[Any, ...]", node))
            elif isinstance(node, ast.Node):
                stack.extend(getattr(node, name) for name in node.__dataclass_fields__ if name != "span")
        return frozenset(found)

    def _import(self, node: ast.Import | ast.ImportFrom | ast.Model, scope: Environment) -> None:
        match node:
            case ast.Model():
                scope.names.update(self.load(node.name, 0, node.name_span).names)
            case ast.Import():
                for alias in node.aliases:
                    module = self.load(alias.path, 0, alias.span)
                    scope.set(alias.name or alias.path.split(".")[-1], module)
            case ast.ImportFrom():
                module = self.load(node.module, node.level, node.span)
                for alias in node.aliases:
                    if alias.path == "*":
                        scope.names.update(module.names)
                    elif alias.path in module.names:
                        scope.set(alias.name or alias.path, module.names[alias.path])
                    else:
                        raise fail("unknown-name", f"`{node.module}` has no `{alias.path}`", alias.span, "not found")

    def _require(self, node: ast.Require, scope: Environment) -> None:
        if node.probability is not None:
            probability = evaluate(self, node.probability, scope)
            if isinstance(probability, bool) or not isinstance(probability, int | float) or not 0 <= probability <= 1:
                raise fail("wrong-value", "a probability must be a known number from 0 to 1", node.probability.span)
            if probability < 1:
                self.soft.append(node.span)
                return
        names: dict[str, ModelValue] = {}
        current: Environment | None = scope
        while current is not None and current.parent is not None:
            names = current.names | names
            current = current.parent
        frozen = Environment(names, current)

        def condition() -> Node:
            value = evaluate(self, node.condition, frozen)
            if isinstance(value, Delayed):
                raise fail("wrong-type", "this needs the position of an object", node.condition.span,
                           "no object here", ("write `F at V`",))  # fmt: skip
            return to_boolean(value, node.condition.span)

        self.requirements.append(Requirement(condition, node.span))

    def _mutate(self, node: ast.Mutate, scope: Environment) -> None:
        scale = 1 if node.scale is None else evaluate(self, node.scale, scope)
        amount = to_scalar(scale, node.span)
        targets = [evaluate(self, part, scope) for part in node.objects] or list(self.objects)
        for target in targets:
            if not isinstance(target, Instance):
                raise fail("wrong-type", "only objects can be mutated", node.span, f"this is {describe(target)}")
            target.mutation = None if isinstance(amount, Constant) and amount.value == 0 else amount


def _bind(function: Function, args: list[ModelValue], named: Mapping[str, ModelValue], span: Span) -> dict[str, ModelValue]:
    """The names that a call gives to a function's parameters."""
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
