"""Boxes over the image of a camera, where the dataset knows how the camera sees and how high boxes lie."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenicq.geometry.camera import Camera, box_corners, box_edges
from scenicq.report.sensors import Sensor
from scenicq.report.svg import element, escape
from scenicq.store.labels import LabelObject

__all__ = ["SpaceBox", "camera_image", "space_box"]


@dataclass(frozen=True, slots=True, eq=False)
class SpaceBox:
    """A box in space.

    Attributes:
        corners: Shape (8, 3), as `box_corners` gives them.
        kind: Classes for the style.
        told: What is said of it.
    """

    corners: NDArray[np.float64]
    kind: str
    told: str


def space_box(member: LabelObject, kind: str, told: str) -> SpaceBox | None:
    """The box of a label object; None where its height, heading or size is not known.

    Args:
        member: The object; where its tilt is not known it stands upright.
        kind: Classes for the style.
        told: What is said of it.
    """
    space, size = member.out_of_plane, (member.width, member.length, member.height)
    if space is None or space.z is None or member.heading is None:
        return None
    width, length, height = size
    if width is None or length is None or height is None:
        return None
    corners = box_corners(
        (member.x, member.y, space.z), (width, length, height), member.heading, space.pitch or 0.0, space.roll or 0.0
    )
    return SpaceBox(corners, kind, told)


def camera_image(sensor: Sensor, camera: Camera | None, boxes: Iterable[SpaceBox]) -> str:
    """The small image of a camera, with the boxes that it shows drawn over it.

    Args:
        sensor: The camera's file, which has a small image.
        camera: How it sees; None draws no boxes.
        boxes: In the order in which they are drawn.
    """
    image = element("img", src=sensor.thumbnail, alt=f"Thumbnail of {sensor.channel}", loading="lazy")
    image = image.removesuffix("</img>")
    if camera is None:
        return image
    drawn = [
        element("g", element("title", escape(box.told)), element("path", d=_path(lines)), class_=box.kind)
        for box in boxes
        if len(lines := box_edges(camera, box.corners))
    ]
    over = element(
        "svg", *drawn, viewBox=f"0 0 {camera.width} {camera.height}", preserveAspectRatio="none", class_="boxes"
    )
    return element("span", image, over, class_="camera")


def _path(lines: NDArray[np.float64]) -> str:
    # what lies far outside need not be exact, and must not be endless
    ends: Sequence[list[list[int]]] = np.clip(np.rint(lines), -100_000, 100_000).astype(np.int64).tolist()
    return "".join(f"M{a} {b}L{c} {d}" for (a, b), (c, d) in ends)
