"""Scenic's own expressions: which operator each stands for, over evaluated operands (language paper, figure 9)."""

# Programs are dynamically typed: their values are `Any`, and so is what lambdas take.
# pyright: reportUnknownLambdaType=false, reportUnknownArgumentType=false, reportUnknownVariableType=false
# pyright: reportUnknownParameterType=false, reportUnknownMemberType=false

from __future__ import annotations

from collections.abc import Callable

from scenicq.compiler import operators
from scenicq.compiler.attributes import part_of
from scenicq.compiler.choices import distribute
from scenicq.compiler.coerce import to_vector
from scenicq.compiler.environment import Environment, Runner
from scenicq.compiler.following import follow
from scenicq.compiler.values import ModelValue, fail, lift
from scenicq.errors import Span
from scenicq.forest import build
from scenicq.syntax import ast

__all__ = ["construct"]


def _apply(span: Span, function: Callable[..., ModelValue], *operands: ModelValue) -> ModelValue:
    """Apply an operator as soon as its operands are known, to every outcome of random choices of objects."""
    return lift(lambda *values: distribute(function, values, span), *operands)


def construct(
    run: Runner, node: ast.Expression, scope: Environment, value: Callable[[ast.Expression], ModelValue]
) -> ModelValue:
    """The value of an expression that Python does not have.

    Args:
        run: The interpreter.
        node: The expression.
        scope: The names it sees.
        value: Evaluates an operand.

    Raises:
        ScenarioError: Whatever is wrong with it.
    """
    span = node.span

    def origin(part: ast.Expression | None) -> ModelValue:
        return run.ego(span) if part is None else value(part)

    match node:
        case ast.New():
            return run.make_instance(node, scope)
        case ast.Deg():
            return lift(lambda v: operators.degrees(v, span), value(node.value))
        case ast.VectorOperator():
            return lift(lambda x, y: to_vector((x, y), span), value(node.x), value(node.y))
        case ast.FieldAt():
            run.budget.step(span, run.budget.LOOK_UP_STEPS)
            return _apply(
                span, lambda f, p: operators.direction_at(f, p, span), value(node.field), value(node.position)
            )
        case ast.RelativeTo():
            return _apply(span, lambda a, b: operators.relative_to(a, b, span), value(node.left), value(node.right))
        case ast.OffsetBy():
            return _apply(span, lambda o, by: operators.offset(o, by, span), value(node.origin), value(node.offset))
        case ast.OffsetAlong():
            operands = value(node.origin), value(node.direction), value(node.offset)
            return _apply(span, lambda o, d, by: operators.along(o, d, by, span), *operands)
        case ast.Follow():
            # a hundred look-ups at most
            run.budget.step(span, 100 * run.budget.LOOK_UP_STEPS)
            operands = value(node.field), origin(node.origin), value(node.distance)
            return _apply(span, lambda f, o, d: follow(run, f, o, d, span), *operands)
        case ast.PartOf():
            return _apply(span, lambda target: part_of(node.part, target, span), value(node.target))
        case _:
            return _measure(run, node, value, origin)


def _measure(
    run: Runner,
    node: ast.Expression,
    value: Callable[[ast.Expression], ModelValue],
    origin: Callable[[ast.Expression | None], ModelValue],
) -> ModelValue:
    """Scalars, truth values and regions."""
    span = node.span
    match node:
        case ast.RelativePosition():
            return _apply(span, lambda t, o: build.vector_difference(to_vector(t, span), to_vector(o, span), span),
                          value(node.target), origin(node.origin))  # fmt: skip
        case ast.RelativeHeading():
            return _apply(
                span, lambda t, o: operators.relative_heading(t, o, span), value(node.target), origin(node.origin)
            )
        case ast.ApparentHeading():
            return _apply(
                span, lambda t, o: operators.apparent_heading(t, o, span), value(node.target), origin(node.origin)
            )
        case ast.DistanceOperator():
            run.budget.step(span, run.budget.LOOK_UP_STEPS)
            return _apply(span, lambda t, o: operators.distance_to(t, o, span), value(node.target), origin(node.origin))
        case ast.DistancePast():
            return _apply(
                span, lambda t, o: operators.distance_past(t, o, span), value(node.target), origin(node.origin)
            )
        case ast.Angle():
            return _apply(span, lambda t, o: operators.angle_to(t, o, span), value(node.target), origin(node.origin))
        case ast.CanSee():
            return _apply(span, lambda v, t: operators.can_see(v, t, span), value(node.viewer), value(node.target))
        case ast.IntersectsOperator():
            return _apply(span, lambda a, b: operators.intersects(a, b, span), value(node.left), value(node.right))
        case ast.Visible() | ast.VisibleFrom():
            viewer = run.ego(span) if isinstance(node, ast.Visible) else value(node.viewer)
            combine = operators.region_difference if node.negated else operators.region_intersection

            def part(region: ModelValue, seer: ModelValue) -> ModelValue:
                return combine(operators.existing(region, span), operators.visible_region(seer, span), span)

            return _apply(span, part, value(node.region), viewer)
        case ast.Implies():
            return lift(lambda a, b: operators.combine("or", [operators.combine("not", [a], span), b], span),
                        value(node.left), value(node.right))  # fmt: skip
        case ast.InitialScenario():
            # the scene that is matched is the initial one
            run.dynamic("initial scenario", span)
            return True
        case ast.Temporal() | ast.UntilOperator():
            raise fail("unsupported-construct", f"`{span.text}` is not supported", span,
                       "does not describe one instant",
                       ("a scene is matched at one instant: state what holds then",))  # fmt: skip
        case _:
            raise fail("unsupported-construct", f"`{span.text}` is not supported", span, "labels are matched in 2D",
                       ("use what has a meaning in the plane",))  # fmt: skip
