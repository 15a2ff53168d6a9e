"""Signals at random moments of every command that writes: what is there afterwards is whole, and the next run goes on.

SIGKILL and SIGQUIT end a process at once; of SIGINT, SIGTERM and SIGHUP the command is told, and leaves nothing.
"""

import argparse
import json
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from rounds import Round, cpu_seconds

ROOT = Path(__file__).parents[3]
PROGRAM = str(ROOT / "sample_data/scenarios/02_crossing_cars.scenic")
OVER_TIME = ROOT / "sample_data" / "over_time" / "03_waits_then_goes.scenic"
COMMAND = str(Path(sys.executable).with_name("scenicq"))
_HANGS_S = 1800.0
"""After so long a run hangs, on however busy a machine."""


SIGNALS = (signal.SIGKILL, signal.SIGQUIT, signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def prepare(made: Path, sound: Path) -> None:
    """Write what some commands read besides a dataset: the pieces of a run, its results, and predictions."""
    made.mkdir(exist_ok=True)
    for more in (["--shard", "1/1", "-o", str(made / "pieces")], ["-o", str(made / "found.jsonl")]):
        words = [COMMAND, "match", PROGRAM, str(sound), *more]
        subprocess.run(words, check=True, stderr=subprocess.DEVNULL)
    with (made / "predictions.jsonl").open("w", encoding="utf-8") as file:
        for line in (ROOT / "sample_data" / "crossroads" / "labels.jsonl").read_text(encoding="utf-8").splitlines():
            label = json.loads(line)
            label["objects"] = [{**each, "score": 0.5} for each in label["objects"]]
            file.write(json.dumps(label) + "\n")


def writers(work: Path, sound: Path, made: Path) -> dict[str, tuple[list[str], Path]]:
    """Every command that writes, with what it writes.

    Args:
        work: Where to; a copy of the dataset is there.
        sound: The dataset.
        made: What `prepare` has made of it.
    """
    found, frame, drives = str(made / "found.jsonl"), "03-busy-intersection/09", str(OVER_TIME)
    evaluate = ["evaluate", found, str(sound), "--predictions", str(made / "predictions.jsonl")]
    return {
        "ingest": (["ingest", str(ROOT / "sample_data/crossroads"), str(work / "made"), "-q"], work / "made"),
        "index": (["index", str(work / "copy"), "-q"], work / "copy"),
        "match": (["match", PROGRAM, str(sound), "-o", str(work / "found.jsonl")], work / "found.jsonl"),
        "resume": (["match", PROGRAM, str(sound), "--resume", "-o", str(work / "kept.jsonl")], work / "kept.jsonl"),
        "report": (["match", PROGRAM, str(sound), "--report", str(work / "report")], work / "report"),
        "shard": (["match", PROGRAM, str(sound), "--shard", "1/1", "-o", str(work / "pieces")], work / "pieces"),
        "export": (["match", PROGRAM, str(sound), "--export", "interchange", str(work / "handed")], work / "handed"),
        "gather": (["gather", str(made / "pieces"), "-o", str(work / "whole.jsonl")], work / "whole.jsonl"),
        "sample": (["sample", PROGRAM, str(sound), "-n", "3", "-o", str(work / "drawn")], work / "drawn"),
        "show": (["show", str(sound), frame, "-o", str(work / "frame.svg")], work / "frame.svg"),
        "page": (["show", str(sound), frame, "-o", str(work / "frame.html")], work / "frame.html"),
        "csv": (["match", PROGRAM, str(sound), "-o", str(work / "found.csv")], work / "found.csv"),
        "parquet": (["match", PROGRAM, str(sound), "-o", str(work / "found.parquet")], work / "found.parquet"),
        "openlabel": (["match", PROGRAM, str(sound), "--export", "openlabel", str(work / "hand")], work / "hand"),
        "paths": (["match", PROGRAM, str(sound), "--export", "paths", str(work / "files")], work / "files"),
        "formulas": (["explain", PROGRAM, str(sound), frame, "--smt2", str(work / "smt"), "--exit-zero"], work / "smt"),
        "compare": (["report", found, found, "-o", str(work / "changes.html")], work / "changes.html"),
        "figures": ([*evaluate, "-o", str(work / "figures.json")], work / "figures.json"),
        "evaluation": ([*evaluate, "--report", str(work / "pages")], work / "pages"),
        "modes": (["check", drives, "--draw-modes", str(work / "modes.svg")], work / "modes.svg"),
    }


def main() -> None:
    """Kill until the time is over; exits with 1 where the next run did not come to the same end."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--minutes", type=float, default=60)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    chance = random.Random(options.seed)
    outcomes: Counter[str] = Counter()
    ended: Counter[str] = Counter()
    attack = Round(
        options.minutes, lambda: f"{outcomes.total()} kills: {dict(outcomes)}, of which ended before: {dict(ended)}"
    )
    with tempfile.TemporaryDirectory() as name:
        base = Path(name)
        environment = {**os.environ, "XDG_STATE_HOME": str(base / "state")}
        sound, made = base / "sound", base / "made"
        words = [COMMAND, "ingest", str(ROOT / "sample_data/crossroads"), str(sound), "-q"]
        subprocess.run(words, check=True, env=environment, stderr=subprocess.DEVNULL)
        prepare(made, sound)
        took: dict[str, float] = {}
        while attack.goes_on():
            work = base / "work"
            work.mkdir()
            shutil.copytree(sound, work / "copy")
            kind, (words, target) = chance.choice(sorted(writers(work, sound, made).items()))
            began, cost = time.monotonic(), cpu_seconds()
            # the first of a kind goes on to its end, which shows how long there is to kill the others
            number, before = chance.choice(SIGNALS), {path.name for path in work.iterdir()}
            after_s = chance.uniform(0.0, took[kind]) if kind in took else _HANGS_S
            if killed(words, environment, after_s, number):
                left = {path.name for path in work.iterdir()} - before - {target.name, f".{target.name}.pieces"}
                if left and number in SIGNALS[2:]:
                    outcomes["left at once"] += 1
                    print(f"{number.name} after {after_s:.2f} s left {left}: {kind}", flush=True)
            else:
                took[kind] = time.monotonic() - began
                ended[kind] += 1
            outcome = outcome_after(words, target, environment)
            attack.took(cpu_seconds() - cost)
            outcomes[outcome] += 1
            if outcome != "mended":
                print(f"{outcome}: {kind}", flush=True)
            shutil.rmtree(work)
    sys.exit(outcomes.total() != outcomes["mended"])


def killed(
    words: list[str], environment: dict[str, str], after_s: float, number: signal.Signals = signal.SIGKILL
) -> bool:
    """Run a command and send it a signal after some seconds; whether it had not ended by itself."""
    running = subprocess.Popen(
        [COMMAND, *words], env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        preexec_fn=_heed_signals,  # noqa: PLW1509 - nothing here has threads
    )  # fmt: skip
    try:
        running.wait(after_s)
    except subprocess.TimeoutExpired:
        running.send_signal(number)
        running.wait()
        return True
    return False


def _heed_signals() -> None:
    """What a shell has ignored by a job in its background, or `nohup`, is not; and nothing dumps its memory."""
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    for each in SIGNALS[1:]:
        signal.signal(each, signal.SIG_DFL)


def outcome_after(words: list[str], target: Path, environment: dict[str, str]) -> str:
    """What the next run of the same command makes of what a killed one has left."""
    more = ["--force"] if words[0] == "ingest" else []
    if target.is_dir() and (words[0] == "sample" or not {"--export", "--smt2", "--report"}.isdisjoint(words)):
        shutil.rmtree(target)  # it is there completely, and is not written over
    done = subprocess.run([COMMAND, *words, *more], env=environment, capture_output=True, text=True, timeout=_HANGS_S,
                          check=False)  # fmt: skip
    if done.returncode != 0:
        return f"exit {done.returncode} {done.stderr[:200]}"
    if words[0] in ("ingest", "index"):
        told = subprocess.run([COMMAND, "info", str(target), "--verify"], env=environment, capture_output=True,
                              check=False)  # fmt: skip
        if told.returncode:
            return "not sound"
    left = [path.name for path in target.parent.iterdir() if path.name.startswith(".")]
    return f"left {left}" if left else "mended"


if __name__ == "__main__":
    main()
