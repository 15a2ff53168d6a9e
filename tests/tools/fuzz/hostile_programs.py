"""Hostile programs: those of the repository with tokens changed, and calls and operators put together by chance.

Whatever a program is, compiling and matching it ends with an answer or a diagnostic. As a program, this goes on until
the time is over and prints what did not.
"""

import argparse
import random
import re
import resource
import signal
import sys
import traceback
from collections import Counter
from pathlib import Path

from rounds import Round, cpu_seconds

ROOT = Path(__file__).parents[3]
_TOKEN = re.compile(r"\s+|\w+|\"[^\"]*\"|'[^']*'|[^\w\s]")
_VALUES = (
    "0", "-1", "1e308", "1e-308", "10**400", "float('nan')", "True", "None", "''", "'a' * 99999", "()", "[]", "{}",
    "range(9)", "ego", "ego.position", "ego.heading", "(1, 2)", "1 @ 2", "30 deg", "Range(0, 1)",
    "Range(-1e308, 1e308)", "Normal(0, 1)", "Uniform(1, 2)", "Uniform(*network.lanes)", "Discrete({1: 2})",
    "DiscreteRange(0, 9)", "network", "road", "curb", "intersection", "roadDirection", "network.lanes",
    "network.lanes[0]", "network.laneAt(ego)", "CircularRegion((0, 0), 9)", "everywhere", "nowhere", "Car",
    "lambda x: x", "self", "10**19",
)  # fmt: skip
CALLS = (
    "sin", "cos", "hypot", "max", "min", "abs", "round", "sum", "len", "sorted", "list", "str", "int", "float",
    "range", "filter", "map", "any", "all", "zip", "enumerate", "pow", "Range", "Normal", "Uniform", "Discrete",
    "TruncatedNormal", "Vector", "CircularRegion", "RectangularRegion", "SectorRegion", "PolygonalRegion",
    "PolylineRegion", "PointSetRegion", "network.laneAt", "network.roadAt", "network.findPointIn", "resample",
    "bool", "tuple", "dict", "set", "isinstance",
)  # fmt: skip
_BINARY = (
    "+", "-", "*", "/", "//", "%", "**", "@", "==", "<", "in", "is", "and", "or", "relative to", "offset by", "at",
    "<<", "&", "can see", "deg relative to",
)  # fmt: skip
FORMS = (
    "distance from {} to {}", "angle from {} to {}", "relative heading of {} from {}", "follow {} from {} for {}",
    "visible {}", "{} offset along {} by {}", "apparent heading of {} from {}", "{}[{}]", "{}.{}",
    "[{} for x in {}]", "{} if {} else {}", "not {}", "-{}", "f'{{{}}}'", "front of {}", "{} deg", "*{}",
)  # fmt: skip
STATEMENTS = (
    "x = {}", "require {}", "require[0.5] {}", "param p = {}", "new Car at {}", "new Car on {}",
    "new Car ahead of {} by {}", "new Car following {} from {} for {}", "new Car at {}, facing {}",
    "new Car at {}, with width {}", "mutate {}", "for x in {}:\n    y = {}", "if {}:\n    pass",
    "new Car beyond {} by {}", "new Car left of {} by {}", "x += {}", "new Car in {}, facing toward {}",
    "new Car at {}, apparently facing {}", "new Car with mutationScale {}",
    "new Car at {}, with requireVisible {}", "assert {}", "new Pedestrian on visible {}", "x[{}] = {}",
)  # fmt: skip


def sources() -> list[str]:
    """Every program of the repository."""
    files = [*sorted((ROOT / "sample_data/scenarios").glob("*.scenic"))]
    pages = sorted((ROOT / "tests/language").glob("*.md"))
    blocks = [text for page in pages for text in re.findall(r"```scenic\n(.*?)```", page.read_text(), re.DOTALL)]
    return [file.read_text() for file in files] + blocks


