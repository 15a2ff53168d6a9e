"""Do scenes that the original Scenic draws match the programs they are drawn from?

Run by `make conformance`: `python tests/conformance/run_conformance.py --map Town01.xodr [PROGRAM...]`. Scenic 3.1.1
stays in an environment of its own (`draw_scenes.py` runs there). Every drawn scene becomes a label. It must match with
the default tolerance, and again with every built-in requirement in force. A program with a line `# sharp: position
heading` also says that its last object has no such freedom: moved by 3 m or turned by 1 rad, it must not match.
A program with a line `# tolerance: position=0.05 why` is matched with that tolerance.
A program with a line `# scenic refuses` is one that both sides refuse. A program with a line `# differs: why` holds a
deviation of Scenic 3.1.1 from its own manual and from the language paper: some of its scenes must not match.
"""

from __future__ import annotations

import argparse
import json
import math
import random
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from scenicq.compiler.program import compile_scenario
from scenicq.compiler.standin import street
from scenicq.errors import ScenarioError, Source
from scenicq.forest.scenario import BuiltIn
from scenicq.geometry.features import read_geojson
from scenicq.geometry.network import Network
from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions, Tolerance
from scenicq.match.verdict import Match, NoMatch, Unknown, Verdict
from scenicq.smt.solver import open_solver
from scenicq.store.classes import is_class
from scenicq.store.labels import Label, LabelObject

HERE = Path(__file__).resolve().parent
SCENIC = "scenic==3.1.1"
OPTIONS = {"default": MatchOptions(), "enforced": MatchOptions(enforce=frozenset(BuiltIn))}
_TOLERANCE = re.compile(r"^# tolerance: position=([0-9.]+)", re.MULTILINE)
_SHARP = re.compile(r"^# sharp:(.*)$", re.MULTILINE)
_DIFFERS = re.compile(r"^# differs:(.*)$", re.MULTILINE)
_REFUSED = re.compile(r"^# scenic refuses", re.MULTILINE)


@dataclass
class Outcome:
    """What came of one program.

    Attributes:
        name: Of the program.
        matched, drawn: Scenes that matched, and all of them.
        told, moved: Displaced scenes that did not match, and all of them.
        deviating: Scenes of a known deviation that did not match; they are not drawn scenes in the sense above.
        faults: What went wrong, one line each.
    """

    name: str
    matched: int = 0
    drawn: int = 0
    told: int = 0
    moved: int = 0
    deviating: int = 0
    faults: list[str] = field(default_factory=list[str])


def environment(folder: Path) -> Path:
    """The Python that has Scenic; installs it at the first run."""
    python = folder / "bin" / "python"
    if not python.exists():
        subprocess.run([sys.executable, "-m", "venv", str(folder)], check=True)
        subprocess.run([str(python), "-m", "pip", "install", "--quiet", SCENIC], check=True)
    probe = subprocess.run([str(python), "-c", "import scenic"], capture_output=True, text=True, check=False)
    if probe.returncode:
        last = probe.stderr.strip().splitlines()[-1]
        raise SystemExit(f"Scenic cannot be imported: {last}\n(OpenCV needs the packages libgl1 and libglib2.0-0)")
    return python


def label_object(name: str, drawn: dict[str, Any]) -> LabelObject:
    """An object of a drawn scene as a label object of the nearest class that the class tree has."""
    category = next(each for each in (*drawn["classes"], "Object") if is_class(each))
    x, y, heading, width, length = (drawn[key] for key in ("x", "y", "heading", "width", "length"))
    return LabelObject(name, category, category, x, y, heading, width, length)


def label_of(scene: dict[str, Any], seed: int) -> Label:
    """A drawn scene as a label, the objects shuffled."""
    ego, *others = (label_object(f"object-{n}", each) for n, each in enumerate(scene["objects"]))
    random.Random(seed).shuffle(others)
    return Label("frame", "recording", 0, "map", ego, tuple(others), scene["params"])


def displaced(scene: dict[str, Any], what: str, seed: int) -> dict[str, Any]:
    """The scene with its last object moved by 3 m, or turned by 1 rad."""
    way = random.Random(seed).uniform(-math.pi, math.pi)
    last = dict(scene["objects"][-1])
    if what == "position":
        last["x"] += 3 * math.cos(way)
        last["y"] += 3 * math.sin(way)
    else:
        last["heading"] += 1.0
    return {**scene, "objects": [*scene["objects"][:-1], last]}


def shown(verdict: Verdict) -> str:
    """A verdict in a line."""
    match verdict:
        case Match():
            return "matches"
        case NoMatch():
            return f"no match: {verdict.cause.what} {verdict.cause.detail}"
        case Unknown():
            return f"unknown: {verdict.reason}"


