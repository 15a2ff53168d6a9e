"""Densities against numerical integration and sampling frequencies; areas; samples that spread."""

from __future__ import annotations

import math
import random
from dataclasses import replace

import numpy as np
import pytest

from scenicq.compiler.program import compile_scenario
from scenicq.errors import Source
from scenicq.evaluate.ranking import log_densities, sample_diverse, sample_plain
from scenicq.forest.improvise import Improviser, Scene
from scenicq.forest.scenario import Scenario
from scenicq.geometry.areas import area
from scenicq.geometry.default_street import street
from scenicq.geometry.regions import Disc, PolygonSet, PolylineSet, Rectangle, Sector, difference, intersection, union
from scenicq.geometry.sampling import sampler
from scenicq.match.verdict import Match
from scenicq.query.execution.results import LogDensity, Result
from scenicq.store.labels import Label, LabelObject

START = "ego = new Object at (0, 0), facing 0 deg\n"
MODEL = "model scenic.domains.driving.model\n"
STREET = street()


def compiled(text: str) -> Scenario:
    return compile_scenario(Source("test.scenic", text), STREET)


def placed(scenario: Scenario, *places: tuple[float, float, float]) -> tuple[Label, dict[str, str]]:
    """A label with each object of the scenario somewhere: x, y, heading."""
    things = [
        LabelObject("ego" if number == scenario.ego else f"o{number}", each.category, "", *place)
        for number, (each, place) in enumerate(zip(scenario.objects, places, strict=True))
    ]
    cast = {each.name: thing.id for each, thing in zip(scenario.objects, things, strict=True)}
    others = tuple(thing for thing in things if thing.id != "ego")
    return Label("f", "r", 0, "street", things[scenario.ego], others), cast


def shown(scenario: Scenario, scene: Scene) -> tuple[Label, dict[str, str]]:
    def place(number: int) -> tuple[float, float, float]:
        x, y = scene.values[number, "position"]  # type: ignore[misc]
        return x, y, scene.values[number, "heading"]  # type: ignore[return-value]

    return placed(scenario, *(place(number) for number in range(len(scenario.objects))))


def density(text: str, *places: tuple[float, float, float]) -> LogDensity:
    scenario = compiled(START + text)
    (found,) = log_densities(scenario, [placed(scenario, (0, 0, 0), *places)], draws=4096)
    return found


def normal(x: float, mean: float, deviation: float) -> float:
    return math.exp(-(((x - mean) / deviation) ** 2) / 2) / deviation / math.sqrt(math.tau)


def test_uniform_places() -> None:
    program = "new Object offset by Range(3, 5) @ Range(5, 20), facing Range(-10, 10) deg relative to ego.heading"
    found = density(program, (4, 12, 0.1))
    assert found.log == pytest.approx(-math.log(2 * 15 * math.radians(20)))
    assert (found.error, found.fixed) == (0, ("ego.position", "ego.heading"))
    outside = density(program, (5.1, 12, 0.1))
    assert outside.log is None
    assert "tolerance" in outside.reason


def test_scaled_and_turned() -> None:
    assert density("new Object at (2 * Range(0, 1), 5), facing Normal(0, 0.5)", (1, 5, 0.3)).reason
    program = "x = Range(0, 1)\nnew Object at (2 * x, 3 * x + Normal(0, 1)), facing Range(0, 1)"
    found = density(program, (1, 2, 0.5))
    assert found.log == pytest.approx(math.log(0.5 * normal(2 - 1.5, 0, 1)))


