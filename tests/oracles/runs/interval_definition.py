"""Matches over time straight from their definition: every binding, every pair of samples, one program at a time.

Programs are drawn as data (`Program`), of which the text is one reading and the plain functions here the other. Where
something is not observed, a completion says what is true there.
"""

from __future__ import annotations

import itertools
import math
import random
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from scenicq.store.labels import Label, LabelObject, Recording

GAP_S = 1.5
NOW = tuple[str, int]  # what stands for an atom at a sample, in a completion


@dataclass(frozen=True)
class Sample:
    """Time in seconds and the position of each track that is observed; the ego is the track "ego"."""

    time: float
    seen: dict[str, tuple[float, float]]


Trace = list[Sample]


def recording_of(name: str, trace: Trace) -> Recording:
    """The recording that shows a trace."""
    labels: list[Label] = []
    for number, sample in enumerate(trace):
        x, y = sample.seen["ego"]
        others = tuple(
            LabelObject(f"{track}{number}", "Car", "car", *place, heading=0.0, track=track)
            for track, place in sample.seen.items()
            if track != "ego"
        )
        ego = LabelObject("ego", "Car", "car", x, y, heading=0.0)
        labels.append(Label(f"{name}-{number}", name, round(sample.time * 1e6), "none", ego, others))
    return Recording(name, "none", tuple(labels))


def speed(trace: Trace, track: str, k: int) -> float | None:
    """The speed of a track by differences over its neighbouring samples."""
    own = [m for m, sample in enumerate(trace) if track in sample.seen]
    place = own.index(k)
    near = [m for m in own[max(place - 1, 0) : place + 2] if abs(trace[m].time - trace[k].time) <= 1.5]
    first, last = near[0], near[-1]
    if first == last:
        return None
    (x, y), (u, v) = trace[first].seen[track], trace[last].seen[track]
    return math.hypot(u - x, v - y) / (trace[last].time - trace[first].time)


Situation = tuple[Trace, dict[str, str], float]
"""A trace, the track of each role, and the value of D."""


@dataclass(frozen=True)
class Condition:
    """An atom: its text, its value at a sample, None where it is not observed, and whether it holds of everything."""

    text: str
    value: Callable[[Situation, int], bool | None]
    always: bool = False


def random_condition(draw: random.Random, roles: list[str], hidden: bool) -> Condition:
    """Draw an atom."""
    role, other = draw.choice(roles), draw.choice(["ego", *roles])
    number = draw.randint(-5, 5) + 0.5
    kinds = ["x", "distance", "speed", *(["hidden"] if hidden else [])]

    def place(s: Situation, k: int, name: str) -> tuple[float, float] | None:
        return s[0][k].seen.get(s[1][name])

    match draw.choice(kinds):
        case "x":
            return Condition(
                f"({role}.position.x > {number})",
                lambda s, k: None if (p := place(s, k, role)) is None else p[0] > number,
            )
        case "distance":

            def near(s: Situation, k: int) -> bool | None:
                p, q = (place(s, k, role), place(s, k, other)) if role != other else ((0.0, 0.0), (0.0, 0.0))
                return None if p is None or q is None else math.dist(p, q) < abs(number) + 2.1

            text = f"((distance from {role} to {other}) < {abs(number) + 2.1})"
            return Condition(text, near, always=role == other)
        case "speed":

            def fast(s: Situation, k: int) -> bool | None:
                found = speed(s[0], s[1][role], k) if place(s, k, role) is not None else None
                return None if found is None else found > abs(number)

            return Condition(f"({role}.speed > {abs(number)})", fast)
        case _:
            return Condition(
                f"({role}.position.x + 1 > D)",
                lambda s, k: None if (p := place(s, k, role)) is None else p[0] + 1 > s[2],
            )


Formula = tuple  # ("atom", Condition) or (operator, *formulas)


def random_formula(draw: random.Random, atom: Callable[[], Condition], depth: int) -> Formula:
    """Draw a formula."""
    if not depth or draw.random() < 0.15:
        return "atom", atom()
    kind = draw.choice(["not", "and", "or", "implies", "always", "always", "eventually", "next", "until"])
    parts = 2 if kind in ("and", "or", "implies", "until") else 1
    return kind, *(random_formula(draw, atom, depth - 1) for _ in range(parts))


