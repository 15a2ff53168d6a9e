"""Scenes of programs that ask of label objects without a role: every one that is drawn matches its program."""

from __future__ import annotations

import pytest

from scenicq.compiler.program import compile_scenario
from scenicq.errors import Source
from scenicq.exporters.sample import sample_labels
from scenicq.geometry.default_street import street
from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import EXACT
from scenicq.match.verdict import Match

HEAD = (
    "model scenic.domains.driving.model\nfrom scenicq.labels import others, count, nearest\n"
    "ego = new Car on road\na = new Car on road\nb = new Pedestrian on sidewalk\nc = new Car on road\n"
)
ASKED = [
    "a is nearest(Car)",
    "not (a is nearest(Object))",
    "(distance to nearest(Car)) < 30",
    "count(Car, within=CircularRegion(ego, 40)) >= 1",
    "count(Car, within=CircularRegion(ego.position, 40)) >= 1",
    "count(Car) == 2 and count(Object) == 3",
    "not any((distance to d) < 1000 for d in others(Object))",
    "all(d.speed > 99 for d in others(Car)) and len(others(Car)) == 0",
    "nearest(Pedestrian).position.x > ego.position.x",
]


@pytest.mark.parametrize("asked", ASKED)
def test_scenes_that_are_drawn_match(asked):
    network = street()
    scenario = compile_scenario(Source("p.scenic", f"{HEAD}require {asked}\n"), network)
    matcher = Matcher(scenario, MatchOptions(tolerance=EXACT))
    for label in sample_labels(scenario, 4, seed=3):
        assert isinstance(matcher.match(label), Match)
