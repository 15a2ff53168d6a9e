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

ROOT = Path(__file__).parents[2]
PROGRAM = str(ROOT / "sample_data/scenarios/02_crossing_cars.scenic")


def writers(work: Path, sound: Path) -> dict[str, tuple[list[str], Path]]:
    """Every command that writes, with what it writes."""
    return {
        "ingest": (["ingest", str(ROOT / "sample_data/crossroads"), str(work / "made"), "-q"], work / "made"),
        "index": (["index", str(work / "copy"), "-q"], work / "copy"),
        "match": (["match", PROGRAM, str(sound), "-o", str(work / "found.jsonl")], work / "found.jsonl"),
        "resume": (["match", PROGRAM, str(sound), "--resume", "-o", str(work / "kept.jsonl")], work / "kept.jsonl"),
        "report": (["match", PROGRAM, str(sound), "--report", str(work / "report")], work / "report"),
        "shard": (["match", PROGRAM, str(sound), "--shard", "1/1", "-o", str(work / "pieces")], work / "pieces"),
        "export": (["match", PROGRAM, str(sound), "--export", "interchange", str(work / "handed")], work / "handed"),
    }


def main() -> None:
    """Kill until the time is over; exits with 1 where the next run did not come to the same end."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--minutes", type=float, default=60)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    chance, until = random.Random(options.seed), time.monotonic() + 60 * options.minutes
    command = str(Path(sys.executable).with_name("scenicq"))
    outcomes: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as name:
        base = Path(name)
        environment = {**os.environ, "XDG_STATE_HOME": str(base / "state")}
        sound = base / "sound"
        subprocess.run([command, "ingest", str(ROOT / "sample_data/crossroads"), str(sound), "-q"], check=True,
                       env=environment)  # fmt: skip
        took: dict[str, float] = {}
        while time.monotonic() < until:
            work = base / "work"
            work.mkdir()
            shutil.copytree(sound, work / "copy")
            words, target = chance.choice(sorted(writers(work, sound).values()))
            kind = words[0] if words[0] != "match" else target.name
            began = time.monotonic()
            running = subprocess.Popen([command, *words], env=environment, stdout=subprocess.DEVNULL,
                                       stderr=subprocess.DEVNULL)  # fmt: skip
            try:
                running.wait(chance.uniform(0.0, took.get(kind, 5.0)))
                took[kind] = time.monotonic() - began
            except subprocess.TimeoutExpired:
                running.send_signal(signal.SIGKILL)
                running.wait()
            outcome = _after(command, words, target, environment)
            outcomes[outcome] += 1
            if outcome != "mended":
                print(f"{outcome}: {kind}", flush=True)
            shutil.rmtree(work)
    print(f"{outcomes.total()} kills:", dict(outcomes))
    sys.exit(outcomes.total() != outcomes["mended"])


def _after(command: str, words: list[str], target: Path, environment: dict[str, str]) -> str:
    """What the next run of the same command makes of what a killed one has left."""
    more = ["--force"] if words[0] == "ingest" else []
    if words[0] == "match" and "--export" in words and target.exists():
        shutil.rmtree(target)  # it is there completely, and is not written over
    done = subprocess.run([command, *words, *more], env=environment, capture_output=True, text=True, timeout=300,
                          check=False)  # fmt: skip
    if done.returncode != 0:
        return f"exit {done.returncode} {done.stderr[:200]}"
    if words[0] in ("ingest", "index"):
        told = subprocess.run([command, "info", str(target), "--verify"], env=environment, capture_output=True,
                              check=False)  # fmt: skip
        if told.returncode:
            return "not sound"
    left = [path.name for path in target.parent.iterdir() if path.name.startswith(".")]
    return f"left {left}" if any(name.endswith((".pieces", ".partial")) for name in left) else "mended"


if __name__ == "__main__":
    main()
