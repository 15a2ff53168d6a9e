"""What is said of the arguments of a call speaks of those that the program gives, and of no others."""

from __future__ import annotations

import re

import pytest

from scenicq.compiler.builtins import language_names, mathematics
from scenicq.compiler.region_attributes import REGION_METHODS
from scenicq.compiler.values import Builtin
from scenicq.errors import ScenarioError

from .scenes import compiled

OWN = ["filter", "map", "sorted", "any", "all", "callable", "RelativeHeading", "AngleTo", "CanSee", "Follow", "Front"]
CALLS = [
    *(name for name, value in language_names().items() if isinstance(value, Builtin)),
    *OWN,
    *(f"math.{name}" for name, value in mathematics().items() if isinstance(value, Builtin)),
    *(f"disc.{name}" for name in REGION_METHODS),
    *(f"network.{name}" for name in ("laneAt", "roadAt", "elementAt")),
    *("ego.distanceTo", "ego.angleTo", "roadDirection.followFrom", "'a'.upper", "[1].append"),
]


@pytest.mark.parametrize("count", [0, 7])
@pytest.mark.parametrize("name", CALLS)
def test_no_argument_is_spoken_of_that_the_program_does_not_give(name: str, count: int) -> None:
    head = "import math\nmodel scenic.domains.driving.model\nego = new Car\ndisc = CircularRegion((0, 0), 3)\n"
    try:
        compiled(f"{head}param p = {name}({', '.join('1' * count)})\n")
    except ScenarioError as error:
        told = error.diagnostics[0].label
        assert "span" not in told
        assert "run" not in told.split()
        given = re.search(r"(\d+) (?:were |was )?given", told)
        assert given is None or int(given[1]) == count
