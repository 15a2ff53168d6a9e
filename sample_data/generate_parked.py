"""Writes `parked/` next to this file: cars parked beside the road, and what an invented model detects of them.

The model misses parked cars that are near, as a program that simulates them might have shown; of everything else it
misses one in eight. Run it with `python sample_data/generate_parked.py`.
"""

from __future__ import annotations

import json
import math
import random
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from generate import ARMS, HERE, compact, place, town_features, write

RECORDINGS, FRAMES, PERIOD_S = 16, 6, 0.5
SPEED = 7.0
PROGRAM = """# A car that is parked beside the road, a little ahead of the ego.
model scenic.domains.driving.model

ego = new Car

gap = Range(4, 20)

parkedCar = new Car offset by Range(3, 5.5) @ gap,
    facing Range(-10, 10) deg relative to ego.heading
"""


def thing(name: str, kind: str, arm: str, right: float, out: float, speed: float) -> dict[str, Any]:
    """An object of a label that drives away from the intersection, towards it (a negative speed), or not at all."""
    heading = ARMS[arm] + (math.pi if speed < 0 else 0.0)
    heading = math.atan2(math.sin(heading), math.cos(heading))
    size = {"Car": (1.9, 4.5), "Truck": (2.5, 8.0), "Adult": (0.6, 0.6)}[kind]
    velocity = abs(speed)
    return {
        "id": name,
        "class": kind,
        "track": name,
        "position": list(place(arm, round(right, 2), round(out, 2))),
        "heading": round(heading, 4),
        "width": size[0],
        "length": size[1],
        "velocity": [round(-velocity * math.sin(heading), 2) + 0.0, round(velocity * math.cos(heading), 2) + 0.0],
    }


def labels() -> Iterator[dict[str, Any]]:
    """All labels, recording by recording."""
    rng = random.Random(19)
    for number in range(RECORDINGS):
        arm = ("east", "west")[number % 2]
        name = f"{number + 1:02}-{arm}"
        start, parked = rng.uniform(20, 40), rng.uniform(22, 27)
        beside, lead, oncoming = rng.uniform(5.5, 6.5), rng.uniform(8, 22), rng.uniform(30, 60)
        for step in range(FRAMES):
            out = start + SPEED * PERIOD_S * step
            ego = thing("ego", "Car", arm, 1.75, out, SPEED)
            objects = [
                thing("parked", "Car", arm, beside, start + parked, 0.0),
                thing("lead", "Car", arm, 1.75, out + lead, SPEED),
                thing("oncoming", "Car", arm, -1.75, out + oncoming - SPEED * PERIOD_S * step * 2, -SPEED),
                thing("walker", "Adult", arm, 9.0, start + 15 + step, 1.4),
            ]
            del ego["id"], ego["class"], ego["track"]
            yield {
                "id": f"{name}/{step}",
                "recording": name,
                "timestamp_us": 1_710_000_000_000_000 + number * 3_600_000_000 + int(step * PERIOD_S * 1e6),
                "map": "crossroads",
                "ego": ego,
                "objects": objects,
                "params": {"weather": ("sunny", "rainy", "cloudy")[number % 3]},
            }


def detected(label: dict[str, Any], rng: random.Random) -> dict[str, Any]:
    """What the model says of a label."""
    found: list[dict[str, Any]] = []
    for each in label["objects"]:
        x, y = each["position"]
        ego = label["ego"]["position"]
        near = each["id"] == "parked" and math.dist((x, y), ego) < 13
        if rng.random() < (0.7 if near else 0.1):
            continue
        found.append(
            {
                "class": each["class"],
                "position": [round(x + rng.gauss(0, 0.25), 2), round(y + rng.gauss(0, 0.25), 2)],
                "heading": round(each["heading"] + rng.gauss(0, 0.04), 3),
                "width": round(each["width"] * math.exp(rng.gauss(0, 0.05)), 2),
                "length": round(each["length"] * math.exp(rng.gauss(0, 0.05)), 2),
                "score": round(rng.betavariate(6, 2), 3),
            }
        )
    if rng.random() < 0.3:
        x, y = label["ego"]["position"]
        place_ = [round(x + rng.uniform(-25, 25), 2), round(y + rng.uniform(-12, 12), 2)]
        found.append({"class": "Car", "position": place_, "heading": 0, "width": 1.9, "length": 4.4,
                      "score": round(rng.betavariate(2, 5), 3)})  # fmt: skip
    return {"id": label["id"], "objects": found}


def main(folder: Path = HERE) -> None:
    """Write the dataset into a folder, in place of what is there under its name."""
    target = folder / "parked"
    shutil.rmtree(target, ignore_errors=True)
    header: dict[str, object] = {"name": "parked", "interchange": 1, "angle": "heading", "classes": "scenic"}
    header["source"] = "invented by sample_data/generate_parked.py; Apache-2.0"
    write(target / "dataset.json", json.dumps(header, indent=0))
    every = list(labels())
    write(target / "labels.jsonl", "\n".join(compact(label) for label in every))
    features = ",\n".join(compact(element) for element in town_features())
    write(target / "maps" / "crossroads.geojson", f'{{"type":"FeatureCollection","features":[\n{features}\n]}}')
    rng = random.Random(7)
    write(target / "predictions.jsonl", "\n".join(compact(detected(label, rng)) for label in every))
    runs = [f"parked_car,{int(rng.random() < 0.5)}" for _ in range(60)]
    write(target / "runs.csv", "\n".join(["scenario,failed", *runs]))
    write(target / "parked_car.scenic", PROGRAM.rstrip("\n"))


if __name__ == "__main__":
    main()
