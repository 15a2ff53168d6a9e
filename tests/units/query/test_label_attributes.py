"""Attributes that labels have and the program does not give its objects: what is read, and what is said of none."""

from __future__ import annotations

import json
from collections import defaultdict
from pathlib import Path

import pytest

from scenicq.errors import ScenarioError, Source
from scenicq.importers.ingest import ingest
from scenicq.match.verdict import Match, Unknown
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.dataset import open_dataset
from scenicq.store.labels import Label, LabelObject, Recording
from scenicq.store.writer import write_dataset

ROOT = Path(__file__).parents[3]
RAW = ROOT.parent / "shared" / "data" / "argoverse2" / "sensor" / "val"
HEAD = "model scenic.domains.driving.model\nfrom scenicq.labels import nearest, others\n"
ANYWHERE = "at (Range(-1e5, 1e5), Range(-1e5, 1e5)), facing Range(-180, 180) deg"
EGO = f"ego = new Car {ANYWHERE}\n"
CAR = f"c = new Car {ANYWHERE}\n"


def query(dataset, text: str, **how) -> Query:
    return Query(dataset, Source("p.scenic", HEAD + text), QueryOptions(solver="portable", **how))


def found(dataset, text: str, **how) -> set[str]:
    return {each.frame for each in query(dataset, text, **how).results() if isinstance(each.verdict, Match)}


def refused(dataset, text: str) -> str:
    with pytest.raises(ScenarioError) as error:
        list(query(dataset, text).results())
    (diagnostic,) = error.value.diagnostics
    return diagnostic.code


def car(name: str, x: float, **said) -> LabelObject:
    return LabelObject(name, "Car", "car", x, 0.0, 0.0, 2.0, 4.0, velocity=(0.0, 0.0), track=name, attributes=said)


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    """Three frames: a parked car that is nearest, one that moves, and one of which nothing is said."""
    cars = [
        (car("a", 5.0, state="parked", points=3.0, towing=True, mixed="x"), car("b", 9.0, state="moving", points=50.0)),
        (car("a", 5.0, state="moving", points=1e17 + 16, towing=False, mixed=1.0),),
        (car("a", 5.0),),
    ]
    labels = [Label(f"f{n}", "r", n * 500_000, "town", car("ego", 0.0), each) for n, each in enumerate(cars)]
    folder = tmp_path_factory.mktemp("datasets") / "d"
    write_dataset(folder, [Recording("r", "town", tuple(labels))], {}, name="d")
    return open_dataset(folder)


@pytest.mark.parametrize("prefilter", [True, False])
@pytest.mark.parametrize(("text", "frames"), [
    ('require c.state == "parked"', {"f0"}), ("require c.points > 40", {"f0", "f1"}), ("require c.towing", {"f0"}),
    ('require c.mixed == "x"', {"f0"}), ("require c.mixed == 1", {"f1"}),
])  # fmt: skip
def test_a_requirement_reads_what_labels_say(dataset, text, frames, prefilter):
    assert found(dataset, f"{EGO}{CAR}{text}\n", prefilter=prefilter) == frames


def test_what_a_label_lacks_is_unknown_and_names_it(dataset):
    told = {each.frame: each.verdict for each in query(dataset, f"{EGO}{CAR}require c.towing\n", every=True).results()}
    assert isinstance(told["f2"], Unknown)
    assert told["f2"].cause.detail == "c.towing is not observed"


def test_others_the_nearest_and_records_read_it(dataset):
    assert found(dataset, f'{EGO}require any(o.state == "parked" for o in others(Car))\n') == {"f0"}
    assert found(dataset, f'{EGO}require nearest(Car).state == "moving"\n') == {"f1"}
    results = [*query(dataset, f"{EGO}record nearest(Car).points as points\n").results()]
    assert [each.recorded["points"].values for each in results] == [(3.0,), (1e17 + 16,), (None,)]


def test_it_is_read_at_each_sample(dataset):
    text = (
        f'{EGO}{CAR}require c.state == "parked"\nrequire eventually c.state == "moving"\nterminate after 0.5 seconds\n'
    )
    (interval,) = query(dataset, text).results()
    assert (interval.frame, interval.verdict.correspondence["c"]) == ("f0", "a")


@pytest.mark.parametrize(
    ("text", "code"),
    [
        (f"{CAR}require c.colour == 'red'", "unknown-attribute"),
        (f"{CAR}d = new Car ahead of c by c.points", "unsupported-construct"),
        ("spot = new OrientedPoint\nrequire spot.points > 3", "unknown-attribute"),
    ],
)
def test_what_labels_lack_and_where_nothing_is_read(dataset, text, code):
    assert refused(dataset, f"{EGO}{text}\n") == code


def test_without_a_dataset_the_check_says_who_knows(run, dataset, tmp_path):
    program = tmp_path / "p.scenic"
    program.write_text(f'{HEAD}{EGO}{CAR}require c.state == "parked"\n')
    alone, beside = run("check", str(program)), run("check", str(program), str(dataset.path))
    assert alone.exit_code == 2
    assert "`state` can be read if labels of the dataset have it" in alone.output + alone.stderr
    assert beside.exit_code == 0


@pytest.mark.slow
def test_counts_are_those_of_the_tables_of_nuscenes(tmp_path):
    source = ROOT / "sample_data" / "nuscenes_tiny"
    tables = source / "v1.0-tiny"
    read = {name: json.loads((tables / f"{name}.json").read_text()) for name in ("sample_annotation", "attribute")}
    names = {each["token"]: each["name"] for each in read["attribute"]}
    moving = {
        each["sample_token"]
        for each in read["sample_annotation"]
        if "vehicle.moving" in {names[token] for token in each["attribute_tokens"]} and each["num_lidar_pts"] >= 10
    }
    ingest(source, tmp_path / "d")
    asked = f'{EGO}c = new Vehicle {ANYWHERE}\nrequire c.vehicle == "moving"\nrequire c.num_lidar_pts >= 10\n'
    assert found(open_dataset(tmp_path / "d"), asked) == moving
    assert moving


@pytest.mark.slow
@pytest.mark.skipif(not RAW.is_dir(), reason="the logs of Argoverse 2 are not here")
def test_counts_are_those_of_the_logs_of_argoverse(tmp_path):
    from pyarrow import feather  # pyright: ignore[reportMissingTypeStubs]

    points: dict[str, list[int]] = defaultdict(list)
    for file in RAW.glob("*/annotations.feather"):
        for row in feather.read_table(file).to_pylist():
            if row["category"] == "PEDESTRIAN":
                points[f"{file.parent.name}/{row['timestamp_ns']}"].append(row["num_interior_pts"])
    ingest(RAW, tmp_path / "d")
    dataset = open_dataset(tmp_path / "d")
    for least in (0, 150, 400, 900):
        asked = f"{EGO}p = new Pedestrian {ANYWHERE}\nrequire p.num_interior_pts > {least}\n"
        some = {frame for frame, mine in points.items() if max(mine) > least}
        assert found(dataset, asked, proofs=False) == some
        asked = f"{EGO}require any(p.num_interior_pts > {least} for p in others(Pedestrian))\n"
        assert found(dataset, asked) == some
        asked = f"{EGO}require len([p for p in others(Pedestrian) if p.num_interior_pts > {least}]) >= 3\n"
        several = {frame for frame, mine in points.items() if sum(each > least for each in mine) >= 3}
        assert found(dataset, asked) == several
