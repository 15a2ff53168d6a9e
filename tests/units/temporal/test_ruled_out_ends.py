"""An end that the program's own values rule out is none: what matches is open-ended, wherever the end is written."""

import pytest

from scenicq.compiler.program import compile_scenario
from scenicq.errors import Source
from scenicq.geometry.default_street import street

HEAD = "ego = new Object in everywhere, facing Range(0, 360) deg\n"
WAYS = {
    "terminate when": "terminate when {0}\n",
    "terminate simulation when": "terminate simulation when {0}\n",
    "monitor": "monitor M(limit):\n    while True:\n        if {0}:\n            terminate\n        wait\n"
    "require monitor M(None)\n",
    "behavior": "limit = None\nbehavior B():\n    while True:\n        if {0}:\n            terminate\n        wait\n"
    "ego = new Object in everywhere, facing Range(0, 360) deg, with behavior B\n",
}


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize(
    ("condition", "says"),
    [
        ("False", False),
        ("(distance from ego to ego) > 5", False),
        ("limit is not None and ego.speed > limit", False),
        ("ego.speed > 5", True),
        ("True", True),
    ],
)
def test_only_an_end_that_a_run_can_come_to_says_when_the_program_ends(way, condition, says):
    head = "" if way == "behavior" else HEAD
    head += "limit = None\n" if way.startswith("terminate") else ""
    program = compile_scenario(Source("p.scenic", head + WAYS[way].format(condition)), street(), behaviors="guards")
    assert program.dynamics is not None
    assert program.dynamics.terminates is says
