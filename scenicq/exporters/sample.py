"""Scenes drawn from a scenario as labels: what `scenicq sample` prints, to be ingested and matched again."""

from __future__ import annotations

import json
import random
from collections.abc import Iterable, Iterator, Set

from scenicq.budget import Exhausted, limited
from scenicq.errors import DataError, Diagnostic, Note, ScenarioError
from scenicq.exporters.interchange import label_record, write_map
from scenicq.exporters.scene_others import of_its_objects
from scenicq.forest.improvise import Improviser, Scene
from scenicq.forest.nodes import Value
from scenicq.forest.scenario import BuiltIn, Scenario
from scenicq.geometry.angles import normalize
from scenicq.geometry.network import Network
from scenicq.store.atomic_files import whole_folder
from scenicq.store.classes import ROOT, is_class
from scenicq.store.labels import Label, LabelObject
from scenicq.store.remote_path import AnyPath
from scenicq.store.targets import target_of

__all__ = ["PATIENCE_S", "sample_labels", "sample_record", "write_sample"]

ATTEMPTS = 20_000
"""Failures for one scene after which the acceptance rate counts as hopeless."""
PATIENCE_S = 60.0
"""Seconds of the processor that one scene may take."""


_MACHINERY = frozenset({
    "position", "heading", "width", "length", "height", "velocity", "speed", "angularSpeed", "viewAngle",
    "visibleDistance", "mutationScale", "positionStdDev", "headingStdDev", "allowCollisions", "requireVisible",
    "regionContainedIn", "cameraOffset", "behavior",
})  # fmt: skip
"""Properties that have a place of their own in a label, or that describe no object."""


def _number(value: Value) -> float | None:
    return float(value) if isinstance(value, float) else None


def _object(scenario: Scenario, scene: Scene, index: int) -> LabelObject:
    owner = scenario.objects[index]
    values = {name: scene.values[index, name] for name in owner.properties}
    position, heading, velocity = values["position"], values["heading"], values.get("velocity")
    assert isinstance(position, tuple)
    assert isinstance(heading, float)
    category = owner.category if is_class(owner.category) else ROOT
    # a library's default height is made up: Scenic needs it, but no program of the plane means it
    height = values.get("height") if "height" in owner.properties and owner.properties["height"].explicit else None
    attributes: dict[str, str | float | bool] = {}
    for name, value in values.items():
        if owner.properties[name].explicit and name not in _MACHINERY and isinstance(value, str | float | bool):
            attributes[name] = value
    return LabelObject(
        owner.name, category, category, *position, normalize(heading),
        _number(values.get("width")), _number(values.get("length")), _number(height),
        velocity if isinstance(velocity, tuple) else None,
        attributes=attributes,
    )  # fmt: skip


def sample_labels(
    scenario: Scenario,
    count: int,
    seed: int,
    waive: Set[BuiltIn] = frozenset(),
    attempts: int = ATTEMPTS,
    timeout_s: float = PATIENCE_S,
) -> Iterator[Label]:
    """Labels of scenes drawn from a scenario, the same for the same seed; objects are called as in the program.

    Args:
        scenario: The scenario.
        count: How many.
        seed: The seed of the random numbers.
        waive: Built-in requirements that need not hold.
        attempts: Failures for one scene after which the acceptance rate counts as hopeless.
        timeout_s: Seconds of the processor that one scene may take.

    Raises:
        ScenarioError: impossible-requirement, where no scene comes up; deadline-passed, where none does in the time.
    """
    rng = random.Random(seed)
    improviser = Improviser(of_its_objects(scenario), frozenset(BuiltIn) - waive)
    for number in range(count):
        try:
            with limited(timeout_s):
                scene = improviser.draw(rng, attempts)
        except Exhausted:
            raise _late(scenario, improviser, number, timeout_s) from None
        if scene is None:
            raise _hopeless(scenario, improviser, number)
        members = [_object(scenario, scene, owner.index) for owner in scenario.objects]
        ego = members.pop(scenario.ego)
        params = {name: value for name, value in scene.params.items() if isinstance(value, str | float | bool)}
        yield Label(f"scene-{number:04}", "sample", number, scenario.map, ego, tuple(members), params)


def _late(scenario: Scenario, improviser: Improviser, drawn: int, timeout_s: float) -> ScenarioError:
    """What to say where the time for a scene is over: what rejected most until then."""
    after = f", after {drawn:,} that came up" if drawn else ""
    message = f"no scene came up on map `{scenario.map}` in {timeout_s:g} s{after}"
    hint = "give it more time with `--timeout`, weaken the requirements, or say with specifiers what they ask for"
    times = improviser.times_rejected()
    if not times:
        return ScenarioError(Diagnostic("deadline-passed", message, hints=(hint,)))
    worst, most = times[0]
    label = f"{worst.text} failed in {most:,} of {sum(count for _, count in times):,} attempts"
    return ScenarioError(Diagnostic("deadline-passed", message, worst.span, label, hints=(hint,)))


def _hopeless(scenario: Scenario, improviser: Improviser, drawn: int) -> ScenarioError:
    """What to say where no scene comes up: which condition rejects most, and how often."""
    times = improviser.times_rejected()
    total = sum(count for _, count in times)
    if not times and improviser.impossible is None:
        message = f"no scene came up on map `{scenario.map}`: it cannot be told {improviser.undecided}"
        return ScenarioError(Diagnostic("impossible-requirement", message))
    if improviser.impossible is not None:
        worst, message = improviser.impossible, f"no scene on map `{scenario.map}` satisfies the program"
        label = f"{worst.text} cannot be met here"
    else:
        worst, most = times[0]
        after = f", after {drawn:,} that came up" if drawn else ""
        message = f"no scene came up on map `{scenario.map}` in {total:,} attempts{after}"
        label = f"{worst.text} failed in {most:,} of them"
    notes = tuple(
        Note(check.span, f"{check.text} failed {count:,} times")
        for check, count in times[:4] if check is not worst and check.span is not None
    )  # fmt: skip
    if worst.built_in is not None:
        hints = (f"`--waive {worst.built_in.value}` draws scenes in which it need not hold",)
    else:
        hints = ("weaken the requirements, or say with specifiers what they ask for",)
    return ScenarioError(Diagnostic("impossible-requirement", message, worst.span, label, notes, hints))


def sample_record(label: Label) -> str:
    """A label as one line of an interchange folder's `labels.jsonl`."""
    return json.dumps(label_record(label, list(label.objects)), ensure_ascii=False)


def write_sample(labels: Iterable[Label], network: Network, name: str, folder: AnyPath) -> None:
    """Write labels and their map as an interchange folder.

    Args:
        labels: Drawn once it is clear that the folder can be written.
        network: The map.
        name: The name of the dataset.
        folder: Here or elsewhere; nothing may be there.

    Raises:
        DataError: target-exists, target-unwritable.
    """
    target_of(folder).check_writable()
    try:
        with whole_folder(folder) as work:
            lines = [sample_record(label) for label in labels]
            (work / "labels.jsonl").write_text("\n".join([*lines, ""]), encoding="utf-8")
            write_map(work / "maps" / f"{network.name}.geojson", network.features)
            header = {"name": name, "interchange": 1, "angle": "heading", "classes": "scenic"}
            (work / "dataset.json").write_text(json.dumps(header, indent=1) + "\n", encoding="utf-8")
    except FileExistsError:
        raise DataError(Diagnostic("target-exists", f"{folder} is there already")) from None
    except OSError as error:
        message = f"{folder} cannot be written: {error.strerror or error}"
        raise DataError(Diagnostic("target-unwritable", message)) from error
