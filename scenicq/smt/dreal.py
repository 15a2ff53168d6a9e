"""The adapter to dReal's Python package, for worker processes only: a call cannot be interrupted."""

from __future__ import annotations

import ctypes
import importlib
import math
import operator
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from scenicq.forest.nodes import (
    Arithmetic,
    ArithmeticOp,
    Compare,
    CompareOp,
    Constant,
    Identity,
    Logic,
    LogicOp,
    Node,
    Range,
)  # fmt: skip
from scenicq.forest.walk import children, postorder
from scenicq.limits import LIMITS
from scenicq.smt.answer import Answer, NoAnswer, Sat, Unsat
from scenicq.smt.inverse_elimination import without_inverses
from scenicq.smt.problem import Formula, Problem, holds
from scenicq.smt.terms import compare, conjunction, disjunction, parts

__all__ = ["VERSION", "check"]

LIBRARIES = (
    "libibex.so",
    "libClpSolver.so.1",
    "libClp.so.1",
    "libCoinUtils.so.3",
    "liblapack.so.3",
    "libblas.so.3",
    "libnlopt.so.0",
)
"""What dReal's wheel needs of the system."""
IBEX_FOLDER = Path("/opt/libibex/2.7.4/lib")
"""Where the wheel looks for libibex besides the loader's own path."""


def _missing() -> list[str]:
    """The libraries that the loader does not find."""
    missing: list[str] = []
    for library in LIBRARIES:
        folder = str(IBEX_FOLDER / library)
        try:
            ctypes.CDLL(folder if Path(folder).exists() else library)
        except OSError:
            missing.append(library)
    return missing


try:
    # by name: the module has no types that a checker could read
    dreal: Any = importlib.import_module("dreal")
except ImportError as error:
    absent = _missing() if error.name != "dreal" else []
    raise ImportError(f"missing libraries: {', '.join(absent)}" if absent else str(error)) from error

VERSION = str(dreal.__version__)

Symbolic = Any
"""An expression or a formula of dReal, which ships no types."""


NEAR = 1000.0
"""Distance at which unbounded ranges are cut off in the search for a witness that holds."""
COARSE = 1e-2
"""Precision at which some alternatives together are tried before the rest is chosen."""


def check(problem: Problem, *, precision: float, timeout_s: float) -> Answer:
    """Decide a problem; see `Solver.check`.

    dReal takes a conjunction in less than a millisecond, but can take seconds for a disjunction of twenty together with
    equalities: hence the disjunctions are split here, one after the other.
    """
    deadline = time.thread_time() + timeout_s
    related = without_inverses(problem)
    variables = {variable.leaf.identity: dreal.Variable(variable.name) for variable in related.variables}
    fixed, choices = _cases(related.constraint)
    try:
        common = _all([_formula(part, variables, precision) for part in fixed])
        options = [[_formula(part, variables, precision) for part in choice] for choice in choices]
        near, given = (_formula(_bounds(related, reach), variables, precision) for reach in (NEAR, math.inf))
    except (ValueError, RuntimeError) as error:
        # constants outside of a function's domain
        return NoAnswer(f"unsupported: {error}")
    doubtful: Sat | None = None
    waiting: list[list[Symbolic]] = [[]]
    while waiting:
        chosen = waiting.pop()
        if time.thread_time() > deadline:
            return NoAnswer("timeout")
        if len(chosen) < len(options):
            # most alternatives contradict those that were chosen before, which a coarse look tells
            if chosen and dreal.CheckSatisfiability(_all([given, common, *chosen]), max(precision, COARSE)) is None:
                continue
            waiting += [[*chosen, option] for option in reversed(options[len(chosen)])]
            continue
        # the box of an answer can be so wide that its middle is no solution: then finer, and close to the origin
        for bounds, delta in ((given, precision), (near, precision), (near, precision / 100)):
            if time.thread_time() > deadline:
                return NoAnswer("timeout")
            box = dreal.CheckSatisfiability(_all([bounds, common, *chosen]), delta)
            if box is None:
                break
            witness = {each.name: _value(box, variables[each.leaf.identity]) for each in problem.variables}
            if holds(problem, witness, precision):
                return Sat(witness)
            doubtful = Sat(witness)
    return doubtful or Unsat()


