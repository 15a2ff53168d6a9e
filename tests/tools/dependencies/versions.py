"""Whether the package runs with the lowest and the newest versions of its dependencies, as pyproject.toml says.

In an environment of its own, without pandas, the source archive (with the lowest) or the wheel (with the newest) is
installed. Its command answers as in the development environment, byte by byte; Parquet, whose bytes name the version
that wrote them, row by row. The lowest versions are the lower bounds of `pyproject.toml`, which alone names them; those
of extras must resolve.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pyarrow.parquet as pq
from archives import build_archives
from packaging.requirements import Requirement

ROOT = Path(__file__).parents[3]
SAMPLES = ROOT / "sample_data"
EXTRAS = ("png", "thumbnails", "dask", "s3")
"""Extras whose lower bounds are looked at; the others are of development, or name one version."""
PROGRAM = """
model scenic.domains.driving.model
x = Range(-30, 30)
ego = new Car
other = new Car offset by (x, Range(-40, 40)), facing Range(0, 360) deg
third = new Car offset by (x + Range(-10, 10), Range(-40, 40)), facing Range(0, 360) deg
"""
"""Linear programs decide frames of this one; their solutions, but not the frames, are a matter of the version."""
COMMANDS = (
    "ingest SAMPLES/crossroads town -q --jobs 2",
    "ingest SAMPLES/parked parked -q",
    "info TOWN --verify",
    "match SAMPLES/scenarios/01_pedestrian_facing_ego.scenic TOWN --all --format jsonl",
    "match SAMPLES/scenarios/02_crossing_cars.scenic TOWN --format csv",
    "match SAMPLES/scenarios/03_against_traffic.scenic TOWN --format table --jobs 2",
    "match SAMPLES/scenarios/04_two_lane_traffic.scenic TOWN -o lanes.parquet --exit-zero",
    "match SAMPLES/scenarios/05_cut_in_from_right.scenic TOWN --format jsonl --near 2",
    "match SAMPLES/over_time/02_cut_in.scenic TOWN --format jsonl",
    "match SAMPLES/over_time/03_waits_then_goes.scenic TOWN --all --format csv",
    "match PROGRAM TOWN --format ids --limit 5 --exit-zero",
    "match PROGRAM TOWN --format ids --limit 2 --exit-zero --method smt --solver portable",
    "match SAMPLES/scenarios/02_crossing_cars.scenic town --format ids",
    "match -e ego=new+Car TOWN",
    "check SAMPLES/scenarios/02_crossing_cars.scenic TOWN --forest",
    "explain SAMPLES/scenarios/02_crossing_cars.scenic TOWN 03-busy-intersection/10 --exit-zero",
    "show TOWN 03-busy-intersection/10",
    "show TOWN 03-busy-intersection/10 --scenario SAMPLES/scenarios/02_crossing_cars.scenic -o frame.html",
    "evaluate SAMPLES/parked/parked_car.scenic parked --predictions SAMPLES/parked/predictions.jsonl --report pages",
    "sample SAMPLES/scenarios/02_crossing_cars.scenic TOWN --seed 1 -n 2",
    "index town -q",
    "match",
    "",
)
"""What is asked; `+` stands for a space, and names in capitals for paths."""
SQL = """
import sys, scenicq
opened = scenicq.open(sys.argv[1])
print(opened.sql("SELECT class, count(*), round(avg(x), 6) FROM objects GROUP BY ALL ORDER BY ALL").fetchall())
print([each.roles for each in opened.match("ego = new Car\\nother = new Car ahead of ego by Range(0, 40)")])
"""


def requirements(lowest: bool) -> list[str]:
    """What is to be installed: the lower bounds, or the requirements as they are."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    texts = project["dependencies"]
    return [lower_bound(text) for text in texts] if lowest else texts


def lower_bound(text: str) -> str:
    """A requirement of the lowest version that another one allows."""
    wanted = Requirement(text)
    (bound,) = [each.version for each in wanted.specifier if each.operator == ">="]
    return f"{wanted.name}=={bound}" + (f"; {wanted.marker}" if wanted.marker else "")


def run(*words: object, **options: object) -> subprocess.CompletedProcess[bytes]:
    """Run a command."""
    return subprocess.run(list(map(str, words)), capture_output=True, check=False, **options)


def must(*words: object) -> str:
    """Run a command that may not fail, and give what it prints."""
    done = run(*words)
    if done.returncode:
        sys.exit(f"{' '.join(map(str, words))}\n{done.stdout.decode()}{done.stderr.decode()}")
    return done.stdout.decode()


