"""Simulated traces as recordings: as they are, with fewer samples, with noise, and changed so that they may break the
program; and how they are written for scenicq."""

from __future__ import annotations

import json
import math
import random
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from comparing import label_object

MORE_S = 1.0
"""Seconds by which a recording goes on after the program has ended, all objects as they moved last."""
THINNED = 5
"""Every so many-th sample is left: 2 of 10 a second."""
MOST_CHANGED = 4
"""Objects that are changed, one after the other: the ego and those that the program names first."""
JITTER = (0.05, math.radians(0.3))
"""Metres and radians of noise. What is 20 m ahead of an object turned by this is 0.1 m aside: with the noise of both
ends 0.2 m, within the tolerance of 0.25 m."""

BEGINS = "trace_begins"
"""A global parameter that is 1 at the first sample of a recording, and 0 at all others."""

States = list[list[list[float]]]
"""For each sample and object: x, y, heading, velocity east and north."""


@dataclass(frozen=True, slots=True)
class Recorded:
    """States to be matched with a program, and replayed in Scenic.

    Attributes:
        name: Of the recording; what it begins with is its kind.
        states: Of its samples.
        time_step: Seconds between two samples.
    """

    name: str
    states: States
    time_step: float

    @property
    def kind(self) -> str:
        """What was done to the trace."""
        return self.name.partition("-")[0]


def continued(states: States, time_step: float) -> States:
    """The states, and those of a second more in which everything goes on as it went last."""
    last = states[-1]
    times = [time_step * n for n in range(1, round(MORE_S / time_step) + 1)]
    return states + [[[x + east * t, y + north * t, h, east, north] for x, y, h, east, north in last] for t in times]


def recordings(trace: dict[str, Any], seed: int) -> Iterator[Recorded]:
    """All that is made of one trace."""
    states, step = trace["states"], trace["time_step"]
    longer = continued(states, step)
    yield Recorded("whole", states, step)
    yield Recorded("thinned", longer[::THINNED], step * THINNED)
    yield Recorded("jitter", _jittered(longer, seed), step)
    yield Recorded("cut", states[: max(2, 2 * len(states) // 3)], step)
    for number in range(min(MOST_CHANGED, len(states[0]))):
        yield Recorded(f"late-{number}", _late(longer, number, round(1.5 / step)), step)
        yield Recorded(f"stops-{number}", _stops(longer, number, len(states) // 3), step)
        yield Recorded(f"aside-{number}", _aside(longer, number, 6.0), step)
        yield Recorded(f"turned-{number}", _turned(longer, number, len(states) // 2), step)
        yield Recorded(f"faster-{number}", _faster(longer, number, 1.8), step)
    yield Recorded("back", _back(longer, len(states) // 2), step)
    for number in range(1, min(MOST_CHANGED, len(states[0]))):
        yield Recorded(f"swapped-{number}", _swapped(longer, number, len(states) // 2), step)


def _jittered(states: States, seed: int) -> States:
    rng = random.Random(seed)

    def noisy(state: list[float]) -> list[float]:
        x, y, heading, east, north = state
        far, way = rng.uniform(0, JITTER[0]), rng.uniform(-math.pi, math.pi)
        heading += rng.uniform(-JITTER[1], JITTER[1])
        return [x + far * math.cos(way), y + far * math.sin(way), heading, east, north]

    return [[noisy(state) for state in sample] for sample in states]


def _with(states: States, number: int, changed: list[list[float]]) -> States:
    return [[*s[:number], new, *s[number + 1 :]] for s, new in zip(states, changed, strict=True)]


def _late(states: States, number: int, steps: int) -> States:
    x, y, heading, _, _ = states[0][number]
    waits = [states[0][number], *([x, y, heading, 0.0, 0.0] for _ in range(steps))]
    return _with(states, number, [*waits, *(sample[number] for sample in states)][: len(states)])


def _stops(states: States, number: int, step: int) -> States:
    x, y, heading, _, _ = states[step][number]
    gone = [sample[number] for sample in states[:step]]
    return _with(states, number, [*gone, *([x, y, heading, 0.0, 0.0] for _ in states[step:])])


def _aside(states: States, number: int, far: float) -> States:
    def moved(n: int, state: list[float]) -> list[float]:
        x, y, heading, east, north = state
        way = far * min(1.0, n / 20)
        return [x + way * math.cos(heading), y + way * math.sin(heading), heading, east, north]

    return _with(states, number, [moved(n, sample[number]) for n, sample in enumerate(states)])


def _turned(states: States, number: int, step: int) -> States:
    def turned(n: int, state: list[float]) -> list[float]:
        return [*state[:2], state[2] + (math.pi / 2 if n >= step else 0.0), *state[3:]]

    return _with(states, number, [turned(n, sample[number]) for n, sample in enumerate(states)])


def _faster(states: States, number: int, factor: float) -> States:
    first = states[0][number]
    return _with(states, number, [first, *([*s[number][:3], *(factor * v for v in s[number][3:])] for s in states[1:])])


def _back(states: States, step: int) -> States:
    """Everything goes back the way it came from a step on, as it faced."""
    gone = reversed(states[:step])
    return states[: step + 1] + [[[x, y, h, -east, -north] for x, y, h, east, north in sample] for sample in gone]


def _swapped(states: States, number: int, step: int) -> States:
    """The object before another and that other trade places at a step."""
    first, then = (
        _with(states, at, [s[of] for s in states]) for at, of in ((number - 1, number), (number, number - 1))
    )
    both = _with(first, number, [sample[number] for sample in then])
    return states[:step] + both[step:]


def write(folder: Path, chart: Path, objects: list[dict[str, Any]], recorded: list[Recorded]) -> None:
    """Write recordings in the interchange format; the objects are called `object-0` (the ego), `object-1`, ..."""
    shutil.rmtree(folder, ignore_errors=True)
    (folder / "maps").mkdir(parents=True)
    shutil.copy(chart, folder / "maps" / "town.geojson")
    header = {"name": "traces", "interchange": 1, "angle": "heading", "classes": "scenic"}
    (folder / "dataset.json").write_text(json.dumps(header), encoding="utf-8")
    with (folder / "labels.jsonl").open("w", encoding="utf-8") as file:
        for each in recorded:
            for number, sample in enumerate(each.states):
                things = [_thing(n, thing, state) for n, (thing, state) in enumerate(zip(objects, sample, strict=True))]
                label = {
                    "id": f"{each.name}/{number:04d}",
                    "recording": each.name,
                    "timestamp_us": round(number * each.time_step * 1e6),
                    "map": "town",
                    "params": {BEGINS: int(number == 0)},
                    "ego": things[0],
                    "objects": things[1:],
                }
                file.write(json.dumps(label) + "\n")


def _thing(number: int, thing: dict[str, Any], state: list[float]) -> dict[str, Any]:
    x, y, heading, east, north = state
    name, category = f"object-{number}", label_object("", thing).category
    size = {"width": thing["width"], "length": thing["length"]}
    motion = {"position": [x, y], "heading": math.remainder(heading, math.tau), "velocity": [east, north]}
    return {"id": name, "track": name, "class": category, **size, **motion}
