"""Generate and match, perturb: what a program draws matches it, and what is certainly outside of it does not."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
from examining import examine
from examples import Example, examples

from scenicq.errors import ScenarioError

HANDFUL = [
    "sample:01_pedestrian_facing_ego", "sample:02_crossing_cars", "sample:03_against_traffic",
    "sample:04_two_lane_traffic", "sample:05_cut_in_from_right", "paper:badly parked car", "paper:overlapping cars",
    "paper:noise", "paper:query paper, figure 6", "conformance:driving_following", "conformance:not_visible",
    "conformance:uniform_objects", "match:shared", "match:hidden requirement",
    "paper:mars", next(name for name, example in examples().items() if "abs(x - 1) // 1" in example.text),
    next(name for name, example in examples().items() if "int(Range(-3, 3))" in example.text),
]  # fmt: skip
NO_SCENE = {
    # about an element that the street does not have
    "conformance:driving_successor": "map-lacks",
    # asks for a point out of sight in an area that is all in sight
    "conformance:sector_wider_than_120": "impossible-requirement",
    # holds only where requirements are checked after the noise, which the language paper does before
    "conformance:mutate_require": "impossible-requirement",
}
NO_SCENES = ("dynamic:", "cookbook-over-time:", "warnings:")
"""Pages of programs about what happens over time, and of programs that cannot be meant."""
OVER_TIME = re.compile(
    r"^\s*(require (not )?\(?(always|eventually|next)\b|terminate when|terminate after)", re.MULTILINE
)
OTHERS = re.compile(r"^from scenicq\.labels import .*\b(others|count|nearest)\b", re.MULTILINE)
"""What asks of all objects matches no more among others; `tests/oracles/labels/test_others.py` judges it."""
EXAMINED = [
    name for name, each in examples().items()
    if not name.startswith(NO_SCENES) and not OTHERS.search(each.text)
    and (each.initial or not OVER_TIME.search(each.text))
]  # fmt: skip


def check(example: Example, count: int) -> None:
    if example.name in NO_SCENE:
        with pytest.raises(ScenarioError) as caught:
            examine(example, count, 7)
        assert caught.value.diagnostics[0].code == NO_SCENE[example.name]
        return
    outcome = examine(example, count, 7)
    assert outcome.faults == []
    assert outcome.drawn == outcome.matched == outcome.enforced == count
    assert outcome.excluded == outcome.pushed


@pytest.mark.parametrize("name", HANDFUL)
@pytest.mark.one_in(4)
def test_some_scenes_match_and_do_not_once_they_are_pushed_out(name: str) -> None:
    check(examples()[name], 2)


@pytest.mark.slow
@pytest.mark.parametrize("name", EXAMINED)
def test_scenes_of_every_program_match_and_do_not_once_they_are_pushed_out(name: str) -> None:
    check(examples()[name], 2)
