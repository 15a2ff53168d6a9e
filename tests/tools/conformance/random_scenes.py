"""Do scenes that Scenic draws from random programs of the driving world match them, on several towns?

Run by `make conformance-random`: `python tests/tools/conformance/random_scenes.py --maps FOLDER --programs N --seed S`.
Each town takes the programs in turn. Scenic 3.1.1 draws up to three scenes of each (`draw_scenes.py`); what it refuses
or never draws is only counted. Each scene becomes a label that is decided with position=0.05 and heading=0.5deg in 20
seconds of processor time, and must match. With one object displaced farther than that it may match only if Scenic
itself, given the witness, puts everything where the label has it.

A program that fails is written to `failures/` of the work folder, with the scene. `--only Town01-17` decides one again.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
import random
import re
import sys
import time
import traceback
from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from comparing import compiled, displaced, label_of, shown
from original import Original, environment
from patience import OutOfPatienceError, patience
from published_scenes import maps_of
from road_programs import Places, compose
from run_conformance import SCENIC, read_map
from shrinking import shrink

from scenicq.budget import Exhausted, limited
from scenicq.errors import ScenarioError
from scenicq.forest.scenario import Scenario
from scenicq.geometry.network import Network
from scenicq.importers.opendrive import convert_xodr
from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import parse_tolerance
from scenicq.match.verdict import Match, NoMatch, Verdict

TOWNS = ("Town01", "Town02", "Town05", "Town07", "Town10HD")
TOLERANCE = parse_tolerance("position=0.05,heading=0.5deg")
CLOCK_S = 20.0
"""Seconds of processor time for compiling a program, and again for each label."""
SCENES = 3
DRAWING_S, FIRST_S = 4.0, 1.2
"""Seconds of processor time that Scenic may take for the scenes of one program, and for the first of them."""
GOOD = frozenset({"right", "Scenic refuses", "no scene", "told apart", "allowed"})


@dataclass
class Finding:
    """What came of a program, or of one scene of it.

    Attributes:
        kind: right, no, unknown, late, crash or refused; "Scenic refuses" or "no scene"; of a displaced label "told
            apart", "allowed" by a replay, "open" where none could be made, or "wrongly matched".
        why: What is said of it.
        scene: The drawn scene.
        excuse: The known difference that explains it, by name.
        seconds: Of processor time.
    """

    kind: str
    why: str = ""
    scene: dict[str, Any] | None = None
    excuse: str = ""
    seconds: float = 0.0


@dataclass
class Town:
    """A map, both sides of it.

    Attributes:
        name: Such as Town01.
        network: Ours.
        places: Where programs may be.
        original: Scenic.
        drawn: Folder of the scenes that it has drawn.
    """

    name: str
    network: Network
    places: Places
    original: Original
    drawn: Path

    def draw(self, text: str) -> dict[str, Any]:
        """Scenes of a program; drawn once."""
        kept = self.drawn / f"{self.name}-{hashlib.sha256(text.encode()).hexdigest()[:24]}.json"
        if kept.exists():
            return json.loads(kept.read_text(encoding="utf-8"))
        answer = self.original.draw(text, SCENES, 1, DRAWING_S, FIRST_S)
        kept.write_text(json.dumps(answer), encoding="utf-8")
        return answer


@dataclass
class Judge:
    """Decides the scenes of programs.

    Attributes:
        solver: Ours.
        moves: Whether displaced scenes are decided, too.
    """

    moves: bool = True

    def findings(self, town: Town, text: str) -> Iterator[Finding]:
        """What comes of a program and each of its scenes."""
        answer = town.draw(text)
        if "error" in answer:
            yield Finding("Scenic refuses", answer["error"].splitlines()[0][:150])
            return
        if not answer["scenes"]:
            yield Finding("no scene", answer.get("ended", ""))
            return
        scenario, fault = self.compiled(town, text)
        if scenario is None:
            first = answer["scenes"][0]
            yield Finding(fault.kind, fault.why, first, excuse(text, first, fault.why))
            return
        matcher = Matcher(scenario, MatchOptions(tolerance=TOLERANCE, timeout_s=CLOCK_S))
        for number, scene in enumerate(answer["scenes"]):
            found, _ = self.decided(matcher, scene, number)
            found.excuse = "" if found.kind == "right" else excuse(text, scene)
            yield found
            if self.moves and found.kind == "right" and number == 0:
                yield self.displaced(town, text, matcher, scene)

    def compiled(self, town: Town, text: str) -> tuple[Scenario | None, Finding]:
        """The program on the map, or what keeps it from being compiled."""
        try:
            with patience(2 * CLOCK_S), limited(CLOCK_S):
                return compiled("random", text, town.network), Finding("right")
        except ScenarioError as error:
            first = error.diagnostics[0]
            return None, Finding("refused", f"{first.code}: {first.message} [{first.span.text if first.span else ''}]")
        except (OutOfPatienceError, Exhausted):
            return None, Finding("late", "compiling")
        except Exception:
            return None, Finding("crash", "compiling: " + traceback.format_exc(limit=-3))

    def decided(self, matcher: Matcher, scene: dict[str, Any], number: int) -> tuple[Finding, Verdict | None]:
        """Whether a scene matches, and the verdict."""
        started = time.process_time()
        verdict: Verdict | None = None
        try:
            with patience(1.5 * CLOCK_S):
                verdict = matcher.match(label_of(scene, number))
        except OutOfPatienceError:
            found = Finding("late", f"over {1.5 * CLOCK_S:g} s", scene)
        except Exception:
            found = Finding("crash", traceback.format_exc(limit=-4), scene)
        else:
            kind = "right" if isinstance(verdict, Match) else "no" if isinstance(verdict, NoMatch) else "unknown"
            about = "" if isinstance(verdict, Match) else f" ({verdict.cause.what} {verdict.cause.place})"
            found = Finding(kind, shown(verdict) + about, scene)
        found.seconds = time.process_time() - started
        if found.kind == "right" and found.seconds > CLOCK_S:
            found.kind = "late"
        return found, verdict

    def displaced(self, town: Town, text: str, matcher: Matcher, scene: dict[str, Any]) -> Finding:
        """Whether a scene with one object displaced beyond the tolerance is told apart, or rightly is not."""
        rng = random.Random(text)
        number = rng.randrange(len(scene["objects"]))
        far, turn = rng.choice(((rng.uniform(0.8, 4), 0.0), (0.0, math.radians(rng.uniform(6, 90))), (1.5, 0.3)))
        moved = displaced(scene, number, rng.randrange(1000), far=far, turn=turn)
        found, verdict = self.decided(matcher, moved, 0)
        if isinstance(verdict, NoMatch):
            return Finding("told apart", "", moved, seconds=found.seconds)
        if isinstance(verdict, Match):
            return self.replayed(town, text, matcher, moved, verdict)
        found.why = "displaced: " + found.why
        found.kind = {"unknown": "open", "late": "open"}.get(found.kind, found.kind)
        return found

    def replayed(self, town: Town, text: str, matcher: Matcher, moved: dict[str, Any], match: Match) -> Finding:
        """Whether Scenic allows a displaced scene, given the witness."""
        witness = {key.removeprefix("random:"): value for key, value in match.witness.items()}
        label, objects = label_of(moved, 0), matcher.scenario.objects
        ids = [match.correspondence[each.name] for each in objects]
        first = next(number for number, each in enumerate(objects) if each.name == "ego")
        ids = [ids[first], *ids[:first], *ids[first + 1 :]]
        known = {"ego": label.ego, **{each.id: each for each in label.objects}}
        labels = [{"x": known[each].x, "y": known[each].y, "heading": known[each].heading} for each in ids]
        what, why = town.original.allows(text, witness, labels, DRAWING_S)
        return Finding({"refuted": "wrongly matched"}.get(what, what), why + f" {dict(match.witness)}", moved)


def excuse(text: str, scene: dict[str, Any], why: str = "") -> str:
    """The known difference that may keep a scene from matching, or nothing; `why` is what ours refuses."""
    if why.startswith("wrong-value") and "must be positive" in why:
        return "size that is not positive"
    on_object = re.search(r"(\w+) = new (?:Oriented)?Point on (?:ego|o\d+)\b", text)
    if on_object and ("distance" in text or f"beyond {on_object[1]}" in text):
        return "height of a point on an object"
    return ""


@dataclass
class Tally:
    """Counts what came of the programs of a run.

    Attributes:
        kinds: Findings by kind, excused ones apart.
        excuses: By name.
        reasons: Of what is refused or unknown.
        times: Seconds of each label that was decided.
    """

    kinds: Counter[str] = field(default_factory=Counter[str])
    excuses: Counter[str] = field(default_factory=Counter[str])
    reasons: Counter[str] = field(default_factory=Counter[str])
    times: list[float] = field(default_factory=list[float])

    def add(self, found: Finding) -> bool:
        """Count a finding; whether it is as it should be."""
        if found.seconds:
            self.times.append(found.seconds)
        if found.excuse:
            self.excuses[found.excuse] += 1
            return True
        self.kinds[found.kind] += 1
        if found.kind in ("refused", "unknown", "open"):
            self.reasons[f"{found.kind}: {found.why.split('[')[0].split('(')[0][:90]}"] += 1
        return found.kind in GOOD or found.kind == "open"

    def show(self) -> None:
        """Print the counts."""
        print(", ".join(f"{count} {kind}" for kind, count in self.kinds.most_common()), flush=True)
        if self.excuses:
            print("excused:", ", ".join(f"{count} {name}" for name, count in self.excuses.most_common()))
        for reason, count in self.reasons.most_common():
            print(f"    {count:>4} {reason}")
        if self.times:
            print(f"worst {max(self.times):.1f} s, mean {sum(self.times) / len(self.times):.2f} s of processor time")


def towns(arguments: argparse.Namespace, python: Path, stack: ExitStack) -> list[Town]:
    """The towns of the run, a process of Scenic's for each until the stack closes."""
    charts, found = maps_of(arguments.maps), list[Town]()
    (arguments.work / "scenes").mkdir(parents=True, exist_ok=True)
    for name in arguments.towns:
        original = Original(python, charts[name], arguments.work / name, options=("--as-decided",))
        stack.callback(original.close)
        original.draw(
            "model scenic.domains.driving.model\nego = new Car\n", 0, 1, 60, 60
        )  # the first waits for the map
        network = read_map(convert_xodr(charts[name], arguments.work / "maps", python=str(python)))
        found.append(Town(name, network, Places.of(network), original, arguments.work / "scenes"))
    return found


