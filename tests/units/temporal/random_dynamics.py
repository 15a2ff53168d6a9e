"""Programs over time drawn at random: requirements, monitors, and what ends a run."""

from __future__ import annotations

import random

from test_ltlf import ATOMS, random_formula

from scenicq.errors import Source, Span
from scenicq.forest.temporal import (
    Atom,
    Dynamics,
    End,
    Goto,
    Process,
    Reject,
    TemporalRequirement,
    Terminate,
    Termination,
    Test,
    Wait,
)

SOURCE = Source("p.scenic", "x" * 100)


def random_monitor(draw: random.Random) -> Process:
    """A graph of steps; every circle holds a `Wait`."""
    count = draw.randint(2, 7)
    steps: list[object] = []
    for number in range(count):
        later = [draw.randint(number + 1, count) for _ in range(2)]
        kind = draw.choices(["test", "wait", "goto", "terminate", "reject", "again"], [35, 25, 10, 10, 10, 10])[0]
        steps.append(
            {
                "test": Test(Atom(draw.randrange(ATOMS)), *later), "wait": Wait(draw.randint(0, count)),
                "goto": Goto(later[0]), "terminate": Terminate(Span(SOURCE, 1, 2)),
                "reject": Reject(Span(SOURCE, 3, 4)), "again": Wait(0),
            }[kind]
        )  # fmt: skip
    return Process(Span(SOURCE, 50, 51), (*steps, End()))


def random_dynamics(draw: random.Random) -> Dynamics:
    formulas = [random_formula(draw, 3) for _ in range(draw.randint(0, 2))]
    ends = [
        Termination(Span(SOURCE, 90, 91), Atom(draw.randrange(ATOMS)), simulation=draw.random() < 0.5)
        for _ in range(draw.choice([0, 0, 1, 2]))
    ]
    ends += [Termination(Span(SOURCE, 92, 93), after_s=draw.choice([0.5, 1.0, 2.0]))] if draw.random() < 0.3 else []
    monitors = [random_monitor(draw) for _ in range(draw.choice([0, 0, 1, 1, 2]))]
    requirements = [TemporalRequirement(formula, Span(SOURCE, k, k + 1)) for k, formula in enumerate(formulas)]
    return Dynamics((), tuple(requirements), tuple(ends), tuple(monitors))
