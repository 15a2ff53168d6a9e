"""Makes the recordings of an invented fleet, as large as wanted: a dataset, or an interchange folder to be ingested.

`python tests/tools/bench/fleet.py OUT --frames N [--interchange] [--needle] [--jobs N] [--seed N]`. The same arguments
give the same traffic. With `--needle` one frame, called `needle`, has what no other has: a truck that stands across the
ego's lane, 12 m ahead of the ego; `NEEDLE` is a scenario that asks for it (with a tolerance of some degrees).
"""

from __future__ import annotations

import argparse
import json
import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from shapely.affinity import translate
from shapely.geometry import mapping

from scenicq.geometry.default_street import street
from scenicq.geometry.features import LINES, REFERENCES, MapFeature, names
from scenicq.importers.base import LabelChecker, RecordingEntry
from scenicq.importers.report import Report
from scenicq.importers.segments import Job, RecordingTask, World, fingerprint, write_segments
from scenicq.store.columns import MemberColumns, RecordingColumns
from scenicq.store.manifest import Manifest
from scenicq.store.segment import SEGMENT_OBJECTS, segments_of
from scenicq.store.writer import DatasetWriter

MAP = "fleet"
TILES, PITCH_M = 5, 240.0
FRAMES, STEP_S, START_US = 40, 0.5, 1_700_000_000_000_000
FEWEST, MOST = 20, 40
FROM_M, TO_M, LANE_M = 10.0, 110.0, 3.5
NEEDLE = """\
model scenic.domains.driving.model
ego = new Car on road
truck = new Truck ahead of ego by Range(4, 8), facing Range(80, 100) deg relative to roadDirection
"""
KINDS: tuple[tuple[str, str, float, tuple[float, float, float]], ...] = (
    # class, class of the source, share, (width, length, height)
    ("Car", "car", 0.55, (1.9, 4.6, 1.7)),
    ("Truck", "truck", 0.08, (2.5, 8.0, 3.2)),
    ("Bicycle", "bicycle", 0.05, (0.7, 1.8, 1.4)),
    ("Adult", "adult", 0.22, (0.6, 0.6, 1.7)),
    ("Cone", "cone", 0.10, (0.4, 0.4, 0.8)),
)


def fleet_map() -> tuple[MapFeature, ...]:
    """The crossing of `scenicq.geometry.default_street`, repeated in a grid."""
    features = street().features
    return tuple(
        moved(feature, f"{column}{row}-", column * PITCH_M, row * PITCH_M)
        for column in range(TILES)
        for row in range(TILES)
        for feature in features
    )


def moved(feature: MapFeature, prefix: str, dx: float, dy: float) -> MapFeature:
    """An element of a map under another name, so many metres off."""
    properties: dict[str, Any] = dict(feature.properties)
    for key in LINES:
        if key in properties:
            properties[key] = [[[x + dx, y + dy] for x, y in line] for line in properties[key]]
    for key in REFERENCES.get(feature.kind, {}):
        if names(feature, key):
            value = properties[key]
            properties[key] = prefix + value if isinstance(value, str) else [prefix + name for name in value]
    return MapFeature(prefix + feature.id, feature.kind, translate(feature.shape, dx, dy), properties)


