"""The original Scenic, in an environment and a process of its own."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent


def environment(folder: Path, package: str, *needed: str) -> Path:
    """The Python that has Scenic; installs it at the first run.

    Args:
        folder: Where the environment is or will be.
        package: Scenic with its version.
        needed: What its version needs besides.

    Raises:
        SystemExit: It cannot be imported there.
    """
    python = folder / "bin" / "python"
    if not python.exists():
        subprocess.run([sys.executable, "-m", "venv", str(folder)], check=True)
        subprocess.run([str(python), "-m", "pip", "install", "--quiet", package, *needed], check=True)
    probe = subprocess.run([str(python), "-c", "import scenic"], capture_output=True, text=True, check=False)
    if probe.returncode:
        last = probe.stderr.strip().splitlines()[-1]
        raise SystemExit(f"Scenic cannot be imported: {last}\n(OpenCV needs the packages libgl1 and libglib2.0-0)")
    return python


class Original:
    """Draws scenes with the original Scenic.

    Attributes:
        map: Its road network, as features of the interchange format.
    """

    def __init__(
        self, python: Path, chart: Path, work: Path, script: str = "draw_scenes.py", options: Sequence[str] = ()
    ) -> None:
        """Start the process.

        Args:
            python: The one that has Scenic.
            chart: An OpenDRIVE map.
            work: A folder for the map and for what Scenic keeps beside it.
            script: What runs there.
            options: Its options.
        """
        work.mkdir(parents=True, exist_ok=True)
        copy = work / chart.name
        if not copy.exists():
            shutil.copy(chart, copy)  # Scenic writes its cache beside the map
        self._command = [python, "-W", "ignore", HERE / script, copy, work, *options]
        self._log = (work / "scenic.log").open("w", encoding="utf-8")
        self._process = self._started()
        self.map = work / "map.geojson"

    def draw(
        self, text: str, count: int, seed: int, seconds: float = 60.0, first: float | None = None
    ) -> dict[str, Any]:
        """Scenes of a program, or the error that Scenic reports for it.

        Args:
            text: The program.
            count: How many scenes.
            seed: The seed of the random numbers.
            seconds: Processor time for all of them.
            first: Processor time after which there is one or it gives up.

        Raises:
            SystemExit: The process has ended.
        """
        limits = {"seconds": seconds, "first": seconds if first is None else first}
        return self._ask({"text": text, "count": count, "seed": seed, **limits})

    def draw_file(self, file: Path, count: int, seed: int, seconds: float) -> dict[str, Any]:
        """Scenes of a program in a file, which may import others beside it.

        Raises:
            SystemExit: The process has ended.
        """
        return self._ask({"file": str(file.resolve()), "count": count, "seed": seed, "seconds": seconds})

    def allows(
        self, text: str, witness: dict[str, Any], labels: list[dict[str, Any]], seconds: float
    ) -> tuple[str, str]:
        """Whether a program allows labels with a witness: "allowed", "refuted" or "open", and why.

        Args:
            text: The program.
            witness: Values of random variables by `line:column`.
            labels: One for each object of the program, the ego first.
            seconds: Processor time that it may take.

        Raises:
            SystemExit: The process has ended.
        """
        answer = self._ask({"text": text, "witness": witness, "labels": labels, "seconds": seconds})
        return answer["replay"], answer["why"]

    def simulate(self, program: dict[str, str], seed: int, seconds: float, steps: int) -> dict[str, Any]:
        """A trace of a program, by `simulate.py`, or the error that Scenic reports for it.

        A process that was interrupted in a simulation simulates nothing any more: another takes its place.

        Args:
            program: Its `text`, or the path of its `file`.
            seed: The seed of the random numbers.
            seconds: Processor time that it may take.
            steps: How many there may be.

        Raises:
            SystemExit: The process has ended.
        """
        answer = self._ask({**program, "seed": seed, "seconds": seconds, "steps": steps})
        if answer.pop("interrupted", False):
            self._end()
            self._process = self._started()
        return answer

    def replay(self, recordings: list[dict[str, Any]], *, behaviors: bool = False) -> list[tuple[str, int]]:
        """How the scene simulated last fares on recorded states, by `simulate.py`.

        Args:
            recordings: Each with its `states` and its `time_step`.
            behaviors: Whether behaviors run, whose actions do nothing.

        Raises:
            SystemExit: The process has ended.
        """
        return [(kind, step) for kind, step in self._ask({"replay": recordings, "behaviors": behaviors})]

    def at_points(self, count: int, seed: int) -> list[dict[str, Any]]:
        """What the network says at random points, see `map_answers`.

        Raises:
            SystemExit: The process has ended.
        """
        return self._ask({"points": count, "seed": seed})["points"]

    def of_elements(self, count: int, seed: int) -> list[dict[str, Any]]:
        """What its elements say, of themselves and of some points each.

        Raises:
            SystemExit: The process has ended.
        """
        return self._ask({"elements": count, "seed": seed})["elements"]

    def _ask(self, request: dict[str, Any]) -> Any:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        try:
            self._process.stdin.write(json.dumps(request) + "\n")
            self._process.stdin.flush()
        except BrokenPipeError:
            pass
        answer = self._process.stdout.readline()
        if not answer:
            raise SystemExit(f"Scenic has ended: see {self._log.name}")
        return json.loads(answer)

    def close(self) -> None:
        """End the process."""
        self._end()
        self._log.close()

    def _started(self) -> subprocess.Popen[str]:
        return subprocess.Popen(
            self._command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._log, text=True, encoding="utf-8"
        )

    def _end(self) -> None:
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait()
