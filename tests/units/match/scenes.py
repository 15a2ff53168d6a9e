"""Labels made from scenarios: the generate, perturb and shuffle oracles."""

from __future__ import annotations

import random
from dataclasses import replace

from drawing import draw_scene

from scenicq.compiler.program import compile_scenario
from scenicq.errors import Source
from scenicq.forest.improvise import Scene
from scenicq.forest.scenario import Scenario
from scenicq.geometry.default_street import street
from scenicq.geometry.network import Network
from scenicq.store.classes import is_class
from scenicq.store.labels import Label, LabelObject

STREET = street()


def compiled(text: str, network: Network = STREET, **options: object) -> Scenario:
    """A program over the made-up street."""
    return compile_scenario(Source("test.scenic", text), network, **options)  # type: ignore[arg-type]


def thing(scenario: Scenario, scene: Scene, index: int, *, sizes: bool = True) -> LabelObject:
    """The label object that a scene shows for an object of the scenario."""
    owner = scenario.objects[index]
    (x, y), heading = scene.values[index, "position"], scene.values[index, "heading"]
    category = owner.category if is_class(owner.category) else "Object"
    return LabelObject(
        id=f"object-{index}",
        category=category,
        source_class=category,
        x=x,
        y=y,
        heading=heading,
        width=scene.values[index, "width"] if sizes else None,
        length=scene.values[index, "length"] if sizes else None,
    )


def label_of(
    scenario: Scenario, scene: Scene, rng: random.Random, *, distractors: int = 0, sizes: bool = True
) -> Label:
    """A scene as a label: objects shuffled among distractors of the same classes."""
    ego = thing(scenario, scene, scenario.ego, sizes=sizes)
    things = [
        thing(scenario, scene, each.index, sizes=sizes) for each in scenario.objects if each.index != scenario.ego
    ]
    for number in range(distractors):
        model = rng.choice(things) if things else ego
        things.append(
            replace(
                model,
                id=f"distractor-{number}",
                x=model.x + rng.uniform(-30, 30),
                y=model.y + rng.uniform(-30, 30),
                heading=rng.uniform(-3.1, 3.1),
            )
        )
    rng.shuffle(things)
    return Label("frame", "recording", 0, "street", ego, tuple(things))


def drawn(scenario: Scenario, seed: int, attempts: int = 2000) -> Scene:
    """A scene, the same for the same seed."""
    scene = draw_scene(scenario, random.Random(seed), attempts)
    assert scene is not None, "no scene came up"
    return scene