@dataclass(frozen=True, slots=True)
class Fleet:
    """Traffic on the map.

    Attributes:
        frames: How many in all.
        seed: Of the traffic.
        needle: Whether the frame in the middle is the needle.
        length: Frames of a recording.
    """

    frames: int
    seed: int
    needle: bool
    length: int = FRAMES

    def sizes(self) -> list[tuple[str, int]]:
        """Name and number of frames of each recording."""
        whole, rest = divmod(self.frames, self.length)
        return [(f"fleet-{n:06}", self.length) for n in range(whole)] + ([(f"fleet-{whole:06}", rest)] if rest else [])

    def recording(self, number: int) -> RecordingColumns:
        """A recording: everybody goes straight on at a constant speed, or stands."""
        name, frames = f"fleet-{number:06}", self._length(number)
        random = np.random.default_rng((self.seed, number))
        tracks = int(random.integers(FEWEST, MOST + 1))
        kind = random.choice(len(KINDS), size=tracks, p=[share for _, _, share, _ in KINDS])
        tile = np.array(divmod(number % TILES**2, TILES)) * PITCH_M
        times = np.arange(frames) * STEP_S
        ego_xy, ego_heading, ego_speed = _straight(random, np.zeros(1, dtype=np.int64), times, tile)
        xy, heading, speed = _straight(random, kind, times, tile)
        name_of = [f"t{track:02}" for track in range(tracks)]
        categories = [KINDS[k][0] for k in kind]
        ids, order = [name_of] * frames, [categories] * frames
        sources = [KINDS[k][1] for k in kind]
        sizes = np.array([KINDS[k][3] for k in kind])
        labels = [f"{name}/{frame:02}" for frame in range(frames)]
        ego_headings = np.repeat(ego_heading, frames)
        if self.needle and number == self.frames // self.length // 2:
            at = frames // 2
            labels[at] = "needle"
            truck = int(np.flatnonzero(kind == 1)[0]) if (kind == 1).any() else 0
            # both on the arm to the north, in the lane on the right, well clear of the crossing
            heading = np.tile(heading, (frames, 1))
            ego_headings[at] = 0.0
            ego_xy[at, 0] = np.add(tile, (LANE_M / 2, 40.0))
            xy[at, truck] = np.add(tile, (LANE_M / 2, 52.0))
            heading[at, truck] = math.pi / 2
            order[at] = [*categories[:truck], "Truck", *categories[truck + 1 :]]
            sizes = np.tile(sizes, (frames, 1, 1))
            sizes[at, truck] = KINDS[1][3]
        whole = np.broadcast_to(heading, (frames, tracks))
        return RecordingColumns(
            name=name,
            map=MAP,
            frames=labels,
            times_us=(START_US + (number * self.length + np.arange(frames)) * round(STEP_S * 1e6)).tolist(),
            params=['{"weather":"clear"}'] * frames,
            egos=_columns(
                ["ego"] * frames,
                ["Car"] * frames,
                [""] * frames,
                ego_xy[:, 0],
                ego_headings,
                np.broadcast_to(np.array(KINDS[0][3]), (frames, 3)),
                np.repeat(ego_speed, frames),
                [None] * frames,
            ),
            objects=_columns(
                [id for row in ids for id in row],
                [category for row in order for category in row],
                sources * frames,
                xy.reshape(-1, 2),
                whole.reshape(-1),
                np.broadcast_to(sizes, (frames, tracks, 3)).reshape(-1, 3),
                np.tile(speed, frames),
                name_of * frames,
            ),
            object_counts=np.full(frames, tracks),
            sensor_counts=np.ones(frames, dtype=np.int64),
            channels=["CAM_FRONT"] * frames,
            paths=[f"samples/{label}.jpg" for label in labels],
        )

    def _length(self, number: int) -> int:
        return min(self.length, self.frames - number * self.length)


