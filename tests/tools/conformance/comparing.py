"""Drawn scenes as labels, and whether they match the program that they were drawn from."""

from __future__ import annotations

import math
import random
import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

from patience import OutOfPatienceError, patience
from random_programs import freedoms

from scenicq.compiler.program import compile_scenario
from scenicq.errors import ScenarioError, Source
from scenicq.forest.scenario import BuiltIn, Scenario
from scenicq.geometry.network import Network
from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import EXACT, Tolerance
from scenicq.match.verdict import Match, NoMatch, Unknown, Verdict
from scenicq.store.classes import is_class
from scenicq.store.labels import Label, LabelObject

OPTIONS = {
    "default": MatchOptions(tolerance=EXACT),
    "enforced": MatchOptions(tolerance=EXACT, enforce=frozenset(BuiltIn)),
}
NOT_IN_SCENIC = re.compile(
    r"must be real number, not \w+|'tuple' object has no attribute 'coordinates'|cannot iterate through a random value|"
    r"heading of \w+ not a scalar|expected Vector, got float|^AssertionError: $"
)
"""Messages of Scenic 3.1.1 where its functions are not made for random values, which scenicq allows, or stumble."""
DOCUMENTED = {"unsupported-construct", "unsupported-region", "random-branch", "map-lacks"}
"""Codes of diagnostics with which a program that Scenic accepts may be refused."""
PATIENCE_S = 15.0
"""Seconds of processor time for the scenes of one random program."""
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
        kind: For a random program: "compared", "both refuse", "ours refuses" (what is not supported), "beyond Scenic",
            "no scene", "undecided" (unknown), "takes long", or what is wrong.
        faults: What went wrong, one line each.
    """

    name: str
    matched: int = 0
    drawn: int = 0
    told: int = 0
    moved: int = 0
    deviating: int = 0
    kind: str = "compared"
    faults: list[str] = field(default_factory=list[str])


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


def displaced(scene: dict[str, Any], number: int, seed: int, *, far: float = 0.0, turn: float = 0.0) -> dict[str, Any]:
    """The scene with one object moved some metres in any direction, and turned by an angle."""
    way = random.Random(seed).uniform(-math.pi, math.pi)
    things = [dict(thing) for thing in scene["objects"]]
    things[number]["x"] += far * math.cos(way)
    things[number]["y"] += far * math.sin(way)
    things[number]["heading"] += turn
    return {**scene, "objects": things}


def shown(verdict: Verdict) -> str:
    """A verdict in a line."""
    match verdict:
        case Match():
            return "matches"
        case NoMatch():
            return f"no match: {verdict.cause.what} {verdict.cause.detail}"
        case Unknown():
            return f"unknown: {verdict.reason}"


def compiled(name: str, text: str, network: Network, version: int | None = None) -> Scenario:
    """The program on a map.

    Raises:
        ScenarioError: It is refused.
    """
    return compile_scenario(Source(name, text), network, version=version, lanes="any")


def tolerance_of(text: str) -> Tolerance:
    """The tolerance that a program of the list is matched with."""
    given = _TOLERANCE.search(text)
    return Tolerance(position=float(given[1])) if given else Tolerance()


def all_match(text: str) -> bool:
    """Whether each scene of a program of the list must match: neither is it refused nor does Scenic depart from it."""
    return not (_REFUSED.search(text) or _DIFFERS.search(text))


def compare(name: str, text: str, answer: dict[str, Any], network: Network, version: int | None = None) -> Outcome:
    """Match a program of the fixed list with the scenes that Scenic drew from it."""
    outcome = Outcome(name)
    refused = bool(_REFUSED.search(text))
    try:
        scenario = compiled(name, text, network, version)
    except ScenarioError as error:
        if not (refused and "error" in answer):
            outcome.faults.append(f"not compiled: {error}")
        return outcome
    if "error" in answer or refused or not answer["scenes"]:
        why = answer.get("error") or answer.get("ended", "nothing, where it should refuse")
        outcome.faults.append(f"Scenic says: {why}")
        return outcome
    tolerance = tolerance_of(text)
    sharp, differs = _SHARP.search(text), _DIFFERS.search(text)
    match_scenes(outcome, scenario, answer["scenes"], tolerance, deviating=bool(differs))
    matcher = Matcher(scenario, MatchOptions(tolerance=tolerance))
    for number, scene in enumerate(() if differs else answer["scenes"]):
        for what in sharp[1].split() if sharp else ():
            away = {"far": 3.0} if what == "position" else {"turn": 1.0}
            _tell_apart(outcome, matcher, displaced(scene, -1, number, **away), number, f"another {what}")
    if differs and not outcome.deviating:
        outcome.faults.append("no scene deviates any more")
    return outcome


def match_scenes(
    outcome: Outcome,
    scenario: Scenario,
    scenes: list[dict[str, Any]],
    tolerance: Tolerance,
    *,
    deviating: bool = False,
) -> None:
    """Match drawn scenes by every set of options."""
    matchers = {name: Matcher(scenario, replace(options, tolerance=tolerance)) for name, options in OPTIONS.items()}
    for number, scene in enumerate(scenes):
        label = label_of(scene, number)
        verdicts = {name: matcher.match(label) for name, matcher in matchers.items()}
        wrong = {name: verdict for name, verdict in verdicts.items() if not isinstance(verdict, Match)}
        if deviating:
            outcome.deviating += bool(wrong)
            continue
        outcome.drawn += 1
        outcome.matched += not wrong
        outcome.faults += [f"scene {number}, {name}: {shown(verdict)}" for name, verdict in wrong.items()]


def _tell_apart(outcome: Outcome, matcher: Matcher, scene: dict[str, Any], number: int, what: str) -> None:
    verdict = matcher.match(label_of(scene, number))
    outcome.moved += 1
    outcome.told += isinstance(verdict, NoMatch)
    if not isinstance(verdict, NoMatch):
        outcome.faults.append(f"scene {number}, {what}: {shown(verdict)}")


def compare_random(name: str, text: str, answer: dict[str, Any], network: Network) -> Outcome:
    """Compare what both make of a random program.

    It must be refused by both or by none, unless scenicq refuses it with a code of what it does not support. Every
    drawn scene must match, and none with an object displaced farther than the program leaves it free.
    """
    outcome = Outcome(name)
    try:
        scenario = compiled(name, text, network)
    except ScenarioError as error:
        codes = {each.code for each in error.diagnostics}
        if "error" in answer:
            outcome.kind = "both refuse"
        elif codes <= DOCUMENTED or "ended" in answer:
            outcome.kind = "ours refuses"
        else:
            outcome.kind = "only ours refuses"
            outcome.faults.append(f"only ours refuses: {error.diagnostics[0].code}: {error.diagnostics[0].message}")
        return outcome
    if "error" in answer and NOT_IN_SCENIC.search(answer["error"]):
        outcome.kind = "beyond Scenic"
        return outcome
    if "error" in answer:
        outcome.kind = "only Scenic refuses"
        outcome.faults.append(f"only Scenic refuses: {answer['error']}")
        return outcome
    if not answer["scenes"]:
        outcome.kind = "no scene"
        return outcome
    try:
        with patience(PATIENCE_S):
            match_scenes(outcome, scenario, answer["scenes"], Tolerance())
            outcome.kind = "not matched" if outcome.faults else "compared"
            matcher = Matcher(scenario, MatchOptions(tolerance=EXACT))
            for number, scene in enumerate(() if outcome.faults else answer["scenes"]):
                for what, moved in _outside(text, scene, number):
                    _tell_apart(outcome, matcher, moved, number, what)
                    outcome.kind = "not told apart" if outcome.faults else "compared"
    except OutOfPatienceError:
        outcome.kind = "takes long"
    if outcome.faults and all("unknown: " in fault for fault in outcome.faults):
        outcome.kind, outcome.drawn, outcome.moved = "undecided", outcome.matched, outcome.told
        outcome.faults.clear()
    return outcome


def _outside(text: str, scene: dict[str, Any], seed: int) -> Iterator[tuple[str, dict[str, Any]]]:
    """The scene with each object moved or turned farther than its program leaves it free."""
    for width, (place, heading) in freedoms(text).items():
        found = [n for n, thing in enumerate(scene["objects"]) if math.isclose(thing["width"], width)]
        if len(found) != 1:
            continue
        if place < math.inf:
            yield f"width {width} moved", displaced(scene, found[0], seed, far=place + 3.0)
        if heading < math.pi - 0.2:
            yield f"width {width} turned", displaced(scene, found[0], seed, turn=(heading + math.pi) / 2 + 0.1)
