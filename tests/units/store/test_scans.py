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
    r"\b((read|scan|sniff)_\w+|\w+_scan|parquet_\w+|glob|st_read\w*)\s*\(|\bFROM\s+'|\b(COPY|EXPORT|IMPORT|ATTACH)\s",
    re.I,
)
"""What reads or writes files in SQL: functions, paths as tables, statements."""
READERS = {"dataset", "ParquetDataset", "read_parquet", "read_json", "read_csv", "from_parquet", "from_csv_auto"}
"""What reads files that are named alike, or takes folders for columns, in the modules of pyarrow and DuckDB."""
METHODS = {"read_parquet", "read_json", "read_csv", "from_parquet", "from_csv_auto", "table_function"}
METHODS |= {"to_parquet", "write_parquet", "to_csv", "write_csv", "read_table", "read_feather"}
"""What takes names of files as a method, of a connection or a relation; those of pyarrow, which take folders, too."""


def scans(content: str) -> set[str]:
    """What a module asks to read or write files by their names, but with Python's own means."""
    # no module that holds none of these has to be parsed
    if not (SCANS.search(content) or any(word in content for word in READERS | METHODS)):
        return set()
    tree = ast.parse(content)
    found: set[str] = set()
    said = {
        id(node.body[0].value)
        for node in ast.walk(tree)
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and isinstance(node.body[0], ast.Expr)
    }
    for node in ast.walk(tree):
        match node:
            case ast.Constant(value=str() as text) if id(node) not in said and _is_sql(text):
                found.add("SQL")
            case ast.Call(func=ast.Attribute(value=ast.Name(id="pq" | "pa" | "ds" | "duckdb"), attr=attr)) if (
                attr in READERS
            ):
                found.add(attr)
            case ast.Call(func=ast.Attribute(attr="read_table"), args=[ast.Call(func=made), *_]) if (
                ast.unparse(made) == "pa.BufferReader"
            ):
                pass  # of bytes, which have no path
            case ast.Call(func=ast.Attribute(attr=attr)) if attr in METHODS:
                found.add(attr)
            case _:
                pass
    return found


def _is_sql(text: str) -> bool:
    """Whether a text has a scan in it; statements are told from words by the case in which they begin a text."""
    return any(
        text[: match.start()].strip() == "" and match[0].isupper() if match[3] else True
        for match in SCANS.finditer(text)
    )


def test_scans_are_made_in_one_place() -> None:
    found = {
        f"{file.relative_to(ROOT).as_posix()}: {each}"
        for folder in ("scenicq", "cli")
        for file in (ROOT / folder).rglob("*.py")
        for each in scans(file.read_text())
    }
    assert found == {"scenicq/store/scans.py: SQL"}


@pytest.mark.parametrize(
    "line",
    [
        "connection.sql(f\"SELECT * FROM read_parquet('{file}')\")",
        "connection.execute('SELECT * FROM ' \"read_json_auto('x.json')\")",
        "connection.sql(f\"FROM '{file}'\")",
        "connection.execute(f\"COPY labels TO '{file}'\")",
        "connection.execute(f\"ATTACH '{file}'\")",
        "connection.execute(f\"SELECT num_rows FROM parquet_file_metadata('{file}')\")",
        "connection.read_csv(file)",
        "connection.table('labels').write_parquet(str(file))",
        "duckdb.from_parquet(str(file))",
        "pq.read_table(file)",
        "pa.dataset(folder)",
    ],
)
def test_a_scan_elsewhere_would_be_found(line: str) -> None:
    assert scans(f"def size(connection, file):\n    return {line}\n")


def test_every_function_of_duckdb_that_opens_files_counts_as_a_scan() -> None:
    """The oracle is DuckDB itself: where it may open no files, it refuses just these."""
    import duckdb

    with closing(duckdb.connect(config={"autoinstall_known_extensions": False})) as connection:
        connection.execute("SET enable_external_access = false")
        functions = connection.execute(
            "SELECT DISTINCT function_name FROM duckdb_functions() WHERE function_type = 'table'"
        )
        refused: set[str] = set()
        for (name,) in functions.fetchall():
            try:
                connection.execute(f"SELECT * FROM {name}('there.none')").fetchall()
            except duckdb.PermissionException:
                refused.add(name)
            except duckdb.Error:
                pass  # it takes no name of a file
    assert {"read_parquet", "read_csv", "glob"} <= refused
    assert {name for name in refused if not SCANS.search(f"FROM {name}(")} == set()
