"""Do programs made of scenarios run in Scenic as their definition says (`tests/oracles/runs/modular_definition.py`)?

Usage: python modular.py FIRST LAST, in the environment that has `scenic` and not `scenicq`.

Random programs are run by Scenic on random samples, on which its objects are where a row says: which conditions hold.
What `tests/oracles/runs/test_modular.py` asks of scenicq is asked of Scenic here, but for `terminate when` in scenarios
that others run, which Scenic 3.1.1 takes for a requirement, and for choices, which it makes at random.
"""

from __future__ import annotations

import random
import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[2] / "oracles/runs"))

from modular_definition import ATOMS, STEP_S, all_ends, random_program, text_of
from scenic import scenarioFromString
from scenic.core.distributions import RejectionException
from scenic.core.errors import ScenicSyntaxError
from scenic.core.simulators import Simulation, Simulator, TerminationType
from scenic.core.vectors import Vector

N = 8
PLACE_Y = 50


class Rows(Simulation):
    """A simulation in which conditions hold where rows say."""

    def __init__(self, scene: Any, rows: list[list[bool]], **options: Any) -> None:
        """Run on some rows, one for each step."""
        self.rows = rows
        super().__init__(scene, **options)

    def createObjectInSimulator(self, obj: Any) -> None:
        """Nothing."""

    def actionsAreCompatible(self, agent: Any, actions: Any) -> bool:
        """All are."""
        return True

    def step(self) -> None:
        """Nothing: rows are read by the number of the step."""

    def getProperties(self, obj: Any, properties: Any) -> dict[str, Any]:
        """The first objects are where their conditions hold or not, all others where they are."""
        found = {name: getattr(obj, name) for name in properties}
        number = round(obj.position.y) - PLACE_Y
        if number >= 0:
            holds = self.rows[min(self.currentTime, len(self.rows) - 1)][number]
            found["position"] = Vector(number + (1.5 if holds else 0.5), obj.position.y, 0)
        return found


class RowSimulator(Simulator):
    """Makes such simulations."""

    def __init__(self, rows: list[list[bool]]) -> None:
        """Take the rows."""
        super().__init__()
        self.rows = rows

    def createSimulation(self, scene: Any, **options: Any) -> Rows:
        """One of them."""
        return Rows(scene, self.rows, **options)


def outcome(scene: Any, rows: list[list[bool]]) -> tuple[str, int]:
    """What Scenic makes of some rows: "over" at a step, "lasts" or "rejected"."""
    simulation = RowSimulator(rows).simulate(scene, maxSteps=len(rows) - 1, maxIterations=1, timestep=STEP_S)
    if simulation is None:
        return "rejected", -1
    if simulation.result.terminationType is TerminationType.timeLimit:
        return "lasts", len(rows) - 1
    return "over", simulation.currentTime


def expected(program: Any, rows: list[list[bool]]) -> tuple[str, int]:
    """What the definition makes of them."""
    found = all_ends(program, rows, [STEP_S * step for step in range(len(rows))], 0)
    assert found is not None
    ((ends, over),) = found
    if over:
        return ("over", max(ends)) if ends else ("rejected", -1)
    return ("lasts", len(rows) - 1) if len(rows) - 1 in ends else ("rejected", -1)


def main() -> None:
    """Compare."""
    first, last = map(int, sys.argv[1:3])
    compared, kinds, wrong = 0, dict.fromkeys(("over", "lasts", "rejected"), 0), 0
    for seed in range(first, last):
        draw = random.Random(seed)
        program = random_program(draw, whens=False, choices=False)
        for _ in range(4):
            # a simulation that is rejected as it begins leaves its scenario running
            rows = [[draw.random() < 0.6 for _ in range(ATOMS)] for _ in range(draw.randint(2, N))]
            try:
                scenario = scenarioFromString(text_of(program, rows[0]), mode2D=True)
            except ScenicSyntaxError:
                # what its compiler makes of interrupts within interrupts is no Python
                continue
            try:
                scene, _ = scenario.generate(maxIterations=1)
            except RejectionException:
                # what is required of all samples does not hold of the first one
                assert expected(program, rows)[0] == "rejected"
                continue
            told, meant = outcome(scene, rows), expected(program, rows)
            compared += 1
            kinds[told[0]] += 1
            # whether the steps are over is asked before behaviors run
            if told != meant and (told[0], meant[0], told[1]) != ("lasts", "over", meant[1]):
                wrong += 1
                print(f"seed {seed}: Scenic says {told}, the definition {meant}\n{text_of(program)}")
                for row in rows:
                    print([int(each) for each in row])
    print(f"{compared} compared, {kinds}, {wrong} differ")


if __name__ == "__main__":
    main()
