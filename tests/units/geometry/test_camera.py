"""Cameras: boxes become the lines that a pinhole shows."""

from __future__ import annotations

import math

import numpy as np
import pytest

from scenicq.geometry.camera import Camera, box_corners, box_edges, quaternion_matrix
from scenicq.importers.motion import pose_of_euler_angles, pose_of_quaternion

# at the origin, 1.5 m high, looking along +y: x right is the map's +x, y down its -z
NORTH = Camera(800, 600, (400.0, 400.0, 400.0, 300.0), (0.0, 0.0, 1.5), (math.sqrt(0.5), -math.sqrt(0.5), 0.0, 0.0))


def box(x: float, y: float, z: float, heading: float = 0.0, pitch: float = 0.0, roll: float = 0.0) -> np.ndarray:
    return box_corners((x, y, z), (2.0, 4.0, 1.5), heading, pitch, roll)


def test_the_camera_looks_along_its_z_axis() -> None:
    matrix = quaternion_matrix(NORTH.rotation)
    assert matrix @ np.array([0, 0, 1]) == pytest.approx([0, 1, 0])
    assert matrix @ np.array([0, 1, 0]) == pytest.approx([0, 0, -1])
    again = pose_of_quaternion(*NORTH.rotation, (0.0, 0.0, 0.0))
    for column, axis in zip(matrix.T, (again.x, again.y, again.z), strict=True):
        assert axis == pytest.approx(column.tolist())


def test_corners_are_those_of_a_turned_box() -> None:
    corners = box(10, 20, 0, heading=0.4, pitch=0.1, roll=-0.2)
    pose = pose_of_euler_angles(-0.2, 0.1, 0.4 + math.pi / 2, (10.0, 20.0, 0.0))
    assert corners[0].tolist() == pytest.approx(pose.transform_point((2.0, -1.0, -0.75)))
    assert corners[6].tolist() == pytest.approx(pose.transform_point((-2.0, 1.0, 0.75)))
    assert corners.mean(axis=0).tolist() == pytest.approx([10, 20, 0])


def test_a_box_ahead_lies_where_a_pinhole_shows_it() -> None:
    lines = box_edges(NORTH, box(0, 20, 1.5))
    assert lines.shape == (12, 2, 2)
    # its back at 18 m, 2 m wide and 1.5 m high, around the middle of the image
    assert lines.min(axis=(0, 1)).tolist() == pytest.approx([400 - 400 / 18, 300 - 300 / 18])
    assert lines.max(axis=(0, 1)).tolist() == pytest.approx([400 + 400 / 18, 300 + 300 / 18])


@pytest.mark.parametrize(("x", "y"), [(0, -20), (60, 20), (-60, 20)])
def test_what_the_image_does_not_show_has_no_lines(x: float, y: float) -> None:
    assert box_edges(NORTH, box(x, y, 1.5)).shape == (0, 2, 2)


def test_a_box_beside_the_camera_is_cut_at_it() -> None:
    lines = box_edges(NORTH, box(1.5, 1.0, 1.5))
    assert 0 < len(lines) < 12
    assert np.isfinite(lines).all()
    assert lines[..., 0].min() > 400
