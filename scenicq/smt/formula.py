"""Quantifier-free formulas over real variables: what the solvers are asked.

Nodes are frozen and may be shared: a formula is a directed acyclic graph, and every function here visits a node once,
without recursion, so that depth is no limit. Interior nodes compare by identity; `flatten` gives a value to compare.

The connectives are conjunction and disjunction only (negation normal form). Build with `apply`, `compare`,
`conjunction`, `disjunction` and `negation`, which fold constants. A term outside of its domain (the square root of -1)
is undefined, and an atom with an undefined side is false.

This module knows nothing of solvers, scenarios or files. Read `evaluation`, then `solver` next.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import StrEnum

from scenicq.budget import look
from scenicq.smt.operators import Operator, operate

__all__ = [
    "FALSE",
    "TRUE",
    "Conjunction",
    "Disjunction",
    "Formula",
    "Node",
    "Num",
    "Op",
    "Operator",
    "Problem",
    "Relation",
    "Row",
    "Term",
    "TermComparison",
    "Var",
    "Variable",
    "apply",
    "compare",
    "conjunction",
    "disjunction",
    "flatten",
    "free_variables",
    "negation",
    "postorder",
    "unflatten",
]

ROUNDING = 1e-12
"""Relative error below which a ground atom that fails is left to the solver's precision instead of being folded."""


class Relation(StrEnum):
    """How the two sides of an atom compare; `>=` and `>` are written the other way round."""

    LE = "<="
    LT = "<"
    EQ = "=="


class _Shared:
    """Printing and pickling of nodes that may be deep and shared."""

    __slots__ = ()

    def __repr__(self) -> str:
        rows = flatten(self)  # type: ignore[arg-type]
        return f"<{type(self).__name__} of {len(rows)} nodes>"

    def __reduce__(self) -> tuple[Callable[[tuple[Row, ...]], Node], tuple[tuple[Row, ...]]]:
        return unflatten, (flatten(self),)  # type: ignore[arg-type]


@dataclass(frozen=True, slots=True)
class Var:
    """A real variable, known by its name."""

    name: str


@dataclass(frozen=True, slots=True)
class Num:
    """A finite constant."""

    value: float

    def __post_init__(self) -> None:
        """Refuse what is no real number."""
        assert math.isfinite(self.value), self.value


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Op(_Shared):
    """A function applied to terms; `ADD`, `MUL`, `MIN` and `MAX` take one argument or more."""

    op: Operator
    args: tuple[Term, ...]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class TermComparison(_Shared):
    """A comparison of two terms."""

    relation: Relation
    left: Term
    right: Term


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Conjunction(_Shared):
    """All of the formulas hold; of none: true."""

    args: tuple[Formula, ...]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Disjunction(_Shared):
    """At least one of the formulas holds; of none: false."""

    args: tuple[Formula, ...]


Term = Var | Num | Op
Formula = TermComparison | Conjunction | Disjunction
Node = Term | Formula
Row = tuple[str, str, tuple[int, ...]]
"""A node of a flattened graph: operator, relation or kind; name or number; the rows of the children."""

TRUE = Conjunction(())
FALSE = Disjunction(())


@dataclass(frozen=True, slots=True)
class Variable:
    """A variable of a problem with its closed range; the ends may be infinite."""

    name: str
    low: float = -math.inf
    high: float = math.inf


@dataclass(frozen=True, slots=True)
class Problem:
    """Are there values of the variables, within their ranges, that satisfy the constraint?

    Attributes:
        variables: Every variable that the constraint uses; the names differ.
        constraint: A formula in negation normal form.
    """

    variables: tuple[Variable, ...]
    constraint: Formula

    def __post_init__(self) -> None:
        """Refuse two variables of one name."""
        names = {variable.name for variable in self.variables}
        assert len(names) == len(self.variables), "two variables of one name"


def apply(operator: Operator, *arguments: Term | float) -> Term:
    """Apply a function to terms and numbers, folding constants and neutral elements.

    Folding computes in binary64, one rounding for each application. What is undefined stays unfolded.
    """
    args = tuple(_term(argument) for argument in arguments)
    if operator in (Operator.ADD, Operator.MUL):
        args = _gather(operator, args)
    if len(args) == 1 and operator in (Operator.ADD, Operator.MUL, Operator.MIN, Operator.MAX):
        return args[0]
    constants = [arg.value for arg in args if isinstance(arg, Num)]
    if len(constants) == len(args):
        value = operate(operator, constants)
        return Num(value) if math.isfinite(value) else Op(operator, args)
    last = args[-1]
    if isinstance(last, Num):
        zero = operator is Operator.SUB and last.value == 0
        one = operator in (Operator.DIV, Operator.POW) and last.value == 1
        if zero or one:
            return args[0]
    if operator is Operator.NEG and isinstance(last, Op) and last.op is Operator.NEG:
        return last.args[0]
    return Op(operator, args)


def _term(argument: Term | float) -> Term:
    return Num(float(argument)) if isinstance(argument, (int, float)) else argument


def _gather(operator: Operator, args: tuple[Term, ...]) -> tuple[Term, ...]:
    """Fold the constants of a sum or product into one, which comes last and is left out where it is neutral."""
    terms = tuple(arg for arg in args if not isinstance(arg, Num))
    constants = [arg.value for arg in args if isinstance(arg, Num)]
    neutral = 0.0 if operator is Operator.ADD else 1.0
    value = operate(operator, constants) if constants else neutral
    if not math.isfinite(value):
        return args
    if value == 0 and operator is Operator.MUL and all(isinstance(term, Var) for term in terms):
        return (Num(0.0),)
    return terms if terms and value == neutral else (*terms, Num(value))


