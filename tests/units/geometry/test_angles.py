"""Angles: the seam at pi, agreement with complex rotation, the conventions of headings."""

# pyright: basic

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenicq.geometry import angles

finite = st.floats(-1e4, 1e4)


@pytest.mark.parametrize(
    ("angle", "expected"),
    [(0.0, 0.0), (math.pi, math.pi), (-math.pi, math.pi), (3 * math.pi, math.pi), (2 * math.pi, 0.0), (-0.5, -0.5)],
)
def test_normalize_at_the_seam(angle: float, expected: float) -> None:
    assert angles.normalize(angle) == expected
    assert angles.normalize_array(np.array([angle]))[0] == pytest.approx(expected, abs=1e-15)


@given(finite)
def test_normalize_keeps_the_direction(angle: float) -> None:
    wrapped = angles.normalize(angle)
    assert -math.pi < wrapped <= math.pi
    assert math.cos(wrapped) == pytest.approx(math.cos(angle), abs=1e-11)
    assert math.sin(wrapped) == pytest.approx(math.sin(angle), abs=1e-11)
    assert angles.distance(wrapped, float(angles.normalize_array(np.array([angle]))[0])) < 1e-11
    assert angles.normalize(wrapped) == wrapped


def in_one_turn(angle: float) -> float:
    """As Scenic does it: whole turns are taken off what is beyond half a turn, at which an angle keeps its sign."""
    while angle > math.pi:
        angle -= math.tau
    while angle < -math.pi:
        angle += math.tau
    return angle


@pytest.mark.parametrize("turns", [-5, -3, -1, -0.75, 0, 0.25, 1, 3, 5])
def test_half_a_turn_keeps_its_sign(turns: float) -> None:
    angle = turns * math.pi
    assert angles.wrap(angle) == in_one_turn(angle)
    assert angles.wrap_array(np.array([angle]))[0] == in_one_turn(angle)


@given(finite)
def test_wrap_and_normalize_differ_at_half_a_turn_alone(angle: float) -> None:
    wrapped, same = angles.wrap(angle), angles.normalize(angle)
    assert wrapped == same or (wrapped, same) == (-math.pi, math.pi)
    assert float(angles.wrap_array(np.array([angle]))[0]) == pytest.approx(wrapped, abs=1e-11)


@given(finite, finite)
def test_difference_turns_b_into_a(a: float, b: float) -> None:
    turn = angles.difference(a, b)
    assert -math.pi < turn <= math.pi
    assert angles.distance(b + turn, a) < 1e-10
    assert angles.distance(a, b) == abs(turn)


def test_distance_across_the_seam() -> None:
    assert angles.distance(math.pi - 0.01, -math.pi + 0.01) == pytest.approx(0.02)
    assert angles.difference(-math.pi + 0.01, math.pi - 0.01) == pytest.approx(0.02)


def test_headings_are_counterclockwise_from_north() -> None:
    assert angles.heading_of(0, 1) == 0
    assert angles.heading_of(-1, 0) == pytest.approx(math.pi / 2)
    assert angles.heading_of(1, 0) == pytest.approx(-math.pi / 2)
    assert angles.heading_of(0.0, -1) == angles.heading_of(-0.0, -1) == math.pi
    assert angles.azimuth(0.0, -1) == angles.azimuth(-0.0, -1) == -math.pi
    assert angles.heading_of(0, 0) == -math.pi / 2


@given(st.floats(-math.pi + 1e-9, math.pi), st.floats(0.01, 100))
def test_direction_and_heading_are_inverse(heading: float, length: float) -> None:
    dx, dy = angles.direction(heading)
    assert angles.distance(angles.heading_of(length * dx, length * dy), heading) < 1e-12
    array = angles.heading_of_array(np.array([dx, 0.0]), np.array([dy, 0.0]))
    assert array.tolist() == pytest.approx([angles.heading_of(dx, dy), -math.pi / 2], abs=1e-15)


@given(finite, finite, finite)
def test_rotate_is_multiplication_by_a_unit_complex_number(x: float, y: float, angle: float) -> None:
    expected = complex(x, y) * complex(math.cos(angle), math.sin(angle))
    assert complex(*angles.rotate(x, y, angle)) == pytest.approx(expected, abs=1e-8)


def test_headings_of_arrays_are_those_of_numbers_to_the_last_bit():
    steps = np.random.default_rng(1).normal(0, 10.0, (2, 5000)) * np.random.default_rng(2).choice(
        [1.0, 1e-6, 0.0], 5000
    )
    for many, one in ((angles.heading_of_array, angles.heading_of), (angles.azimuth_array, angles.azimuth)):
        found = many(steps[0], steps[1]).tolist()
        assert found == [one(x, y) for x, y in steps.T.tolist()]
        assert many(steps.reshape(2, 50, 100)[0], steps.reshape(2, 50, 100)[1]).ravel().tolist() == found
