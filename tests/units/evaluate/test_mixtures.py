"""Densities of mixtures against histograms of a sampler that shares no code with them: NumPy's."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from scenicq.compiler.program import compile_scenario
from scenicq.errors import Source
from scenicq.evaluate.ranking import log_densities
from scenicq.geometry.default_street import street
from scenicq.store.labels import Label, LabelObject

Rng = np.random.Generator
Sampler = Callable[[Rng, int], np.ndarray]
DRAWS, BINS, IN_BIN = 1_000_000, 30, 60


def uniform(low: float, high: float) -> Sampler:
    return lambda rng, n: rng.uniform(low, high, n)


def normal(mean: float, deviation: float) -> Sampler:
    return lambda rng, n: rng.normal(mean, deviation, n)


def mixed(*parts: Sampler | tuple[Sampler, float]) -> Sampler:
    """One of several samplers, each by its weight."""

    def draw(rng: Rng, n: int) -> np.ndarray:
        pairs = [part if isinstance(part, tuple) else (part, 1.0) for part in parts]
        weights = np.array([weight for _, weight in pairs])
        which = rng.choice(len(pairs), n, p=weights / weights.sum())
        values = np.stack([sampler(rng, n) for sampler, _ in pairs])
        return values[which, np.arange(n)] if values.ndim == 2 else values[which, np.arange(n), :]

    return draw


def pair(x: Sampler, y: Sampler) -> Sampler:
    return lambda rng, n: np.column_stack((x(rng, n), y(rng, n)))


def choice(rng: Rng, n: int, *values: float) -> np.ndarray:
    return rng.choice(np.array(values), n)


def shared(rng: Rng, n: int) -> np.ndarray:
    x = rng.uniform(1, 3, n)
    return np.where(rng.random(n) < 0.5, x, 2 * x)


def shared_and_moved(rng: Rng, n: int) -> np.ndarray:
    x = rng.uniform(1, 3, n)
    return np.where(rng.random(n) < 0.5, x, x + rng.uniform(0, 1, n))


def stretched(rng: Rng, n: int) -> np.ndarray:
    h = rng.uniform(0, 2, n)
    return np.where(rng.random(n) < 0.5, rng.uniform(0, 1, n) * (1 + h), rng.uniform(5, 6, n) + h)


def cut_normal(rng: Rng, n: int) -> np.ndarray:
    found = rng.normal(0, 1, 3 * n)
    return found[(found > -1) & (found < 2)][:n]


def below_30(rng: Rng, n: int) -> np.ndarray:
    found = mixed(uniform(10, 12), uniform(14, 40))(rng, n)
    return found[found < 30]


def diagonal(rng: Rng, n: int) -> np.ndarray:
    x = mixed(uniform(0, 1), uniform(2, 3))(rng, n)
    return np.column_stack((x, x + rng.uniform(0, 1, n)))


def tied(rng: Rng, n: int) -> np.ndarray:
    """One choice for both coordinates."""
    first = rng.random(n) < 0.25
    return np.column_stack(
        (
            np.where(first, rng.uniform(0, 2, n), rng.uniform(1, 4, n)),
            np.where(first, rng.uniform(0, 1, n), rng.uniform(0, 5, n)),
        )
    )


def disc_or_box(rng: Rng, n: int) -> np.ndarray:
    away, turn = 2 * np.sqrt(rng.random(n)), rng.uniform(0, 2 * np.pi, n)
    box = np.column_stack((rng.uniform(4, 6, n), rng.uniform(-2, 2, n)))
    return np.where((rng.random(n) < 0.5)[:, None], np.column_stack((away * np.cos(turn), away * np.sin(turn))), box)


NUMBERS: dict[str, Sampler] = {
    "Uniform(Range(10, 12), Range(14, 40))": mixed(uniform(10, 12), uniform(14, 40)),
    "Uniform(Range(14, 40), Range(10, 12))": mixed(uniform(10, 12), uniform(14, 40)),
    "Uniform(Range(10, 12), Range(14, 40))\nrequire gap < 30": below_30,
    "Discrete({Range(0, 5): 1, Range(3, 9): 3})": mixed((uniform(0, 5), 1), (uniform(3, 9), 3)),
    "Discrete({Normal(0, 1): 2, Normal(4, 0.5): 1})": mixed((normal(0, 1), 2), (normal(4, 0.5), 1)),
    "Discrete({Range(0, 10): 9, Normal(5, 0.1): 1})": mixed((uniform(0, 10), 9), (normal(5, 0.1), 1)),
    "Uniform(Normal(0, 1), Range(-1, 3))": mixed(normal(0, 1), uniform(-1, 3)),
    "Uniform(TruncatedNormal(0, 1, -1, 2), Range(1, 4))": mixed(cut_normal, uniform(1, 4)),
    "2 * Uniform(Range(0, 1), Range(2, 4)) + 1": mixed(uniform(1, 3), uniform(5, 9)),
    "Uniform(Range(0, 1), Range(2, 4)) / 2": mixed(uniform(0, 0.5), uniform(1, 2)),
    "3 - Uniform(Range(0, 1), Range(1, 2))": mixed(uniform(2, 3), uniform(1, 2)),
    "-Uniform(Range(0, 1), Normal(2, 1))": mixed(uniform(-1, 0), normal(-2, 1)),
    "Uniform(Range(0, 1), Range(2, 4)) + Range(0, 1)": lambda rng, n: (
        mixed(uniform(0, 1), uniform(2, 4))(rng, n) + rng.random(n)
    ),
    "Uniform(Range(0, 1), Range(3, 5)) + Uniform(Range(0, 2), Normal(1, 1))": lambda rng, n: (
        mixed(uniform(0, 1), uniform(3, 5))(rng, n) + mixed(uniform(0, 2), normal(1, 1))(rng, n)
    ),
    "Uniform(Range(0, 1), Uniform(Range(5, 6), Range(5.5, 8)))": mixed(
        uniform(0, 1), mixed(uniform(5, 6), uniform(5.5, 8))
    ),
    "Uniform(Range(0, 1), Range(0, 1), Range(0.5, 2))": mixed(uniform(0, 1), uniform(0, 1), uniform(0.5, 2)),
    "Uniform(1, 3) * Range(1, 2)": lambda rng, n: choice(rng, n, 1, 3) * rng.uniform(1, 2, n),
    "Uniform(1, 3) * Uniform(Range(1, 2), Range(1.5, 4))": lambda rng, n: (
        choice(rng, n, 1, 3) * mixed(uniform(1, 2), uniform(1.5, 4))(rng, n)
    ),
    "DiscreteRange(1, 3) * Range(1, 2)": lambda rng, n: choice(rng, n, 1, 2, 3) * rng.uniform(1, 2, n),
    "Range(0, 1) + DiscreteRange(0, 4) * 0.5": lambda rng, n: rng.random(n) + choice(rng, n, 0, 0.5, 1, 1.5, 2),
    "Uniform(Range(0, 1) * (1 + h), Range(5, 6) + h)": stretched,
    "g * x * g": lambda rng, n: np.square(rng.uniform(-2, 3, n)) * rng.uniform(1, 3, n),
    "Uniform(x, 2 * x)": shared,
    "Uniform(x, x + Range(0, 1))": shared_and_moved,
    "Range(0, Uniform(1, 4))": lambda rng, n: rng.random(n) * choice(rng, n, 1, 4),
    "Normal(Uniform(0, 5), 1)": mixed(normal(0, 1), normal(5, 1)),
    "Uniform(Range(0, Range(1, 2)), Range(3, 4))": mixed(
        lambda rng, n: rng.random(n) * rng.uniform(1, 2, n), uniform(3, 4)
    ),
}
PLACES: dict[str, Sampler] = {
    "Uniform(Range(0, 1) @ Range(0, 2), Range(3, 5) @ Range(1, 4))": mixed(
        pair(uniform(0, 1), uniform(0, 2)), pair(uniform(3, 5), uniform(1, 4))
    ),
    "Discrete({Range(0, 1) @ Range(0, 1): 1, Normal(2, 1) @ Range(0, 3): 2})": mixed(
        (pair(uniform(0, 1), uniform(0, 1)), 1), (pair(normal(2, 1), uniform(0, 3)), 2)
    ),
    "(Uniform(Range(0, 1), Range(3, 4)), Uniform(Range(0, 1), Range(0, 3)))": pair(
        mixed(uniform(0, 1), uniform(3, 4)), mixed(uniform(0, 1), uniform(0, 3))
    ),
    "(u, u + Range(0, 1))": diagonal,
    "Discrete({Range(0, 2) @ Range(0, 1): 1, Range(1, 4) @ Range(0, 5): 3})": tied,
}  # fmt: skip
NONE = {
    "g * g": "solved",
    "abs(g)": "solved",
    "Uniform(Range(10, 12), 14)": "solved",
    "Discrete({Range(0, 1): 1, g * g: 1})": "solved",
    "DiscreteRange(0, 2) * Range(1, 2)": "area",
}
"""Expressions without a density, or with one that is not affine, and what is said of them."""


def found_at(program: str, places: np.ndarray) -> tuple[np.ndarray, np.ndarray, set[str]]:
    """Densities of places, their errors, and the reasons for which there is none."""
    begin = "g = Range(-2, 3)\nx = Range(1, 3)\nh = Range(0, 2)\nu = Uniform(Range(0, 1), Range(2, 3))\n"
    text = "ego = new Object at (0, 0), facing 0\n" + begin + program
    scenario = compile_scenario(Source("test.scenic", text), street())
    labels = []
    for x, y in places.tolist():
        ego, other = LabelObject("ego", "Object", "", 0, 0, 0), LabelObject("o", "Object", "", x, y, 0.1)
        cast = {scenario.objects[scenario.ego].name: "ego", scenario.objects[1 - scenario.ego].name: "o"}
        labels.append((Label("f", "r", 0, "street", ego, (other,)), cast))
    told = log_densities(scenario, labels, draws=1024)
    log = np.array([-np.inf if each.log is None else each.log for each in told])
    return np.exp(log), np.array([each.error for each in told]), {each.reason for each in told if each.reason}


def of_numbers(gap: str, places: np.ndarray) -> tuple[np.ndarray, np.ndarray, set[str]]:
    there = np.column_stack((np.full(len(places), 0.5), places))
    return found_at(f"gap = {gap}\nnew Object at (Range(0, 1), gap), facing Range(-0.5, 0.5)\n", there)


def close(found: np.ndarray, error: np.ndarray, counts: np.ndarray, size: float, count: int) -> None:
    """Densities, in the mean over a bin, against how many draws fall into it."""
    expected = counts / count / size
    chance = 5 * np.sqrt(np.maximum(counts, 1)) / count / size
    assert np.abs(found - expected).max() > 0 or not expected.any()
    off = np.abs(found - expected) - chance - 5 * error - 0.01 * expected
    assert off.max() <= 0.02 * expected.max(), (off.argmax(), found, expected)


@pytest.mark.one_in(36)
@pytest.mark.parametrize("gap", NUMBERS)
def test_densities_of_mixtures(gap: str) -> None:
    values = NUMBERS[gap](np.random.default_rng(5), DRAWS)
    # a requirement's own probability is left out of densities
    share = len(values) / DRAWS if "require" in gap else 1.0
    low, high = np.quantile(values, (0.0005, 0.9995))
    counts, ends = np.histogram(values, BINS, (low, high))
    inside = (np.arange(IN_BIN * BINS) + 0.5) / IN_BIN / BINS
    found, error, _ = of_numbers(gap, low + (high - low) * inside)
    close(found.reshape(BINS, IN_BIN).mean(axis=1), (found * error).reshape(BINS, IN_BIN).mean(axis=1), counts,
          (ends[1] - ends[0]) / share, len(values))  # fmt: skip


@pytest.mark.one_in(2)
@pytest.mark.parametrize("place", PLACES)
def test_densities_of_places(place: str) -> None:
    values = PLACES[place](np.random.default_rng(6), DRAWS)
    low, high = np.quantile(values, 0.001, axis=0), np.quantile(values, 0.999, axis=0)
    bins, inside = 8, 4
    counts, *_ = np.histogram2d(*values.T, bins, list(zip(low, high, strict=True)))
    axes = [
        one + (other - one) * (np.arange(bins * inside) + 0.5) / bins / inside
        for one, other in zip(low, high, strict=True)
    ]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    found, error, _ = found_at(f"new Object at {place}, facing Range(-0.5, 0.5)\n", grid)

    def by_bin(each: np.ndarray) -> np.ndarray:
        return each.reshape(bins, inside, bins, inside).mean(axis=(1, 3))

    size = float(np.prod((high - low) / bins))
    edges = 0.15 * found.max()  # a bin that an edge cuts has few points
    expected = counts / DRAWS / size
    chance = 5 * np.sqrt(np.maximum(counts, 1)) / DRAWS / size
    off = np.abs(by_bin(found) - expected) - chance - 5 * by_bin(found * error)
    assert off.max() <= edges
    assert np.median(np.abs(off)) <= 0.02 * expected.max()


@pytest.mark.parametrize("gap", NONE)
def test_where_there_is_no_density_none_is_told(gap: str) -> None:
    found, _, reasons = of_numbers(gap, np.array([0.3, 1.5, 2.2]))
    assert not found.any()
    (reason,) = reasons
    assert NONE[gap] in reason
