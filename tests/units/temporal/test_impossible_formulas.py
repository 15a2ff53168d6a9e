"""A formula that is refused as impossible holds on no trace; `holds` is the definition."""

from __future__ import annotations

import itertools
import random

from interval_definition import Condition, holds, random_formula, text_of

from scenicq.compiler.program import compile_scenario
from scenicq.errors import ScenarioError, Source
from scenicq.geometry.default_street import street
from scenicq.geometry.network import Network

OPEN = Condition("(ego.position.x > 0)", lambda *_: None)
KNOWN = {Condition("(1 > 2)", lambda *_: False): False, Condition("(1 < 2)", lambda *_: True): True}
SAMPLES = 3


def is_possible(formula: tuple) -> bool:
    """Whether some trace of at most three samples satisfies a formula."""
    for n in range(1, SAMPLES + 1):
        for values in itertools.product([False, True], repeat=n):
            if holds(formula, lambda atom, k, values=values: KNOWN.get(atom, values[k]), 0, n - 1):
                return True
    return False


def code_of(program: str, network: Network) -> str | None:
    """What is wrong with a program."""
    try:
        compile_scenario(Source("p.scenic", program), network, behaviors="guards")
    except ScenarioError as error:
        return error.diagnostics[0].code
    return None


def test_what_is_refused_holds_on_no_trace():
    draw, network, refused, impossible = random.Random(5), street(), 0, 0
    for _ in range(300):
        formula = "always", random_formula(draw, lambda: draw.choice([OPEN, *KNOWN]), 3)
        impossible += not is_possible(formula)
        program = f"ego = new Object at Range(-9, 9) @ 0, facing 0\nrequire {text_of(formula)}\n"
        code = code_of(program, network)
        assert code in (None, "impossible-requirement"), program
        if code is not None:
            assert not is_possible(formula), program
            refused += 1
    assert 2 * refused > impossible > 0
