"""Wall times of the whole command: the five sample scenarios, the start of `--help`, an ingest. CPU times of compiling.

Runs on the recordings beside this checkout where there are any, else on the sample data. Prints a table and writes
the numbers to bench-results/.
"""

from __future__ import annotations

import json
import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time
from datetime import UTC, datetime
from pathlib import Path

ROOT = Path(__file__).parents[3]
sys.path.insert(0, str(ROOT / "tests" / "units" / "compiler"))

from hostile import END, HOSTILE, TOO_LONG  # noqa: E402

from scenicq.compiler.program import compile_scenario  # noqa: E402
from scenicq.errors import ScenarioError, Source  # noqa: E402
from scenicq.geometry.default_street import street  # noqa: E402

RECORDINGS = ROOT.parent / "shared" / "data" / "boston"
RESULTS = ROOT / "bench-results"
COMMAND = str(Path(sys.executable).with_name("scenicq"))
SETTING = ("--tolerance", "x=0.25,y=0.25,heading=5deg", "--classes", "coarse", "--radius", "50", "--format", "ids")
ROUNDS = 5


def timed(*args: object) -> tuple[float, str]:
    """Seconds that a command takes, and its output; exit code 1 means that nothing matched."""
    started = time.perf_counter()
    done = subprocess.run([COMMAND, *map(str, args)], capture_output=True, text=True, check=False)
    elapsed_s = time.perf_counter() - started
    if done.returncode not in (0, 1):
        sys.exit(done.stderr)
    return elapsed_s, done.stdout


def median(*args: object) -> tuple[float, str]:
    """The median of several runs, and the output of the last."""
    runs = [timed(*args) for _ in range(ROUNDS)]
    return statistics.median(seconds for seconds, _ in runs), runs[-1][1]


def near(dataset: Path) -> dict[str, float]:
    """CPU seconds of a match that also says which frames come closest, beside the same match alone; medians."""
    scenario = ROOT / "sample_data" / "scenarios" / "01_pedestrian_facing_ego.scenic"
    plain, both = list[float](), list[float]()
    for _ in range(ROUNDS):
        for times, more in ((plain, ()), (both, ("--near", "3"))):
            before = os.times()
            timed("match", scenario, dataset, "--format", "jsonl", "--jobs", "1", *more)
            after = os.times()
            times.append(after.children_user + after.children_system - before.children_user - before.children_system)
    seconds, alone = statistics.median(both), statistics.median(plain)
    return {"seconds": seconds, "% of the plain match": 100 * seconds / alone}


def compiling() -> dict[str, float]:
    """CPU seconds in which a program of 300 lines compiles, the least of several runs, and the bar."""
    lines = ["model scenic.domains.driving.model", "ego = new Car"]
    for number in range(50):
        lines += [f"gap{number} = Range({number}, 90)", f"wide{number} = gap{number} + 1"]
        lines += [f"def twice{number}(x):", "    return 2 * x"]
        lines += [f"new Car offset by (twice{number}(wide{number}), gap{number})", f"require gap{number} < 80"]
    source, network, times = Source("long.scenic", "\n".join(lines) + "\n"), street(), list[float]()
    for _ in range(ROUNDS):
        started = time.process_time()
        compile_scenario(source, network)
        times.append(time.process_time() - started)
    return {"seconds": min(times), "lines": len(lines), "bar in ms": 300, "share of the bar in %": min(times) / 0.003}


def hostile() -> dict[str, float]:
    """CPU seconds in which the worst of the hostile programs is refused, and the bar."""
    network, worst = street(), 0.0
    for text in (*HOSTILE.values(), *TOO_LONG.values()):
        started = time.process_time()
        try:
            compile_scenario(Source("hostile.scenic", text + END), network)
        except ScenarioError:
            worst = max(worst, time.process_time() - started)
        else:
            sys.exit("a hostile program compiles")
    return {"seconds": worst, "programs": len(HOSTILE) + len(TOO_LONG), "share of the bar in %": worst / 0.02}


def measure(source: Path, folder: Path) -> dict[str, dict[str, float]]:
    """All measurements: name, then what is measured."""
    dataset = folder / "dataset"
    found: dict[str, dict[str, float]] = {"--help": {"seconds": median("--help")[0]}, "compile": compiling()}
    found["hostile, the worst"] = hostile()
    seconds, _ = timed("ingest", source, dataset, "-q")
    objects = json.loads((dataset / "dataset.json").read_text())["total"]["objects"]
    found["ingest"] = {"seconds": seconds, "objects": objects, "objects per second": objects / seconds}
    for scenario in sorted((ROOT / "sample_data" / "scenarios").glob("*.scenic")):
        seconds, output = median("match", scenario, dataset, *SETTING)
        found[scenario.stem] = {"seconds": seconds, "matches": len(output.splitlines())}
    found["--near 3"] = near(dataset)
    return found


def main() -> None:
    """Measure, print and keep."""
    source = RECORDINGS if RECORDINGS.is_dir() else ROOT / "sample_data" / "crossroads"
    if source != RECORDINGS:
        print(f"{RECORDINGS} is not there: the sample data is measured instead")
    with tempfile.TemporaryDirectory() as folder:
        found = measure(source, Path(folder))
    print(f"{source.name}, median of {ROUNDS} runs")
    for name, numbers in found.items():
        rest = ", ".join(f"{number:,.0f} {what}" for what, number in numbers.items() if what != "seconds")
        print(f"  {name:28} {numbers['seconds']:8.2f} s  {rest}".rstrip())
    now = datetime.now(UTC)
    RESULTS.mkdir(exist_ok=True)
    content = {"time": now.isoformat(), "python": platform.python_version(), "source": source.name, "results": found}
    (RESULTS / f"{now:%Y%m%dT%H%M%S}.json").write_text(json.dumps(content, indent=1) + "\n")


if __name__ == "__main__":
    main()
