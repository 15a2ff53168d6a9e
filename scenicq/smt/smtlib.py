"""Formulas as SMT-LIB 2 text, and what solvers reply.

The text is in the dialect that dReal, z3 and cvc5 share, with dReal's names for functions beyond it. Parts that are
used more than once are defined once, so that the text is no longer than the graph. Where a quotient is undefined,
SMT-LIB lets it be anything: a solver's model must be replayed, its "unsat" holds all the more. Inverse trigonometric
functions go out as relations, as dReal loses solutions of its own and others have none (`inverse_elimination`).
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from decimal import Decimal
from fractions import Fraction
from typing import cast

from scenicq.forest.nodes import Arithmetic, ArithmeticOp, Compare, Constant, Identity, Logic, Range
from scenicq.forest.walk import children, postorder
from scenicq.smt.answer import Answer, NoAnswer, Sat, Unsat
from scenicq.smt.inverse_elimination import without_inverses
from scenicq.smt.problem import Formula, Problem, Term

__all__ = ["read_reply", "to_smtlib"]

_SIMPLE = re.compile(r"[A-Za-z][A-Za-z0-9_.]*")
_RESERVED = frozenset(
    (
        "BINARY",
        "Bool",
        "DECIMAL",
        "HEXADECIMAL",
        "Int",
        "NUMERAL",
        "Real",
        "STRING",
        "abs",
        "acos",
        "and",
        "arccos",
        "arcsin",
        "arctan",
        "arctan2",
        "as",
        "asin",
        "assert",
        "atan",
        "atan2",
        "cos",
        "cosh",
        "distinct",
        "div",
        "exists",
        "exit",
        "exp",
        "false",
        "forall",
        "is_int",
        "ite",
        "let",
        "log",
        "max",
        "maximize",
        "min",
        "minimize",
        "mod",
        "not",
        "or",
        "par",
        "pi",
        "pop",
        "pow",
        "push",
        "reset",
        "sin",
        "sinh",
        "sqrt",
        "tan",
        "tanh",
        "to_int",
        "to_real",
        "true",
        "xor",
    )
)
_LONGEST = 60
"""Nesting of an expression beyond which a part of it gets a definition."""
_NAMES = {"neg": "-", "==": "="}
"""What SMT-LIB calls otherwise than the forest."""


def to_smtlib(problem: Problem, precision: float) -> str:
    """Write a problem as an SMT-LIB 2 script that asks for satisfiability and a model.

    Args:
        problem: The problem.
        precision: The δ of delta-complete solvers; others ignore it.
    """
    problem = without_inverses(problem)
    names = _symbols(variable.name for variable in problem.variables)
    lines = ["(set-option :produce-models true)", "(set-logic QF_NRA)", f"(set-info :precision {_decimal(precision)})"]
    for variable in problem.variables:
        name = names[variable.name]
        lines.append(f"(declare-fun {name} () Real)")
        if variable.low > -math.inf:
            lines.append(f"(assert (<= {_number(variable.low)} {name}))")
        if variable.high < math.inf:
            lines.append(f"(assert (<= {name} {_number(variable.high)}))")
    known = {variable.leaf.identity: names[variable.name] for variable in problem.variables}
    definitions, constraint = _expressions(problem.constraint, known, precision)
    lines += [*definitions, f"(assert {constraint})", "(check-sat)", "(get-model)", "(exit)"]
    return "\n".join(lines) + "\n"


def _symbols(names: Iterable[str]) -> dict[str, str]:
    """A symbol for each name; those that start with `t!` or `v!` are ours."""
    symbols: dict[str, str] = {}
    for number, name in enumerate(names):
        plain = _SIMPLE.fullmatch(name) and name not in _RESERVED
        symbols[name] = name if plain else f"v!{number}"
    return symbols


def _decimal(value: float) -> str:
    text = format(Decimal(repr(float(value))), "f")
    return text if "." in text else text + ".0"


def _number(value: float) -> str:
    return f"(- {_decimal(-value)})" if value < 0 else _decimal(abs(value))


def _numbered(root: Formula) -> list[tuple[Formula | Term, tuple[int, ...]]]:
    """Every part once, each with the numbers of those below it, the root last; equal parts have one number."""
    numbers: dict[int, int] = {}
    known: dict[Hashable, int] = {}
    parts: list[tuple[Formula | Term, tuple[int, ...]]] = []
    for node in cast("Iterable[Formula | Term]", postorder((root,))):
        below = () if isinstance(node, Range) else tuple(numbers[id(child)] for child in children(node))
        match node:
            case Constant(value):
                own = type(value), value
            case Range():
                own = node.identity
            case _:
                own = node.op
        numbers[id(node)] = number = known.setdefault((own, below), len(parts))
        if number == len(parts):
            parts.append((node, below))
    return parts


def _zeros(node: Formula | Term, below: tuple[int, ...]) -> tuple[int, ...]:
    """The number of what a node divides by, unless it is known and not zero: where that is zero, it is undefined."""
    match node:
        case Arithmetic(ArithmeticOp.DIV, (_, by)) if not (isinstance(by, Constant) and by.value):
            return below[1:]
        case Arithmetic(ArithmeticOp.POW, (_, Constant(value=float() as exponent))) if exponent < 0:
            return below[:1]
        case _:
            return ()


def _expressions(root: Formula, names: Mapping[Identity, str], precision: float) -> tuple[list[str], str]:
    """Definitions of parts that are shared or deep, and the expression of the root."""
    numbered = _numbered(root)
    uses = Counter(child for _, below in numbered for child in below)
    definitions: list[str] = []
    texts: list[str] = []
    depths: list[int] = []
    zeros: list[frozenset[int]] = []
    for number, (node, below) in enumerate(numbered):
        inner = () if isinstance(node, Logic) else (zeros[child] for child in below)
        zeros.append(frozenset(_zeros(node, below)).union(*inner))
        args = [texts[child] for child in below]
        match node:
            case Compare(_, Constant(value=float() as left), Constant(value=float() as right)):
                # only comparisons that rounding decides are of numbers
                written = "true" if abs(left - right) <= precision else "false"
            case Compare() if zeros[number]:
                nonzero = " ".join(f"(not (= {texts[divisor]} 0.0))" for divisor in sorted(zeros[number]))
                written = f"(and {nonzero} {_application(node.op, args)})"
            case Compare() | Logic():
                written = _application(node.op, args)
            case Arithmetic():
                written = _operation(node, args, f"t!{number}", definitions)
            case Range():
                written = names[node.identity]
            case Constant():
                written = str(node.value).lower() if isinstance(node.value, bool) else _number(cast(float, node.value))
        depth = 1 + max((depths[child] for child in below), default=-1)
        if below and uses[number] and (uses[number] > 1 or depth > _LONGEST):
            sort = "Real" if isinstance(node, Arithmetic) else "Bool"
            definitions.append(f"(define-fun t!{number} () {sort} {written})")
            written, depth = f"t!{number}", 0
        texts.append(written)
        depths.append(depth)
    return definitions, texts[-1]


def _operation(node: Arithmetic, args: list[str], name: str, definitions: list[str]) -> str:
    """An operation; those that repeat their arguments define them first."""
    if node.op in (ArithmeticOp.ABS, ArithmeticOp.MIN, ArithmeticOp.MAX, ArithmeticOp.POW):
        args = [_named(f"{name}.{place}", arg, definitions) for place, arg in enumerate(args)]
    match node.op:
        case ArithmeticOp.ABS:
            return f"(ite (<= 0.0 {args[0]}) {args[0]} (- {args[0]}))"
        case ArithmeticOp.MIN:
            return f"(ite (<= {args[0]} {args[1]}) {args[0]} {args[1]})"
        case ArithmeticOp.MAX:
            return f"(ite (<= {args[1]} {args[0]}) {args[0]} {args[1]})"
        case ArithmeticOp.POW:
            return _power(args[0], int(cast(float, cast(Constant, node.args[1]).value)))
        case _:
            return _application(node.op, args)


def _application(name: str, args: Sequence[str]) -> str:
    return f"({_NAMES.get(name, name)} {' '.join(args)})"


def _named(name: str, text: str, definitions: list[str]) -> str:
    if not text.startswith("("):
        return text
    definitions.append(f"(define-fun {name} () Real {text})")
    return name


def _power(base: str, exponent: int) -> str:
    if exponent < 0:
        return f"(/ 1.0 {_power(base, -exponent)})"
    return f"(* {' '.join([base] * exponent)})" if exponent > 1 else (base if exponent else "1.0")


_STATUS = re.compile(r"^\s*(sat|delta-sat|unsat|unknown|timeout)\b", re.MULTILINE)
_ERROR = re.compile(r'\(error\s+"((?:[^"]|"")*)"')
_BOX = re.compile(r"^\s*(\S+)\s*:\s*\[([^\],]+),([^\]]+)\]\s*$", re.MULTILINE)
_TOKEN = re.compile(r'\|[^|]*\||"(?:[^"]|"")*"|[()\[\],]|[^\s()\[\],]+')

Tree = str | list["Tree"]


def read_reply(text: str, problem: Problem) -> Answer:
    """What a solver said of the script of a problem.

    Understands `sat`, `delta-sat`, `unsat`, `unknown` and `timeout`; models as `define-fun`, as pairs of `get-value`,
    or as intervals, of which the middle is taken. The witness is not replayed here.
    """
    status = _STATUS.search(text)
    error = _ERROR.search(text)
    if error and (status is None or error.start() < status.start()):
        # a complaint about an assertion means that something else was decided
        return NoAnswer(f"unsupported: {error.group(1)}")
    if status is None:
        return NoAnswer("garbage")
    match status.group(1):
        case "unsat":
            return Unsat()
        case "unknown":
            return NoAnswer("budget")
        case "timeout":
            return NoAnswer("timeout")
        case _:
            return _model(text[status.end() :], problem)


def _model(text: str, problem: Problem) -> Answer:
    values = {name.strip("|"): _middle(low, high) for name, low, high in _BOX.findall(text)}
    for tree in _subtrees(_parse(text)):
        match tree:
            case ["define-fun", str() as name, [], "Real", *value]:
                values[name.strip("|")] = _value(value)
            case [str() as name, value]:
                values.setdefault(name.strip("|"), _value([value]))
            case _:
                pass
    witness: dict[str, float] = {}
    for name, symbol in _symbols(variable.name for variable in problem.variables).items():
        value = values.get(symbol)
        if value is None and symbol in values:
            return NoAnswer("unsupported: a value in the model is no number")
        # a variable that the model leaves out is free
        witness[name] = 0.0 if value is None else value
    return Sat(witness)


def _parse(text: str) -> list[Tree]:
    """All S-expressions of a text; unmatched brackets are closed or ignored."""
    stack: list[list[Tree]] = [[]]
    for word in _TOKEN.findall(text):
        if word in ("(", "["):
            stack.append([])
        elif word in (")", "]"):
            if len(stack) > 1:
                done = stack.pop()
                stack[-1].append(["interval", *done] if word == "]" else done)
        elif word != ",":
            stack[-1].append(word)
    return [tree for level in stack for tree in level]


def _subtrees(trees: list[Tree]) -> Iterator[Tree]:
    waiting = list(reversed(trees))
    while waiting:
        tree = waiting.pop()
        yield tree
        if isinstance(tree, list):
            waiting.extend(reversed(tree))


def _value(trees: Sequence[Tree]) -> float | None:
    """The number that a term of a model stands for, None if it cannot be read."""
    match trees:
        case [["interval", str() as low, str() as high]]:
            return _middle(low, high)
        case [tree]:
            exact = _fraction(tree)
            return None if exact is None else _double(exact)
        case _:
            return None


def _fraction(tree: Tree) -> Fraction | None:
    match tree:
        case str():
            try:
                # z3 marks a decimal that it cut off
                return Fraction(tree.removesuffix("?"))
            except (ValueError, ZeroDivisionError):
                return None
        case ["-", str() | list() as operand]:
            value = _fraction(operand)
            return None if value is None else -value
        case ["/", str() | list() as upper, str() | list() as lower]:
            numerator, denominator = _fraction(upper), _fraction(lower)
            return None if numerator is None or not denominator else numerator / denominator
        case _:
            return None


def _double(value: Fraction) -> float | None:
    try:
        return float(value)
    except OverflowError:
        return None


def _middle(low: str, high: str) -> float | None:
    try:
        a, b = float(low), float(high)
    except ValueError:
        return None
    middle = a / 2 + b / 2
    if math.isfinite(middle):
        return middle
    return next((end for end in (a, b) if math.isfinite(end)), 0.0)