def make_environment(folder: Path, package: Path, *, lowest: bool, pre: bool) -> Path:
    """Install the package, an archive or a wheel, into an environment of its own; the folder of its commands."""
    shutil.rmtree(folder, ignore_errors=True)
    must(sys.executable, "-m", "venv", folder)
    bin_ = folder / ("Scripts" if os.name == "nt" else "bin")
    pip = (bin_ / "python", "-m", "pip", "--disable-pip-version-check")
    must(*pip, "install", "-q", "--prefer-binary", *["--pre"] * pre, *requirements(lowest))
    must(*pip, "install", "-q", "--no-deps", package)
    found = {each["name"].lower(): each["version"] for each in json.loads(must(*pip, "list", "--format", "json"))}
    assert "pandas" not in found, "pandas is what some packages need without saying so"
    must(*pip, "check")
    named = [Requirement(text) for text in requirements(lowest)]
    mine = [each for each in named if each.marker is None or each.marker.evaluate()]
    for each in mine:
        assert each.specifier.contains(found[each.name.lower()], prereleases=True), (
            str(each),
            found[each.name.lower()],
        )
    versions = ", ".join(f"{each.name} {found[each.name.lower()]}" for each in mine)
    print(f"{'oldest' if lowest else 'newest'}: {versions}", flush=True)
    if lowest:
        extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
        for name in EXTRAS:
            must(*pip, "install", "-q", "--dry-run", *map(lower_bound, extras[name]), *requirements(lowest))
        print(f"the lower bounds of {', '.join(EXTRAS)} resolve", flush=True)
    return bin_


def answers(bin_: Path, folder: Path, town: Path) -> dict[str, object]:
    """What the command of an environment prints and writes, with the code that it exits with."""
    folder.mkdir()
    (folder / "between.scenic").write_text(PROGRAM)
    environment = {**os.environ, "XDG_STATE_HOME": str(folder / "state"), "COLUMNS": "80"}
    environment.pop("PYTHONPATH", None)
    found: dict[str, object] = {}
    for line in COMMANDS:
        named = {"TOWN": str(town), "PROGRAM": "between.scenic"}
        words = [named.get(word, re.sub("^SAMPLES", str(SAMPLES), word)).replace("+", " ") for word in line.split()]
        done = run(bin_ / "scenicq", *words, cwd=folder, env=environment)
        # usage and help are laid out by click; that something is told is all that is the same in every version
        told = done.stderr if line and words[1:] else bool(done.stderr)
        found[line] = (done.returncode, done.stdout, told)
    done = run(bin_ / "python", "-I", "-c", SQL, town, cwd=folder, env=environment)
    found["SQL and matches in Python"] = (done.returncode, done.stdout, done.stderr)
    for page in ("frame.html", "pages/index.html"):
        # a dataset's version hangs on who wrote its files
        shown = re.sub(rb"@[0-9a-f]{8}", b"@...", (folder / page).read_bytes()) if (folder / page).exists() else None
        found[page] = shown
    # names of a dataset's files tell their bytes; there is one file a table
    files = {file.parent.name: file for file in sorted((folder / "town").rglob("*.parquet"))}
    for name, file in {"lanes.parquet": folder / "lanes.parquet", **files}.items():
        with pq.ParquetFile(file) as opened:
            table = opened.read()
        found[name] = (str(table.schema), table.to_pylist())
    return found


def differing(expected: dict[str, object], found: dict[str, object], name: str) -> list[str]:
    """What is answered otherwise in an environment, told."""
    differ = [what for what in expected | found if expected.get(what) != found.get(what)]
    for what in differ:
        here, there = str(expected.get(what)), str(found.get(what))
        equal = next((n for n, (a, b) in enumerate(zip(here, there, strict=False)) if a != b), 0)
        first = max(equal - 100, 0)
        print(f"differs: {what}\n  here   {here[first : first + 2000]}\n  {name} {there[first : first + 2000]}")
    return differ


def main() -> None:
    """Compare; exit with 1 where an answer differs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("which", nargs="+", choices=("oldest", "newest"))
    parser.add_argument("--pre", action="store_true", help="pre-releases, too")
    given = parser.parse_args()
    here = Path(sys.executable).parent
    with tempfile.TemporaryDirectory() as scratch, ThreadPoolExecutor(1 + len(given.which)) as pool:
        town = Path(scratch, "of-all")
        must(here / "scenicq", "ingest", SAMPLES / "crossroads", town, "-q")

        # the one is installed from its own bytes, the other from those of the wheel that is made of it
        packages = dict(zip(("oldest", "newest"), build_archives(Path(scratch)), strict=True))

        def there(which: str) -> dict[str, object]:
            folder = ROOT / f".venv-{which}"
            bin_ = make_environment(folder, packages[which], lowest=which == "oldest", pre=given.pre)
            return answers(bin_, Path(scratch, which), town)

        ours = pool.submit(answers, here, Path(scratch, "here"), town)
        theirs = {which: pool.submit(there, which) for which in given.which}
        expected = ours.result()
        found = {which: each.result() for which, each in theirs.items()}
    codes = {
        what: value[0] for what, value in expected.items() if isinstance(value, tuple) and isinstance(value[0], int)
    }
    wrong = [what for what, code in codes.items() if (code != 0) != (what in ("match", ""))]
    told = f"; no answers: {wrong}" if wrong else ""
    differ = {which: differing(expected, each, which) for which, each in found.items()}
    for which, those in differ.items():
        print(f"{which}: {len(expected)} answers, {len(those)} differ{told}")
    sys.exit(bool(any(differ.values()) or wrong))


if __name__ == "__main__":
    main()
