"""A record of verdicts before a change, to compare with after it.

`record FILE` matches drawn labels, whole and displaced, against the programs of the test lists, of the sample data, of
chains along roads and of a bend, under three tolerances and without a solver. It writes one JSON line a question: what
was asked, the label's digest, verdict, correspondence, witness and cause. `compare FILE` asks the same again and lists
what differs; a label that itself came out differently (drawing or compiling has changed) is listed apart.
"""

from __future__ import annotations

import hashlib
import json
import random
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import fields, replace
from pathlib import Path

TESTS = Path(__file__).parents[2]
sys.path[:0] = [str(TESTS / each) for each in ("oracles/drawn_scenes", "units/match", "oracles/labels")]

from compositions import Composer  # noqa: E402
from examples import examples, town  # noqa: E402
from hidden_roads import BEND, BENDS, CHAIN, ON_BEND  # noqa: E402
from scenes import label_of  # noqa: E402

from scenicq.compiler.program import compile_scenario  # noqa: E402
from scenicq.errors import ScenarioError, Source  # noqa: E402
from scenicq.forest.improvise import Improviser, Scene  # noqa: E402
from scenicq.forest.scenario import Scenario  # noqa: E402
from scenicq.match.matcher import Matcher  # noqa: E402
from scenicq.match.options import MatchOptions  # noqa: E402
from scenicq.match.tolerance import parse_tolerance  # noqa: E402
from scenicq.match.verdict import Match, NoMatch, Verdict  # noqa: E402
from scenicq.store.labels import Label  # noqa: E402

TOLERANCES = ("position=0.001,heading=0.001", "position=0.25,heading=5deg", "x=0.25,y=0.1,heading=2deg")
SEEDS = range(2)
COMPOSED = range(40)
LEFT_OUT = {"paper:mars"}
"""Takes seconds a label where there is no solver."""
SHIFTS = (0.0, 0.02, 0.3, 1.0, 8.0)
Record = dict[str, object]


def _programs() -> Iterator[tuple[str, Scenario]]:
    for example in examples().values():
        # a page's programs are found again by their text: lines come and go
        digest = hashlib.sha256(example.text.encode()).hexdigest()[:8]
        name = example.name if not example.name.rpartition(":")[2].isdigit() else f"page:{digest}"
        if name in LEFT_OUT:
            continue
        try:
            yield name, example.compiled()
        except ScenarioError:
            continue
    for seed in COMPOSED:
        text = Composer(random.Random(seed)).compose(points=2, objects=2)
        yield f"composed:{seed}", compile_scenario(Source("composed.scenic", text), town(), version=3)
    for cars in (1, 2):
        text = "model scenic.domains.driving.model\n" + CHAIN.format(cars=cars)
        yield f"chain:{cars}", compile_scenario(Source("chain.scenic", text), town())
    for name, text in BENDS.items():
        yield f"bend:{name}", compile_scenario(Source("bend.scenic", ON_BEND + text), BEND)


def _labels(scenario: Scenario, seeds: Sequence[int]) -> Iterator[tuple[str, Label]]:
    for seed in seeds:
        rng = random.Random(seed)
        try:
            scene: Scene | None = Improviser(scenario, frozenset()).draw(rng, 500)
        except ScenarioError:
            return
        if scene is None:
            continue
        whole = label_of(scenario, scene, rng, distractors=3)
        yield f"{seed}", whole
        if whole.objects:
            moved, off = list(whole.objects), rng.choice(SHIFTS)
            victim = rng.randrange(len(moved))
            old = moved[victim]
            moved[victim] = replace(old, x=old.x + off, heading=old.heading + rng.choice(SHIFTS) / 4)
            yield f"{seed}, displaced", replace(whole, objects=tuple(moved))


def _shown_label(label: Label) -> str:
    """What is known of the objects: what is not says nothing, so that records outlive new columns."""
    objects = (label.ego, *label.objects)
    known = [{each.name: getattr(one, each.name) for each in fields(one)} for one in objects]
    return repr([[(name, value) for name, value in one.items() if value not in (None, (), {})] for one in known])


def _shown(verdict: Verdict) -> Record:
    match verdict:
        case Match(correspondence, witness):
            return {"verdict": "match", "correspondence": dict(correspondence), "witness": dict(witness)}
        case NoMatch(cause, partial):
            told = [cause.what, cause.detail, cause.place]
            return {"verdict": "no_match", "correspondence": dict(partial), "cause": told}
        case unknown:
            told = [unknown.reason, unknown.cause.what, unknown.cause.detail, unknown.cause.place]
            return {"verdict": "unknown", "correspondence": dict(unknown.correspondence), "cause": told}


def records() -> Iterator[Record]:
    """Every question with its answer."""
    options = {text: MatchOptions(tolerance=parse_tolerance(text)) for text in TOLERANCES}
    for name, scenario in _programs():
        # hidden roads take a second a label
        labels = list(_labels(scenario, SEEDS[:1] if name.startswith(("chain:", "bend:")) else SEEDS))
        for text, each in options.items():
            matcher = Matcher(scenario, each)
            for variant, label in labels:
                digest = hashlib.sha256(_shown_label(label).encode()).hexdigest()[:12]
                asked: Record = {"asked": f"{name} | {variant} | {text}", "label": digest}
                # through JSON, so that what is compared is what is written
                yield json.loads(json.dumps(asked | _shown(matcher.match(label))))


def _record(path: Path) -> None:
    with path.open("w", encoding="utf-8") as file:
        file.writelines(json.dumps(each) + "\n" for each in records())


def _compare(path: Path) -> int:
    before = {each["asked"]: each for each in map(json.loads, path.read_text(encoding="utf-8").splitlines())}
    counts = Counter[str]()
    for after in records():
        old = before.pop(str(after["asked"]), None)
        if old is None:
            counts["only now"] += 1
            continue
        differing = [key for key in ("verdict", "correspondence", "witness", "cause") if old.get(key) != after.get(key)]
        if old["label"] != after["label"]:
            counts["other label"] += 1
        elif differing:
            counts[differing[0]] += 1
            sys.stdout.write(f"{differing[0]} differs:\n  {json.dumps(old)}\n  {json.dumps(after)}\n")
        else:
            counts["equal"] += 1
    counts["only before"] = len(before)
    sys.stdout.write(f"{dict(counts)}\n")
    return 1 if counts["verdict"] or counts["correspondence"] else 0


def main() -> int:
    """Record or compare; 1 where a verdict or a correspondence differs."""
    match sys.argv[1:]:
        case ["record", name]:
            _record(Path(name))
            code = 0
        case ["compare", name]:
            code = _compare(Path(name))
        case _:
            sys.stderr.write("verdicts.py record FILE | compare FILE\n")
            return 2
    sys.stdout.write(f"{time.process_time():.0f} s of processor time\n")
    return code


if __name__ == "__main__":
    sys.exit(main())
