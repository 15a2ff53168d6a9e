"""Waymo Open Motion: records, checksums, what the map becomes."""

from __future__ import annotations

import math
import shutil
from pathlib import Path

import pytest

from scenicq.errors import DataError
from scenicq.geometry.network import Network
from scenicq.importers.base import Options
from scenicq.importers.fields import InvalidError
from scenicq.importers.ingest import ingest
from scenicq.importers.protobuf import integers, parse, signed
from scenicq.importers.report import Report
from scenicq.importers.tfrecord import crc32c, records
from scenicq.importers.waymo import Waymo
from scenicq.store.dataset import open_dataset

SAMPLE = Path(__file__).parents[2] / "sample_data" / "waymo_tiny"
NAME = "tiny.tfrecord-00000-of-00001"
FIRST = "5ce0c0de00000001"


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """A copy of the file that a test may spoil."""
    return Path(shutil.copytree(SAMPLE, tmp_path / "source")) / NAME


def by_bit(content: bytes) -> int:
    state = 0xFFFFFFFF
    for byte in content:
        state ^= byte
        for _ in range(8):
            state = state >> 1 ^ (0x82F63B78 if state & 1 else 0)
    return state ^ 0xFFFFFFFF


@pytest.mark.parametrize("length", [0, 1, 9, 16_383, 16_384, 16_385, 40_007])
def test_checksum_in_lanes_is_that_bit_by_bit(length: int) -> None:
    content = bytes((7 * i * i + i) & 255 for i in range(length))
    assert crc32c(content) == by_bit(content)


def test_checksum_of_the_standard() -> None:
    assert crc32c(b"123456789") == 0xE3069283


def test_messages() -> None:
    message = parse(b"\x08\x96\x01\x12\x02\x01\x7f\x19" + b"\0" * 6 + b"\xf0?\x25\0\0\x80?")
    assert message[1] == [150]
    assert list(integers(message[2])) == [1, 127]
    assert message[3] == [1.0]
    assert message[4] == [1.0]
    assert signed(parse(b"\x08" + b"\xff" * 9 + b"\x01")[1][0]) == -1


@pytest.mark.parametrize("content", [b"\x08", b"\x12\x05ab", b"\x19abc", b"\x0b", b"\xff" * 12, b"\x08" + b"\x80" * 20])
def test_what_is_no_message(content: bytes) -> None:
    with pytest.raises(InvalidError):
        parse(content)


def test_lanes_have_a_nominal_width_and_a_direction() -> None:
    source = Waymo().read(SAMPLE, Options(), Report())
    network = Network(FIRST, source.maps[FIRST])
    assert network.roadDirection.values(30, -1.75) == pytest.approx((-math.pi / 2,))
    assert network.lanes[0].polygon.area == pytest.approx(60 * 3.5)
    assert network.lanes[0].properties["nominal_width"] == 3.5
    assert len(network.intersections) == 1
    assert network.crossings[0].polygon.area == pytest.approx(28)
    assert "nominal" in source.facts["lane_width_m"]


def test_steps_that_are_not_valid_have_no_object(tmp_path: Path) -> None:
    ingest(SAMPLE, tmp_path / "d")
    counts = [len(label.objects) for label in open_dataset(tmp_path / "d").labels()]
    assert counts == [1, 2, 2, 2, 2, 2] * 2


@pytest.mark.parametrize("claim", [3, 10**10, 2**64 - 1])
def test_a_wrong_length_ends_the_file(file: Path, tmp_path: Path, claim: int) -> None:
    content = file.read_bytes()
    second = 16 + int.from_bytes(content[:8], "little")
    length = claim.to_bytes(8, "little")
    file.write_bytes(content[:second] + length + content[second + 8 :])
    summary = ingest(file.parent, tmp_path / "d")
    assert (summary.recordings, summary.frames) == (1, 6)
    assert [(entry.what, entry.code) for entry in summary.left_out if entry.what == "file"] == [
        ("file", "file-invalid")
    ]


def test_a_length_with_a_right_checksum_but_beyond_the_file(file: Path) -> None:
    crc = by_bit((10**10).to_bytes(8, "little"))
    masked = ((crc >> 15 | crc << 17) + 0xA282EAD8) & 0xFFFFFFFF
    file.write_bytes((10**10).to_bytes(8, "little") + masked.to_bytes(4, "little") + b"abc")
    with pytest.raises(DataError, match="claims 10000000000 bytes"):
        list(records(file))


def test_a_record_that_has_changed_is_left_out(file: Path, tmp_path: Path) -> None:
    content = bytearray(file.read_bytes())
    content[200] ^= 1
    file.write_bytes(content)
    summary = ingest(file.parent, tmp_path / "d")
    assert summary.recordings == 1
    assert any("checksum is wrong" in diagnostic.message for diagnostic in summary.diagnostics)


def test_a_scenario_that_is_there_twice(file: Path, tmp_path: Path) -> None:
    file.write_bytes(file.read_bytes() * 2)
    summary = ingest(file.parent, tmp_path / "d")
    assert summary.recordings == 2
    assert [entry.count for entry in summary.left_out if entry.what == "recording"] == [2]
