"""Without a map, or without its defaults, what the program leaves out may be anything, and the user is told so."""

from __future__ import annotations

import json

import pytest

from scenicq.errors import ScenarioError, Source
from scenicq.importers.ingest import ingest
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.dataset import open_dataset

FREE = ", in everywhere, facing Range(0, 360) deg"
TURNED = ", facing Range(0, 360) deg"
PAIRS = [
    ("ego = new Car", f"ego = new Car {FREE[1:]}"),
    ("ego = new Car\nnew Pedestrian", f"ego = new Car {FREE[1:]}\nnew Pedestrian {FREE[1:]}"),
    ("ego = new Car\nc = new Car\nrequire (distance to c) < 15",
     f"ego = new Car {FREE[1:]}\nc = new Car {FREE[1:]}\nrequire (distance to c) < 15"),
    ("ego = new Car\nnew Car at ego offset by (Range(-2, 2), Range(3, 30))",
     f"ego = new Car {FREE[1:]}\nnew Car at ego offset by (Range(-2, 2), Range(3, 30)){TURNED}"),
    ("ego = new Car\nnew Car ahead of ego by Range(2, 12)",
     f"ego = new Car {FREE[1:]}\nnew Car ahead of ego by Range(2, 12)"),
    ("ego = new Car\nnew Car facing Range(-20, 20) deg relative to ego",
     f"ego = new Car {FREE[1:]}\nnew Car in everywhere, facing Range(-20, 20) deg relative to ego"),
    ("class Mine(Car):\n    width: Range(1, 3)\nego = new Mine",
     f"class Mine(Car):\n    width: Range(1, 3)\nego = new Mine {FREE[1:]}"),
    ("ego = new Car\nc = new Car\nrequire always (distance to c) < 18",
     f"ego = new Car {FREE[1:]}\nc = new Car {FREE[1:]}\nrequire always (distance to c) < 18"),
]  # fmt: skip
"""Programs in plain words, and with what these then mean."""
MODEL = "model scenic.domains.driving.model\n"


def label(number: int) -> dict:
    heading = 0.3 * number
    return {
        "id": f"f{number}", "recording": "r", "timestamp_us": 10**15 + number * 500_000,
        "ego": {"position": [0, 2.0 * number], "heading": heading, "width": 2, "length": 4},
        "objects": [
            {"id": "a", "class": "Car", "track": "a", "position": [0.2, 20], "heading": 0.1, "width": 2, "length": 4},
            {"id": "p", "class": "Pedestrian", "track": "p", "position": [5 - number, 12], "heading": 1.2},
        ],
    }  # fmt: skip


@pytest.fixture(scope="module", params=["lines alike", "lines of both kinds"])
def mapless(request, tmp_path_factory):
    """Labels that name no map: read as columns, and one by one."""
    folder = tmp_path_factory.mktemp("mapless")
    about = {"name": "d", "interchange": 1, "angle": "heading", "classes": "scenic"}
    (folder / "dataset.json").write_text(json.dumps(about), encoding="utf-8")
    labels = [label(number) for number in range(12)]
    labels[0]["objects"][0] |= {"position": [0, 10], "heading": 0}
    if request.param != "lines alike":
        labels[3]["map"] = None
        labels[4]["timestamp_us"] = float(labels[4]["timestamp_us"])
    (folder / "labels.jsonl").write_text("".join(f"{json.dumps(each)}\n" for each in labels), encoding="utf-8")
    ingest(folder, folder / "d", strict=True)
    return open_dataset(folder / "d")


def found(dataset, program, **options):
    query = Query(dataset, Source("p.scenic", MODEL + program), QueryOptions(**options))
    return [(each.frame, each.recording, type(each.verdict), each.interval) for each in query.results()]


@pytest.mark.parametrize("pair", PAIRS)
@pytest.mark.parametrize("prefilter", [True, False])
@pytest.mark.one_in(6)
def test_plain_words_ask_nothing_of_a_map_that_is_not_there(pair, prefilter, mapless):
    plain, said = (found(mapless, each, prefilter=prefilter) for each in pair)
    assert plain == said
    assert plain


@pytest.mark.parametrize("pair", PAIRS)
@pytest.mark.one_in(3)
def test_a_map_is_not_asked_where_the_user_says_so(pair, crossroads):
    dataset = open_dataset(crossroads)
    assert found(dataset, pair[0], map_defaults=False) == found(dataset, pair[1])


def test_the_map_counts_where_it_is_there(crossroads):
    dataset = open_dataset(crossroads)
    assert len(found(dataset, PAIRS[0][0])) < len(found(dataset, PAIRS[0][0], map_defaults=False))


AHEAD = "from scenicq.labels import ahead\nego = new Car\nnew Car on ahead(ego, 40)"


@pytest.mark.parametrize("program", ["ego = new Car on road", "ego = new Car\nnew Car facing roadDirection", AHEAD])
def test_what_the_program_asks_of_a_map_is_still_asked(program, mapless):
    with pytest.raises(ScenarioError) as told:
        found(mapless, program)
    assert {each.code for each in told.value.diagnostics} == {"map-lacks"}


def notes(dataset, program, **options):
    query = Query(dataset, Source("p.scenic", MODEL + program), QueryOptions(**options))
    return [each.code for each in query.notes()]


def test_it_is_said_once_where_it_matters(mapless, crossroads):
    assert notes(mapless, PAIRS[1][0]) == ["no-map"]
    assert notes(mapless, PAIRS[1][1]) == []
    assert notes(mapless, PAIRS[1][0], map_defaults=False) == []
    assert notes(open_dataset(crossroads), PAIRS[1][0]) == []
