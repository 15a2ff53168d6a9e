"""Hostile datasets in the project's own format: sound checksums over what no dataset may hold.

`damages` lists every kind; `make_hostile` applies one to a copy of a sound dataset. As a program, it has commands run
over every kind, and over random pairs of kinds for the time that is left.
"""

import argparse
import contextlib
import hashlib
import importlib
import json
import os
import random
import resource
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import traceback
from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
from rounds import Round, attend

ROOT = Path(__file__).parents[3]
_COMMAND = str(Path(sys.executable).with_name("scenicq"))
_FRAME = "03-busy-intersection/09"
"""One of the sample data."""
_MOST_KIB = 2 << 20
"""Memory that no run may take."""
Damage = Callable[[Path], None]

_REALS = (float("nan"), float("inf"), -float("inf"), 1e300, -1e300)
_TEXTS = ("", "x" * 5000, "a\nb", "\x1b[31mred", "\u202eevil", "'; DROP TABLE labels; --", "../../etc/passwd")
_JSON = ("", "{", "[]", "1", "null", '{"a": NaN}', '{"a": 1e999}', '{"a": [1]}', '{"a": {}}', '{"a": null}', "[" * 5000)
_COUNTS = (-1, -(2**31), 2**31 - 1, 1, 1000)
_SOUND_TEXTS = {"", "a\nb", "\x1b[31mred", "\u202eevil", "'; DROP TABLE labels; --", "../../etc/passwd"}


def rewrite(folder: Path, table: str, change: Callable[[pa.Table], pa.Table], number: int = 0) -> None:
    """Replace a file by changed rows, and enter it in the manifest with its true size and checksum."""
    manifest = json.loads((folder / "dataset.json").read_text())
    part = manifest["tables"][table][number]
    file = folder / part["path"]
    rows = change(pq.read_table(file, partitioning=None))
    pq.write_table(rows, file)
    enter(folder, table, number, rows.num_rows)


def enter(folder: Path, table: str, number: int, rows: int | None = None) -> None:
    """Make the manifest say of a file what is true."""
    manifest = json.loads((folder / "dataset.json").read_text())
    part = manifest["tables"][table][number]
    data = (folder / part["path"]).read_bytes()
    part.update(bytes=len(data), sha256=hashlib.sha256(data).hexdigest())
    if rows is not None:
        part["rows"] = rows
    (folder / "dataset.json").write_text(json.dumps(manifest))


def _with_value(table: str, column: str, value: object, row: int = 0) -> Damage:
    def change(rows: pa.Table) -> pa.Table:
        field = rows.schema.field(column)
        values = rows[column].to_pylist()
        values[min(row, len(values) - 1)] = value
        place = rows.column_names.index(column)
        return rows.set_column(place, pa.field(column, field.type), pa.array(values, field.type))

    return lambda folder: rewrite(folder, table, change)


def _as_type(table: str, column: str, kind: pa.DataType) -> Damage:
    def change(rows: pa.Table) -> pa.Table:
        place = rows.column_names.index(column)
        return rows.set_column(place, column, pa.nulls(len(rows), kind))

    return lambda folder: rewrite(folder, table, change)


def _bytes(table: str, data: bytes) -> Damage:
    def apply(folder: Path) -> None:
        manifest = json.loads((folder / "dataset.json").read_text())
        (folder / manifest["tables"][table][0]["path"]).write_bytes(data)
        enter(folder, table, 0)

    return apply


def _manifest(path: tuple[str, ...], value: object) -> Damage:
    def apply(folder: Path) -> None:
        content = json.loads((folder / "dataset.json").read_text())
        at = content
        for key in path[:-1]:
            at = at[key]
        at[path[-1]] = value
        (folder / "dataset.json").write_text(json.dumps(content))

    return apply


def nested(depth: int) -> bytes:
    """Geometry collections within each other, as well-known binary."""
    return struct.pack("<BII", 1, 7, 1) * depth + struct.pack("<BII", 1, 7, 0)


def _polygon(*corners: tuple[float, float], count: int | None = None) -> bytes:
    points = b"".join(struct.pack("<dd", *corner) for corner in corners)
    return struct.pack("<BII", 1, 3, 1) + struct.pack("<I", len(corners) if count is None else count) + points


_GEOMETRIES = {
    "nested": nested(100_000),
    "nothing": b"",
    "short": b"\x01\x03\x00",
    "big-endian": struct.pack(">BII", 0, 3, 0),
    "point": struct.pack("<BIdd", 1, 1, 0.0, 0.0),
    "empty": struct.pack("<BII", 1, 3, 0),
    "counts": _polygon((0, 0), (1, 0), (1, 1), (0, 0), count=2**32 - 1),
    "rings": struct.pack("<BII", 1, 3, 2**32 - 1),
    "nan": _polygon((0, 0), (float("nan"), 0), (1, 1), (0, 0)),
    "inf": _polygon((0, 0), (float("inf"), 0), (1, 1), (0, 0)),
    "far": _polygon((0, 0), (1e300, 0), (1, 1), (0, 0)),
    "open": _polygon((0, 0), (1, 0), (1, 1), (0, 1)),
    "bow": _polygon((0, 0), (2, 2), (2, 0), (0, 2), (0, 0)),
    "more": _polygon((0, 0), (1, 0), (1, 1), (0, 0)) + b"more",
    "third": struct.pack("<BII", 1, 1003, 1),
    "ewkb": struct.pack("<BIII", 1, 0x20000003, 4326, 0),
}
_PROPERTIES = (*_JSON, '{"centerline": 1}', '{"centerline": [[1]]}', '{"centerline": [[[0, 0], [1e300, 0]]]}',
               '{"centerline": [[["a", 0], [1, 0]]]}', '{"left": {}}', '{"group": 5}',
               '{"successors": [1, 2]}')  # fmt: skip


