"""Names of folders are names: a dataset says the same wherever it lies, also beside others that are named alike.

The oracle is the dataset where it was made. Each column of each table and each sign that an engine might take for a
pattern has its turn as a folder, here and in object storage.
"""

from __future__ import annotations

import ast
import json
import re
import shutil
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

import scenicq
from scenicq.errors import Source
from scenicq.importers.ingest import ingest
from scenicq.query.execution.interval_frames import frames_of
from scenicq.query.execution.records import record
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.dataset import open_dataset
from scenicq.store.observed_motion import observed_motion
from scenicq.store.schema import SCHEMAS

ROOT = Path(__file__).parents[3]
FRAMES = "model scenic.domains.driving.model\nego = new Car\nother = new Car offset by (Range(-9, 9), Range(-40, 40))\n"
OVER_TIME = f"{FRAMES}require eventually (distance to other) < 12\n"
COLUMNS = sorted({name for schema in SCHEMAS.values() for name in schema.names} | {"file_row_number", "filename"})
PATTERNS = {
    "a?b": "axb",
    "a*b": "axxb",
    "a**b": "axxb",
    "a[xy]b": "axb",
    "a[!q]b": "axb",
    "a[x-z]b": "ayb",
    "{a,b}": "a",
}
"""Names of folders, with that of a sibling which a pattern would find."""
ORDINARY = ("a'b", 'a"b', "a b", "a%3Fb", "a#b", "a;b", "a\\b", "~a", "$a", "ä日", "a=b=c", "=", "-")


def rows(address: str | Path) -> dict[str, Any]:
    """Every table, as SQL in Python sees it."""
    opened = scenicq.open(address)
    found = {table: opened.sql(f"SELECT * FROM {table}") for table in SCHEMAS}
    return {table: (relation.columns, relation.fetchall()) for table, relation in found.items()}


def answers(address: str | Path) -> dict[str, Any]:
    """What a dataset answers by every way in which SQL reads it."""
    dataset = open_dataset(address)
    found: dict[str, Any] = {"motion": observed_motion(dataset)}
    for name, text in (("frames", FRAMES), ("over time", OVER_TIME)):
        query = Query(dataset, Source("p.scenic", text), QueryOptions())
        results = list(query.results())
        found[name] = [record(each) for each in results]
        found[f"not compared in {name}"] = query.coverage(dataset.maps)
        if query.is_over_time():
            shown = [(label.frame, roles) for each in results for label, roles in frames_of(dataset, each)]
            found["in the intervals"] = shown
        bare = Query(dataset, Source("p.scenic", text), QueryOptions(proofs=False))
        found[f"names of {name}"] = [each.frame for each in bare.results()]
    return found


@pytest.fixture(scope="module")
def town(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A few frames of two recordings."""
    source = tmp_path_factory.mktemp("source")
    shutil.copytree(ROOT / "sample_data" / "crossroads", source, dirs_exist_ok=True)
    lines = (source / "labels.jsonl").read_text().splitlines()
    chosen = [line for line in lines if json.loads(line)["recording"] in ("03-busy-intersection", "06-cut-in")]
    (source / "labels.jsonl").write_text("\n".join(chosen[::4]) + "\n")
    target = tmp_path_factory.mktemp("town") / "town"
    ingest(source, target)
    return target


@pytest.fixture(scope="module")
def other(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Another dataset, for a sibling that is not to be read."""
    target = tmp_path_factory.mktemp("other") / "other"
    ingest(ROOT / "sample_data" / "parked", target)
    return target


@pytest.fixture(scope="module")
def expected(town: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """Tables and answers of the dataset where it was made."""
    found = answers(town)
    assert found["frames"]
    assert found["over time"]
    assert found["names of frames"]
    return rows(town), found


@pytest.mark.parametrize("value", ["1", pytest.param("zzz", marks=pytest.mark.slow)])
def test_a_folder_is_no_column(value: str, town: Path, expected: tuple[Any, Any], tmp_path: Path) -> None:
    place = tmp_path / "here"
    shutil.copytree(town, place / "town")
    for column in COLUMNS:
        place = place.rename(tmp_path / f"{column}={value}")
        assert rows(place / "town") == expected[0], place.name


@pytest.mark.parametrize("value", ["1", "zzz"])
@pytest.mark.one_in(2)
def test_nor_are_all_of_them(value: str, town: Path, expected: tuple[Any, Any], tmp_path: Path) -> None:
    place = tmp_path.joinpath(*(f"{column}={value}" for column in COLUMNS), "town")
    shutil.copytree(town, place)
    assert answers(place) == expected[1]


ELSEWHERE = [f"{column}={value}" for column in COLUMNS for value in ("1", "zzz")] + [*PATTERNS, *ORDINARY]
"""Names of folders in object storage."""
_FEW = {"class=1", "map=zzz", "a?b", "{a,b}", "a%3Fb"}


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[] if name in _FEW else [pytest.mark.slow]) for name in ELSEWHERE]
)
@pytest.mark.one_in(10)
def test_nor_in_object_storage(name: str, bucket: Any, town: Path, other: Path, expected: tuple[Any, Any]) -> None:
    """A sibling that a pattern would find is beside it."""
    places = {f"fleet/{name}": town} | ({f"fleet/{PATTERNS[name]}": other} if name in PATTERNS else {})
    for place, content in places.items():
        for file in content.rglob("*"):
            if file.is_file():
                bucket.pipe_file(f"{place}/town/{file.relative_to(content).as_posix()}", file.read_bytes())
    assert rows(f"s3://fleet/{name}/town") == expected[0]
    if name in _FEW:
        found = answers(f"s3://fleet/{name}/town")
        assert found == expected[1]