def text_of(formula: Formula) -> str:
    """A formula in Scenic."""
    if formula[0] == "atom":
        return formula[1].text
    parts = [text_of(part) for part in formula[1:]]
    return f"({formula[0]} {parts[0]})" if len(parts) == 1 else f"({parts[0]} {formula[0]} {parts[1]})"


def conditions(formula: Formula) -> list[Condition]:
    """The atoms of a formula."""
    if formula[0] == "atom":
        return [formula[1]]
    return [each for part in formula[1:] for each in conditions(part)]


Truth = Callable[[Condition, int], bool]
"""The value of an atom at a sample, in one completion."""


def holds(formula: Formula, truth: Truth, k: int, j: int) -> bool:
    """A formula at sample k of a trace that ends with sample j: LTL on finite traces by its definition."""
    kind, *parts = formula
    match kind:
        case "atom":
            return truth(parts[0], k)
        case "not":
            return not holds(parts[0], truth, k, j)
        case "and":
            return all(holds(part, truth, k, j) for part in parts)
        case "or":
            return any(holds(part, truth, k, j) for part in parts)
        case "implies":
            return not holds(parts[0], truth, k, j) or holds(parts[1], truth, k, j)
        case "always":
            return all(holds(parts[0], truth, m, j) for m in range(k, j + 1))
        case "eventually":
            return any(holds(parts[0], truth, m, j) for m in range(k, j + 1))
        case "next":
            return k < j and holds(parts[0], truth, k + 1, j)
        case _:
            return any(
                holds(parts[1], truth, m, j) and all(holds(parts[0], truth, b, j) for b in range(k, m))
                for m in range(k, j + 1)
            )


Now = Callable[[int], bool]
"""The value of each condition of a monitor, by its number, at the sample at which it runs."""
Steps = Iterator[str]
"""What a monitor does at each sample: "end", "reject", or "" where it waits."""


def _ends(now: Now) -> Steps:
    while True:
        if now(0):
            yield "end"
        yield ""


def _stages(now: Now) -> Steps:
    while not now(0):
        yield ""
    while now(1):
        yield ""
    yield "end"


def _demands(now: Now) -> Steps:
    while True:
        if not now(0):
            yield "reject"
        yield ""


def _rounds(now: Now) -> Steps:
    for each in range(3):
        if each == 1 and now(0):
            continue
        if each and not now(1):
            yield "reject"
        yield ""
    while now(0):
        yield ""
        if now(1):
            break
    else:
        yield "end"


def _cases(now: Now) -> Steps:
    while True:
        if now(0):
            if not now(1):
                yield "reject"
        elif now(2):
            yield "end"
        yield ""


def _waits(now: Now) -> Steps:
    while not now(0):
        yield ""
    yield ""  # two steps are shorter than what lies between samples
    if now(1):
        return
    if not now(2):
        yield "reject"
    yield "end"


MONITORS: dict[str, tuple[str, int, Callable[[Now], Steps]]] = {
    "ends": ("while True:\n        if {0}:\n            terminate\n        wait", 1, _ends),
    "stages": ("while not {0}:\n        wait\n    while {1}:\n        wait\n    terminate", 2, _stages),
    "demands": ("while True:\n        require {0}\n        wait", 1, _demands),
    "rounds": (
        "for each in range(3):\n        if each == 1 and {0}:\n            continue\n        require each == 0 or {1}\n"
        "        wait\n    while {0}:\n        wait\n        if {1}:\n            break\n    else:\n        terminate",
        2,
        _rounds,
    ),
    "cases": (
        "while True:\n        if {0}:\n            require {1}\n        elif {2}:\n            terminate\n        wait",
        3,
        _cases,
    ),
    "waits": (
        "wait until {0}\n    wait for 2 steps\n    if {1}:\n        return\n    require {2}\n    terminate",
        3,
        _waits,
    ),
}
"""The text of each monitor, how many conditions it has, and what it does."""