def damages() -> dict[str, Damage]:
    """Every kind of damage, by name."""
    found: dict[str, Damage] = {}
    schemas = _schemas()
    for table, schema in schemas.items():
        for field in schema:
            key = f"{table}.{field.name}"
            if not field.nullable:
                found[f"{key} null"] = _with_value(table, field.name, None)
            if field.type == pa.float64():
                for value in _REALS:
                    found[f"{key} {value}"] = _with_value(table, field.name, value)
            if field.type == pa.list_(pa.float64()):
                for value in (*_REALS, None):
                    found[f"{key} [{value}]"] = _with_value(table, field.name, [value])
            if field.name.endswith(("attributes", "params")):
                for number, value in enumerate(_JSON):
                    found[f"{key} json {number}"] = _with_value(table, field.name, value)
            elif field.type == pa.string() and not (table == "regions" and field.name == "properties"):
                for number, value in enumerate(_TEXTS):
                    found[f"{key} text {number}"] = _with_value(table, field.name, value)
            if pa.types.is_integer(field.type) and field.type != pa.uint64():
                for value in _COUNTS:
                    found[f"{key} {value}"] = _with_value(table, field.name, value, row=1)
            wrong = pa.int64() if field.type != pa.int64() else pa.string()
            found[f"{key} type"] = _as_type(table, field.name, wrong)
            found[f"{key} missing"] = _changed(table, lambda rows, name=field.name: rows.drop_columns([name]))
        found[f"{table} empty"] = _changed(table, lambda rows: rows.slice(0, 0))
        found[f"{table} twice"] = _changed(table, lambda rows: pa.concat_tables([rows, rows]))
        found[f"{table} backwards"] = _changed(table, lambda rows: rows.take(list(range(len(rows)))[::-1]))
        found[f"{table} column twice"] = _changed(table, lambda rows: rows.append_column(rows.column_names[0], rows[0]))
        found[f"{table} text"] = _bytes(table, b"no parquet at all")
        found[f"{table} no bytes"] = _bytes(table, b"")
        found[f"{table} magic"] = _bytes(table, b"PAR1" + b"\xff" * 64 + struct.pack("<I", 64) + b"PAR1")
        found[f"{table} no parts"] = _manifest(("tables", table), [])
        found[f"{table} no list"] = _manifest(("tables", table), 5)
    for name, data in _GEOMETRIES.items():
        found[f"regions.geometry {name}"] = _with_value("regions", "geometry", data)
    for number, text in enumerate(_PROPERTIES):
        found[f"regions.properties {number}"] = _with_value("regions", "properties", text)
    for key in ("total", "maps", "by_map", "by_class", "by_recording", "provenance", "left_out", "name", "tracks"):
        for value in (None, 5, -1, "text", [], {}, [1], {"a": "b"}, 10**400):
            found[f"manifest {key} {str(value)[:12]}"] = _manifest((key,), value)
    found["manifest frames"] = _manifest(("total", "frames"), 10**15)
    return found


def _changed(table: str, change: Callable[[pa.Table], pa.Table]) -> Damage:
    return lambda folder: rewrite(folder, table, change)


def _schemas() -> dict[str, pa.Schema]:
    from scenicq.store.schema import SCHEMAS

    return SCHEMAS


def make_hostile(sound: Path, target: Path, *applied: Damage) -> bool:
    """Copy a dataset and damage the copy; whether the damages could be applied."""
    shutil.copytree(sound, target)
    try:
        for damage in applied:
            damage(target)
    except (pa.ArrowException, KeyError, IndexError, TypeError, ValueError):
        return False
    return True


def commands(folder: Path, scratch: Path) -> dict[str, list[str]]:
    """Every command that reads a dataset."""
    program = str(ROOT / "sample_data/scenarios/02_crossing_cars.scenic")
    return {
        "match": ["match", program, str(folder), "--all", "--format", "jsonl"],
        "bare": ["match", program, str(folder), "--no-prefilter", "--method", "smt"],
        "report": ["match", program, str(folder), "--report", str(scratch / "report")],
        "check": ["check", program, str(folder)],
        "info": ["info", str(folder), "--verify"],
        "show": ["show", str(folder), _FRAME],
        "explain": ["explain", program, str(folder), _FRAME],
        "sample": ["sample", program, str(folder), "-n", "1"],
        "index": ["index", str(folder)],
    }


