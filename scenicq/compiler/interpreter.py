"""Running a program's statements: names, control flow, functions, classes, objects and requirements.

The interpreter collects objects, requirements and parameters; `program` turns them into a scenario.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, assert_never, cast

from scenicq.compiler.arithmetic import number_error
from scenicq.compiler.assignment import assign
from scenicq.compiler.classes import bind_arguments, define_class, refuse_decorators
from scenicq.compiler.coerce import reads_over_time, to_region, to_scalar
from scenicq.compiler.comparisons import binary, iterate
from scenicq.compiler.coroutines import (
    CoroutineCall,
    CoroutineDefinition,
    DelayedCall,
    ScenarioCall,
    ScenarioDefinition,
    ScenarioNotBegunError,
    beside_blocks,
)
from scenicq.compiler.courses import Course
from scenicq.compiler.deviations import deviation, leaves_the_plane
from scenicq.compiler.element_lookups import LaneRule, Lookups
from scenicq.compiler.environment import Budget, Environment
from scenicq.compiler.exclusions import Exclusions
from scenicq.compiler.expressions import evaluate
from scenicq.compiler.items import items_of
from scenicq.compiler.known_properties import known_truth
from scenicq.compiler.label_attributes import LabelAttributes
from scenicq.compiler.logic import condition
from scenicq.compiler.overrides import override
from scenicq.compiler.recorded_values import RecordStatement, record_statement
from scenicq.compiler.requirements import RequireStatement, requirement
from scenicq.compiler.scoping import own_names
from scenicq.compiler.specifier_meanings import SpecifierContext, bind
from scenicq.compiler.specifiers import construct
from scenicq.compiler.temporal import TimedStatements
from scenicq.compiler.timed_statements import leave_out, timed_statement
from scenicq.compiler.unread import evaluate_when_read
from scenicq.compiler.values import (
    Choice,
    DelayedValue,
    Function,
    Instance,
    ModelValue,
    PropertyDefinition,
    ScenicClass,
    describe,
    fail,
    is_node,
)
from scenicq.errors import Diagnostic, ScenarioError, Span
from scenicq.forest import build
from scenicq.forest.nodes import Feature, Node
from scenicq.forest.walk import postorder
from scenicq.geometry.driven_courses import GAP_S
from scenicq.geometry.network import Network
from scenicq.geometry.regions import Everywhere
from scenicq.syntax import ast
from scenicq.syntax.walk import walk

__all__ = ["Interpreter"]

_OBJECT_STEPS = 300
"""Steps that an object takes: its properties and requirements are work later on, too."""


class _Break(Exception):
    pass


class _Continue(Exception):
    pass


class _Return(Exception):
    def __init__(self, value: ModelValue) -> None:
        super().__init__()
        self.value = value


@dataclass(eq=False)
class Interpreter:
    """One run of a program.

    Attributes:
        version: The version of Scenic.
        initial: Whether dynamic parts are ignored rather than refused.
        imports: Runs an import or model statement; the environment takes the names.
        network: The road network.
        gap_s: Seconds without a label at which the course of a track is cut.
        lanes: Which of several lanes that contain an object are its own.
        label_attributes: What kinds of values labels have under the name of each attribute; None without a dataset.
        budget: What the program may still use.
        objects: The objects made so far.
        records: What results are to carry.
        params: Global parameters: value, place, whether a library sets it.
        given_params: Those that have a value whatever the program says.
        excluded: Outcomes of random choices that no scene has.
        lookups: What the program asks about places of the map.
        timed: Takes what is said about time; None for a program that is matched at one instant.
        overrides: Whether a scenario overrides what objects have.
        is_initial: Whether what runs is the initial scenario.
        begun: What a scenario has made, by name; None before it begins.
        simulation: What `simulation()` gives; None before the program has run.
        course: Decides the tests of a condition on the scene while one is evaluated: there, no value of an object is
            known before a label tells it. None while the program itself runs.
    """

    version: int
    initial: bool
    imports: Callable[[ast.Import | ast.ImportFrom | ast.Model, Environment], None]
    network: Network
    gap_s: float = GAP_S
    lanes: LaneRule = "along"
    label_attributes: LabelAttributes | None = None
    budget: Budget = field(default_factory=Budget)
    objects: list[Instance] = field(default_factory=list[Instance])
    requirements: list[RequireStatement] = field(default_factory=list[RequireStatement])
    records: list[RecordStatement] = field(default_factory=list[RecordStatement])
    params: dict[str, tuple[ModelValue, Span, bool]] = field(default_factory=dict[str, Any])
    given_params: frozenset[str] = frozenset()
    excluded: Exclusions = field(default_factory=Exclusions)
    lookups: Lookups = field(default_factory=Lookups)
    timed: TimedStatements | None = None
    overrides: bool = False
    is_initial: bool = True
    begun: Callable[[ScenarioCall], Mapping[str, ModelValue] | None] = lambda _: None
    ignored: list[Diagnostic] = field(default_factory=list[Diagnostic])
    current_ego: Instance | None = None
    simulation: ModelValue = None
    course: Course | None = None
    workspace: Node = field(default_factory=lambda: build.constant(Everywhere()))
    _bound: dict[int, tuple[object, frozenset[str]]] = field(default_factory=dict[int, Any])

    # --- what expressions ask for

    def ego(self, span: Span) -> Instance:
        """The ego.

        Raises:
            ScenarioError: no-ego, where none is defined yet.
        """
        if self.current_ego is None:
            example = "ego = new Car" if self.version == 3 else "ego = Car"
            raise fail("no-ego", "the ego is used before it is defined", span, "refers to the ego",
                       (f"define it first, as in `{example}`",))  # fmt: skip
        return self.current_ego

    def name_value(self, name: str, value: ModelValue, scope: Environment, span: Span) -> None:
        """Give a name a value; an object's first name becomes its own."""
        if isinstance(value, DelayedValue):
            raise fail("wrong-type", "this needs the position of an object", span, "no object here",
                       ("use it in a specifier, or write `F at V`",))  # fmt: skip
        if name == "ego":
            self._set_ego(value, span)
            return
        if isinstance(value, Instance) and not (value.index is None or value.label or scope.library or self.course):
            value.label = name
        if name == "workspace":
            self.workspace = to_region(value, span)
        if name in scope.shared and scope.shared[name].is_module and reads_over_time():
            raise fail("unsupported-construct", f"`{name}` of the program cannot be given a value over time", span,
                       "called while a recording is followed", ("keep it in a variable of the behavior",))  # fmt: skip
        scope.set(name, value)

    def _set_ego(self, value: ModelValue, span: Span) -> None:
        if not (isinstance(value, Instance) and value.index is not None):
            bare = isinstance(value, ScenicClass)
            raise fail("wrong-type", "the ego must be an object", span, f"this is {describe(value)}",
                       (f"write `ego = new {value.name}`",) if bare else ())  # fmt: skip
        self.current_ego = value

    def evaluate(self, node: ast.Expression, scope: Environment) -> ModelValue:
        """The value of an expression."""
        return evaluate(self, node, scope)

    def demand(self, condition: Callable[[], Node], span: Span) -> None:
        """Require a condition; see `specifiers.Evaluator`."""
        self.requirements.append(RequireStatement(condition, span))

    def call_function(
        self, function: Function, args: list[ModelValue], named: Mapping[str, ModelValue], span: Span
    ) -> ModelValue:
        """Call a function."""
        given = bind_arguments(function, args, named, span)
        if isinstance(function, ScenarioDefinition):
            return ScenarioCall(function, given, span)
        if isinstance(function, CoroutineDefinition):
            return CoroutineCall(function, given, span)
        scope = Environment(given, cast(Environment, function.environment), own=self.own_names(function))
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

    def own_names(self, function: Function) -> frozenset[str]:
        """The names that a function binds; worked out once for each text of a function."""
        if not isinstance(function.body, tuple):
            return frozenset()
        body = function.body
        if id(body) not in self._bound:
            self._bound[id(body)] = body, own_names(body)
        return self._bound[id(body)][1]

    def make_function(
        self,
        name: str,
        parameters: tuple[ast.Parameter, ...],
        body: tuple[ast.Statement, ...] | ast.Expression,
        scope: Environment,
        span: Span,
    ) -> Function:
        """Make a function, evaluating the defaults of its parameters."""
        given = {p.name: evaluate(self, p.default, scope) for p in parameters if p.default is not None}
        return Function(name, parameters, given, body, scope, span)

    def make_instance(self, node: ast.New, scope: Environment) -> Instance:
        """Make a point, oriented point or object."""
        cls = evaluate(self, node.cls, scope)
        if isinstance(cls, Choice):
            raise fail("unsupported-construct", "an object of a random class is not supported", node.cls.span,
                       "which class is random", ("write one program per class",))  # fmt: skip
        if not isinstance(cls, ScenicClass):
            further = node.specifiers[0].span.text.split()[0] if node.specifiers and not node.keyword else ""
            hints = (f"a comma separates specifiers: write `{node.cls.span.text}, {further} ...`",) if further else ()
            raise fail("wrong-type", "an object needs a class", node.cls.span, f"this is {describe(cls)}", hints)
        return self._make(cls, node.specifiers, scope, node.span)

    def _make(
        self, cls: ScenicClass, specifiers: tuple[ast.Specifier, ...], scope: Environment, span: Span
    ) -> Instance:
        is_object = cls.derives_from("Object")
        around = SpecifierContext(
            self.version,
            self.ego,
            lambda: self.workspace,
            self.budget,
            self.network,
            self._may_lack,
            is_object=is_object,
        )
        dynamic = [each for each in specifiers if isinstance(each, ast.WithSpecifier) and each.property == "behavior"]
        behaviors = [(self._behavior(each, scope), each.span) for each in dynamic]
        kept = [each for each in specifiers if each not in dynamic]
        bound = tuple(bind(node, lambda part: evaluate(self, part, scope), around) for node in kept)
        if scope.library:
            bound = tuple(replace(specifier, explicit=False) for specifier in bound)
        if is_object:
            self.budget.step(span, _OBJECT_STEPS)
        instance = Instance(cls, len(self.objects) if is_object else None, span)
        if is_object:
            self.objects.append(instance)
        construct(instance, bound, self)
        if self.timed is not None and self.timed.behaviors != "ignore" and is_object:
            if not behaviors and "behavior" in instance.properties:
                behaviors = [(instance.properties.pop("behavior"), span)]
            for behavior, place in behaviors:
                self.timed.behave(instance, behavior, place)
        return instance

    def _may_lack(self, index: Node) -> bool:
        """Whether an option of a choice, or of one that its index depends on, lacks a part that the program needs."""
        todo, seen = [index], set[tuple[int, str]]()
        while todo:
            for node in postorder([todo.pop()]):
                if self.excluded.may_lack(node):
                    return True
                if isinstance(node, Feature) and node.object >= 0 and (node.object, node.property) not in seen:
                    seen.add((node.object, node.property))
                    value = self.objects[node.object].properties.get(node.property)
                    todo += [cast(Node, value)] if is_node(value) else []
        return False

    def _behavior(self, node: ast.WithSpecifier, scope: Environment) -> ModelValue:
        """What `with behavior` gives, unless behaviors are left out or refused."""
        if self.timed is None or self.timed.behaviors == "ignore":
            self.dynamic("with behavior", node.span)
            return None
        return evaluate(self, node.value, scope)

    def default(self, definition: PropertyDefinition, instance: Instance) -> ModelValue:
        """The default of a property for an instance; see `specifiers.Evaluator`."""
        if definition.default is None:
            return definition.computed(instance)
        scope = Environment({"self": instance}, cast(Environment, definition.environment))
        value = evaluate(self, definition.default, scope)
        while isinstance(value, DelayedValue):
            value = value.evaluate(instance)
        if leaves_the_plane(definition.name, value):
            raise fail("unsupported-construct", f"this `{definition.name}` is not supported", definition.span,
                       "labels are matched in 2D", ("leave it out",))  # fmt: skip
        spelled = "orientationStdDev" if definition.name == "headingStdDev" else definition.name
        return deviation(spelled, value, definition.span)

    # --- statements

    def run(self, body: tuple[ast.Statement, ...], scope: Environment) -> None:
        """Run statements in order."""
        for statement in body:
            try:
                self._execute(statement, scope)
            except ArithmeticError as error:
                raise number_error(error, statement.span, "in this statement") from None

    def _execute(self, node: ast.Statement, scope: Environment) -> None:
        self.budget.step(node.span)
        match node:
            case ast.ExpressionStatement():
                self._value(node.value, scope)
            case ast.Assign():
                value = evaluate_when_read(self, node.value, scope, lambda: self._assigned(node.value, scope))
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
                self._loop(
                    node, ((item,) for item in items_of(self, evaluate(self, node.iterable, scope), node.span)), scope
                )
            case ast.While():
                test = node.test
                self._loop(node, iter(lambda: known_truth(self, condition(self, test, scope), test.span), False), scope)
            case ast.Break():
                raise _Break
            case ast.Continue():
                raise _Continue
            case ast.Pass():
                pass
            case ast.FunctionDef():
                refuse_decorators(node.decorators)
                scope.set(node.name, self.make_function(node.name, node.parameters, node.body, scope, node.span))
            case ast.Return():
                raise _Return(None if node.value is None else self._value(node.value, scope))
            case ast.ClassDef():
                scope.set(node.name, define_class(self, node, scope))
            case ast.Import() | ast.ImportFrom() | ast.Model():
                self.imports(node, scope)
            case ast.Param():
                for item in node.items:
                    if item.name in self.given_params:
                        continue
                    self.params[item.name] = (evaluate(self, item.value, scope), item.span, scope.library)
            case ast.Require():
                made = requirement(self, node, scope)
                self.requirements += [made] if made is not None else []
            case ast.Mutate():
                self._mutate(node, scope)
            case ast.Assert():
                if not known_truth(self, condition(self, node.test, scope), node.test.span):
                    raise fail("runtime-error", "the assertion does not hold", node.span)
            case ast.Global() | ast.Nonlocal():
                self._share(node, scope)
            case ast.Simulator():
                self.dynamic("simulator", node.span)
            case ast.DynamicStatement(kind="record" | "record initial" | "record final"):
                record_statement(self, node, scope)
            case ast.DynamicDefinition(kind="scenario"):
                if lines := beside_blocks(node.body):
                    raise fail("parse-error", "a scenario with blocks cannot have other statements", lines[0].span,
                               "beside the blocks", ("write it in the `setup` block",))  # fmt: skip
                made = self.make_function(node.name, node.parameters, node.body, scope, node.span)
                scope.set(
                    node.name,
                    ScenarioDefinition(made.name, made.parameters, made.defaults, made.body, scope, made.span),
                )
                self.overrides = self.overrides or any(isinstance(each, ast.Override) for each in walk(*node.body))
            case ast.DynamicDefinition(kind="setup" | "compose"):
                raise fail("parse-error", f"`{node.kind}` stands outside of a scenario", node.span, "no block here",
                           ("write it within `scenario Name():`",))  # fmt: skip
            case ast.Override():
                override(self, node, scope)
            case ast.DynamicStatement() | ast.DynamicDefinition() | ast.RequireMonitor() if self.timed is not None:
                timed_statement(self, self.timed, node, scope)
            case ast.Take() | ast.Do() | ast.TryInterrupt():
                self.dynamic(node.kind, node.span)
            case ast.DynamicStatement() | ast.DynamicDefinition() | ast.RequireMonitor():
                self.dynamic("require monitor" if isinstance(node, ast.RequireMonitor) else node.kind, node.span)
                if isinstance(node, ast.DynamicDefinition) and node.name:
                    scope.set(node.name, None)
            case ast.Try():
                self.run((*node.body, *node.orelse, *node.final), scope)  # what fails is an error all the same
            case ast.Delete() | ast.Raise() | ast.WithStatement() | ast.UnsupportedStatement():
                word = node.span.text.split()[0].rstrip(":")
                raise fail("unsupported-construct", f"`{word}` is not supported", node.span, "not needed for a scene",
                           ("write what the scene needs with assignments, `if`, `for` and functions",))  # fmt: skip
            case ast.PropertyDefault():
                raise fail("parse-error", "a property line belongs in a class", node.span)
            case _:
                assert_never(node)

    def _value(self, node: ast.Expression, scope: Environment) -> ModelValue:
        """An expression's value; up to Scenic 2 the bare name of a class is an instance of it."""
        value = evaluate(self, node, scope)
        bare = isinstance(value, ScenicClass) and isinstance(node, ast.Name | ast.Attribute)
        if bare and self.version < 3 and not scope.library:
            return self._make(cast(ScenicClass, value), (), scope, node.span)
        return value

    def _assigned(self, node: ast.Expression, scope: Environment) -> ModelValue:
        """An expression's value; a call that takes what a scenario has not made yet waits until it is done."""
        try:
            return self._value(node, scope)
        except ScenarioNotBegunError:
            if not isinstance(node, ast.Call):
                raise
            return DelayedCall(node)

    def dynamic(self, kind: str, span: Span) -> None:
        """Refuse what does not describe one instant, or note that it is ignored.

        Raises:
            ScenarioError: unsupported-construct, unless dynamic parts are to be ignored.
        """
        if self.timed is not None:
            return leave_out(self.timed, self.ignored, kind, span)
        found = Diagnostic(
            "unsupported-construct",
            f"`{kind}` is not supported",
            span,
            "does not describe one instant",
            hints=("a scene is one instant: remove this, or use `--initial` to ignore it",),
            severity="warning" if self.initial else "error",
        )
        if not self.initial:
            raise ScenarioError(found)
        self.ignored.append(found)

    def _augment(self, node: ast.AugmentedAssign, scope: Environment) -> None:
        old, new = evaluate(self, node.target, scope), evaluate(self, node.value, scope)
        if node.operator == "+" and isinstance(old, list) and not isinstance(new, list):
            new = iterate(new, node.span)
        value = binary(node.operator, old, new, node.span)
        if isinstance(old, list | set) and type(value) is type(old):
            # other names of the same list or set see the change, as in Python
            held = list(cast("list[ModelValue]", value))
            old.clear()
            old.extend(held) if isinstance(old, list) else old.update(held)
            return
        assign(self, node.target, value, scope)

    def _branch(self, node: ast.If, scope: Environment) -> None:
        for branch in node.branches:
            if known_truth(self, condition(self, branch.test, scope), branch.test.span):
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

    def _share(self, node: ast.Global | ast.Nonlocal, scope: Environment) -> None:
        for name in node.names:
            if isinstance(node, ast.Global):
                scope.shared[name.id] = scope.module
                continue
            found = scope.parent.find(name.id) if scope.parent is not None else None
            if found is None or found.is_module:
                raise fail("unknown-name", f"`{name.id}` is not defined in a function around this one", name.span)
            scope.shared[name.id] = found

    def _mutate(self, node: ast.Mutate, scope: Environment) -> None:
        scale = 1 if node.scale is None else evaluate(self, node.scale, scope)
        amount = to_scalar(scale, node.span)
        targets = [evaluate(self, part, scope) for part in node.objects] or list(self.objects)
        for target in targets:
            if not isinstance(target, Instance):
                raise fail("wrong-type", "only objects can be mutated", node.span, f"this is {describe(target)}",
                           ("name the objects, or write `mutate` for all",))  # fmt: skip
            target.mutation = amount
