"""The variables of a problem that is being made, and what each random variable of the forest becomes among them."""

from __future__ import annotations

import math

from scenicq.errors import CannotEvaluate
from scenicq.forest.bounds import scalar_bounds
from scenicq.forest.nodes import ArithmeticOp, Constant, DiscreteRange, Identity, Index, Normal, Range, TruncatedNormal
from scenicq.limits import LIMITS
from scenicq.smt.problem import Formula, Term, Variable
from scenicq.smt.terms import apply, compare, disjunction

__all__ = ["ScalarLeaf", "Unknowns"]

ScalarLeaf = Range | Normal | TruncatedNormal | DiscreteRange | Index


class Unknowns:
    """The variables of one problem.

    Attributes:
        variables: All of them, in order of their making.
        side: What holds of them besides the constraints.
        made: The variables of each random variable: one, or two for a point.
        whole: The random variables that are whole numbers.
    """

    def __init__(self) -> None:
        """Begin without variables."""
        self.variables: list[Variable] = []
        self.side: list[Formula] = []
        self.made: dict[Identity, tuple[Variable, ...]] = {}
        self.whole: set[Identity] = set()

    def add(self, prefix: str, low: float, high: float, identity: Identity | None = None) -> Variable:
        """Add a variable with a closed range, which is a new random number unless it is told which."""
        self.variables.append(Variable.of(f"{prefix}{len(self.variables)}", low, high, identity))
        return self.variables[-1]

    def fresh(self, prefix: str, low: float = -math.inf, high: float = math.inf) -> Range:
        """A new variable as a term."""
        return self.add(prefix, low, high).leaf

    def number(self, node: ScalarLeaf, args: list[Term]) -> Term:
        """The variable of a random number (figure 18).

        Args:
            node: The random number.
            args: Codes of the parameters of its distribution.

        Raises:
            CannotEvaluate: It is a whole number out of too many, or out of a random range.
        """
        if node.identity in self.made:
            return self.made[node.identity][0].leaf
        low, high = scalar_bounds(node)
        made = self.add(type(node).__name__.lower(), low, high, node.identity)
        self.made[node.identity] = (made,)
        variable = made.leaf
        match node:
            case Range() if not all(isinstance(arg, Constant) for arg in args):
                ends = apply(ArithmeticOp.MIN, *args), apply(ArithmeticOp.MAX, *args)
                self.side += [compare("<=", ends[0], variable), compare("<=", variable, ends[1])]
            case TruncatedNormal() if not all(isinstance(arg, Constant) for arg in args):
                self.side += [compare("<=", args[2], variable), compare("<=", variable, args[3])]
            case DiscreteRange() | Index():
                if not math.isfinite(high - low) or high - low > LIMITS.integer_values:
                    raise CannotEvaluate("an integer from a random or very long range")
                numbers = range(math.ceil(low), math.floor(high) + 1)
                self.whole.add(node.identity)
                self.side.append(disjunction(compare("==", variable, float(n)) for n in numbers))
            case _:
                pass
        return variable