def test_headings_wrap() -> None:
    program = "new Object at (Range(0, 1), Range(0, 1)), facing Range(170, 200) deg"
    each = -math.log(math.radians(30))
    for heading in (math.radians(175), math.radians(-175), math.radians(-165)):
        assert density(program, (0.5, 0.5, heading)).log == pytest.approx(each)
    assert density(program, (0.5, 0.5, math.radians(-155))).log is None
    wide = "new Object at (Range(0, 1), Range(0, 1)), facing Normal(180, 90) deg"
    expected = sum(normal(math.pi + 0.2 + turn * math.tau, math.pi, math.pi / 2) for turn in range(-3, 4))
    assert density(wide, (0.5, 0.5, 0.2 - math.pi)).log == pytest.approx(math.log(expected), abs=1e-3)


def integral(function, low: float, high: float, steps: int = 20_000) -> float:
    at = low + (high - low) * (np.arange(steps) + 0.5) / steps
    return float(np.mean([function(value) for value in at.tolist()]) * (high - low))


@pytest.mark.parametrize("x", [0.3, 1.2, 2.6])
@pytest.mark.parametrize("y", [0.5, 4.0, 7.5])
def test_hidden_variables_by_numerical_integration(x: float, y: float) -> None:
    """A hidden h scales one coordinate and moves the other; a requirement cuts it."""
    program = "h = Range(0, 3)\nnew Object at (Range(0, 1) * (1 + h), h * h + Range(-2, 2)), facing Range(-1, 1)\n"
    program += "require h > 0.5"

    def inside(h: float) -> float:
        return (h > 0.5) * (0 <= x / (1 + h) <= 1) / (1 + h) * (-2 <= y - h * h <= 2) / 4 / 2 / 3

    found, expected = density(program, (x, y, 0.2)), integral(inside, 0, 3)
    if expected == 0:
        assert found.log is None
    else:
        assert found.log == pytest.approx(math.log(expected), abs=max(0.02, 4 * found.error))


def test_finite_choices() -> None:
    program = "c = Discrete({0: 1, 10: 3})\nnew Object at (c + Range(0, 2), Range(0, 1)), facing Uniform(0, 90) deg"
    found = density(program, (11, 0.5, math.pi / 2))
    assert found.log == pytest.approx(math.log(0.75 / 2 * 0.5), abs=0.05)
    assert density(program, (1, 0.5, 0.3)).log is None


def test_points_of_regions() -> None:
    scenario = compiled(MODEL + "ego = new Car on road, facing Range(-15, 15) deg relative to roadDirection")
    drawn = Improviser(scenario, frozenset())
    labels = [shown(scenario, drawn.draw(random.Random(seed), 1000)) for seed in range(40)]  # type: ignore[arg-type]
    found = log_densities(scenario, labels)
    assert all(each.log is not None for each in found)
    # where one direction holds, all of the road is as likely
    whole = area(union(STREET.roadRegion, STREET.intersectionRegion))
    plain = [each.log for each in found if each.error < 1e-9]
    assert plain
    assert np.ptp(plain) < 1e-9
    assert whole is not None
    assert plain[0] == pytest.approx(-math.log(whole * math.radians(30)))


@pytest.mark.parametrize("program", [
    "ego = new Car\nspot = new OrientedPoint on visible curb\nnew Car left of spot by 0.5",
    "ego = new Car at (0, 0), facing 0 deg",
])  # fmt: skip
def test_where_there_is_no_density_it_says_so(program: str) -> None:
    scenario = compiled(MODEL + program)
    label = placed(scenario, *((float(n), 0.0, 0.0) for n in range(len(scenario.objects))))
    (found,) = log_densities(scenario, [label])
    assert found.log is None
    assert found.reason


