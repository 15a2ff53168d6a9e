"""Boxes: the order of corners, and sizes whatever the heading."""

# pyright: basic

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenicq.geometry.boxes import box_polygon, corners


def test_corners_of_a_box_that_looks_north() -> None:
    assert corners(10, 20, 0, 2, 4).tolist() == [[11, 22], [9, 22], [9, 18], [11, 18]]


def test_corners_of_a_box_that_looks_west() -> None:
    # front is to the west, right is to the north
    np.testing.assert_allclose(corners(0, 0, math.pi / 2, 2, 4), [[-2, 1], [-2, -1], [2, -1], [2, 1]], atol=1e-12)


@given(st.floats(-10, 10), st.floats(0.1, 5), st.floats(0.1, 20))
def test_polygon_has_the_size_and_runs_counterclockwise(heading: float, width: float, length: float) -> None:
    polygon = box_polygon(3, -2, heading, width, length)
    assert polygon.area == pytest.approx(width * length)
    assert polygon.exterior.is_ccw
    assert (polygon.centroid.x, polygon.centroid.y) == pytest.approx((3, -2))
    outline = corners(3, -2, heading, width, length)
    assert np.hypot(*(outline[0] - outline[1])) == pytest.approx(width)
    assert np.hypot(*(outline[1] - outline[2])) == pytest.approx(length)
