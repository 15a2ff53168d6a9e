"""Datasets of scenes of programs, as they are and nudged."""

from __future__ import annotations

import random
import sys
from dataclasses import replace
from pathlib import Path

from drawing import draw_scene

from scenicq.compiler.program import compile_scenario
from scenicq.errors import Source
from scenicq.geometry.angles import normalize
from scenicq.geometry.default_street import street
from scenicq.store.dataset import Dataset, open_dataset
from scenicq.store.labels import Label, LabelObject, Recording
from scenicq.store.writer import write_dataset

sys.path.insert(0, str(Path(__file__).parents[1] / "match"))
from made_up import RANDOM
from programs import HEADER, PROGRAMS
from scenes import label_of

STREET = street()


def turned_in(thing: LabelObject) -> LabelObject:
    """With a heading as every importer gives it."""
    return thing if thing.heading is None else replace(thing, heading=normalize(thing.heading))


def nudged(thing: LabelObject, rng: random.Random) -> LabelObject:
    scale = rng.choice([0.0, 0.0, 0.3, 2.0, 10.0])
    return replace(
        thing,
        x=thing.x + rng.uniform(-scale, scale),
        y=thing.y + rng.uniform(-scale, scale),
        heading=None if rng.random() < 0.05 else (thing.heading or 0.0) + rng.uniform(-scale, scale) / 5,
    )


def dataset_of(programs: dict[str, str], folder: Path) -> Dataset:
    """Scenes of programs, as they are and nudged, as one recording on the street."""
    rng = random.Random(1)
    labels: list[Label] = []
    for text in programs.values():
        scenario = compile_scenario(Source("test.scenic", HEADER + text), STREET)
        for _ in range(2 if programs is PROGRAMS else 1):
            scene = draw_scene(scenario, rng, 300 if text in RANDOM.values() else 5000)
            if scene is None:
                assert text in RANDOM.values()
                continue
            label = label_of(scenario, scene, rng, distractors=2, sizes=rng.random() < 0.5)
            for change in range(3):
                things = tuple(turned_in(nudged(each, rng) if change else each) for each in label.objects)
                ego = turned_in(nudged(label.ego, rng) if change == 2 else label.ego)
                number = len(labels)
                labels.append(
                    replace(
                        label,
                        frame=f"frame-{number:04}",
                        timestamp_us=number,
                        ego=replace(ego, id="ego", heading=ego.heading or 0.0),
                        objects=things,
                        params=rng.choice(
                            [
                                {},
                                {"weather": "rain", "hour": 7.0},
                                {"weather": "clear"},
                                {"hour": 13.0},
                                {"hour": "late"},
                            ]
                        ),
                    )
                )
    target = folder / "dataset"
    write_dataset(
        target, iter([Recording("recording", "street", tuple(labels))]), {"street": STREET.features}, name="t"
    )
    return open_dataset(target)