def monitored(kind: str, atoms: list[Condition], truth: Truth, i: int, j: int) -> str:
    """What a monitor that starts at i does at j, if it has not done anything before: "end", "reject" or ""."""
    at = i
    steps = MONITORS[kind][2](lambda number: truth(atoms[number], at))
    for at in range(i, j + 1):
        said = next(steps, "")
        if said == "reject":
            return "reject"
        if said == "end":
            return "end" if at == j else "ended"
    return ""


def may_end(kind: str, atoms: list[Condition]) -> bool:
    """Whether a monitor ends some run: whatever may be observed is, at each sample anew."""
    draw = random.Random(0)
    for _ in range(300):
        said = MONITORS[kind][2](lambda number: atoms[number].always or draw.random() < 0.5)
        for _ in range(8):
            if next(said, "") == "end":
                return True
    return False


@dataclass
class Program:
    """A dynamic program with up to two roles."""

    roles: list[str]
    start: Condition | None
    requirements: list[Formula]
    ends: list[Condition]
    after_s: float | None
    monitors: list[tuple[str, list[Condition]]]
    hidden: bool = False
    atoms: list[Condition] = field(default_factory=list)

    @property
    def terminates(self) -> bool:
        """Whether it says when it ends: a `terminate` to which no observation leads is none."""
        return bool(self.ends) or self.after_s is not None or any(may_end(*each) for each in self.monitors)

    def text(self) -> str:
        """The program in Scenic."""
        lines = ["ego = new Object at (Range(-999, 999), Range(-999, 999)), facing 0"]
        lines += [f"{role} = new Object at (Range(-999, 999), Range(-999, 999)), facing 0" for role in self.roles]
        lines += ["D = Range(-3, 3)"] if self.hidden else []
        lines += [f"require {self.start.text}"] if self.start else []
        lines += [
            f"require always ({text_of(f)})" if f[0] == "atom" else f"require {text_of(f)}" for f in self.requirements
        ]
        lines += [f"terminate when {each.text}" for each in self.ends]
        lines += [f"terminate after {self.after_s} seconds"] if self.after_s is not None else []
        for number, (kind, atoms) in enumerate(self.monitors):
            body = MONITORS[kind][0].format(*(atom.text for atom in atoms))
            lines += [f"monitor M{number}():\n    {body}", f"require monitor M{number}()"]
        return "\n".join(lines) + "\n"


def random_program(draw: random.Random) -> Program:
    """Draw a program."""
    roles = ["a", "b"][: draw.randint(1, 2)]
    hidden = draw.random() < 0.3
    made: list[Condition] = []

    def atom() -> Condition:
        made.append(random_condition(draw, roles, hidden))
        return made[-1]

    start = random_condition(draw, roles, hidden=False) if draw.random() < 0.3 else None
    if start is not None and "speed" in start.text:
        start = None  # at the start, the program's own value counts where there is none
    formulas = [random_formula(draw, atom, 3) for _ in range(draw.randint(0, 2))]
    ends = [atom() for _ in range(draw.choice([0, 0, 1]))]
    after_s = draw.choice([None, None, 1.0, 2.0])
    kinds = [draw.choice(list(MONITORS)) for _ in range(draw.choice([0, 0, 1]))]
    monitors = [(kind, [atom() for _ in range(MONITORS[kind][1])]) for kind in kinds]
    # a formula that is one atom alone is written with `always`
    formulas = [("always", f) if f[0] == "atom" else f for f in formulas]
    formulas = [
        f if any(word in text_of(f) for word in ("always", "eventually", "next", "until")) else ("always", f)
        for f in formulas
    ]
    if not formulas and not ends and after_s is None and not monitors:
        after_s = 1.0
    return Program(roles, start, formulas, ends, after_s, monitors, hidden, made)


