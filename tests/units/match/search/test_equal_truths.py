"""Truth values that must be equal, or not: alternatives, decided without a solver as plain evaluation says."""

from __future__ import annotations

import random

import pytest
from scenes import STREET, compiled

from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import Tolerance
from scenicq.match.verdict import Match, NoMatch
from scenicq.store.labels import Label, LabelObject

HEAD = (
    "model scenic.domains.driving.model\nx = Range(0, 2)\ny = Range(0, 4)\nz = Range(0, 1)\n"
    "ego = new Car in everywhere, facing 0 deg\nother = new Car at x @ y, facing 0 deg\n"
)
OBSERVED = ("x > 1", "y > 2")
HIDDEN = ("z > 0.5", "z < 0.2")


def composed(rng: random.Random, depth: int) -> str:
    """A condition on what is observed and on what is hidden."""
    if depth == 0:
        return rng.choice((*OBSERVED, *HIDDEN))
    left, right = (f"({composed(rng, rng.randrange(depth))})" for _ in range(2))
    return rng.choice((f"{left} == {right}", f"{left} != {right}", f"not {left}", f"{left} and {right}"))


@pytest.mark.parametrize("seed", range(40))
@pytest.mark.one_in(3)
def test_equal_truths_are_decided_as_evaluation_says(seed):
    rng = random.Random(seed)
    told = composed(rng, 3)
    matcher = Matcher(
        compiled(f"{HEAD}require {told}\n", STREET), MatchOptions(tolerance=Tolerance(position=0.1, heading=0.1))
    )
    for x in (0.5, 1.5):
        for y in (1.0, 3.0):
            other = LabelObject("other", "Car", "car", x, y, 0.0, 2.0, 4.5)
            ego = LabelObject("ego", "Car", "car", 30.0, 30.0, 0.0, 2.0, 4.5)
            verdict = matcher.match(Label("frame", "recording", 0, "street", ego, (other,)))
            expected = any(eval(told, {"x": x, "y": y, "z": z}) for z in (0.1, 0.4, 0.9))
            assert isinstance(verdict, Match if expected else NoMatch), (told, x, y, verdict)