def _straight(
    random: np.random.Generator, kind: NDArray[np.int64], times: NDArray[np.float64], tile: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Positions (frames, n, 2), headings (n,) and speeds (n,) of movers on their parts of an arm of the crossing."""
    n = len(kind)
    arm = random.integers(4, size=n) * math.pi / 2
    side = np.where(random.random(n) < 0.5, 1.0, -1.0)
    vehicle, walker = kind <= 2, kind == 3
    lane = (random.integers(2, size=n) + 0.5) * LANE_M + random.normal(0, 0.2, n)
    right = side * np.where(vehicle, lane, 2 * LANE_M + np.where(walker, random.uniform(1.2, 3.8, n), 0.5))
    stands = np.where(vehicle, random.random(n) < 0.3, kind == 4)
    speed = np.where(stands, 0.0, np.where(vehicle, random.uniform(2, 4, n), random.uniform(0.8, 1.6, n)))
    # Traffic keeps right: on the right of an arm one drives away from the crossing.
    along = np.where(side > 0, random.uniform(FROM_M, TO_M - 20, n), random.uniform(FROM_M + 20, TO_M, n))
    out = along + side * speed * times[:, None]
    out = FROM_M + np.mod(out - FROM_M, TO_M - FROM_M)
    cos, sin = np.cos(arm), np.sin(arm)
    xy = np.stack((right * cos - out * sin, right * sin + out * cos), axis=-1) + tile
    heading = arm + np.where(side > 0, 0.0, math.pi) + random.normal(0, 0.03, n)
    return np.round(xy, 3), np.round(np.mod(heading + math.pi, 2 * math.pi) - math.pi, 5), np.round(speed, 2)


def _columns(
    ids: Sequence[str],
    categories: Sequence[str],
    sources: Sequence[str],
    xy: NDArray[np.float64],
    heading: NDArray[np.float64],
    sizes: NDArray[np.float64],
    speed: NDArray[np.float64],
    tracks: Sequence[str | None],
) -> MemberColumns:
    turned = np.where(heading > math.pi, heading - 2 * math.pi, heading)
    return MemberColumns(
        id=ids,
        category=categories,
        source_class=sources,
        x=np.ascontiguousarray(xy[:, 0]),
        y=np.ascontiguousarray(xy[:, 1]),
        heading=turned,
        width=np.ascontiguousarray(sizes[:, 0]),
        length=np.ascontiguousarray(sizes[:, 1]),
        height=np.ascontiguousarray(sizes[:, 2]),
        vx=np.round(-np.sin(turned) * speed, 3),
        vy=np.round(np.cos(turned) * speed, 3),
        track=tracks,
        attributes=[None] * len(ids),
    )


@dataclass(frozen=True, slots=True)
class FleetReader:
    """The recordings of some numbers."""

    fleet: Fleet
    numbers: tuple[int, ...]

    def recordings(self, labels: LabelChecker, report: Report) -> Iterator[RecordingColumns]:
        """In order."""
        return (self.fleet.recording(number) for number in self.numbers)


def write_store(fleet: Fleet, target: Path, jobs: int) -> Manifest:
    """A dataset."""
    maps = {MAP: fleet_map()}
    sizes = fleet.sizes()
    groups = list(segments_of([(name, frames * (FEWEST + MOST) // 2) for name, frames in sizes], SEGMENT_OBJECTS))
    with DatasetWriter(target, maps, force=True) as writer:
        waiting: list[Job] = []
        first = 0
        for number, group in enumerate(groups):
            mark = fingerprint([repr(fleet)], [RecordingEntry(name, 0, "") for name in group], frozenset())
            shares = tuple(RecordingTask(name, "", FleetReader(fleet, (first + n,))) for n, name in enumerate(group))
            waiting.append(Job(number, shares, mark))
            first += len(group)
        written = write_segments(World(writer.folder, maps), waiting, jobs, lambda recording, frames: None)
        for job, segment in zip(waiting, written, strict=True):
            writer.adopt(job.number, segment)
        return writer.finish(name="fleet", importer="fleet")


def write_interchange(fleet: Fleet, target: Path) -> None:
    """An interchange folder."""
    (target / "maps").mkdir(parents=True)
    header = {"name": "fleet", "interchange": 1, "angle": "heading", "classes": "classes.json"}
    (target / "dataset.json").write_text(json.dumps(header))
    (target / "classes.json").write_text(json.dumps({source: category for category, source, _, _ in KINDS}))
    features = [
        {
            "type": "Feature",
            "geometry": mapping(feature.shape),
            "properties": {"id": feature.id, "kind": feature.kind, **feature.properties},
        }
        for feature in fleet_map()
    ]
    (target / "maps" / f"{MAP}.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    with (target / "labels.jsonl").open("w") as file:
        for number in range(len(fleet.sizes())):
            file.writelines(_lines(fleet.recording(number)))


def _lines(columns: RecordingColumns) -> Iterator[str]:
    source_of = {category: source for category, source, _, _ in KINDS}
    egos, objects = _entries(columns.egos), _entries(columns.objects)
    start = 0
    for number, frame in enumerate(columns.frames):
        count = int(columns.object_counts[number])
        places = range(start, start + count)
        start += count
        members = [
            {"id": columns.objects.id[n], "class": source_of[columns.objects.category[n]], **objects[n]} for n in places
        ]
        label = {
            "id": frame,
            "recording": columns.name,
            "timestamp_us": columns.times_us[number],
            "map": columns.map,
            "ego": egos[number],
            "objects": members,
            "params": {"weather": "clear"},
            "sensors": {columns.channels[number]: columns.paths[number]},
        }
        yield json.dumps(label, separators=(",", ":")) + "\n"


def _entries(members: MemberColumns) -> list[dict[str, Any]]:
    columns = [
        getattr(members, name).tolist() for name in ("x", "y", "heading", "width", "length", "height", "vx", "vy")
    ]
    return [
        {
            "position": [x, y],
            "heading": heading,
            "width": width,
            "length": length,
            "height": height,
            "velocity": [vx, vy],
        }
        | ({"track": track} if track else {})
        for x, y, heading, width, length, height, vx, vy, track in zip(*columns, members.track, strict=True)
    ]


def main() -> None:
    """Read the arguments, write, and say how long it took."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--frames", type=int, required=True)
    parser.add_argument("--interchange", action="store_true")
    parser.add_argument("--needle", action="store_true")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    fleet = Fleet(given.frames, given.seed, given.needle)
    started = time.perf_counter()
    if given.interchange:
        write_interchange(fleet, given.out)
        print(f"{given.frames} frames in {time.perf_counter() - started:.1f} s")
        return
    manifest = write_store(fleet, given.out, given.jobs)
    seconds = time.perf_counter() - started
    size = sum(part.bytes for parts in manifest.tables.values() for part in parts) / 1e6
    print(
        f"{manifest.total.frames} frames, {manifest.total.objects} objects, {size:.0f} MB in {seconds:.1f} s: "
        f"{manifest.total.objects / seconds:,.0f} objects/s"
    )


if __name__ == "__main__":
    main()
