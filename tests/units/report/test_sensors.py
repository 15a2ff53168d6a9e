"""Sensor files: linked where they are inside the dataset, with small images of cameras that nothing can abuse."""

import base64
import io
import random
import shutil
import struct
import time
import zlib
from pathlib import Path

import pytest

from scenicq.importers.ingest import ingest
from scenicq.query.execution.program_files import read_program
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.report import sensors, write
from scenicq.report.sensors import SensorFiles
from scenicq.report.write import write_report
from scenicq.store.dataset import open_dataset

images = pytest.importorskip("PIL.Image", reason="the extra scenicq[thumbnails] is not installed")
WIDTH, HEIGHT = 1600, 900


def _camera(file, seed=0):
    """A picture as large and as detailed as a camera's."""
    noise = images.frombytes("L", (320, 180), random.Random(seed).randbytes(320 * 180))
    noise.resize((WIDTH, HEIGHT)).convert("RGB").save(file, quality=85)


def _png_of_size(file, width, height):
    """A PNG that says that it is large, in a few bytes."""

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    body = chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(b"\0" * 1000)) + chunk(b"IEND", b"")
    file.write_bytes(b"\x89PNG\r\n\x1a\n" + body)


@pytest.fixture
def root(tmp_path):
    (tmp_path / "data" / "cam").mkdir(parents=True)
    (tmp_path / "out" / "r").mkdir(parents=True)
    return tmp_path / "data"


@pytest.fixture
def report(root):
    return root.parent / "out" / "r"


def test_files_are_linked_where_they_are_and_nowhere_else(root, report, tmp_path):
    _camera(tmp_path / "secret.jpg")
    for name in ("a b.jpg", "javascript:x.jpg", "c#?%.jpg"):
        (root / "cam" / name).touch()
    (root / "cam" / "out.jpg").symlink_to(tmp_path / "secret.jpg")
    (root / "cam" / "loop.jpg").symlink_to(root / "cam" / "loop.jpg")
    files = SensorFiles((root,), report, report, thumbnails=True)
    paths = {"CAM": "cam/a b.jpg", "CAM_J": "cam/javascript:x.jpg", "CAM_C": "cam/c#?%.jpg"}
    bad = ["../secret.jpg", str(tmp_path / "secret.jpg"), "cam/../../secret.jpg", "cam/out.jpg", "cam/loop.jpg"]
    bad += ["\x00", "nope.jpg", "", "cam", "x" * 5000]
    found = {sensor.channel: sensor for sensor in files.find(paths | {f"X{n}": path for n, path in enumerate(bad)})}
    assert found["CAM"].link == "./../../data/cam/a%20b.jpg"
    assert found["CAM_J"].link == "./../../data/cam/javascript%3Ax.jpg"
    assert found["CAM_C"].link == "./../../data/cam/c%23%3F%25.jpg"
    for number, path in enumerate(bad):
        assert (found[f"X{number}"].link, found[f"X{number}"].thumbnail) == (None, None), path
    assert list(report.iterdir()) == []


def test_thumbnails_are_small_and_made_once(root, report):
    _camera(root / "a.jpg")
    files = SensorFiles((root,), report, report, thumbnails=True)
    (first,) = files.find({"CAM": "a.jpg"})
    small = images.open(report / first.thumbnail)
    assert small.size == (320, 180)
    assert small.format == "JPEG"
    (root / "a.jpg").write_bytes(b"no picture any more")
    assert files.find({"CAM": "a.jpg"}) == [first]


def test_without_pillow_files_are_linked_and_no_more(root, report, monkeypatch):
    _camera(root / "a.jpg")
    monkeypatch.setattr(sensors, "find_spec", lambda _: None)
    (found,) = SensorFiles((root,), report, report, sensors.can_make_thumbnails()).find({"CAM": "a.jpg"})
    assert found.link is not None
    assert found.thumbnail is None


def test_a_thumbnail_of_a_camera_takes_less_than_30_ms(root, report):
    _camera(root / "a.jpg")
    times = []
    for _ in range(5):
        started = time.process_time()
        SensorFiles((root,), report, report, thumbnails=True).find({"CAM": "a.jpg"})
        times.append(time.process_time() - started)
    assert min(times[1:]) < 0.03


