"""The portable solver: delta-complete branch and prune over interval contractors.

Boxes of values are narrowed by contractors, which never lose a solution, and split, until none is left (the problem is
unsatisfiable) or a point that satisfies the constraint is met. A point that satisfies it only within the precision is
kept while the search goes on a little, for a better one or for the proof that there is none.

The search takes the box whose sample comes nearest to satisfying the constraint, and from time to time the oldest.
"""

from __future__ import annotations

import heapq
import math
import random
import time
from collections import deque
from dataclasses import dataclass

from scenicq.budget import Exhausted
from scenicq.limits import LIMITS
from scenicq.smt.affine import EMPTY, ENTAILED
from scenicq.smt.answer import Answer, NoAnswer, Sat, Unsat
from scenicq.smt.evaluation import holds
from scenicq.smt.formula import Problem, Relation, TermComparison, postorder
from scenicq.smt.system import Alternative, System, compile_system, contract_choice
from scenicq.smt.variable_isolation import Recipe, recipes

__all__ = ["check"]

GAIN = 0.9
"""A round of contraction counts if it cuts the width of a variable to this part."""
EXACT = 1e-9
"""An equality that fails by no more holds but for rounding."""
SAMPLES = 2
"""Points that are tried in each box."""
OVERLAP = 1.5
"""A box is split by a choice if the alternatives together are no more than this part of its volume."""
OLDEST_EVERY = 4
"""How often the oldest box is taken."""


@dataclass(slots=True)
class _Box:
    """A box of the search with what must still hold in it."""

    low: list[float]
    high: list[float]
    systems: tuple[System, ...]
    choices: list[list[Alternative]]
    recipes: tuple[Recipe, ...] = ()
    done: bool = False


def check(problem: Problem, *, precision: float, timeout_s: float) -> Answer:
    """Decide a problem; see `Solver.check`."""
    if any(variable.low > variable.high for variable in problem.variables):
        return Unsat()
    index = {variable.name: number for number, variable in enumerate(problem.variables)}
    try:
        system = compile_system(problem.constraint, index)
    except Exhausted as error:
        return NoAnswer(error.reason)
    return _Search(problem, system, index, precision).run(time.thread_time() + timeout_s)


class _Search:
    """One run of branch and prune."""

    def __init__(self, problem: Problem, system: System, index: dict[str, int], precision: float) -> None:
        self._problem = problem
        self._system = system
        self._index = index
        self._precision = precision
        self._names = [variable.name for variable in problem.variables]
        self._random = random.Random(0)
        self._best: Sat | None = None
        self._best_margin = -math.inf
        atoms = [node for node in postorder(problem.constraint, terms=False) if isinstance(node, TermComparison)]
        self._enough = -EXACT if any(atom.relation is Relation.EQ for atom in atoms) else 0.0
        self._scales: list[float] = []
        self._cookbook: dict[tuple[int, ...], tuple[Recipe, ...]] = {}

    def run(self, deadline: float) -> Answer:
        """Search until decided, or until the time or the number of boxes is used up."""
        low = [variable.low for variable in self._problem.variables]
        high = [variable.high for variable in self._problem.variables]
        fresh = [_Box(low, high, (self._system,), _opened(self._system, low, high))]
        queue: list[tuple[float, int, _Box]] = []
        ages: deque[_Box] = deque()
        undecided = False
        patience, count = LIMITS.solver_patience, 0
        while True:
            for box in fresh:
                count += 1
                patience -= self._best is not None
                if time.thread_time() > deadline:
                    return self._best or NoAnswer("timeout")
                if not self._narrow(box):
                    continue
                margin = self._sample(box)
                if self._best and self._best_margin >= self._enough:
                    return self._best
                heapq.heappush(queue, (-margin, count, box))
                ages.append(box)
            if self._best and patience < 0:
                return self._best
            if count > LIMITS.solver_boxes:
                return NoAnswer("budget")
            box = _next(queue, ages, count)
            if box is None:
                break
            fresh = self._branch(box)
            undecided = undecided or not fresh
        if undecided:
            return self._best or NoAnswer("budget")
        return Unsat()

    def _narrow(self, box: _Box) -> bool:
        """Contract a box until that gains little; False if it is empty."""
        low, high = box.low, box.high
        for _ in range(LIMITS.solver_sweeps):
            old_low, old_high = low[:], high[:]
            systems: list[System] = []
            for system in box.systems:
                said = system.contract(low, high)
                if said == EMPTY:
                    return False
                if said != ENTAILED:
                    systems.append(system)
            choices: list[list[Alternative]] = []
            for choice in box.choices:
                said, live = contract_choice([system for system, _, _ in choice], low, high)
                if said == EMPTY:
                    return False
                if len(live) == 1:
                    systems.append(live[0][0])
                    choices.extend(_opened(live[0][0], low, high))
                elif live:
                    choices.append(live)
            box.systems, box.choices = tuple(systems), choices
            if not _gained(old_low, old_high, low, high):
                break
        if not self._scales:
            widths = [b - a for a, b in zip(low, high, strict=True)]
            self._scales = [1.0 if math.isinf(width) else max(width, 1e-9) for width in widths]
        return True

    def _sample(self, box: _Box) -> float:
        """Try points of a box and keep the best; the greatest margin met."""
        box.recipes = self._recipes(box.systems)
        most = -math.inf
        for point in range(SAMPLES):
            values = {name: self._pick(box, number, point) for number, name in enumerate(self._names)}
            margin = self._margin(box, values)
            most = max(most, margin)
            known = -math.inf if self._best is None else self._best_margin
            if margin >= -self._precision and margin > known and holds(self._problem, values, self._precision):
                self._best, self._best_margin = Sat(values), margin
            if margin >= self._enough:
                break
        return most

    def _pick(self, box: _Box, number: int, point: int) -> float:
        low, high = box.low[number], box.high[number]
        if point == 0 or math.isinf(high - low):
            return _middle(low, high)
        return min(high, max(low, low + (high - low) * self._random.random()))

    def _margin(self, box: _Box, values: dict[str, float]) -> float:
        """Complete a point by the recipes, in place, and say by how much it satisfies what must hold in the box."""
        margin = math.inf
        for recipe in box.recipes:
            value = recipe.value(values)
            variable = self._problem.variables[self._index[recipe.name]]
            if not math.isfinite(value):
                return -math.inf
            values[recipe.name] = value
            margin = min(margin, value - variable.low, variable.high - value)
        for system in box.systems:
            margin = min(margin, system.evaluator(values))
        for choice in box.choices:
            margin = min(margin, max(system.margin(values) for system, _, _ in choice))
        return margin

    def _recipes(self, systems: tuple[System, ...]) -> tuple[Recipe, ...]:
        key = tuple(id(system) for system in systems if system.equalities)
        if key not in self._cookbook:
            atoms = [atom for system in systems for atom in system.equalities]
            self._cookbook[key] = recipes(atoms)
        return self._cookbook[key]

    def _branch(self, box: _Box) -> list[_Box]:
        """Split a box by a choice or by a variable; no boxes if it is too small for either."""
        used = {number for system in box.systems for number in system.variables}
        used.update(number for choice in box.choices for system, _, _ in choice for number in system.variables)
        wide = [number for number in used if self._splittable(box.low[number], box.high[number])]
        computed = {self._index[recipe.name] for recipe in box.recipes}
        free = [number for number in wide if number not in computed] or wide
        shares = [sum(_share(box, alternative, wide) for alternative in choice) for choice in box.choices]
        if shares and (min(shares) <= OVERLAP or not free):
            return _split_by_choice(box, shares.index(min(shares)))
        if not free:
            return []
        number = max(free, key=lambda number: ((box.high[number] - box.low[number]) / self._scales[number], -number))
        return _bisect(box, number)

    def _splittable(self, low: float, high: float) -> bool:
        if math.isinf(high - low):
            return low < LIMITS.solver_reach and high > -LIMITS.solver_reach
        return high - low > max(self._precision * 1e-3, 1e-12 * max(abs(low), abs(high)), 1e-15)