@pytest.mark.parametrize("column", ["class", "map", "frame", "recording", "id", "heading", "ego_x", "first_object"])
@pytest.mark.one_in(4)
def test_answers_stay_the_same(column: str, town: Path, expected: tuple[Any, Any], tmp_path: Path) -> None:
    shutil.copytree(town, tmp_path / f"{column}=1" / "town")
    assert answers(tmp_path / f"{column}=1" / "town") == expected[1]


@pytest.mark.parametrize("name", [*PATTERNS, *ORDINARY])
@pytest.mark.parametrize("deep", [False, True])
@pytest.mark.one_in(40)
def test_a_folder_is_no_pattern(
    name: str, deep: bool, town: Path, other: Path, expected: tuple[Any, Any], tmp_path: Path
) -> None:
    """Whether the dataset itself or a folder above it has the name."""

    def place(folder: str) -> Path:
        return tmp_path / folder / "town" if deep else tmp_path / folder

    shutil.copytree(town, place(name))
    if name in PATTERNS:
        shutil.copytree(other, place(PATTERNS[name]))
    for address in (place(name), place(name).as_uri()):
        assert rows(address) == expected[0]
    assert answers(place(name)) == expected[1]


def test_an_address_of_a_file_is_all_path(town: Path, other: Path, expected: tuple[Any, Any], tmp_path: Path) -> None:
    shutil.copytree(other, tmp_path / "a")
    for name in ("a?b", "a#b"):
        shutil.copytree(town, tmp_path / name)
        assert rows(f"file://{tmp_path}/{name}") == rows(f"file://localhost{tmp_path}/{name}") == expected[0]


def test_a_connection_reads_the_dataset_alone(town: Path, other: Path, tmp_path: Path) -> None:
    shutil.copytree(town, tmp_path / "a?b")
    shutil.copytree(other, tmp_path / "axb")
    dataset = open_dataset(tmp_path / "a?b")
    sibling = open_dataset(tmp_path / "axb").files("labels")[0]
    import duckdb

    with closing(dataset.connect()) as connection:
        for path in (sibling, str(dataset.files("labels")[0]).replace("?", "*")):
            with pytest.raises(duckdb.Error):
                connection.sql(f"SELECT * FROM read_parquet('{path}')").fetchall()


SCANS = re.compile(
    r"\b(read_parquet|parquet_scan|parquet_metadata|parquet_schema|read_(nd)?json\w*|read_csv\w*|sniff_csv|read_text"
    r"|read_blob|glob)\s*\(|\bFROM\s+'"
)
"""What reads files in SQL."""
READERS = {"dataset", "ParquetDataset", "read_parquet", "read_json", "read_csv", "from_parquet", "from_csv_auto"}
"""What reads files that are named alike, or takes folders for columns, in the modules of pyarrow and DuckDB."""
READING = READERS | {"read_table", "read_feather"}


def test_scans_are_made_in_one_place() -> None:
    found: set[str] = set()
    for folder in ("scenicq", "cli"):
        for file in (ROOT / folder).rglob("*.py"):
            name = file.relative_to(ROOT).as_posix()
            content = file.read_text()
            if not (SCANS.search(content) or any(word in content for word in READING)):
                continue
            for node in ast.walk(ast.parse(content)):
                match node:
                    case ast.Constant(value=str() as text) if SCANS.search(text):
                        found.add(name)
                    case ast.Call(func=ast.Attribute(value=ast.Name(id="pq" | "pa" | "ds" | "duckdb"), attr=attr)) if (
                        attr in READERS
                    ):
                        found.add(f"{name}: {attr}")
                    case ast.Call(func=ast.Attribute(attr="read_table"), args=[ast.Call(func=made), *_]) if (
                        ast.unparse(made) == "pa.BufferReader"
                    ):
                        pass  # of bytes, which have no path
                    case ast.Call(func=ast.Attribute(attr="read_table" | "read_feather")):
                        found.add(f"{name}: read_table")
                    case _:
                        pass
    assert found == {"scenicq/store/scans.py"}
