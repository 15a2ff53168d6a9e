"""Programs put together by chance end with an answer or a diagnostic: a short seeded part of `hostile_programs.py`."""

import random

import pytest
from hostile_programs import CALLS, FORMS, STATEMENTS, attempt, generated, mutated, sources

from scenicq.errors import CODES

ENDS = {*CODES, "Match", "NoMatch", "Unknown"}


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.one_in(2)
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


HARD = ("10**400", "-1e308", "float('nan')", "10**19", "lambda x: x", "None")


def _places(form):
    count = form.count("{}")
    for place in range(count):
        for hard in HARD:
            yield form.format(*(hard if number == place else "(1, 2)" for number in range(count)))


@pytest.mark.parametrize("form", STATEMENTS)
@pytest.mark.one_in(4)
def test_hard_values_in_every_place_of_every_statement(form):
    for line in _places(form):
        text = f"model scenic.domains.driving.model\nego = new Car\n{line}\n"
        assert attempt(text) in ENDS, text


@pytest.mark.parametrize("form", [*FORMS, *(f"{call}({{}})" for call in CALLS)])
@pytest.mark.one_in(12)
def test_hard_values_in_every_place_of_every_expression(form):
    for expression in _places(form):
        text = f"model scenic.domains.driving.model\nego = new Car\nrequire {expression} < 5\n"
        assert attempt(text) in ENDS, text
