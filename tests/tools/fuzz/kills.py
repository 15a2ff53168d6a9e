"""Kills at random moments of every command that writes: what is there afterwards is whole, and the next run goes on."""

import argparse
import os
import random
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
COMMAND = str(Path(sys.executable).with_name("scenicq"))
_HANGS_S = 1800.0
"""After so long a run hangs, on however busy a machine."""


def writers(work: Path, sound: Path, pieces: Path) -> dict[str, tuple[list[str], Path]]:
    """Every command that writes, with what it writes.

    Args:
        work: Where to; a copy of the dataset is there.
        sound: The dataset.
        pieces: What a run in shards has left of it.
    """
    return {
        "ingest": (["ingest", str(ROOT / "sample_data/crossroads"), str(work / "made"), "-q"], work / "made"),
        "index": (["index", str(work / "copy"), "-q"], work / "copy"),
        "match": (["match", PROGRAM, str(sound), "-o", str(work / "found.jsonl")], work / "found.jsonl"),
        "resume": (["match", PROGRAM, str(sound), "--resume", "-o", str(work / "kept.jsonl")], work / "kept.jsonl"),
        "report": (["match", PROGRAM, str(sound), "--report", str(work / "report")], work / "report"),
        "shard": (["match", PROGRAM, str(sound), "--shard", "1/1", "-o", str(work / "pieces")], work / "pieces"),
        "export": (["match", PROGRAM, str(sound), "--export", "interchange", str(work / "handed")], work / "handed"),
        "gather": (["gather", str(pieces), "-o", str(work / "whole.jsonl")], work / "whole.jsonl"),
        "sample": (["sample", PROGRAM, str(sound), "-n", "3", "-o", str(work / "drawn")], work / "drawn"),
        "show": (["show", str(sound), "03-busy-intersection/09", "-o", str(work / "frame.svg")], work / "frame.svg"),
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
        sound, pieces = base / "sound", base / "pieces"
        for words in (
            ["ingest", str(ROOT / "sample_data/crossroads"), str(sound), "-q"],
            ["match", PROGRAM, str(sound), "--shard", "1/1", "-o", str(pieces)],
        ):
            subprocess.run([COMMAND, *words], check=True, env=environment, stderr=subprocess.DEVNULL)
        took: dict[str, float] = {}
        while attack.goes_on():
            work = base / "work"
            work.mkdir()
            shutil.copytree(sound, work / "copy")
            kind, (words, target) = chance.choice(sorted(writers(work, sound, pieces).items()))
            began, cost = time.monotonic(), cpu_seconds()
            # the first of a kind goes on to its end, which shows how long there is to kill the others
            if not killed(words, environment, chance.uniform(0.0, took[kind]) if kind in took else _HANGS_S):
                took[kind] = time.monotonic() - began
                ended[kind] += 1
            outcome = outcome_after(words, target, environment)
            attack.took(cpu_seconds() - cost)
            outcomes[outcome] += 1
            if outcome != "mended":
                print(f"{outcome}: {kind}", flush=True)
            shutil.rmtree(work)
    sys.exit(outcomes.total() != outcomes["mended"])


def killed(words: list[str], environment: dict[str, str], after_s: float) -> bool:
    """Run a command and kill it after some seconds; whether it had not ended by itself."""
    running = subprocess.Popen([COMMAND, *words], env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        running.wait(after_s)
    except subprocess.TimeoutExpired:
        running.send_signal(signal.SIGKILL)
        running.wait()
        return True
    return False


def outcome_after(words: list[str], target: Path, environment: dict[str, str]) -> str:
    """What the next run of the same command makes of what a killed one has left."""
    more = ["--force"] if words[0] == "ingest" else []
    if (words[0] == "sample" or "--export" in words) and target.exists():
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
    return f"left {left}" if any(name.endswith((".pieces", ".partial")) for name in left) else "mended"


if __name__ == "__main__":
    main()
