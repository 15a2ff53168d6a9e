"""Maps that programs name, with a dataset and without one."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from scenicq.compiler.named_map import named_map
from scenicq.errors import DataError, ScenarioError, Source
from scenicq.importers.ingest import ingest
from scenicq.match.verdict import NoMatch
from scenicq.query.execution.executors import ordered_results, run_here
from scenicq.query.execution.pieces import partitions
from scenicq.query.execution.program_map import program_network, read_network
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.dataset import open_dataset

SAMPLES = Path(__file__).parents[4] / "sample_data"
TOWN = SAMPLES / "crossroads" / "maps" / "crossroads.geojson"
BODY = "model scenic.domains.driving.model\nego = new Car on road\n"


def program(name: str) -> Source:
    return Source("p.scenic", f"param map = localPath('{name}'), render = 0\n{BODY}")


def code_of(source: Source, folder: Path) -> tuple[str, str]:
    with pytest.raises(DataError) as error:
        program_network(source, folder, None, folder / "cache")
    (diagnostic,) = error.value.diagnostics
    assert diagnostic.span is not None
    assert any("--map FILE" in hint for hint in diagnostic.hints)
    return diagnostic.code, diagnostic.message


@pytest.mark.parametrize(
    ("text", "file"),
    [
        ("param map = localPath('a/Town05.xodr')\n", "a/Town05.xodr"),
        ("param 'map' = 'Town05.xodr'\n", "Town05.xodr"),
        ("param map = localPath('a.xodr')\nparam map = localPath('b.xodr')\n", "b.xodr"),
        ("param map = localPath(name)\n", None),
        ("param maps = 'Town05.xodr'\n", None),
        ("", None),
    ],
)
def test_what_a_program_names(text: str, file: str | None) -> None:
    found = named_map(Source("p", text + BODY))
    assert (None if found is None else found.file) == file


def test_the_map_beside_the_program_is_used(tmp_path: Path) -> None:
    shutil.copy(TOWN, tmp_path / "town.geojson")
    network = program_network(program("town.geojson"), tmp_path, None, tmp_path / "cache")
    assert network is not None
    assert network.name == "town"
    assert len(network.lanes) == len(read_network(TOWN, tmp_path).lanes)
    assert program_network(Source("p", BODY), tmp_path, None, tmp_path) is None


def test_maps_that_cannot_be_had(tmp_path: Path) -> None:
    folder = tmp_path / "p"
    folder.mkdir()
    (folder / "map.txt").write_text("{}")
    (folder / "bad.geojson").write_text("{")
    shutil.copy(TOWN, tmp_path / "town.geojson")
    assert code_of(program("none.xodr"), folder) == ("file-missing", "the map `none.xodr` is not there")
    assert code_of(program("\\0"), folder)[0] == "file-missing"
    assert "outside of the program's folder" in code_of(program("../town.geojson"), folder)[1]
    assert code_of(program("map.txt"), folder)[0] == "file-invalid"
    assert code_of(program("bad.geojson"), folder)[0] == "file-invalid"


def test_a_dataset_keeps_its_own_map_and_says_so(tmp_path: Path) -> None:
    ingest(SAMPLES / "crossroads", tmp_path / "d")
    dataset = open_dataset(tmp_path / "d")
    for name, told in (("else/Town05.xodr", 1), ("maps\\\\crossroads.xodr", 0)):
        query = Query(dataset, program(name))
        assert len(list(query.results())) > 100
        warnings = [each for each in query.funnel.warnings if each.code == "map-lacks"]
        assert len(warnings) == told
        assert all("`Town05.xodr`" in each.message and "`crossroads`" in each.message for each in warnings)


def test_what_a_map_lacks_is_told_with_the_dataset(tmp_path: Path) -> None:
    source = Path(shutil.copytree(SAMPLES / "crossroads", tmp_path / "source"))
    lines = (source / "labels.jsonl").read_text().splitlines()[:5]
    (source / "labels.jsonl").write_text("\n".join(lines))
    town = json.loads(TOWN.read_text())
    town["features"] = [each for each in town["features"] if each["properties"]["kind"] != "crossing"]
    (source / "maps" / "crossroads.geojson").write_text(json.dumps(town))
    ingest(source, tmp_path / "walkless")
    (source / "maps" / "crossroads.geojson").unlink()
    ingest(source, tmp_path / "mapless")
    text = BODY + "walker = new Pedestrian on crossing\n"
    for name, message in (
        ("walkless", f"the map `crossroads` has nothing for `crossing` (dataset {tmp_path / 'walkless'})"),
        ("mapless", f"dataset {tmp_path / 'mapless'} has no map `crossroads`, and the program needs one"),
    ):
        with pytest.raises(ScenarioError) as error:
            list(Query(open_dataset(tmp_path / name), Source("p", text)).results())
        (diagnostic,) = error.value.diagnostics
        assert (diagnostic.code, diagnostic.message) == ("map-lacks", message)


@pytest.mark.parametrize("prefilter", [True, False])
@pytest.mark.one_in(2)
def test_frames_of_a_map_that_lacks_something_have_their_rows(tmp_path: Path, prefilter: bool) -> None:
    source = Path(shutil.copytree(SAMPLES / "crossroads", tmp_path / "source"))
    labels = [json.loads(line) for line in (source / "labels.jsonl").read_text().splitlines()]
    moved = sorted({label["recording"] for label in labels})[1]
    for label in labels:
        label["map"] = "bare" if label["recording"] == moved else label["map"]
    (source / "labels.jsonl").write_text("".join(json.dumps(label) + "\n" for label in labels))
    town = json.loads(TOWN.read_text())
    town["features"] = [each for each in town["features"] if each["properties"]["kind"] != "crossing"]
    (source / "maps" / "bare.geojson").write_text(json.dumps(town))
    ingest(source, tmp_path / "d")
    dataset, program = open_dataset(tmp_path / "d"), Source("p", BODY + "walker = new Pedestrian on crossing\n")
    on_bare = [label["id"] for label in labels if label["recording"] == moved]
    reached: list[int] = []
    query = Query(dataset, program, QueryOptions(every=True, prefilter=prefilter))
    results = list(query.results(reached.append))
    assert sorted(result.frame for result in results) == sorted(label["id"] for label in labels)
    assert sum(reached) == query.funnel.frames == len(labels)
    told = [
        result for result in results if isinstance(result.verdict, NoMatch) and result.verdict.cause.what == "map bare"
    ]
    assert [result.frame for result in told] == on_bare
    assert query.funnel.excluded["map bare"] == len(on_bare)
    assert all("nothing for `crossing`" in str(result.verdict) for result in told)
    again = Query(dataset, program, query.options)
    assert list(ordered_results(again, run_here, partitions(dataset, 3), reached.append)) == results
    few = Query(dataset, program, replace(query.options, every=False))
    assert not any(result.frame in on_bare for result in few.results())