def programs(arguments: argparse.Namespace, towns: list[Town]) -> Iterator[tuple[str, Town, int]]:
    """The programs of a run by their names, each with its town and number; the towns take them in turn."""
    for number in range(arguments.first, arguments.first + arguments.programs):
        for town in towns if arguments.only else [towns[number % len(towns)]]:
            name = f"{town.name}-{arguments.seed}-{number}"
            if not arguments.only or name in arguments.only:
                yield name, town, number


def run(arguments: argparse.Namespace, towns: list[Town], judge: Judge, tally: Tally) -> bool:
    """Decide the programs; whether all is as it should be."""
    good = True
    for name, town, number in programs(arguments, towns):
        text = compose(f"{arguments.seed}/{town.name}/{number}", town.places)
        tally.kinds["programs"] += 1
        for found in judge.findings(town, text):
            tally.kinds["scenes"] += found.scene is not None and found.kind not in ("told apart", "allowed", "open")
            fine = tally.add(found)
            good = good and fine
            if arguments.only or not fine or found.kind == "open" or arguments.verbose:
                print(f"{name}: {found.kind} {found.excuse} {found.seconds:.1f} s {found.why}", flush=True)
            if not fine or found.kind == "open":
                _write(arguments, judge, town, name, text, found)
        if tally.kinds["programs"] % 100 == 0:
            tally.show()
    return good