def compare(relation: str, left: Term | float, right: Term | float) -> Formula:
    """Compare two terms.

    A ground atom becomes `TRUE` or `FALSE`, unless it fails by no more than rounding: then it stays, so that the
    solver's precision decides.

    Args:
        relation: One of `<=`, `<`, `==`, `>=`, `>`.
        left: A term or number.
        right: A term or number.
    """
    if relation in (">=", ">"):
        return compare("<" + relation[1:], right, left)
    atom = TermComparison(Relation(relation), _term(left), _term(right))
    if not (isinstance(atom.left, Num) and isinstance(atom.right, Num)):
        return atom
    low, high = atom.left.value, atom.right.value
    holds = {Relation.LE: low <= high, Relation.LT: low < high, Relation.EQ: low == high}[atom.relation]
    if holds:
        return TRUE
    return atom if abs(low - high) <= ROUNDING * max(1.0, abs(low), abs(high)) else FALSE


def conjunction(formulas: Iterable[Formula]) -> Formula:
    """All of the formulas: `TRUE` of none, `FALSE` if one is, nested conjunctions merged."""
    args = _merge(formulas, Conjunction)
    if any(isinstance(arg, Disjunction) and not arg.args for arg in args):
        return FALSE
    return TRUE if not args else args[0] if len(args) == 1 else Conjunction(args)


def disjunction(formulas: Iterable[Formula]) -> Formula:
    """At least one of the formulas: `FALSE` of none, `TRUE` if one is, nested disjunctions merged."""
    args = _merge(formulas, Disjunction)
    if any(isinstance(arg, Conjunction) and not arg.args for arg in args):
        return TRUE
    return FALSE if not args else args[0] if len(args) == 1 else Disjunction(args)


def _merge(formulas: Iterable[Formula], kind: type[Conjunction | Disjunction]) -> tuple[Formula, ...]:
    merged: dict[int, Formula] = {}
    for formula in formulas:
        look()
        members = (
            formula.args
            if isinstance(formula, (Conjunction, Disjunction)) and isinstance(formula, kind)
            else (formula,)
        )
        merged.update((id(member), member) for member in members)
    return tuple(merged.values())


def negation(formula: Formula) -> Formula:
    """The opposite in negation normal form; where a term is undefined, an atom and its opposite are both false."""
    opposite: dict[int, Formula] = {}
    for node in postorder(formula):
        match node:
            case TermComparison(Relation.LE, left, right):
                opposite[id(node)] = compare("<", right, left)
            case TermComparison(Relation.LT, left, right):
                opposite[id(node)] = compare("<=", right, left)
            case TermComparison(_, left, right):
                opposite[id(node)] = disjunction((compare("<", left, right), compare("<", right, left)))
            case Conjunction(args):
                opposite[id(node)] = disjunction(opposite[id(arg)] for arg in args)
            case Disjunction(args):
                opposite[id(node)] = conjunction(opposite[id(arg)] for arg in args)
            case _:
                pass
    return opposite[id(formula)]


def postorder(root: Node, *, terms: bool = True) -> list[Node]:
    """Every node below and including the root once, by identity, children before parents; terms only on demand."""
    order: list[Node] = []
    seen: set[int] = set()
    stack: list[Node | None] = [root]
    while stack:
        node = stack.pop()
        if node is None:
            # the mark above a node whose children are done
            done = stack.pop()
            assert done is not None
            order.append(done)
        elif id(node) not in seen:
            seen.add(id(node))
            children = _children(node, terms=terms)
            if children:
                stack += (node, None)
                stack += reversed(children)
            else:
                order.append(node)
    return order


def _children(node: Node, *, terms: bool) -> tuple[Node, ...]:
    if isinstance(node, (Op, Conjunction, Disjunction)):
        return node.args
    return (node.left, node.right) if terms and isinstance(node, TermComparison) else ()


def flatten(root: Node) -> tuple[Row, ...]:
    """The graph as rows, children first, the root last, equal nodes merged: equal formulas give equal rows."""
    rows: dict[Row, int] = {}
    index: dict[int, int] = {}
    for node in postorder(root):
        if isinstance(node, Op):
            row: Row = (node.op.value, "", tuple([index[id(arg)] for arg in node.args]))
        elif isinstance(node, Var):
            row = ("var", node.name, ())
        elif isinstance(node, Num):
            row = ("num", repr(float(node.value)), ())
        elif isinstance(node, TermComparison):
            row = (node.relation.value, "", (index[id(node.left)], index[id(node.right)]))
        else:
            row = ("and" if isinstance(node, Conjunction) else "or", "", tuple([index[id(arg)] for arg in node.args]))
        index[id(node)] = rows.setdefault(row, len(rows))
    return tuple(rows)


def unflatten(rows: tuple[Row, ...]) -> Node:
    """Build the graph of rows; equal parts are one object."""
    nodes: list[Node] = []
    for kind, text, children in rows:
        nodes.append(_node(kind, text, tuple([nodes[child] for child in children])))
    return nodes[-1]


def _node(kind: str, text: str, children: tuple[Node, ...]) -> Node:
    match kind:
        case "var":
            return Var(text)
        case "num":
            return Num(float(text))
        case "and":
            return Conjunction(children) if children else TRUE  # type: ignore[arg-type]
        case "or":
            return Disjunction(children) if children else FALSE  # type: ignore[arg-type]
        case "<=" | "<" | "==":
            return TermComparison(Relation(kind), *children)  # type: ignore[arg-type]
        case _:
            return Op(Operator(kind), children)  # type: ignore[arg-type]


def free_variables(root: Node) -> tuple[str, ...]:
    """The names of the variables below a node, sorted."""
    return tuple(sorted({node.name for node in postorder(root) if isinstance(node, Var)}))