def test_what_is_no_image_or_too_large_is_linked_only(root, report, recwarn):
    (root / "broken.jpg").write_bytes(b"no image")
    _camera(root / "cut.jpg")
    (root / "cut.jpg").write_bytes((root / "cut.jpg").read_bytes()[:2000])
    (root / "script.jpg").write_bytes(b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n(x) run\n")
    _png_of_size(root / "large.png", 9000, 9000)
    _png_of_size(root / "bomb.png", 60_000, 60_000)
    (root / "text.txt").write_text("x")
    files = SensorFiles((root,), report, report, thumbnails=True)
    names = ["broken.jpg", "cut.jpg", "script.jpg", "large.png", "bomb.png", "text.txt"]
    for sensor in files.find({f"CAM{n}": name for n, name in enumerate(names)}):
        assert sensor.link is not None
        assert sensor.thumbnail is None, sensor.path
    assert not recwarn.list


@pytest.fixture
def driven(tmp_path, scenarios):
    """The sample recordings with the pictures of their cameras, and a query of theirs."""
    source = tmp_path / "source"
    shutil.copytree(Path(__file__).parents[3] / "sample_data" / "crossroads", source)
    folder = source / "samples" / "CAM_FRONT" / "03-busy-intersection"
    folder.mkdir(parents=True)
    for number in (9, 10, 11):
        _camera(folder / f"{number:02}.jpg", number)
    ingest(source, tmp_path / "dataset")
    query = Query(
        open_dataset(tmp_path / "dataset"), read_program(scenarios / "02_crossing_cars.scenic"), QueryOptions()
    )
    return query, list(query.results())


def test_a_page_of_one_frame_has_its_camera_inside(driven, run, tmp_path):
    page = tmp_path / "alone" / "frame.html"
    page.parent.mkdir()
    frame = (tmp_path / "dataset", "03-busy-intersection/09", "-o", page)
    assert run("show", *frame, "--sensors", tmp_path / "source").output == ""
    text = page.read_text(encoding="utf-8")
    assert text.count('<img src="data:image/jpeg;base64,') == 1
    assert "./../source/samples/CAM_FRONT/03-busy-intersection/09.jpg" in text
    assert list(page.parent.iterdir()) == [page]


def test_a_report_has_its_cameras_inside(driven, tmp_path):
    text = write_report(*driven, tmp_path / "r", sensors=tmp_path / "source").read_text(encoding="utf-8")
    assert [path.name for path in (tmp_path / "r").iterdir()] == ["index.html"]
    shown = [part.partition('"')[0] for part in text.split('<img src="data:image/jpeg;base64,')[1:]]
    assert len(shown) == 3
    assert {images.open(io.BytesIO(base64.b64decode(each))).size for each in shown} == {(320, 180)}
    assert text.count("./../source/samples/CAM_FRONT/03-busy-intersection/") == 3
    assert text.count("(not found here)") == len(driven[1]) - 3


def test_the_cameras_in_front_come_first_where_there_are_too_many(root, report):
    channels = ("CAM_BACK", "CAM_FRONT", "CAM_FRONT_LEFT", "LIDAR_TOP")
    for channel in channels:
        _camera(root / f"{channel}.jpg")
    files = SensorFiles((root,), report, report, thumbnails=True, most=2)
    found = files.find({channel: f"{channel}.jpg" for channel in channels})
    assert [each.channel for each in found if each.thumbnail] == ["CAM_FRONT", "CAM_FRONT_LEFT"]
    assert all(each.link for each in found)


def test_cameras_lie_beside_a_report_that_is_too_large(driven, tmp_path, monkeypatch):
    monkeypatch.setattr(sensors, "INSIDE_BYTES", 0)
    write_report(*driven, tmp_path / "few", sensors=tmp_path / "source")
    assert len(list((tmp_path / "few" / "thumbnails").iterdir())) == 3
    monkeypatch.setattr(write, "INLINE", 1)
    monkeypatch.setattr(sensors, "INSIDE_BYTES", 10**9)
    text = write_report(*driven, tmp_path / "many", sensors=tmp_path / "source").read_text(encoding="utf-8")
    small = {path.name for path in (tmp_path / "many" / "thumbnails").iterdir()}
    assert {part[:24] for part in text.split('<img src="thumbnails/')[1:]} == small
    assert len(small) == 3


def test_the_folder_that_a_dataset_names_is_not_taken(driven, tmp_path):
    text = write_report(*driven, tmp_path / "r").read_text(encoding="utf-8")
    assert "data:image" not in text
    assert text.count("(not found here)") == len(driven[1])