def mutated(text: str, others: list[str], chance: random.Random) -> str:
    """A program with some tokens dropped, doubled, exchanged or replaced by those of another one."""
    tokens = _TOKEN.findall(text)
    for _ in range(chance.randint(1, 4)):
        if not tokens:
            break
        place = chance.randrange(len(tokens))
        match chance.randrange(6):
            case 0:
                del tokens[place]
            case 1:
                tokens.insert(place, tokens[place])
            case 2:
                other = chance.randrange(len(tokens))
                tokens[place], tokens[other] = tokens[other], tokens[place]
            case 3:
                tokens[place] = chance.choice(_VALUES)
            case 4:
                found = _TOKEN.findall(chance.choice(others))
                tokens[place] = chance.choice(found) if found else ""
            case _:
                tokens[place] = f"({chance.choice(_BINARY)} {tokens[place]})"
    return "".join(tokens)


def expression(chance: random.Random, depth: int = 2) -> str:
    """An expression put together by chance."""
    if depth <= 0 or chance.random() < 0.3:
        return chance.choice(_VALUES)
    match chance.randrange(3):
        case 0:
            args = ", ".join(expression(chance, depth - 1) for _ in range(chance.randrange(4)))
            return f"{chance.choice(CALLS)}({args})"
        case 1:
            return f"({expression(chance, depth - 1)}) {chance.choice(_BINARY)} ({expression(chance, depth - 1)})"
        case _:
            form = chance.choice(FORMS)
            return form.format(*(f"({expression(chance, depth - 1)})" for _ in range(form.count("{}"))))


def generated(chance: random.Random) -> str:
    """A program of statements put together by chance."""
    lines = ["model scenic.domains.driving.model", "ego = new Car"]
    for _ in range(chance.randint(1, 4)):
        form = chance.choice(STATEMENTS)
        lines.append(form.format(*(expression(chance) for _ in range(form.count("{}")))))
    return "\n".join(lines) + "\n"


def attempt(text: str) -> str:
    """Compile a program and match it with a small label; what came of it.

    Raises:
        Exception: Something that is our own mistake.
    """
    from scenicq.compiler.program import compile_scenario
    from scenicq.errors import ScenicqError, Source
    from scenicq.geometry.default_street import street
    from scenicq.match.matcher import Matcher
    from scenicq.match.options import MatchOptions
    from scenicq.store.labels import Label, LabelObject

    network = street()
    try:
        scenario = compile_scenario(Source("fuzz.scenic", text), network, initial=True)
    except ScenicqError as error:
        return error.diagnostics[0].code
    x, y = network.lanes[0].centerline.pieces[0].coords[0]
    cars = tuple(LabelObject(f"c{i}", "Car", "car", x + i, y + 5 * i, 0.1 * i, 2.0, 4.5) for i in range(3))
    label = Label("f", "r", 0, network.name, LabelObject("ego", "Car", "car", x, y, 0.0, 2.0, 4.5), cars)
    return type(Matcher(scenario, MatchOptions(timeout_s=5.0)).match(label)).__name__


class Hang(BaseException):
    """A run takes too long."""


def main() -> None:
    """Try programs until the time is over; exits with 1 where one ended otherwise than by an answer or a diagnostic."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--minutes", type=float, default=60)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    resource.setrlimit(resource.RLIMIT_AS, (4 << 30, 4 << 30))
    chance, known = random.Random(options.seed), sources()
    outcomes: Counter[str] = Counter()
    attack = Round(options.minutes, lambda: f"{outcomes.total()} programs: {dict(outcomes.most_common())}")

    def late(*_: object) -> None:
        raise Hang

    # seconds of the processor: other work on the machine makes no program hang
    signal.signal(signal.SIGVTALRM, late)
    while attack.goes_on():
        text = generated(chance) if chance.random() < 0.5 else mutated(chance.choice(known), known, chance)
        signal.setitimer(signal.ITIMER_VIRTUAL, 70)
        began = cpu_seconds()
        try:
            outcomes[attempt(text)] += 1
        except (Exception, Hang) as error:
            name = f"{type(error).__name__} {traceback.extract_tb(error.__traceback__)[-1].name}"
            outcomes[f"BAD {name}"] += 1
            if outcomes[f"BAD {name}"] > 3:
                continue
            print(f"--- {name}\n{text}\n{traceback.format_exc(limit=-3)}", flush=True)
        finally:
            signal.setitimer(signal.ITIMER_VIRTUAL, 0)
            attack.took(cpu_seconds() - began)
    sys.exit(any(name.startswith("BAD") for name in outcomes))


if __name__ == "__main__":
    main()
