"""Which version a program is read as where pairs are given to functions, and what is said of unknown models."""

from __future__ import annotations

import pytest

from scenicq.errors import ScenarioError

from .scenes import compiled


@pytest.mark.parametrize(
    ("text", "version"),
    [
        ("ego = Car\nplatoon = createPlatoonAt(ego, 3, dist=(2, 8))\n", 1),
        ("ego = Car\ncarAheadOfCar(ego, (2, 8))\n", 1),
        ("ego = Car\nplatoon = createPlatoonAt(ego, 3)\n", 2),
        ("ego = Car\ndef ahead(gap=3):\n    return Car ahead of ego by 2 * gap\nahead(gap=(2, 8))\n", 1),
        ("ego = Car\ndef ahead(gap, more=1):\n    return Car ahead of ego by 2 * gap\nahead((2, 8))\n", 1),
        ("ego = Car\ndef ahead(gap):\n    return Car ahead of ego by gap\nahead((2, 8))\n", 2),
        ("ego = Car at 9 @ 9\nCar at 1 @ 2, apparently facing (0, 0.5)\n", 1),
        ("ego = Car at 9 @ 9\nCar offset along (0, 0.5) by 3 @ 4\n", 1),
        ("ego = Car\ndef put(place):\n    Car at place\nput((2, 8))\n", 2),
    ],
)
def test_a_pair_given_to_a_function_tells_the_version(text: str, version: int) -> None:
    assert compiled(text).version == version


def hints(text: str) -> tuple[str, ...]:
    with pytest.raises(ScenarioError) as refusal:
        compiled(text)
    return refusal.value.diagnostics[0].hints


def test_an_undecided_pair_is_refused_with_the_version_that_would_take_it() -> None:
    (hint,) = hints("ego = new Object at (0, 0), with width (2, 3)\n")
    assert "--scenic 1" in hint
    assert not hints("ego = new Object at (0, 0), with width (2, 3, 4)\n")


@pytest.mark.parametrize(
    ("name", "nearest"),
    [
        ("scenic.simulators.carla.nuscenes_model", "scenic.simulators.carla.model"),
        ("scenic.domains.driving.model2d", "scenic.domains.driving.model"),
        ("scenic.simulators.gta.gtamodel", "scenic.simulators.gta.model"),
    ],
)
def test_an_unknown_model_is_refused_with_the_nearest(name: str, nearest: str) -> None:
    assert any(f"`{nearest}` is the nearest" in hint for hint in hints(f"model {name}\nego = new Object\n"))
