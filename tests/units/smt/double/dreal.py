"""A double of dReal's Python package: it takes what the bindings of 4.21.06.2 take (`dreal/dreal_py.cc`), nothing else.

It has what the adapter needs, without the inverse functions that lose solutions. As there, arguments have no names, a
number or variable will do for an expression, and constants outside of a function's domain are refused. What a formula
amounts to, the built-in solver decides.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import reduce, wraps

import built_in

from scenicq.forest.nodes import Arithmetic, ArithmeticOp, Compare, CompareOp, Constant, Logic, LogicOp, Range
from scenicq.forest.walk import leaves, transform
from scenicq.smt import problem
from scenicq.smt.answer import NoAnswer, Sat

__version__ = "4.21.6.2"


def binding(*overloads):
    """A function that takes arguments of these types alone."""

    def bound(function: Callable[..., object]):
        @wraps(function)
        def call(*args):
            for kinds in overloads:
                given = [_as(kind, arg) for kind, arg in zip(kinds, args, strict=False)]
                if len(kinds) == len(args) and all(each is not None for each in given):
                    return function(*given)
            raise TypeError(f"{function.__name__}(): incompatible function arguments: {[type(arg) for arg in args]}")

        return call

    return bound


def _as(kind, arg):
    """An argument as what is declared, by an implicit conversion where there is one; None if it is none."""
    if kind is float and type(arg) is int:
        return float(arg)
    if kind is Expression and isinstance(arg, int | float | Variable):
        return Expression(arg)
    return arg if isinstance(arg, kind) else None


class Variable:
    """A variable of type Real."""

    def __init__(self, *args):
        if [type(arg) for arg in args] != [str]:
            raise TypeError("__init__(): incompatible constructor arguments")
        (self._name,) = args
        self.leaf = Range(Constant(-math.inf), Constant(math.inf))

    def __eq__(self, other):
        raise NotImplementedError("a formula, for variables of type Bool")

    def __hash__(self):
        return id(self)


class Expression:
    """A term."""

    def __init__(self, *args):
        match args:
            case (int() | float() as number,):
                self.node = Constant(float(number))
            case (Variable() as of,):
                self.node = of.leaf
            case _:
                raise TypeError("__init__(): incompatible constructor arguments")

    __hash__ = object.__hash__


def _expression(node) -> Expression:
    made = Expression(0.0)
    made.node = node
    return made


def _function(op: ArithmeticOp, arity: int, domain: Callable[..., bool] = lambda *_: True, error=ValueError):
    """A function; of constants in its domain, the domain errors of C++ as pybind11 passes them on."""

    @binding((Expression,) * arity)
    def apply(*args):
        constants = [each.node.value for each in args if isinstance(each.node, Constant)]
        if len(constants) == arity and not domain(*constants):
            raise error(f"{op.value} of {constants}")
        return _expression(Arithmetic(op, tuple(each.node for each in args)))

    return apply


sqrt = _function(ArithmeticOp.SQRT, 1, lambda x: x >= 0)
log = _function(ArithmeticOp.LOG, 1, lambda x: x >= 0)
exp, sin, cos, tan, atan = (
    _function(op, 1)
    for op in (ArithmeticOp.EXP, ArithmeticOp.SIN, ArithmeticOp.COS, ArithmeticOp.TAN, ArithmeticOp.ATAN)
)
pow = _function(ArithmeticOp.POW, 2, lambda x, n: x >= 0 or n == int(n))
Min, Max = _function(ArithmeticOp.MIN, 2), _function(ArithmeticOp.MAX, 2)
_quotient = _function(ArithmeticOp.DIV, 2, lambda _, by: by != 0, RuntimeError)


def _operator(function: Callable[..., object]):
    """A method that leaves to the other side what it does not take."""

    def method(self, *others):
        try:
            return function(self, *others)
        except TypeError:
            return NotImplemented

    return method


for _name, _made in {
    "__add__": _function(ArithmeticOp.ADD, 2),
    "__sub__": _function(ArithmeticOp.SUB, 2),
    "__mul__": _function(ArithmeticOp.MUL, 2),
    "__truediv__": _quotient,
    "__neg__": _function(ArithmeticOp.NEG, 1),
    "__abs__": _function(ArithmeticOp.ABS, 1),
    "__pow__": pow,
}.items():
    setattr(Expression, _name, _operator(_made))


class Formula:
    """A formula."""

    def __init__(self, *_):
        raise TypeError("__init__(): only of a variable of type Bool")

    @staticmethod
    def TRUE():
        return _formula(Constant(True))

    @staticmethod
    def FALSE():
        return _formula(Constant(False))


def _formula(node) -> Formula:
    made = object.__new__(Formula)
    made.node = node
    return made


def _comparison(op: CompareOp):
    @binding((Expression, Expression))
    def compare(left, right):
        return _formula(Compare(op, left.node, right.node))

    return _operator(compare)


for _name, _op in {"__lt__": CompareOp.LT, "__le__": CompareOp.LE, "__gt__": CompareOp.GT, "__ge__": CompareOp.GE,
                   "__eq__": CompareOp.EQ, "__ne__": CompareOp.NE}.items():  # fmt: skip
    setattr(Expression, _name, _comparison(_op))


def _connective(op: LogicOp):
    """Connect one formula or more, two by two, as the package's `__init__.py` does."""

    @binding((Formula, Formula))
    def both(left, right):
        return _formula(Logic(op, (left.node, right.node)))

    def connect(*formulas):
        assert len(formulas) >= 1, "Must supply at least one operand"
        return reduce(both, formulas)

    return connect


logical_and, logical_or = _connective(LogicOp.AND), _connective(LogicOp.OR)


class Interval:
    """What a variable may be in a box."""

    def __init__(self, low, high):
        self._low, self._high = low, high

    def mid(self):
        """The middle."""
        return self._low / 2 + self._high / 2


class Box:
    """An answer."""

    def __init__(self, values):
        self._values = values

    @binding((object, Variable))
    def has_key(self, key):
        """Whether a variable is in the formula."""
        return key.leaf.identity in self._values

    @binding((object, Variable), (object, int))
    def __getitem__(self, key):
        return Interval(*(self._values[key.leaf.identity],) * 2)


@binding((Formula, float))
def CheckSatisfiability(formula, delta):
    """A box where the formula holds, weakened by no more than delta, or None if there is no solution."""

    def weakened(node):
        if not isinstance(node, Compare) or node.op is CompareOp.EQ:
            return node
        return Compare(node.op, node.left, Arithmetic(ArithmeticOp.ADD, (node.right, Constant(delta / 2))))

    variables = tuple(problem.Variable(f"v{number}", leaf) for number, leaf in enumerate(leaves(formula.node)))
    asked = problem.Problem(variables, transform(formula.node, weakened))
    answer = built_in.check(asked, precision=delta / 2, timeout_s=1e6)
    if isinstance(answer, NoAnswer):
        raise RuntimeError(answer.reason)
    if not isinstance(answer, Sat):
        return None
    return Box({each.leaf.identity: answer.witness[each.name] for each in variables})
