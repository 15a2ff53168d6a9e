"""Recordings of several maps side by side are asked as those of each map alone."""

from __future__ import annotations

import pytest
from maps_in_turns import MAPS, maps_in_turns

from scenicq.errors import Source
from scenicq.query.execution.option_texts import DRIVING, read_options
from scenicq.query.execution.records import record
from scenicq.query.execution.run import Query

ANYWHERE = "in everywhere, facing Range(0, 360) deg"
PAIR = f"ego = new Car {ANYWHERE}\nother = new Car {ANYWHERE}\n"
PROGRAMS = {
    "frames": f"{PAIR}require (distance to other) < 10",
    "comes near": f"{PAIR}require eventually (distance to other) < 9",
    "stays": f"{PAIR}require always (distance to other) < 10",
    "until": f"{PAIR}require (distance to other) < 11 until (distance to other) < 9",
    "the ego alone": f"ego = new Car {ANYWHERE}\nrequire eventually ego.position.y > 1",
}


@pytest.fixture(scope="module")
def datasets(tmp_path_factory):
    folder = tmp_path_factory.mktemp("turns")
    return maps_in_turns(folder / "all"), [maps_in_turns(folder / name, name) for name in MAPS]


@pytest.mark.parametrize("options", [{}, {"prefilter": False}, {"ego": "any"}, {"every": True}], ids=str)
@pytest.mark.parametrize("program", PROGRAMS)
@pytest.mark.one_in(12)
def test_each_map_alone_gives_the_same(datasets, program, options):
    def found(dataset):
        query = Query(dataset, Source("p", PROGRAMS[program]), read_options(model=DRIVING, **options))
        return [record(each) for each in query.results()]

    together, alone = datasets
    expected = [each for dataset in alone for each in found(dataset)]
    assert found(together) == expected
    assert expected