def _write(arguments: argparse.Namespace, judge: Judge, town: Town, name: str, text: str, found: Finding) -> None:
    """The program with what was seen, made smaller if asked for."""
    if arguments.shrink:
        moves, judge.moves = judge.moves, found.kind in ("wrongly matched", "open")

        def same(smaller: str) -> bool:
            return any(each.kind == found.kind and not each.excuse for each in judge.findings(town, smaller))

        text = shrink(text, same)
        found = next((each for each in judge.findings(town, text) if each.kind == found.kind), found)
        judge.moves = moves
        print(text, flush=True)
    folder = arguments.work / "failures" / found.kind
    folder.mkdir(parents=True, exist_ok=True)
    comment = "".join(f"# {line}\n" for line in [town.name, *found.why.splitlines(), json.dumps(found.scene)])
    (folder / f"{name}.scenic").write_text(comment + text, encoding="utf-8")


def parse_arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--maps", type=Path, nargs="+", required=True, help="folders of OpenDRIVE maps")
    parser.add_argument("--towns", nargs="+", default=list(TOWNS), help="the maps of these names")
    parser.add_argument("--environment", type=Path, default=Path(".conformance-venv"), help="where Scenic is installed")
    parser.add_argument("--work", type=Path, default=Path(".conformance/random"), help="folder of what is drawn")
    parser.add_argument("--programs", type=int, default=3000, help="how many, over all towns")
    parser.add_argument("--first", type=int, default=0, help="number of the first program")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", nargs="*", default=[], metavar="TOWN-SEED-NUMBER", help="programs of these names")
    parser.add_argument("--no-displaced", dest="displaced", action="store_false", help="decide drawn scenes only")
    parser.add_argument("--shrink", action="store_true", help="make programs that fail smaller")
    parser.add_argument("--verbose", action="store_true", help="tell of every scene")
    return parser.parse_args()


def main() -> int:
    """Compare; 0 if everything is as it should be."""
    arguments = parse_arguments()
    python, tally = environment(arguments.environment, SCENIC), Tally()
    print(f"seed {arguments.seed}, programs {arguments.first} to {arguments.first + arguments.programs - 1}")
    with ExitStack() as stack:
        good = run(arguments, towns(arguments, python, stack), Judge(arguments.displaced), tally)
    tally.show()
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
