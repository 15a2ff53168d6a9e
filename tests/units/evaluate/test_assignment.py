"""Assignments and figures against the definition, one prediction after the other."""

from __future__ import annotations

import math

import numpy as np
import pytest

from scenicq.evaluate.assignment import Centres, assign, find_pairs
from scenicq.evaluate.precision import Errors, average_precision, box_errors, mean_errors, resampled_errors


def centres(rng: np.random.Generator, count: int, *, spatial: bool = False) -> Centres:
    frame, category = rng.integers(0, 4, count).astype(np.int32), rng.integers(0, 2, count).astype(np.int32)
    # whole metres: many distances are equal
    x, y, z = (rng.integers(0, 8, count).astype(np.float64) for _ in range(3))
    return Centres(frame, category, x, y, z / 2 if spatial else None)


def one_by_one(predictions: Centres, objects: Centres, threshold: float, *, nearest_only: bool) -> list[int]:
    taken: set[int] = set()
    found: list[int] = []
    for number in range(len(predictions.x)):
        best, nearest = math.inf, -1
        for other in range(len(objects.x)):
            same = predictions.frame[number] == objects.frame[other]
            if same and predictions.category[number] == objects.category[other]:
                up = 0.0 if predictions.z is None or objects.z is None else predictions.z[number] - objects.z[other]
                dx, dy = predictions.x[number] - objects.x[other], predictions.y[number] - objects.y[other]
                away = math.sqrt(dx * dx + dy * dy + up * up)
                if away < best and (nearest_only or other not in taken):
                    best, nearest = away, other
        mine = nearest >= 0 and nearest not in taken and best < threshold
        found.append(nearest if mine else -1)
        if nearest >= 0 and (mine or nearest_only):
            taken.add(nearest)
    return found


@pytest.mark.parametrize("spatial", [False, True])
@pytest.mark.parametrize("nearest_only", [False, True])
@pytest.mark.parametrize("seed", range(20))
@pytest.mark.one_in(4)
def test_the_same_as_one_after_the_other(seed: int, nearest_only: bool, spatial: bool) -> None:
    rng = np.random.default_rng(seed)
    predictions, objects = centres(rng, 60, spatial=spatial), centres(rng, 40, spatial=spatial)
    pairs = find_pairs(predictions, objects, 4.0, nearest_only=nearest_only)
    for threshold in (0.5, 1.5, 4.0):
        found = assign(pairs, np.arange(60), 40, threshold, nearest_only=nearest_only)
        assert found.tolist() == one_by_one(predictions, objects, threshold, nearest_only=nearest_only)


def test_nothing_to_assign() -> None:
    none = Centres(*(np.zeros(0, dtype=np.int32),) * 2, *(np.zeros(0),) * 2)
    some = centres(np.random.default_rng(0), 3)
    for predictions, objects in ((none, some), (some, none), (none, none)):
        pairs = find_pairs(predictions, objects, 4.0)
        count = len(predictions.x)
        assert assign(pairs, np.arange(count), len(objects.x), 4.0).tolist() == [-1] * count


def figures(found: list[bool], objects: int, *, clipped: bool) -> float:
    hits = np.array([found])
    sums = [np.cumsum(each, axis=1, dtype=np.float64) for each in (hits, ~hits)]
    return float(average_precision(*sums, np.array([float(objects)]), clipped=clipped)[0])


def test_average_precision() -> None:
    assert figures([True] * 10, 10, clipped=True) == pytest.approx(1)
    assert figures([True] * 10, 10, clipped=False) == pytest.approx(1)
    assert figures([False] * 10, 10, clipped=True) == 0
    # precision 0.5 everywhere: (0.5 - 0.1) / 0.9
    assert figures([False, True] * 2000, 2000, clipped=True) == pytest.approx(0.4 / 0.9, abs=1e-3)
    assert figures([False, True] * 2000, 2000, clipped=False) == pytest.approx(0.5, abs=1e-3)
    # half of the objects, all right
    assert figures([True] * 500, 1000, clipped=True) == pytest.approx(40 / 90, abs=0.01)
    assert math.isnan(figures([True], 0, clipped=True))


def test_errors_of_boxes() -> None:
    one = np.array([1.0])
    sizes, others = np.array([[2.0, 4.0, 1.0]]), np.array([[1.0, 4.0, 1.0]])

    def errors(turn: float, *, half: bool = False, hull: bool = False) -> list[float]:
        given = Errors(3 * one, 4 * one, sizes, others, turn * one, one, 0 * one, 12 * one, one)
        return box_errors(given, np.array([half]), hull=hull)[0].tolist()

    assert errors(math.tau - 0.5) == pytest.approx([13, 0.5, 0.5, 1, 1])
    assert errors(math.pi - 0.5, half=True)[2] == pytest.approx(0.5)
    sizes[0], others[0] = (2, 1, 1), (1, 2, 1)
    assert errors(0)[1] == pytest.approx(2 / 3)
    assert errors(0, hull=True)[1] == pytest.approx(3 / 4)
    others[0, 2] = math.nan
    assert errors(0)[1] == pytest.approx(2 / 3)


def test_mean_errors() -> None:
    score = np.linspace(1, 0.1, 100)
    errors = np.column_stack([np.full(100, 0.3), np.arange(100.0), np.full(100, math.nan), np.ones(100), np.zeros(100)])
    found = np.full(100, True)
    plain = mean_errors(score, found, errors, 100, clipped=False)
    assert plain[:2].tolist() == pytest.approx([0.3, 49.5])
    assert math.isnan(plain[2])
    clipped = mean_errors(score, found, errors, 100, clipped=True)
    assert clipped[0] == pytest.approx(0.3)
    assert clipped[2:].tolist() == [1, 1, 0]
    # the means of the first 11, 12 ... 100 errors, in the mean
    assert clipped[1] == pytest.approx(np.mean([(n - 1) / 2 for n in range(11, 101)]), abs=0.02)
    sums, counts = np.cumsum(errors[:, 1])[None], np.arange(1.0, 101)[None]
    again = resampled_errors(sums, counts, counts, np.array([100.0]), clipped=True)
    assert again[0] == pytest.approx(clipped[1], abs=0.02)
    assert resampled_errors(sums, counts, counts, np.array([100.0]), clipped=False)[0] == pytest.approx(49.5)
