"""Scenes drawn from a scenario as labels: what `scenicq sample` prints, to be ingested and matched again."""

from __future__ import annotations

import json
import random
from collections.abc import Iterable, Iterator
from pathlib import Path

from scenicq.errors import DataError, Diagnostic, ScenarioError
from scenicq.forest.improvise import Scene, draw_scene
from scenicq.forest.nodes import Value
from scenicq.forest.scenario import Scenario
from scenicq.geometry.angles import normalize
from scenicq.geometry.network import Network
from scenicq.query.export_interchange import label_record, write_map
from scenicq.store.classes import ROOT, is_class
from scenicq.store.labels import Label, LabelObject

__all__ = ["sample_labels", "sample_record", "write_sample"]

ATTEMPTS = 20_000
"""Scenes tried before the acceptance rate counts as hopeless."""


def _number(value: Value) -> float | None:
    return float(value) if isinstance(value, float) else None


def _object(scenario: Scenario, scene: Scene, index: int) -> LabelObject:
    thing = scenario.objects[index]
    position, heading = scene.values[index, "position"], scene.values[index, "heading"]
    assert isinstance(position, tuple)
    assert isinstance(heading, float)
    width, length = (_number(scene.values.get((index, name))) for name in ("width", "length"))
    category = thing.category if is_class(thing.category) else ROOT
    return LabelObject(thing.name, category, category, *position, normalize(heading), width, length)


def sample_labels(scenario: Scenario, count: int, seed: int) -> Iterator[Label]:
    """Labels of scenes drawn from a scenario, the same for the same seed; objects are called as in the program.

    Raises:
        ScenarioError: impossible-requirement, where `ATTEMPTS` draws give no scene.
    """
    rng = random.Random(seed)
    for number in range(count):
        scene = draw_scene(scenario, rng, ATTEMPTS)
        if scene is None:
            first = next((each.span for each in scenario.requirements if each.built_in is None), None)
            message = f"no scene in {ATTEMPTS:,} draws satisfies the program on map `{scenario.map}`"
            hints = ("weaken the requirements, or say with specifiers what they ask for",)
            raise ScenarioError(Diagnostic("impossible-requirement", message, first, hints=hints))
        things = [_object(scenario, scene, thing.index) for thing in scenario.objects]
        ego = things.pop(scenario.ego)
        params = {name: value for name, value in scene.params.items() if isinstance(value, str | float | bool)}
        yield Label(f"scene-{number:04}", "sample", number, scenario.map, ego, tuple(things), params)


def sample_record(label: Label) -> str:
    """A label as one line of an interchange folder's `labels.jsonl`."""
    return json.dumps(label_record(label, list(label.objects)), ensure_ascii=False)


def write_sample(labels: Iterable[Label], network: Network, name: str, folder: Path) -> None:
    """Write labels and their map as an interchange folder.

    Raises:
        DataError: target-exists, target-unwritable.
    """
    lines = [sample_record(label) for label in labels]
    try:
        folder.mkdir(parents=True)
        (folder / "labels.jsonl").write_text("\n".join([*lines, ""]), encoding="utf-8")
        write_map(folder / "maps" / f"{network.name}.geojson", network.features)
        header = {"name": name, "interchange": 1, "angle": "heading", "classes": "scenic"}
        (folder / "dataset.json").write_text(json.dumps(header, indent=1) + "\n", encoding="utf-8")
    except FileExistsError:
        raise DataError(Diagnostic("target-exists", f"{folder} is there already")) from None
    except OSError as error:
        raise DataError(Diagnostic("target-unwritable", f"{folder} cannot be written: {error.strerror}")) from None
