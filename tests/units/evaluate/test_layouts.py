"""Planted truths through the command: no false alarm in layouts that once gave many, and what is there is found."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from layouts import LAYOUTS, Judgement, judge, match, plant, predict


def judged(
    run: Callable[..., Any], folder: Path, name: str, count: int, *, planted: bool, seed: int = 0
) -> list[Judgement]:
    layout = LAYOUTS[name]
    more = layout.more if planted else 0.0
    recordings = plant(layout, folder, seed)
    match(run, folder)
    found = []
    for repeat in range(count):
        predict(layout, recordings, folder / "predictions.jsonl", np.random.default_rng((seed, repeat, planted)), more)
        found.append(judge(run, folder, folder / "predictions.jsonl", layout.options, more))
    return found


ALARMED = ("many candidates", "standing ego", "far roles", "one stratum", "6 others", "dark night", "alone by night")
"""Layouts in which nearly every dataset gave a false alarm, when all that counted was a class of distance."""
REFUSED = {
    "far roles": "no other object",
    "one stratum": "no other object",
    "6 others": "independent ones",
    "alone by night": "same `time`",
    "four recordings": "equally large recordings",
    "two vehicles": "equally large vehicles",
}


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] if place % 3 else []) for place, name in enumerate(ALARMED)]
)
@pytest.mark.one_in(9)
def test_layouts_that_gave_false_alarms_give_none(run: Callable[..., Any], tmp_path: Path, name: str) -> None:
    found = judged(run, tmp_path, name, 3, planted=False)
    assert sum(each.worse for each in found) <= 1
    assert not any(each.worse for each in found if each.refused)


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] if place % 2 else []) for place, name in enumerate(REFUSED)]
)
@pytest.mark.one_in(3)
def test_what_is_missing_is_said(run: Callable[..., Any], tmp_path: Path, name: str) -> None:
    (found,) = judged(run, tmp_path, name, 1, planted=True)
    assert found.refused
    assert REFUSED[name] in found.text


@pytest.mark.slow
@pytest.mark.parametrize("name", LAYOUTS)
def test_false_alarms_are_rare_in_every_layout(run: Callable[..., Any], tmp_path: Path, name: str) -> None:
    """Three false alarms in 12 datasets are three chances in a thousand, at a rate of 2.5 % or less."""
    assert sum(each.worse for each in judged(run, tmp_path, name, 12, planted=False, seed=7)) <= 2


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in LAYOUTS if name not in REFUSED])
def test_what_is_there_is_never_denied(run: Callable[..., Any], tmp_path: Path, name: str) -> None:
    found = judged(run, tmp_path, name, 12, planted=True, seed=5)
    assert sum(each.against for each in found) <= 2
    if name not in ("20 others", "tracks", "rare class"):
        assert sum(each.worse for each in found) >= 7
