"""Boxes over images of cameras, in reports of matches and of evaluations."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from scenicq.errors import Source
from scenicq.evaluate.evaluation import evaluate
from scenicq.evaluate.pages import write_pages
from scenicq.geometry.camera import Camera
from scenicq.query.execution.run import Query
from scenicq.report.camera_pictures import camera_image, space_box
from scenicq.report.sensors import Sensor
from scenicq.report.write import write_report
from scenicq.store.dataset import open_dataset
from scenicq.store.labels import Label, LabelObject, OutOfPlane, Recording
from scenicq.store.writer import write_dataset

# looks along +y from a height of 1.5 m
CAMERA = Camera(640, 360, (300.0, 300.0, 320.0, 180.0), (0.0, 0.0, 1.5), (0.5**0.5, -(0.5**0.5), 0.0, 0.0))
BACK = Camera(640, 360, (300.0, 300.0, 320.0, 180.0), (0.0, 0.0, 1.5), (0.0, 0.0, 0.5**0.5, -(0.5**0.5)))
PROGRAM = Source("ahead.scenic", "ego = new Object at (0, 0), facing 0\nlead = new Object at (0, 20), facing 0\n")


def car(name: str, y: float, z: float | None = 0.75) -> LabelObject:
    space = None if z is None else OutOfPlane(z)
    return LabelObject(name, "Car", "car", 0.0, y, 0.0, 2.0, 4.0, 1.5, out_of_plane=space)


def thumbnail(name: str = "CAM_FRONT") -> Sensor:
    return Sensor(name, "a.jpg", "./a.jpg", "thumbnails/a.jpg")


def test_boxes_lie_over_the_image() -> None:
    boxes = [space_box(car("<a>", 20.0), "found", "<a>"), space_box(car("b", -20.0), "missed", "b")]
    text = camera_image(thumbnail(), CAMERA, [box for box in boxes if box is not None])
    assert 'viewBox="0 0 640 360"' in text
    assert text.count('class="found"') == 1
    assert "&lt;a&gt;" in text
    assert 'class="missed"' not in text, "what lies behind the camera is not drawn"
    numbers = [int(number) for number in re.findall(r"-?\d+", text.partition(' d="')[2].partition('"')[0])]
    assert all(300 < x < 340 for x in numbers[::2])
    assert all(180 <= y < 210 for y in numbers[1::2])


def test_without_calibration_or_height_nothing_is_drawn() -> None:
    assert "<svg" not in camera_image(thumbnail(), None, [])
    assert space_box(car("a", 20.0, None), "found", "a") is None
    assert space_box(LabelObject("a", "Car", "car", 0.0, 0.0, 0.0, out_of_plane=OutOfPlane(1.0)), "found", "a") is None


def test_reports_show_them(tmp_path: Path) -> None:
    images = pytest.importorskip("PIL.Image", reason="the extra scenicq[thumbnails] is not installed")
    ego = LabelObject("ego", "Car", "car", 0.0, 0.0, 0.0, 2.0, 4.0)
    labels = tuple(
        Label(f"f{number}", "r", number, "none", ego, (car("a", 20.0), car("b", 40.0)),
              sensors={"CAM_BACK": "b.png", "CAM_FRONT": "a.png"}, cameras={"CAM_BACK": BACK, "CAM_FRONT": CAMERA})
        for number in range(2)
    )  # fmt: skip
    write_dataset(tmp_path / "d", [Recording("r", "none", labels)], {}, name="d")
    for name in ("a.png", "b.png"):
        images.new("RGB", (640, 360), "gray").save(tmp_path / "d" / name)
    query = Query(open_dataset(tmp_path / "d"), PROGRAM)
    results = list(query.results())
    text = write_report(query, results, tmp_path / "report").read_text(encoding="utf-8")
    assert 'class="boxes"' in text
    assert re.search(r'class="asked c\d"', text)
    boxes = [
        {
            "class": "Car",
            "position": [0, 40],
            "heading": 0,
            "width": 2,
            "length": 4,
            "height": 1.5,
            "score": 0.9,
            "z": 1,
        }
    ]
    file = tmp_path / "boxes.jsonl"
    file.write_text("".join(json.dumps({"id": label.frame, "objects": boxes}) + "\n" for label in labels))
    found = evaluate({"a": results}, query.dataset, file)
    text = write_pages(found, query.dataset, tmp_path / "pages").read_text(encoding="utf-8")
    assert text.index(">CAM_FRONT<") < text.index(">CAM_BACK<"), "what shows the objects in question comes first"
    over = text.partition('class="boxes"')[2].partition("</svg>")[0]
    assert 'class="missed asked"' in over
    assert 'class="found"' in over
    assert 'class="prediction"' in over