def _cases(constraint: Formula) -> tuple[list[Formula], list[tuple[Formula, ...]]]:
    """The parts of a conjunction that stay, and the alternatives that are tried one by one."""
    fixed: list[Formula] = []
    choices: list[tuple[Formula, ...]] = []
    count = 1
    for alternatives in sorted((parts(LogicOp.OR, part) for part in parts(LogicOp.AND, constraint)), key=len):
        count *= len(alternatives)
        if len(alternatives) > 1 and count <= LIMITS.dreal_conjunctions:
            choices.append(alternatives)
        else:
            fixed.append(disjunction(alternatives))
    return fixed, choices


def _bounds(problem: Problem, reach: float) -> Formula:
    """The ranges of the variables, those without an end cut off at a distance."""
    atoms: list[Formula] = []
    for variable in problem.variables:
        low = variable.low if math.isfinite(variable.low) else min(-reach, variable.high - reach)
        high = variable.high if math.isfinite(variable.high) else max(reach, variable.low + reach)
        if math.isfinite(low):
            atoms.append(compare("<=", low, variable.leaf))
        if math.isfinite(high):
            atoms.append(compare("<=", variable.leaf, high))
    return conjunction(atoms)


def _all(formulas: list[Symbolic]) -> Symbolic:
    return dreal.logical_and(dreal.Formula.TRUE(), *formulas)


def _value(box: Symbolic, variable: Symbolic) -> float:
    """The middle of a variable's range, 0 where it does not matter."""
    return float(box[variable].mid()) if box.has_key(variable) else 0.0


def _formula(root: Formula, variables: dict[Identity, Symbolic], precision: float) -> Symbolic:
    made: dict[int, Symbolic] = {}
    for node in postorder((root,)):
        made[id(node)] = _translated(node, [made[id(child)] for child in children(node)], variables, precision)
    return made[id(root)]


def _translated(node: Node, args: list[Symbolic], variables: dict[Identity, Symbolic], precision: float) -> Symbolic:
    match node:
        case Range():
            return dreal.Expression(variables[node.identity])
        case Constant(value=bool() as value):
            return dreal.Formula.TRUE() if value else dreal.Formula.FALSE()
        case Constant(value=float() as value):
            return dreal.Expression(value)
        case Arithmetic():
            return _FUNCTIONS[node.op](*args)
        case Compare(_, Constant(value=float() as left), Constant(value=float() as right)):
            # only comparisons that rounding decides are of numbers
            return dreal.Formula.TRUE() if abs(left - right) <= precision else dreal.Formula.FALSE()
        case Compare():
            return _RELATIONS[node.op](*args)
        case Logic(op=LogicOp.OR):
            return dreal.logical_or(dreal.Formula.FALSE(), *args)
        case _:
            return _all(args)


def _quotient(a: Symbolic, b: Symbolic) -> Symbolic:
    return a / b


_RELATIONS: dict[CompareOp, Callable[[Symbolic, Symbolic], Symbolic]] = {
    CompareOp.LE: operator.le,
    CompareOp.LT: operator.lt,
    CompareOp.EQ: operator.eq,
}

_FUNCTIONS: dict[ArithmeticOp, Callable[..., Symbolic]] = {
    ArithmeticOp.ADD: operator.add,
    ArithmeticOp.SUB: operator.sub,
    ArithmeticOp.MUL: operator.mul,
    ArithmeticOp.DIV: _quotient,
    ArithmeticOp.NEG: operator.neg,
    ArithmeticOp.ABS: abs,
    ArithmeticOp.MIN: dreal.Min,
    ArithmeticOp.MAX: dreal.Max,
    ArithmeticOp.SQRT: dreal.sqrt,
    ArithmeticOp.SIN: dreal.sin,
    ArithmeticOp.COS: dreal.cos,
    ArithmeticOp.TAN: dreal.tan,
    ArithmeticOp.ATAN: dreal.atan,
    ArithmeticOp.POW: dreal.pow,
    ArithmeticOp.EXP: dreal.exp,
    ArithmeticOp.LOG: dreal.log,
}
