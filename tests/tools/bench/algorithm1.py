"""Algorithm 1 of the query paper, as it is printed and as its authors ran it: what the matcher is measured against.

The authors' public prototype (github.com/ek65/Scenic, branch `scenic-query`) writes one SMT-LIB file for each set of
jointly dependent features, starts a shell and a solver process for it, and puts every triangle of the map within the
visible distance into the formula; it goes through the permutations in order. The paper's text also skips those that
begin like one that failed, which the prototype does not. The variants here differ in these points, so that it can be
seen what each of them costs: "as published" is the paper's text, "as prototyped" the prototype. Where the latter is
slower for no good reason, the variants are not: triangles are half planes instead of barycentric coordinates with two
more variables each, a permutation that breaks a class is never asked about, permutations are not listed beforehand, and
a process is forked from one that has the solver loaded.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from unittest.mock import patch

import numpy as np

from scenicq.forest.groups import Group
from scenicq.forest.scenario import Scenario
from scenicq.geometry.cells import triangles
from scenicq.geometry.regions import Region
from scenicq.match.decide.solver_step import ask
from scenicq.match.options import MatchOptions
from scenicq.match.problem.conditioned import condition_group
from scenicq.match.problem.constraints import build_groups
from scenicq.match.problem.observation import observe
from scenicq.match.problem.outcome import Satisfied
from scenicq.smt import region_membership
from scenicq.smt.answer import Solver
from scenicq.store.labels import Label

__all__ = ["VARIANTS", "Variant", "matches"]

VISIBLE_M = 200.0
"""The ego's visible distance in the paper's scalability experiment (section 6)."""


@dataclass(frozen=True, slots=True)
class Variant:
    """A way to run algorithm 1.

    Attributes:
        name: What it is called.
        remembers: Whether permutations that begin like one that failed are skipped (lines 5 and 15).
        process: Whether each formula gets a solver process of its own; a start of Python is not counted.
        whole: Whether formulas hold all triangles in sight, as they are, instead of the cells near the label.
    """

    name: str
    remembers: bool = True
    process: bool = False
    whole: bool = False


VARIANTS = (
    Variant("algorithm 1"),
    Variant("algorithm 1, a process each", process=True),
    Variant("as published", process=True, whole=True),
    Variant("all permutations", remembers=False),
    Variant("all permutations, a process each", remembers=False, process=True),
    Variant("as prototyped", remembers=False, process=True, whole=True),
)


def matches(
    scenario: Scenario, label: Label, variant: Variant, solver: Solver, options: MatchOptions, tick: Callable[[], None]
) -> bool:
    """Whether a label matches.

    Args:
        scenario: The scenario.
        label: The label.
        variant: How the algorithm is run.
        solver: Decides the formulas.
        options: The options.
        tick: Called for each permutation; ends the search by an exception.
    """
    if not variant.whole:
        return _permute(scenario, label, variant, solver, options, tick)
    with _whole_map(label):
        return _permute(scenario, label, variant, solver, options, tick)


def _permute(
    scenario: Scenario, label: Label, variant: Variant, solver: Solver, options: MatchOptions, tick: Callable[[], None]
) -> bool:
    things = [label.ego, *label.objects]
    seen = [observe(thing) for thing in things]
    roles = [thing.index for thing in scenario.objects if thing.index != scenario.ego]
    groups: tuple[Group, ...] = build_groups(
        scenario, (*(frozenset(seen[0]) for _ in scenario.objects), frozenset()), options
    )
    bad: set[tuple[int, ...]] = set()
    for chosen in itertools.permutations(range(1, len(things)), len(roles)):
        tick()
        if any(chosen[:size] in bad for size in range(1, len(chosen) + 1)):
            continue
        cast = {scenario.ego: 0, **dict(zip(roles, chosen, strict=True))}
        if any(things[cast[i]].category != scenario.objects[i].category for i in roles):
            continue
        for group in groups:
            observed = {(i, name): value for i in group.objects for name, value in seen[cast[i]].items()}
            if not isinstance(ask([condition_group(group, observed)], options, solver), Satisfied):
                if variant.remembers:
                    last = max((roles.index(i) for i in group.objects if i in roles), default=-1)
                    bad.add(chosen[: last + 1])
                break
        else:
            return True
    return False


@contextmanager
def _whole_map(label: Label) -> Iterator[None]:
    """Put every triangle within the ego's visible distance into formulas."""
    x, y = label.ego.x, label.ego.y
    around = (x - VISIBLE_M, y - VISIBLE_M, x + VISIBLE_M, y + VISIBLE_M)

    def in_sight(region: Region, _: object) -> list[np.ndarray]:
        return triangles(region, around)

    with patch.object(region_membership, "convex_cells", in_sight):
        yield
