"""Conditions that branch on random values, as one expression: `if`, filters, `sorted` in `require`, monitors, ends.

Scenic evaluates such a condition on a drawn scene, where every value is known. Here it is compiled before any label is
known. So it is evaluated once for each path through the branches, its *course* (symbolic execution), and the values are
joined to a choice. Where something is missing on a path, such as a lane, the scenes that take the path are excluded.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from scenicq.compiler.coerce import kind_of_model
from scenicq.compiler.exclusions import Exclusions
from scenicq.compiler.random_values import LACKING
from scenicq.compiler.values import Choice, ModelValue, fail, is_node
from scenicq.errors import ScenarioError, Span
from scenicq.forest import build
from scenicq.forest.nodes import CompareOp, Constant, Feature, Index, LogicOp, Node, Select
from scenicq.forest.walk import leaves
from scenicq.limits import LIMITS

if TYPE_CHECKING:
    from scenicq.compiler.interpreter import Interpreter

__all__ = ["Course", "as_test", "forbid_courses", "option_of", "split_by_course"]


class Course:
    """Decides each random test while a condition is evaluated. This base class refuses every test."""

    __slots__ = ()

    def decide(self, test: Node, span: Span) -> bool:
        """The outcome of a random test on this path.

        Raises:
            ScenarioError: random-branch: branches are forbidden here, or the paths draw different random variables.
        """
        raise _refused(span, "a loop must run a known number of times")


@dataclass(eq=False, slots=True)
class _Taken(Course):
    """One path.

    Attributes:
        given: The first tests with their outcomes; each later test comes out true.
        tests: The tests so far, in order.
        outcomes: Their outcomes.
        excluded: The exclusions. They assume the outcomes so far, so that what is missing is excluded here only.
        around: Ends these assumptions.
    """

    given: tuple[tuple[Node, bool], ...]
    excluded: Exclusions
    around: ExitStack
    tests: list[Node] = field(default_factory=list[Node])
    outcomes: list[bool] = field(default_factory=list[bool])

    def decide(self, test: Node, span: Span) -> bool:
        """The given outcome of the next test; true after the last given one."""
        number, outcome = len(self.tests), True
        if number < len(self.given):
            before, outcome = self.given[number]
            if [leaf.identity for leaf in leaves(test)] != [leaf.identity for leaf in leaves(before)]:
                raise _refused(span, "each course of the condition draws this again")
            test = before
        self.tests.append(test)
        self.outcomes.append(outcome)
        self.around.enter_context(self.excluded.assuming(test, int(outcome), 2))
        return outcome


def _refused(span: Span, label: str) -> ScenarioError:
    return fail("random-branch", "`if` and loops cannot depend on a random value", span, label,
                ("draw it before, outside of the condition",))  # fmt: skip


@contextmanager
def _on(run: Interpreter, course: Course) -> Generator[None]:
    before, run.course = run.course, course
    try:
        yield
    finally:
        run.course = before


def forbid_courses(run: Interpreter) -> AbstractContextManager[None]:
    """A block in which a random test is an error; objects are still read as a label shows them."""
    return _on(run, Course())


def split_by_course(run: Interpreter, evaluate: Callable[[], Node], span: Span) -> Node:
    """Evaluate a condition on every path, and join the values to one expression.

    Args:
        run: The interpreter.
        evaluate: Evaluates the condition.
        span: The condition.

    Raises:
        ScenarioError: What is wrong with the condition; budget-exceeded, for too many courses.
    """
    tests: dict[tuple[bool, ...], Node] = {}
    values: dict[tuple[bool, ...], Node] = {}
    missing: ScenarioError | None = None
    todo: list[tuple[tuple[Node, bool], ...]] = [()]
    while todo:
        if len(values) >= LIMITS.condition_courses:
            what = f"this condition has more than {LIMITS.condition_courses:,} courses"
            raise fail("budget-exceeded", what, span, "",
                       ("compare fewer objects with each other",))  # fmt: skip
        given = todo.pop()
        with ExitStack() as around:
            course = _Taken(given, run.excluded, around)
            try:
                with _on(run, course):
                    value = evaluate()
            except ScenarioError as error:
                if error.diagnostics[0].code not in LACKING or not course.tests:
                    raise
                missing = missing or error
                value = None
        taken = tuple(course.outcomes)
        for number in range(len(given), len(taken)):
            tests[taken[:number]] = course.tests[number]
            known = tuple(zip(course.tests[:number], taken[:number], strict=True))
            todo.append((*known, (course.tests[number], False)))
        if value is None:
            _exclude(run.excluded, course, span)
        values[taken] = value or build.constant(False, span)
    if missing is not None and all(isinstance(each, Constant) and each.value is False for each in values.values()):
        raise missing
    for path in sorted(tests, key=len, reverse=True):
        values[path] = _either(tests[path], values.pop((*path, False)), values.pop((*path, True)), span)
    return values[()]


def _exclude(excluded: Exclusions, course: _Taken, span: Span) -> None:
    """Exclude the scenes that take a course."""
    steps = list(zip(course.tests, course.outcomes, strict=True))
    with ExitStack() as around:
        for test, outcome in steps[:-1]:
            around.enter_context(excluded.assuming(test, int(outcome), 2))
        excluded.add(steps[-1][0], [int(steps[-1][1])], 2, span)


def _either(test: Node, no: Node, yes: Node, span: Span) -> Node:
    """`yes if test else no`; a constant branch makes it `and`, `or` or `not`."""
    opposite = build.opposite(test)
    match no, yes:
        case Constant(value=bool(without)), Constant(value=bool(with_)):
            return yes if without is with_ else test if with_ else opposite
        case Constant(value=False), _:
            return build.logic(LogicOp.AND, test, yes, span=span)
        case Constant(value=True), _:
            return build.logic(LogicOp.OR, opposite, yes, span=span)
        case _, Constant(value=False):
            return build.logic(LogicOp.AND, opposite, no, span=span)
        case _, Constant(value=True):
            return build.logic(LogicOp.OR, test, no, span=span)
        case _:
            return Select(test, (no, yes), span=span)


def option_of(run: Interpreter, value: ModelValue, span: Span) -> ModelValue:
    """The option that a random choice takes on this path, found by bisection. Other values are returned unchanged.

    Raises:
        ScenarioError: random-branch, where only one course may be taken.
    """
    while isinstance(value, Choice) and run.course is not None:
        options, low, high = value.options, 0, len(value.options)
        while any(option is not options[low] for option in options[low:high]):
            middle = (low + high) // 2
            low, high = (low, middle) if run.course.decide(_comes_before(value, middle), span) else (middle, high)
        value = options[low]
    return value


def _comes_before(choice: Choice, number: int) -> Node:
    """The test that a choice takes one of its first `number` options."""
    if isinstance(choice.index, Index):
        return Select(choice.index, tuple(build.constant(each < number) for each in range(len(choice.options))))
    return build.compare(CompareOp.LT, choice.index, build.constant(float(number)))


def as_test(value: ModelValue, span: Span) -> ModelValue:
    """Make a random value a truth value. A value that is not random, or has no such truth, is returned unchanged."""
    if isinstance(value, Choice):
        options = [as_test(option, span) for option in value.options]
        if any(is_node(option) and kind_of_model(option) != "boolean" for option in options):
            return value
        known = [option if is_node(option) else build.constant(bool(option), span) for option in options]
        return Select(value.index, tuple(known), span=span)
    if not is_node(value) or isinstance(value, Constant):
        return value
    match kind_of_model(value):
        case "scalar":
            return build.compare(CompareOp.NE, value, build.constant(0.0, span), span)
        case "boolean" if isinstance(value, Feature):
            # a label may have anything in place of a truth value
            return build.compare(CompareOp.EQ, value, build.constant(True, span), span)
        case _:
            return value
