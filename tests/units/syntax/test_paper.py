"""The programs that the two papers print, and the scenarios that come with the package."""

from __future__ import annotations

from pathlib import Path

import pytest

from scenicq.errors import Source
from scenicq.syntax import ast
from scenicq.syntax.parser import parse
from scenicq.syntax.walk import walk

from .paper_programs import PROGRAMS
from .shape import module, shape

SCENARIOS = sorted((Path(__file__).parents[3] / "sample_data" / "scenarios").glob("*.scenic"))


@pytest.mark.parametrize("name", PROGRAMS)
def test_program_of_a_paper(name: str) -> None:
    text, instances, versions = PROGRAMS[name]
    found = module(text)
    assert sum(isinstance(node, ast.New) for node in walk(*found.body)) == instances
    assert found.versions == versions


@pytest.mark.parametrize("path", SCENARIOS, ids=lambda path: path.stem)
def test_scenario_of_the_package(path: Path) -> None:
    found = parse(Source(path.name, path.read_text(encoding="utf-8")))
    assert found.version == 3
    assert isinstance(found.body[0], ast.Model)
    assert not any(isinstance(node, ast.UnsupportedStatement | ast.DynamicStatement) for node in walk(*found.body))


def test_there_are_scenarios() -> None:
    assert len(SCENARIOS) >= 5


def test_badly_parked_car() -> None:
    body = module(PROGRAMS["badly parked car"][0]).body
    assert [shape(node) for node in body] == [
        "Assign([ego], Car)",
        "Assign([spot], New(OrientedPoint, [<on <visible curb>>], False))",
        "Assign([badAngle], <(* Uniform(1.0, (- 1.0)) Tuple([10, 20])) deg>)",
        "New(Car, [<left of spot by 0.5>, <facing <badAngle relative to roadDirection>>], False)",
    ]


def test_platoon_function() -> None:
    (function,) = module(PROGRAMS["platoon function"][0]).body
    assert isinstance(function, ast.FunctionDef)
    (_, loop) = function.body
    assert isinstance(loop, ast.For)
    assert [shape(node) for node in loop.body] == [
        "Assign([center], <follow roadDirection from <front of lastCar> for resample(dist)>)",
        (
            "Assign([pos], New(OrientedPoint, [<right of center by shift>, "
            "<facing <resample(wiggle) relative to roadDirection>>], False))"
        ),
        (
            "Assign([lastCar], New(Car, [<ahead of pos>, "
            "With(model, IfElse((model is None), car.model, resample(model)))], False))"
        ),
    ]
