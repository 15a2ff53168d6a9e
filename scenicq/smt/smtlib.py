"""Formulas as SMT-LIB 2 text, and what solvers reply.

The text is in the dialect that dReal, z3 and cvc5 share, with dReal's names for functions beyond it. Parts that are
used more than once are defined once, so that the text is no longer than the graph. Where a quotient is undefined,
SMT-LIB lets it be anything: a solver's model must be replayed, its "unsat" holds all the more. Inverse trigonometric
functions go out as relations, as dReal loses solutions of its own and others have none (`inverse_elimination`).
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Sequence
from decimal import Decimal
from fractions import Fraction

from scenicq.smt.answer import Answer, NoAnswer, Sat, Unsat
from scenicq.smt.formula import Problem, Row, flatten
from scenicq.smt.inverse_elimination import without_inverses

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
_RELATIONS = ("<=", "<", "==")
_NAMES = {"add": "+", "mul": "*", "sub": "-", "neg": "-", "div": "/", "==": "=", "<": "<", "<=": "<="}


def to_smtlib(problem: Problem, precision: float) -> str:
    """Write a problem as an SMT-LIB 2 script that asks for satisfiability and a model.

    Args:
        problem: The problem.
        precision: The δ of delta-complete solvers; others ignore it.
    """
    problem = without_inverses(problem)
    rows = flatten(problem.constraint)
    names = _symbols(variable.name for variable in problem.variables)
    lines = ["(set-option :produce-models true)", "(set-logic QF_NRA)", f"(set-info :precision {_decimal(precision)})"]
    for variable in problem.variables:
        name = names[variable.name]
        lines.append(f"(declare-fun {name} () Real)")
        if variable.low > -math.inf:
            lines.append(f"(assert (<= {_number(variable.low)} {name}))")
        if variable.high < math.inf:
            lines.append(f"(assert (<= {name} {_number(variable.high)}))")
    definitions, constraint = _expressions(rows, names, precision)
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


def _divisors(rows: Sequence[Row]) -> list[frozenset[int]]:
    """The rows that a row divides by, itself or below: where one of them is zero, the row is undefined."""
    found: list[frozenset[int]] = []
    for kind, _, children in rows:
        below: set[int] = set()
        if kind not in ("and", "or"):
            below.update(*(found[child] for child in children))
        if kind == "div" and not _is_number(rows[children[1]]):
            below.add(children[1])
        if kind == "pow" and float(rows[children[1]][1]) < 0:
            below.add(children[0])
        found.append(frozenset(below))
    return found


def _is_number(row: Row) -> bool:
    """Whether a row is a constant other than zero."""
    return row[0] == "num" and float(row[1]) != 0


def _expressions(rows: Sequence[Row], names: dict[str, str], precision: float) -> tuple[list[str], str]:
    """Definitions of parts that are shared or deep, and the expression of the last row."""
    uses = [0] * len(rows)
    for _, _, children in rows:
        for child in children:
            uses[child] += 1
    definitions: list[str] = []
    divisors = _divisors(rows)
    texts: list[str] = []
    depths: list[int] = []
    for number, (kind, text, children) in enumerate(rows):
        if kind in ("var", "num"):
            texts.append(names[text] if kind == "var" else _number(float(text)))
            depths.append(0)
            continue
        args = [texts[child] for child in children]
        if kind in ("abs", "min", "max", "pow"):
            # these repeat their arguments
            args = [_named(f"t!{number}.{place}", arg, definitions) for place, arg in enumerate(args)]
        if kind in _RELATIONS and all(rows[child][0] == "num" for child in children):
            # only atoms that rounding decides are ground
            close = abs(float(rows[children[0]][1]) - float(rows[children[1]][1])) <= precision
            written = "true" if close else "false"
        else:
            written = _application(kind, args, [rows[child] for child in children])
        if kind in _RELATIONS and divisors[number]:
            zeros = " ".join(f"(not (= {texts[divisor]} 0.0))" for divisor in sorted(divisors[number]))
            written = f"(and {zeros} {written})"
        depth = 1 + max((depths[child] for child in children), default=0)
        if number < len(rows) - 1 and (uses[number] > 1 or depth > _LONGEST):
            sort = "Bool" if kind in ("and", "or", *_RELATIONS) else "Real"
            definitions.append(f"(define-fun t!{number} () {sort} {written})")
            written, depth = f"t!{number}", 0
        texts.append(written)
        depths.append(depth)
    return definitions, texts[-1]


def _named(name: str, text: str, definitions: list[str]) -> str:
    if not text.startswith("("):
        return text
    definitions.append(f"(define-fun {name} () Real {text})")
    return name


def _application(kind: str, args: list[str], children: list[Row]) -> str:
    match kind:
        case "and" | "or" if not args[1:]:
            return args[0] if args else ("true" if kind == "and" else "false")
        case "add" | "mul" if len(args) == 1:
            return args[0]
        case "abs":
            return f"(ite (<= 0.0 {args[0]}) {args[0]} (- {args[0]}))"
        case "min" | "max":
            chosen = args[0]
            for arg in args[1:]:
                first, second = (chosen, arg) if kind == "min" else (arg, chosen)
                chosen = f"(ite (<= {first} {second}) {chosen} {arg})"
            return chosen
        case "pow":
            return _power(args[0], int(float(children[1][1])))
        case _:
            return f"({_NAMES.get(kind, kind)} {' '.join(args)})"


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