def main() -> None:
    """Run every command over every kind of damage, then over pairs, until the time is over; or over some pairs."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--minutes", type=float, default=60)
    parser.add_argument("--pairs", type=int, default=0, help="so many random pairs alone; they may take all minutes")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--limit", type=float, default=30.0, help="CPU seconds of a run that hangs")
    options = parser.parse_args()
    chance = random.Random(options.seed)
    outcomes: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as name:
        work = Path(name)
        os.environ["XDG_STATE_HOME"] = str(work / "state")
        sound, folder = work / "sound", work / "hostile"
        subprocess.run([_COMMAND, "ingest", str(ROOT / "sample_data/crossroads"), str(sound), "-q"], check=True)
        shutil.copytree(sound, folder)
        _load(work, [*commands(folder, work).values()])
        shutil.rmtree(folder)
        kinds = damages()
        todo = [[kind] for kind in kinds]
        chance.shuffle(todo)
        if options.pairs:
            todo = [chance.sample(sorted(kinds), 2) for _ in range(options.pairs)]
        applied = 0

        def figures() -> str:
            told = f"{outcomes.total()} runs, {applied} damaged datasets, {len(kinds)} kinds of damage"
            return f"{told}, {len(todo)} not reached: {dict(outcomes)}"

        attack = Round(options.minutes, figures)
        while attack.goes_on(more=bool(todo) or not options.pairs):
            chosen = todo.pop() if todo else chance.sample(sorted(kinds), 2)
            # in a process of its own: one with threads of libraries is not to be forked
            if _apart(partial(_damage, sound, folder, [kinds[kind] for kind in chosen]), work)[0] == "exit 0":
                applied += 1
                for number, (what, words) in enumerate(commands(folder, work).items()):
                    outcome, spent = _apart(partial(_invoke, words, number > 0), work, options.limit)
                    attack.took(spent)
                    outcomes[outcome] += 1
                    if not outcome.startswith("exit"):
                        print(f"{outcome}: {chosen} {what}", flush=True)
            for left in (folder, work / "report"):
                shutil.rmtree(left, ignore_errors=True)
    sys.exit(any(outcomes[bad] for bad in ("internal error", "signal", "hang", "memory")))


def _damage(sound: Path, folder: Path, applied: list[Damage]) -> int:
    return int(not make_hostile(sound, folder, *applied))


def _load(work: Path, runs: list[list[str]]) -> None:
    """Load whatever modules some runs need, once, so that processes that are forked have them."""

    def run() -> int:
        for words in runs:
            _apart(partial(_invoke, words, True, work / "modules"), work)
        return 0

    _apart(run, work, 60.0 * len(runs))
    for module in dict.fromkeys((work / "modules").read_text().split()):
        if not module.startswith(("__", "multiprocessing")):
            with contextlib.suppress(ImportError):
                importlib.import_module(module)


def _invoke(words: list[str], checks_here: bool, modules: Path | None = None) -> int:
    """The command in this process.

    Args:
        words: Its arguments.
        checks_here: Whether a dataset is looked at in this process, too, whose end is then what the run ends with: to
            start another one for that takes longer than all else.
        modules: A file to which the names of the modules are appended that are loaded in the end.
    """
    from scenicq_cli import datasets, start

    if checks_here:
        datasets.check_apart = lambda dataset: dataset.open(check=True) and None
    sys.argv = [_COMMAND, *words]
    try:
        start.main()
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else int(end.code is not None)
    finally:
        if modules is not None:
            with modules.open("a") as file:
                file.write("\n".join([*sys.modules, ""]))
    return 0


def _apart(run: Callable[[], int], work: Path, limit: float = 60.0) -> tuple[str, float]:
    """Do something in a forked process: how that ends, and CPU seconds.

    Args:
        run: Gives the exit code.
        work: Where its output goes.
        limit: CPU seconds after which it hangs.
    """
    output = work / "output"
    child = os.fork()
    if child == 0:
        code = 70
        try:
            signal.signal(signal.SIGTERM, signal.SIG_DFL)
            signal.signal(signal.SIGINT, signal.default_int_handler)
            resource.setrlimit(resource.RLIMIT_CPU, (int(limit), int(limit) + 1))
            said = os.open(output, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
            os.dup2(said, 1)
            os.dup2(said, 2)
            code = run()
            sys.stdout.flush()
            sys.stderr.flush()
        except BaseException:
            traceback.print_exc()
        finally:
            os._exit(code)
    status, used, late = attend(child, 60 * limit)
    spent = used.ru_utime + used.ru_stime
    code, told = os.waitstatus_to_exitcode(status), output.read_text(errors="replace")
    if late or code == -signal.SIGXCPU:
        return "hang", spent
    if code < 0:
        return "signal", spent
    if "internal error" in told or "Traceback" in told:
        return "internal error", spent
    return "memory" if used.ru_maxrss > _MOST_KIB else f"exit {code}", spent


if __name__ == "__main__":
    main()
