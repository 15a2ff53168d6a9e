"""Who is alike: against the definition, object by object."""

from __future__ import annotations

import numpy as np
import pytest

from scenicq.evaluate.controls import CALIPER, Controls, Likeness, find_controls, number_of


def drawn(rng: np.random.Generator, count: int = 160, *, frames: int = 24) -> tuple[np.ndarray, np.ndarray, Likeness]:
    frame = rng.integers(0, frames, count)
    recording = frame // 3
    category = rng.integers(0, 2, count)
    mine = rng.random(count) < 0.3
    like = Likeness(
        kind=number_of((category, rng.integers(0, 2, count))),
        category=category,
        distance=rng.choice((rng.uniform(5, 60, count), rng.integers(1, 6, count) * 9.0)),
        frame=frame,
        recording=recording,
        cluster=recording // 2,
        params=recording % 3,
    )
    return mine, ~mine & (rng.random(count) < 0.8), like


def by_definition(mine: np.ndarray, others: np.ndarray, like: Likeness) -> tuple[set[int], np.ndarray]:
    """The objects that are compared, and the weights of the others."""
    total, compared = np.zeros(len(mine)), set()
    for i in np.flatnonzero(mine).tolist():
        away = like.distance[i]
        reach = max(3.0, CALIPER * away)
        kin = [j for j in np.flatnonzero(others).tolist() if like.kind[j] == like.kind[i]]
        gaps = [like.distance[j] - away for j in kin]
        if not any(-reach <= gap <= reach / 10 for gap in gaps) or not any(-reach / 10 <= gap <= reach for gap in gaps):
            continue
        for column in (like.frame, like.recording, like.cluster, like.params):
            near = [j for j, gap in zip(kin, gaps, strict=True) if column[j] == column[i] and abs(gap) <= reach]
            if near:
                compared.add(i)
                total[near] += 1 / len(near)
                break
    return compared, total / max(len(compared), 1)


@pytest.mark.parametrize("seed", range(12))
def test_others_are_those_of_the_definition(seed: int) -> None:
    mine, others, like = drawn(np.random.default_rng(seed))
    found = find_controls(mine, others, like)
    compared, weight = by_definition(mine, others, like)
    assert set(np.flatnonzero(found.compared).tolist()) == compared
    assert found.weight == pytest.approx(weight, abs=1e-9)
    assert sum(found.places) == len(compared)
    assert found.weight.sum() == pytest.approx(1)


def difference(found: Controls, values: np.ndarray) -> float:
    return float(found.difference @ values)


@pytest.mark.parametrize("seed", range(6))
def test_what_hangs_on_distance_and_recording_is_in_no_difference(seed: int) -> None:
    """What is missed by class and distance, by recording, and by the role: only the role's part is left."""
    rng = np.random.default_rng(100 + seed)
    mine, others, like = drawn(rng, 900, frames=12)
    # nobody needs others of another recording
    like = Likeness(**{name: getattr(like, name) for name in ("kind", "category", "distance", "frame", "recording")},
                    cluster=like.recording, params=like.recording)  # fmt: skip
    found = find_controls(mine, others, like)
    slope = np.array([0.01, -0.02])[like.category]
    values = rng.random(4)[like.recording] + slope * like.distance + 0.25 * found.compared
    assert difference(found, values) == pytest.approx(0.25, abs=1e-4)
    # without the regression what is nearer on the average would count
    plain = found.compared / found.compared.sum() - found.weight
    assert abs(float(plain @ values) - 0.25) > 1e-3


def test_nobody_is_compared_where_distances_do_not_overlap() -> None:
    distance = np.array([*np.linspace(31, 40, 40), *np.linspace(42, 49, 20)])
    zero = np.zeros(60, dtype=np.int64)
    mine = np.arange(60) >= 40
    like = Likeness(zero, zero, distance, zero, zero, zero, zero)
    assert not find_controls(mine, ~mine, like).compared.any()
    assert not find_controls(mine, np.zeros(60, dtype=bool), like).compared.any()


def test_others_of_the_frame_come_first() -> None:
    """One of the own frame is enough, and those of other parameters are none."""
    at = np.full(6, 20.0)
    zero = np.zeros(6, dtype=np.int64)
    frame = np.array([0, 0, 1, 2, 3, 4])
    recording = np.array([0, 0, 0, 1, 2, 3])
    params = np.array([0, 0, 0, 0, 1, 1])
    mine = np.array([True, False, False, False, True, False])
    found = find_controls(mine, ~mine, Likeness(zero, zero, at, frame, recording, recording, params))
    assert found.weight.tolist() == [0, 0.5, 0, 0, 0, 0.5]
    assert found.places == (1, 0, 0, 1)
    assert found.elsewhere.tolist() == [False, False, False, False, True, False]
