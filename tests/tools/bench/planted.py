"""How often `evaluate` is wrong: datasets in which the truth is known, in more than twenty layouts, by the command.

`python tests/tools/bench/planted.py [--datasets 400] [--drawn 20] [--only NAME] [--page]` draws the
recordings of each layout anew (`--drawn` times), matches them once, and gives them predictions many times, without
and with a difference. The first
predictions of each are judged by the installed command, too, which must say the same to the byte. Prints for each
layout how often objects are told worse or better without being so, how often the command refuses a verdict, the
power, how often intervals of the difference hold the truth, and how often the recordings are said to speak against a
failure that is there. `--page` puts the table into the page for statisticians.
"""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import sys
import tempfile
import time
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from click.testing import CliRunner

ROOT = Path(__file__).parents[3]
sys.path.insert(0, str(ROOT / "tests" / "units" / "evaluate"))
from layouts import LAYOUTS, Judgement, Layout, judge, match, plant, predict  # noqa: E402

from scenicq_cli.main import cli  # noqa: E402

RESULTS = ROOT / "bench-results"
PAGE = ROOT / "scenicq" / "evaluate" / "README.md"
COMMAND = str(Path(sys.executable).with_name("scenicq"))
MOST_FALSE, MOST_AGAINST, LEAST_HELD = 0.04, 0.05, 0.93
HEAD = ("layout", "worse", "better", "refused", "holds", "power", "refused", "holds", "against")


def run(*words: object) -> object:
    """The command, in this process."""
    return CliRunner().invoke(cli, [str(word) for word in words], prog_name="scenicq")


def installed(folder: Path, predictions: Path, options: tuple[str, ...]) -> str:
    """What the installed command says."""
    words = ["evaluate", folder / "asked.jsonl", folder / "dataset", "--predictions", predictions, "--format", "json",
             "--simulated", folder / "runs.csv", *options]  # fmt: skip
    return subprocess.run([COMMAND, *map(str, words)], capture_output=True, text=True, check=True).stdout


def judgements(layout: Layout, datasets: int, drawn: int, seed: int) -> tuple[list[Judgement], list[Judgement]]:
    """What is said without a difference, and with one."""
    found: tuple[list[Judgement], list[Judgement]] = ([], [])
    for number in range(drawn):
        with tempfile.TemporaryDirectory() as temporary:
            folder = Path(temporary)
            recordings = plant(layout, folder, seed + number)
            match(run, folder)
            file = folder / "predictions.jsonl"
            for place, more in enumerate((0.0, layout.more)):
                for repeat in range(number, datasets, drawn):
                    predict(layout, recordings, file, np.random.default_rng((seed, repeat, place)), more)
                    said = judge(run, folder, file, layout.options, more)
                    if repeat == number and said.text != installed(folder, file, layout.options):
                        raise AssertionError(f"{layout.name}: the installed command says something else")
                    found[place].append(said)
    return found


def figures(found: tuple[list[Judgement], list[Judgement]]) -> list[float]:
    """Shares, in the order of the head."""
    null, planted = found

    def share(values: list[bool]) -> float:
        return float(np.mean(values)) if values else float("nan")

    def held(some: list[Judgement]) -> float:
        return share([each.holds for each in some if each.holds is not None and not each.refused])

    return [
        share([each.worse for each in null]),
        share([each.better for each in null]),
        share([each.refused for each in null]),
        held(null),
        share([each.worse for each in planted]),
        share([each.refused for each in planted]),
        held(planted),
        share([each.against for each in planted]),
    ]


def main() -> None:
    """Plant, judge, print and keep."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--datasets", type=int, default=400)
    parser.add_argument("--drawn", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", action="append", choices=list(LAYOUTS))
    parser.add_argument("--page", action="store_true")
    given = parser.parse_args()
    rows: list[str] = ["| " + " | ".join(HEAD) + " |", "|---" * len(HEAD) + "|"]
    kept: dict[str, list[float]] = {}
    begun = time.process_time()
    for name in given.only or LAYOUTS:
        layout = LAYOUTS[name]
        told = figures(judgements(layout, given.datasets, given.drawn, given.seed))
        kept[name] = told
        cells = ["-" if np.isnan(value) else f"{100 * value:.0f} %" for value in told]
        rows.append("| " + " | ".join((layout.what, *cells)) + " |")
        print(rows[-1], flush=True)
    # chance of the judge's own
    slack = 2 * (MOST_FALSE / given.datasets) ** 0.5
    for name, (worse, _, _, holds, _, _, holds_too, against) in kept.items():
        wrong = [
            what
            for what, bad in (
                (f"{worse:.1%} false alarms", worse > MOST_FALSE + slack),
                (f"intervals hold {min(holds, holds_too):.1%}", min(holds, holds_too) < LEAST_HELD - slack),
                (f"{against:.1%} against what is there", against > MOST_AGAINST + slack),
            )
            if bad
        ]
        print(f"  {'FAIL' if wrong else 'pass'}  {name}{': ' if wrong else ''}{', '.join(wrong)}")
    count = f"{given.datasets} datasets of each layout, seed {given.seed}"
    print(f"{count}, {time.process_time() - begun:.0f} CPU s")
    if given.page:
        table = "\n".join(
            ("<!-- made by tests/tools/bench/planted.py -->", "", f"{count}:", "", *rows, "", "<!-- end -->")
        )
        text = PAGE.read_text(encoding="utf-8")
        PAGE.write_text(re.sub(r"<!-- made.*<!-- end -->", lambda _: table, text, flags=re.DOTALL), encoding="utf-8")
    now = datetime.now(UTC)
    RESULTS.mkdir(exist_ok=True)
    content = {"time": now.isoformat(), "datasets": given.datasets, "seed": given.seed, "layouts": kept}
    (RESULTS / f"planted-{now:%Y%m%dT%H%M%S}.json").write_text(json.dumps(content, indent=1) + "\n")


if __name__ == "__main__":
    main()
