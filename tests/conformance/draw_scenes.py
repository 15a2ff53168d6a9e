"""Draws scenes with the original Scenic. Runs in an environment of its own, which has `scenic` and not `scenicq`.

Usage: python draw_scenes.py MAP.xodr OUT SCENES PROGRAM...

Writes OUT/map.geojson (Scenic's own network of the map, as interchange features) and OUT/NAME.json for each program:
either {"error": text} or {"scenes": [[object, ...], ...]}, the ego first, headings in Scenic's convention.
"""

from __future__ import annotations

import json
import random
import sys
from pathlib import Path
from typing import Any

import numpy as np
import scenic
from network_features import features_of
from scenic.domains.driving.roads import Network

MOST_ATTEMPTS = 20_000


def thing(thing: Any) -> dict[str, Any]:
    """An object of a scene as plain numbers, with the names of its classes, most derived first."""
    return {
        "classes": [cls.__name__ for cls in type(thing).__mro__],
        "x": float(thing.position.x),
        "y": float(thing.position.y),
        "heading": float(thing.heading),
        "width": float(thing.width),
        "length": float(thing.length),
    }


def draw(text: str, chart: Path, count: int, seed: int) -> dict[str, Any]:
    """Scenes of a program, or why there are none."""
    random.seed(seed)
    np.random.seed(seed)
    try:
        scenario = scenic.scenarioFromString(text, params={"map": str(chart)}, mode2D=True)
        drawn = [scenario.generate(maxIterations=MOST_ATTEMPTS)[0] for _ in range(count)]
    except Exception as error:  # whatever Scenic says of the program is its answer
        return {"error": f"{type(error).__name__}: {error}"}
    plain = [
        {
            "objects": [thing(each) for each in scene.objects],
            "params": {k: v for k, v in scene.params.items() if isinstance(v, str | int | float | bool) and k != "map"},
        }
        for scene in drawn
    ]
    return {"scenes": plain}


def main(arguments: list[str]) -> None:
    """Draw for every program."""
    chart, out, count = Path(arguments[0]), Path(arguments[1]), int(arguments[2])
    collection = {"type": "FeatureCollection", "features": features_of(Network.fromFile(chart))}
    (out / "map.geojson").write_text(json.dumps(collection), encoding="utf-8")
    for seed, path in enumerate(map(Path, arguments[3:])):
        answer = draw(path.read_text(encoding="utf-8"), chart, count, seed)
        (out / f"{path.stem}.json").write_text(json.dumps(answer), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