def test_ranks_agree_with_sampling_frequencies() -> None:
    """Of many scenes, more fall near labels of a higher density."""
    text = START + "d = Range(0, 4)\nnew Object at (Normal(0, 1) + d, Range(0, 2) * (1 + d)), facing Range(-1, 1)"
    scenario = compiled(text)
    drawn = Improviser(scenario, frozenset())
    rng = random.Random(3)
    places = [drawn.draw(rng, 1000).values[1, "position"] for _ in range(20_000)]  # type: ignore[union-attr]
    xy = np.array(places)
    spots = [(0.5, 1.0), (2.0, 2.0), (4.0, 4.0), (5.0, 1.0), (-1.0, 3.0), (3.0, 7.0)]
    labels = [placed(scenario, (0, 0, 0), (*spot, 0.0)) for spot in spots]
    logs = [each.log for each in log_densities(scenario, labels, draws=2048)]
    for spot, log in zip(spots, logs, strict=True):
        count = int((np.hypot(*(xy - spot).T) < 0.4).sum())
        expected = 20_000 * math.pi * 0.16 * 2 * math.exp(log or -99)
        assert abs(count - expected) < 5 * math.sqrt(expected + 1) + 0.1 * expected


def test_the_same_draws_every_time() -> None:
    program = "h = Normal(0, 1)\nnew Object at (h * h + Range(0, 2), Range(0, 1)), facing Range(-1, 1)"
    assert density(program, (1, 0.5, 0)) == density(program, (1, 0.5, 0))


def test_areas() -> None:
    square = PolygonSet((_square(0, 0, 10), _square(5, 0, 10)), "squares")
    assert area(square) == pytest.approx(150)
    disc = Disc((0.0, 0.0), 3.0)
    assert area(disc) == pytest.approx(9 * math.pi)
    assert area(Sector((0.0, 0.0), 2.0, 1.0, 0.5)) == pytest.approx(1)
    assert area(Rectangle((0.0, 0.0), 1.0, 2.0, 3.0)) == 6
    assert area(intersection(square, disc)) == pytest.approx(9 * math.pi / 4, rel=1e-3)
    assert area(union(square, disc)) == pytest.approx(150 + 27 * math.pi / 4, rel=1e-3)
    assert area(difference(square, disc)) == pytest.approx(150 - 9 * math.pi / 4, rel=1e-3)
    assert area(intersection(square, Sector((5.0, 5.0), 3.0, 0.0, 1.0))) == pytest.approx(4.5, rel=1e-3)
    import shapely

    assert area(PolylineSet((shapely.LineString([(0, 0), (1, 1)]),), "line")) is None


def _square(x: float, y: float, size: float):
    import shapely

    return shapely.box(x, y, x + size, y + size)


def test_areas_agree_with_the_sampler() -> None:
    region = intersection(PolygonSet((_square(0, 0, 10),), "square"), Sector((0.0, 0.0), 8.0, -0.6, 1.0))
    draw, rng = sampler(region), random.Random(0)
    small = sum(x < 3 and y < 3 for x, y in (draw(rng) for _ in range(20_000)))
    part = area(intersection(region, PolygonSet((_square(0, 0, 3),), "part")))
    assert small / 20_000 == pytest.approx(part / area(region), abs=0.02)


def results(recordings: int, frames: int) -> list[Result]:
    rng = random.Random(1)
    return [
        Result(f"{r}/{f}", f"r{r}", f * 500_000, Match({}, {"a.scenic:1:1": rng.random(), "p": (1.0, rng.random())}))
        for r in range(recordings)
        for f in range(frames)
    ]  # fmt: skip


def test_samples_that_spread() -> None:
    found = results(8, 30)
    chosen = sample_diverse(found, 16)
    assert len(chosen) == 16
    assert {each.recording for each in chosen} == {each.recording for each in found}
    values = sorted(each.verdict.witness["a.scenic:1:1"] for each in chosen)
    assert max(np.diff([0, *values, 1])) < 0.25
    assert chosen == sample_diverse(found, 16)
    assert [each for each in found if each in chosen] == chosen
    uneven = [*results(1, 40), *(replace(each, recording="other") for each in results(1, 2))]
    assert sum(each.recording == "other" for each in sample_diverse(uneven, 10)) == 2
    assert sample_diverse(found, 1000) == found
    assert len(sample_plain(found, 5)) == 5
    assert sample_plain(found, 5) == sample_plain(found, 5)
