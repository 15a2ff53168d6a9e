"""Do scenes that scenicq samples have the distribution of those that the original Scenic draws?

Each number of a scene (positions, headings, sizes, parameters), and some sums of all of them, which tell how they hang
together, is put to a two-sample Kolmogorov-Smirnov test.
"""

from __future__ import annotations

import math
import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenicq.exporters.sample import sample_labels
from scenicq.forest.scenario import Scenario
from scenicq.store.labels import Label

Sample = NDArray[np.float64]
CHANCE = 1e-3
"""The probability that a program with the right distribution fails."""
SUMS = 6
ATTEMPTS = 20_000


@dataclass(frozen=True)
class Distance:
    """How far two samples of one number are apart.

    Attributes:
        what: The number.
        apart: The Kolmogorov-Smirnov distance.
        allowed: What it may be by chance.
    """

    what: str
    apart: float
    allowed: float


def apart(one: Sample, other: Sample) -> float:
    """The Kolmogorov-Smirnov distance of two samples: the largest difference of their distribution functions."""
    both = np.sort(np.concatenate([one, other]))
    shares = [np.searchsorted(np.sort(each), both, side="right") / len(each) for each in (one, other)]
    return float(np.abs(shares[0] - shares[1]).max())


def allowed(first: int, second: int, chance: float) -> float:
    """The distance of two samples of one distribution that is exceeded with at most that probability."""
    return math.sqrt(-math.log(chance / 2) / 2 * (first + second) / (first * second))


def numbers_of_drawn(scene: Mapping[str, Any]) -> dict[str, float]:
    """The numbers of a scene that Scenic has drawn."""
    found: dict[str, float] = {}
    for index, thing in enumerate(scene["objects"]):
        found |= _numbers(index, thing["x"], thing["y"], thing["heading"], thing["width"], thing["length"])
    return found


def numbers_of_label(label: Label) -> dict[str, float]:
    """The numbers of a sampled label; its objects come in the order of the program."""
    found: dict[str, float] = {}
    for index, thing in enumerate((label.ego, *label.objects)):
        assert thing.heading is not None
        assert thing.width is not None
        assert thing.length is not None
        found |= _numbers(index, thing.x, thing.y, thing.heading, thing.width, thing.length)
    return found


def _numbers(index: int, x: float, y: float, heading: float, width: float, length: float) -> dict[str, float]:
    turn = math.remainder(heading, math.tau)
    # an angle has a seam: a turn by rounding there would look like a jump
    return {
        f"{index}.x": x, f"{index}.y": y, f"{index}.sin": math.sin(turn), f"{index}.cos": math.cos(turn),
        f"{index}.width": width, f"{index}.length": length,
    }  # fmt: skip


def distances(scenario: Scenario, scenes: Sequence[Mapping[str, Any]], seed: int) -> list[Distance]:
    """The numbers of drawn scenes beside those of as many sampled ones.

    Args:
        scenario: The program that they were drawn from.
        scenes: Scenes that Scenic has drawn.
        seed: Of the sample.
    """
    drawn = [numbers_of_drawn(scene) for scene in scenes]
    # Scenic draws with the same generator: with the same seed too, samples would be equal rather than alike
    labels = sample_labels(scenario, len(scenes), seed + 10_007, attempts=ATTEMPTS)
    sampled = [numbers_of_label(label) for label in labels]
    names = list(drawn[0])
    one, other = (np.array([[each[name] for name in names] for each in found]) for found in (drawn, sampled))
    # the last digits differ, which the test would take for a difference where many values are equal
    one, other = one.round(6), other.round(6)
    spread = np.where(one.std(axis=0) > 1e-6, one.std(axis=0), 1.0)
    rng = np.random.default_rng(random.Random(seed).randrange(2**32))
    weights = rng.normal(size=(len(names), SUMS)) / spread[:, None]
    columns = [(name, one[:, i], other[:, i]) for i, name in enumerate(names)]
    columns += [(f"sum {i}", np.round(one @ weights[:, i], 6), np.round(other @ weights[:, i], 6)) for i in range(SUMS)]
    limit = allowed(len(scenes), len(scenes), CHANCE / len(columns))
    return [Distance(name, apart(a, b), limit) for name, a, b in columns]
