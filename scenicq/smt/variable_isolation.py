"""Solving equalities for a variable, so that sample points satisfy them.

`x == f(y)` is met by no random point. Where an equality can be solved for a variable by inverse arithmetic, the
variable is computed from the others instead of being sampled. Part of the portable solver, and only a guide for its
search: a division by zero here spoils a sample, not a proof.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from scenicq.smt.evaluation import Evaluator
from scenicq.smt.formula import Op, Operator, Relation, Term, TermComparison, Var, free_variables, postorder

__all__ = ["Recipe", "recipes"]


@dataclass(frozen=True, slots=True)
class Recipe:
    """How to compute a variable from variables that are sampled or computed before."""

    name: str
    value: Evaluator


def recipes(atoms: Iterable[TermComparison]) -> tuple[Recipe, ...]:
    """Choose equalities and solve each for a variable, in an order in which they can be computed."""
    needs: dict[str, frozenset[str]] = {}
    found: dict[str, Evaluator] = {}
    for atom in atoms:
        if atom.relation is not Relation.EQ:
            continue
        for name in _candidates(atom):
            if name in found:
                continue
            solution = _solved(atom, name)
            if solution is None:
                continue
            needed = _closure(frozenset(free_variables(solution)), needs)
            if name not in needed:
                found[name] = Evaluator(solution)
                needs[name] = frozenset(free_variables(solution))
                break
    order: list[str] = []
    waiting = sorted(found, key=lambda name: len(_closure(needs[name], needs)), reverse=True)
    while waiting:
        name = waiting[-1]
        before = sorted(other for other in needs[name] if other in found and other not in order)
        if before:
            waiting.extend(before)
            continue
        waiting.pop()
        if name not in order:
            order.append(name)
    return tuple(Recipe(name, found[name]) for name in order)


def _closure(names: frozenset[str], needs: dict[str, frozenset[str]]) -> set[str]:
    """The names and all that they are computed from."""
    closure: set[str] = set()
    stack = list(names)
    while stack:
        name = stack.pop()
        if name not in closure:
            closure.add(name)
            stack.extend(needs.get(name, ()))
    return closure


def _candidates(atom: TermComparison) -> list[str]:
    """The variables of an atom, those first that are a whole side of it."""
    sides = [side.name for side in (atom.left, atom.right) if isinstance(side, Var)]
    return [*sides, *(name for name in free_variables(atom) if name not in sides)]


def _solved(atom: TermComparison, name: str) -> Term | None:
    """The term that a variable equals, if it occurs once and under invertible operators only."""
    holders = {id(node) for node in postorder(atom) if isinstance(node, Var) and node.name == name}
    for node in postorder(atom):
        if isinstance(node, Op) and any(id(arg) in holders for arg in node.args):
            holders.add(id(node))
    side, other = atom.left, atom.right
    if id(side) not in holders:
        side, other = other, side
    if id(other) in holders:
        return None
    while isinstance(side, Op):
        inside = [arg for arg in side.args if id(arg) in holders]
        outside = [arg for arg in side.args if id(arg) not in holders]
        if len(inside) != 1:
            return None
        inverse = _inverse(side, inside[0], outside, other)
        if inverse is None:
            return None
        side, other = inside[0], inverse
    return other


def _inverse(term: Op, inside: Term, outside: list[Term], value: Term) -> Term | None:
    first = term.args[0] is inside
    match term.op:
        case Operator.ADD:
            return Op(Operator.SUB, (value, Op(Operator.ADD, tuple(outside)))) if outside else value
        case Operator.MUL:
            return Op(Operator.DIV, (value, Op(Operator.MUL, tuple(outside)))) if outside else value
        case Operator.NEG:
            return Op(Operator.NEG, (value,))
        case Operator.SUB:
            return Op(Operator.ADD if first else Operator.SUB, (value, outside[0]) if first else (outside[0], value))
        case Operator.DIV:
            return Op(Operator.MUL if first else Operator.DIV, (value, outside[0]) if first else (outside[0], value))
        case _:
            return None