def random_trace(draw: random.Random, *, gaps: bool) -> Trace:
    """Draw a trace."""
    tracks = ["ego", "t", "u", "v"][: draw.randint(2, 4)]
    time, trace = 0.0, list[Sample]()
    places = {track: (float(draw.randint(-5, 5)), float(draw.randint(-5, 5))) for track in tracks}
    for _ in range(draw.randint(2, 8)):
        seen = {t: p for t, p in places.items() if t == "ego" or not gaps or draw.random() < 0.8}
        trace.append(Sample(time, seen))
        time += draw.choice([0.5, 0.5, 0.5, 1.0, 1.6 if gaps else 0.5])
        places = {t: (x + draw.randint(-2, 2), y + draw.randint(-2, 2)) for t, (x, y) in places.items()}
    return trace


def said(program: Program, exchanged: dict[str, str]) -> list[object]:
    """What a program says with some roles put for others, in an order that does not hang on how it is written."""

    def atom(condition: Condition) -> str:
        words = [exchanged.get(word, word) for word in re.split(r"\b", condition.text)]
        text = "".join(words)
        text = re.sub(r"distance from (\w+) to \1\b", "0", text)
        return re.sub(r"from (\w+) to (\w+)", lambda m: "between {} and {}".format(*sorted(m.groups())), text)

    def form(formula: Formula) -> str:
        kind, *parts = formula
        if kind == "atom":
            return atom(parts[0])
        if kind == "implies":
            return form(("or", ("not", parts[0]), parts[1]))
        told = [form(part) for part in parts]
        return f"({kind} {' '.join(sorted(told) if kind in ('and', 'or') else told)})"

    monitors = [f"{kind} {[atom(each) for each in atoms]}" for kind, atoms in program.monitors]
    requirements, ends = [form(each) for each in program.requirements], [atom(each) for each in program.ends]
    return [*map(sorted, (requirements, ends, monitors)), None if program.start is None else atom(program.start)]


def bindings(program: Program, trace: Trace) -> list[dict[str, str]]:
    """Every way to give roles distinct tracks; of roles that nothing tells apart in one order only."""
    tracks = sorted({track for sample in trace for track in sample.seen} - {"ego"})
    ways = itertools.permutations if tells_apart(program) else itertools.combinations
    return [
        {"ego": "ego", **dict(zip(program.roles, chosen, strict=True))} for chosen in ways(tracks, len(program.roles))
    ]


def tells_apart(program: Program) -> bool:
    """Whether a program says something of one role that it does not say of the other."""
    return said(program, {}) != said(program, {"a": "b", "b": "a"})


def life_end(trace: Trace, binding: dict[str, str], i: int) -> int:
    """The last sample of the common life of the tracks of a binding; -1 where one is not observed at i."""
    end = len(trace) - 1
    for track in binding.values():
        own = [k for k, sample in enumerate(trace) if track in sample.seen and k >= i]
        if not own or own[0] != i:
            return -1
        last = i
        for k in own[1:]:
            if round(trace[k].time - trace[last].time, 6) > GAP_S:
                break
            last = k
        end = min(end, last)
    return end


def matches(program: Program, trace: Trace, binding: dict[str, str], truth: Truth) -> set[tuple[int, int]]:
    """Every (i, j) that matches under a binding in one completion."""
    found: set[tuple[int, int]] = set()
    for i in range(len(trace)):
        last = life_end(trace, binding, i)
        if last < 0 or (program.start is not None and not truth(program.start, i)):
            continue
        for j in range(i, last + 1):
            late = [
                k
                for k in range(i, j + 1)
                if program.after_s is not None and trace[k].time - trace[i].time >= program.after_s - 1e-6
            ]
            # these stop the monitors before they run
            stopped = any(truth(each, j) for each in program.ends) or bool(late and late[0] == j)
            done = [monitored(kind, atoms, truth, i, j - stopped) for kind, atoms in program.monitors]
            before = any(truth(each, k) for each in program.ends for k in range(i, j)) or "ended" in done
            before = before or bool(late and late[0] < j) or (stopped and "end" in done)
            over = stopped or "end" in done
            if program.terminates and (before or not over):
                continue
            if "reject" not in done and all(holds(f, truth, i, j) for f in program.requirements):
                found.add((i, j))
    if program.terminates:
        return found
    # a program that never says when it ends goes on as long as everything holds
    return {(i, max(j for k, j in found if k == i)) for i, _ in found}
