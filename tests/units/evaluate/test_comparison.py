"""What is said of two groups, on objects whose truth is known."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from scenicq.evaluate.comparison import ObjectComparison, compare
from scenicq.evaluate.controls import Likeness


def planted(clusters: int, rate: float, more: float, seed: int, frames: int = 4) -> ObjectComparison:
    """Recordings of frames with an object in question and two others each."""
    rng = np.random.default_rng(seed)
    count = 3 * clusters * frames
    frame = np.repeat(np.arange(clusters * frames), 3)
    zero = np.zeros(count, dtype=np.int64)
    mine = np.arange(count) % 3 == 0
    like = Likeness(zero, zero, np.full(count, 20.0), frame, frame // frames, frame // frames, zero)
    return compare("role x", rng.random(count) < rate + more * mine, mine, ~mine, like, rng)


@pytest.mark.parametrize("seed", range(3))
def test_as_many_recordings_as_it_asks_for_tell(seed: int) -> None:
    """A difference of ten points is told in about 80 of 100 datasets of that size."""
    asked = planted(12, 0.2, 0.0, seed)
    if not asked.because:
        asked = planted(12, 0.2, 0.0, seed + 10)
    assert asked.more is not None
    size = 12 + asked.more
    told = [planted(size, 0.2, 0.1, 100 + number).p_value < 0.05 for number in range(100)]
    assert 0.55 <= np.mean(told) <= 0.99


@pytest.mark.parametrize("rate", [0.05, 0.3])
def test_false_alarms_are_as_rare_as_said(rate: float) -> None:
    found = [planted(12, rate, 0.0, number) for number in range(300)]
    alarms = np.mean([each.p_value < 0.05 for each in found])
    assert alarms <= 0.05 + 2 * math.sqrt(0.05 * 0.95 / 300)
    held = np.mean([each.interval[0] <= 0 <= each.interval[1] for each in found])
    assert held >= 0.92


def test_a_verdict_needs_evidence_either_way() -> None:
    clear = planted(80, 0.1, 0.3, 1)
    assert clear.says == "worse"
    assert clear.because == ""
    assert replace(clear, p_corrected=0.2).says == "too little"
    none = planted(200, 0.05, 0.0, 5, frames=8)
    assert none.says == "no worse"
    assert replace(none, margin=0.001).says == "too little"
    assert planted(80, 0.4, -0.35, 3).says == "better"
    few = planted(5, 0.1, 0.5, 4)
    assert few.says == "too little"
    assert few.because.startswith("it is as much as 5.0 equally large recordings would tell")
    assert "recordings of this kind would tell a difference of 10 points" in few.because
    assert few.beside == "role x: 20 beside others of the same frame"


def test_nothing_to_compare() -> None:
    zero = np.zeros(3, dtype=np.int64)
    like = Likeness(zero, zero, np.full(3, 9.0), zero, zero, zero, zero)
    mine = np.array([True, True, True])
    alone = compare("role x", mine, mine, ~mine, like, np.random.default_rng(0))
    assert (alone.says, alone.alone, alone.share.rate) == ("too little", 1.0, 1.0)
    assert alone.because == "no other object is alike"
    nobody = compare("role x", mine, ~mine, mine, like, np.random.default_rng(0))
    assert (nobody.says, nobody.alone, math.isnan(nobody.share.rate)) == ("too little", 0.0, True)