def _opened(system: System, low: list[float], high: list[float]) -> list[list[Alternative]]:
    """The choices of a system, each alternative with the whole box."""
    return [[(alternative, low, high) for alternative in choice] for choice in system.choices]


def _gained(old_low: list[float], old_high: list[float], low: list[float], high: list[float]) -> bool:
    for a, b, c, d in zip(old_low, old_high, low, high, strict=True):
        if (a != c or b != d) and not d - c > GAIN * (b - a):
            return True
    return False


def _middle(low: float, high: float) -> float:
    """A point between two ends, which may be infinite."""
    if math.isinf(low):
        return 0.0 if math.isinf(high) else high - max(1.0, abs(high))
    if math.isinf(high):
        return low + max(1.0, abs(low))
    return low / 2 + high / 2


def _share(box: _Box, alternative: Alternative, numbers: list[int]) -> float:
    """The part of a box's volume that an alternative leaves."""
    _, low, high = alternative
    share = 1.0
    for number in numbers:
        whole = box.high[number] - box.low[number]
        part = min(high[number], box.high[number]) - max(low[number], box.low[number])
        share *= 1.0 if math.isinf(part) else max(part, 0.0) / whole
    return share


def _split_by_choice(box: _Box, place: int) -> list[_Box]:
    others = box.choices[:place] + box.choices[place + 1 :]
    children: list[_Box] = []
    for system, low, high in box.choices[place]:
        lower = list(map(max, low, box.low))
        upper = list(map(min, high, box.high))
        if all(a <= b for a, b in zip(lower, upper, strict=True)):
            opened = _opened(system, lower, upper)
            children.append(_Box(lower, upper, (*box.systems, system), others + opened))
    return children


def _bisect(box: _Box, number: int) -> list[_Box]:
    middle = _middle(box.low[number], box.high[number])
    lower = _Box(box.low[:], box.high[:], box.systems, box.choices)
    upper = _Box(box.low[:], box.high[:], box.systems, box.choices)
    lower.high[number] = upper.low[number] = middle
    return [lower, upper]


def _next(queue: list[tuple[float, int, _Box]], ages: deque[_Box], count: int) -> _Box | None:
    """The most promising box that is left, or the oldest."""
    while queue and ages:
        box = ages.popleft() if count % OLDEST_EVERY == 0 else heapq.heappop(queue)[2]
        if not box.done:
            box.done = True
            return box
    return None