def compare(path: Path, answer: dict[str, Any], network: Network, solver: Any) -> Outcome:
    """Match a program with the scenes that Scenic drew from it."""
    text = path.read_text(encoding="utf-8")
    outcome = Outcome(path.stem)
    refused = bool(_REFUSED.search(text))
    try:
        scenario = compile_scenario(Source(path.name, text), network)
    except ScenarioError as error:
        if not (refused and "error" in answer):
            outcome.faults.append(f"not compiled: {error}")
        return outcome
    if "error" in answer or refused:
        outcome.faults.append(f"Scenic says: {answer.get('error', 'nothing, where it should refuse')}")
        return outcome
    given = _TOLERANCE.search(text)
    tolerance = Tolerance(position=float(given[1])) if given else Tolerance()
    matchers = {
        name: Matcher(scenario, replace(options, tolerance=tolerance), solver) for name, options in OPTIONS.items()
    }
    sharp, differs = _SHARP.search(text), _DIFFERS.search(text)
    for number, scene in enumerate(answer["scenes"]):
        label = label_of(scene, number)
        verdicts = {name: matcher.match(label) for name, matcher in matchers.items()}
        wrong = {name: verdict for name, verdict in verdicts.items() if not isinstance(verdict, Match)}
        if differs:
            outcome.deviating += bool(wrong)
            continue
        outcome.drawn += 1
        outcome.matched += not wrong
        outcome.faults += [f"scene {number}, {name}: {shown(verdict)}" for name, verdict in wrong.items()]
        for what in sharp[1].split() if sharp else ():
            verdict = matchers["default"].match(label_of(displaced(scene, what, number), number))
            outcome.moved += 1
            outcome.told += isinstance(verdict, NoMatch)
            if not isinstance(verdict, NoMatch):
                outcome.faults.append(f"scene {number}, another {what}: {shown(verdict)}")
    if differs and not outcome.deviating:
        outcome.faults.append("no scene deviates any more")
    return outcome


def outcomes(arguments: argparse.Namespace) -> Iterator[Outcome]:
    """Draw and compare."""
    paths = sorted(arguments.programs or (HERE / "programs").glob("*.scenic"))
    work: Path = arguments.work
    work.mkdir(parents=True, exist_ok=True)
    chart = work / arguments.map.name
    if not chart.exists():
        shutil.copy(arguments.map, chart)  # Scenic writes its cache beside the map
    if not arguments.reuse:
        python, script = environment(arguments.environment), HERE / "draw_scenes.py"
        command = [python, "-W", "ignore", script, chart, work, str(arguments.scenes), *paths]
        subprocess.run(command, check=True)
    problems: list[str] = []
    features = read_geojson(work / "map.geojson", lambda name, fact: problems.append(f"{name}: {fact}"))
    if problems:
        yield Outcome("the map", faults=problems)
    town = Network("map", features)
    with open_solver("portable") as solver:
        for path in paths:
            answer = json.loads((work / f"{path.stem}.json").read_text(encoding="utf-8"))
            plain = not re.search(r"^model ", path.read_text(encoding="utf-8"), re.MULTILINE)
            yield compare(path, answer, street() if plain else town, solver)


def main() -> int:
    """Print a table; 0 if everything is as it should be."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("programs", nargs="*", type=Path, help="all in programs/ if none is given")
    parser.add_argument("--map", type=Path, required=True, help="OpenDRIVE file of a town")
    parser.add_argument("--environment", type=Path, default=Path(".conformance-venv"), help="where Scenic is installed")
    parser.add_argument("--work", type=Path, default=Path(".conformance"), help="folder of intermediate files")
    parser.add_argument("--reuse", action="store_true", help="match the scenes that the last run has drawn")
    parser.add_argument("--scenes", type=int, default=20, help="scenes of each program")
    matched = drawn = told = moved = 0
    good = True
    print(f"{'program':<28}{'matched':>9}{'told apart':>12}")
    for outcome in outcomes(parser.parse_args()):
        print(f"{outcome.name:<28}{f'{outcome.matched}/{outcome.drawn}':>9}{f'{outcome.told}/{outcome.moved}':>12}")
        for fault in outcome.faults[:3]:
            print(f"    {fault}")
        good = good and not outcome.faults
        matched, drawn = matched + outcome.matched, drawn + outcome.drawn
        told, moved = told + outcome.told, moved + outcome.moved
    print(f"{'all':<28}{f'{matched}/{drawn}':>9}{f'{told}/{moved}':>12}   {100 * matched / max(drawn, 1):.2f} %")
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
