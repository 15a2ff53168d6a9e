"""Programs put together by chance end with an answer or a diagnostic: a short seeded part of `hostile_programs.py`."""

import random

import pytest
from hostile_programs import attempt, generated, mutated, sources

from scenicq.errors import CODES

ENDS = {*CODES, "Match", "NoMatch", "Unknown"}


@pytest.mark.parametrize("seed", range(4))
def test_generated_programs_end_with_an_answer(seed):
    chance = random.Random(seed)
    for _ in range(40):
        text = generated(chance)
        assert attempt(text) in ENDS, text


@pytest.mark.parametrize("seed", range(4))
def test_mutated_programs_end_with_an_answer(seed):
    chance, known = random.Random(seed), sources()
    for _ in range(15):
        text = mutated(chance.choice(known), known, chance)
        assert attempt(text) in ENDS, text
