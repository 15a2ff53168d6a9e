"""Waymo Open Motion: records, checksums, what the map becomes."""

from __future__ import annotations

import math
import shutil
import struct
from itertools import pairwise, product
from pathlib import Path

import numpy as np
import pytest

from scenicq.errors import DataError
from scenicq.geometry.network import Network
from scenicq.importers.base import ImportOptions
from scenicq.importers.fields import InvalidError
from scenicq.importers.ingest import ingest
from scenicq.importers.lane_parts import AdjacentLane, cut_lanes
from scenicq.importers.protobuf import integers, parse, to_signed
from scenicq.importers.report import Report
from scenicq.importers.tfrecord import crc32c, records
from scenicq.importers.waymo import Waymo
from scenicq.importers.waymo_map import scenario_features
from scenicq.store.dataset import open_dataset

SAMPLE = Path(__file__).parents[3] / "sample_data" / "waymo_tiny"
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
    assert to_signed(parse(b"\x08" + b"\xff" * 9 + b"\x01")[1][0]) == -1


@pytest.mark.parametrize("content", [b"\x08", b"\x12\x05ab", b"\x19abc", b"\x0b", b"\xff" * 12, b"\x08" + b"\x80" * 20])
def test_what_is_no_message(content: bytes) -> None:
    with pytest.raises(InvalidError):
        parse(content)


def test_lanes_have_a_nominal_width_and_a_direction() -> None:
    source = Waymo().read(SAMPLE, ImportOptions(), Report())
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


class TestNeighbours:
    """Of a lane whose neighbours change along it."""

    @pytest.mark.parametrize("seed", range(20))
    def test_parts_have_the_neighbours_that_the_source_gives(self, seed: int) -> None:
        random = np.random.default_rng(seed)
        rows: list[list[tuple[str, float, float]]] = []
        for row in range(4):
            ends = sorted({0.0, 100.0, *(float(10 * random.integers(1, 10)) for _ in range(3))})
            rows.append([(f"{row}.{number}", a, b) for number, (a, b) in enumerate(pairwise(ends))])
        lengths = {name: b - a for row in rows for name, a, b in row}
        beside: dict[str, list[AdjacentLane]] = {name: [] for name in lengths}
        for lower, upper in pairwise(rows):
            for (one, a, b), (other, c, d) in product(lower, upper):
                if (low := max(a, c)) < (high := min(b, d)):
                    mine, its = ((low - a) / (b - a), (high - a) / (b - a)), ((low - c) / (d - c), (high - c) / (d - c))
                    beside[one].append(AdjacentLane(other, True, *mine, *its))
                    beside[other].append(AdjacentLane(one, False, *its, *mine))
        parts = cut_lanes(lengths, beside, 0.75)
        place = {name: (a, b) for row in rows for name, a, b in row}

        def at(row: int, x: float) -> str | None:
            return next((name for name, a, b in rows[row] if a <= x < b), None) if 0 <= row < 4 else None

        for name, found in parts.items():
            first, last = place[name]
            assert [part.start for part in found] == [0.0, *(part.end for part in found[:-1])]
            for x in np.arange(first + 0.5, last, 1.0):
                (part,) = (each for each in found if each.start <= (x - first) / (last - first) < each.end)
                row = int(name[0])
                for side, other_row in ((part.left, row + 1), (part.right, row - 1)):
                    assert (side and side[0]) == at(other_row, x)
                    if side is not None:
                        other = parts[side[0]][side[1]]
                        a, b = place[side[0]]
                        assert other.start <= (x - a) / (b - a) < other.end
                        # parts beside each other begin and end together
                        assert (b - a) * (other.end - other.start) == pytest.approx(
                            (last - first) * (part.end - part.start)
                        )

    def test_sections_of_a_scenario(self) -> None:
        def point(x: float, y: float) -> bytes:
            return field(8, b"\x09" + struct.pack("<d", x) + b"\x11" + struct.pack("<d", y))

        def field(number: int, content: bytes) -> bytes:
            return varint(number << 3 | 2) + varint(len(content)) + content

        def varint(value: int) -> bytes:
            return bytes([value]) if value < 128 else bytes([value & 127 | 128]) + varint(value >> 7)

        def whole(number: int, value: int) -> bytes:
            return varint(number << 3) + varint(value)

        def lane(name: int, first: int, last: int, y: float, *neighbours: tuple[int, int, int, int, int, int]) -> bytes:
            points = b"".join(point(float(x), y) for x in range(first, last + 1))
            beside = b"".join(
                field(side, b"".join(whole(number, value) for number, value in enumerate(each, start=1)))
                for side, *each in neighbours
            )
            return whole(1, name) + field(3, whole(2, 2) + points + beside)

        messages = [
            lane(1, 0, 200, 0.0, (11, 2, 0, 99, 0, 99), (11, 3, 100, 200, 0, 100)),
            lane(2, 0, 100, 3.5, (12, 1, 0, 99, 0, 99)),
            lane(3, 100, 200, 3.5, (12, 1, 0, 100, 100, 200)),
        ]
        features = scenario_features(
            [memoryview(each) for each in messages], lambda _, problem: pytest.fail(problem), Report()
        )
        network = Network("m", features)
        for x, name in ((20.0, "2"), (80.0, "2"), (120.0, "3"), (180.0, "3")):
            section = network.laneSectionAt(x, 0.0)
            assert section is not None
            left = section._laneToLeft
            assert left is not None
            assert left.lane.id == name
            assert left._laneToRight is section
        assert len(network.laneGroups) == 1
