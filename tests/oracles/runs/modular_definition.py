"""Programs of scenarios run as Scenic 3.1.1 runs them, straight from its manual, on samples with known conditions.

One thing is as the manual has it and not as Scenic does it: what a scenario that others run says with `terminate when`
ends it. `tests/tools/conformance/modular.py` runs the same programs in Scenic.
"""

from __future__ import annotations

import random
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

ATOMS = 6
Body = list[tuple[Any, ...]]
"""Statements: a word, then conditions by number, times in steps, names, and bodies."""
STEP_S = 0.1
FREE = "with allowCollisions True, with requireVisible False"


@dataclass
class Part:
    """A scenario.

    Attributes:
        pre, invariant: Conditions that are asked when it begins, and after each sample.
        setup: What it says: "always", "eventually", "when" with a condition, "after" with steps, "monitor" and
            "override" with names.
        body: What it composes; None where it composes nothing.
    """

    pre: int | None
    invariant: int | None
    setup: Body
    body: Body | None


@dataclass
class Modular:
    """A program.

    Attributes:
        parts: Its scenarios, that which it runs as `Main`.
        monitors, behaviors: What they do, by name.
        given: The behaviors of its two objects that have some, None for none.
    """

    parts: dict[str, Part]
    monitors: dict[str, Body]
    behaviors: dict[str, Body]
    given: tuple[str | None, str | None]


AGENTS = ("ego", "other")


# --- drawing programs


def random_program(draw: random.Random, *, whens: bool = True, choices: bool = True) -> Modular:
    """A program.

    Args:
        draw: Draws it.
        whens: Whether scenarios that others run may say `terminate when`.
        choices: Whether it may choose.
    """
    monitors = {f"M{n}": _lines(draw, "monitor", 1, []) for n in range(2)}
    behaviors = {f"B{n}": _lines(draw, "behavior", 1, []) for n in range(3)}
    names = [f"S{n}" for n in range(draw.randint(1, 3))]
    parts: dict[str, Part] = {}
    for number, name in enumerate(names):
        inner = names[:number] if draw.random() < 0.5 else []
        parts[name] = _part(draw, inner, whens=whens, choices=choices)
    parts["Main"] = _part(draw, names, whens=True, choices=choices, top=True)
    given = tuple(draw.choice([None, *behaviors]) for _ in AGENTS)
    found = Modular(parts, monitors, behaviors, given)  # type: ignore[arg-type]
    # what can be in very many states takes long
    return found if text_of(found).count("do ") < 5 else random_program(draw, whens=whens, choices=choices)


def _atom(draw: random.Random) -> int:
    return draw.randrange(ATOMS)


def _part(draw: random.Random, inner: list[str], *, whens: bool, choices: bool, top: bool = False) -> Part:
    setup: Body = []
    for _ in range(draw.choice([0, 1, 1, 2]) if not top else draw.choice([0, 0, 1])):
        kinds = ["always", "eventually", "after", "monitor", "override"] + (["when"] if whens else [])
        kind = draw.choice(kinds)
        if top and kind == "override":
            kind = "always"
        if kind in ("always", "eventually", "when"):
            setup.append((kind, _atom(draw)))
        elif kind == "after":
            setup = [each for each in setup if each[0] != "after"]
            setup.append((kind, draw.choice([1, 2, 3, 4])))
        elif kind == "monitor":
            setup.append((kind, f"M{draw.randrange(2)}"))
        else:
            setup.append((kind, draw.choice(AGENTS), draw.choice([None, "B0", "B1", "B2"])))
    composes = top or (bool(inner) and draw.random() < 0.7)
    body = _lines(draw, "compose", 1 if not top else 2, inner, choices=choices) if composes else None
    pre = _atom(draw) if draw.random() < 0.1 else None
    invariant = _atom(draw) if draw.random() < 0.1 else None
    return Part(pre, invariant, setup, body)


def _lines(
    draw: random.Random, kind: str, depth: int, names: list[str], *, choices: bool = True, inside: bool = False
) -> Body:
    found: Body = []
    for _ in range(draw.choice([1, 1, 2, 3]) if depth else draw.choice([1, 1, 2])):
        found.append(_line(draw, kind, depth, names, choices=choices, inside=inside))
    if not any(each[0] in ("wait", "do", "try", "loop") for each in found):
        found.append(("wait",))
    return found


def _line(
    draw: random.Random, kind: str, depth: int, names: list[str], *, choices: bool, inside: bool
) -> tuple[Any, ...]:
    words = ["wait", "wait", "if", "require", "terminate"]
    if depth:
        words += ["loop"]
    if kind == "compose":
        words += ["do"] * 8 if names else []
        words += ["override", "terminate simulation"]
        words += ["try"] * 3 if depth else []
        words += ["abort"] if inside else []
    word = draw.choice(words)
    if word in ("wait", "abort", "terminate simulation"):
        return (word,)
    if word == "terminate":
        return (word,) if draw.random() < 0.4 else ("wait",)
    if word == "require":
        return (word, _atom(draw)) if draw.random() < 0.4 else ("wait",)
    if word == "if":
        body = _lines(draw, kind, max(depth - 1, 0), names, choices=choices, inside=inside)
        return word, _atom(draw), body
    if word == "loop":
        # it waits in any case
        return word, draw.choice([None, _atom(draw)]), [
            *_lines(draw, kind, depth - 1, names, choices=choices, inside=inside), ("wait",)
        ]  # fmt: skip
    if word == "override":
        return word, draw.choice(AGENTS), draw.choice([None, "B0", "B1", "B2"])
    if word == "try":
        return word, _lines(draw, kind, depth - 1, names, choices=choices, inside=True), [
            (_atom(draw), [("wait",), *_lines(draw, kind, depth - 1, names, choices=choices, inside=True)])
            for _ in range(draw.choice([1, 1, 1, 2]))
        ]  # fmt: skip
    some = [draw.choice(names) for _ in range(draw.choice([1, 1, 2]))]
    how = draw.choice([None, None, ("until", _atom(draw)), ("for", draw.choice([1, 2, 3]))])
    schedule = draw.choice(["", "", "choose", "shuffle"]) if choices and how is None else ""
    return "do", some, how, schedule


# --- as text


def text_of(program: Modular, row: list[bool] | None = None) -> str:
    """The program in Scenic.

    Args:
        program: The program.
        row: Which conditions hold in the initial scene.
    """
    lines: list[str] = []
    for name, body in program.monitors.items():
        lines += [f"monitor {name}():", *_text(body, 1)]
    for name, body in program.behaviors.items():
        lines += [f"behavior {name}():", *_text(body, 1)]
    for name, part in program.parts.items():
        lines.append(f"scenario {name}({'' if name == 'Main' else 'other'}):")
        if part.pre is not None:
            lines.append(f"    precondition: {condition(part.pre)}")
        if part.invariant is not None:
            lines.append(f"    invariant: {condition(part.invariant)}")
        lines.append("    setup:")
        if name == "Main":
            for agent, behavior in zip(AGENTS, program.given, strict=True):
                place = AGENTS.index(agent) * 5 + 100
                lines.append(f"        {agent} = new Object at ({place}, 0), {FREE}"
                             + (f", with behavior {behavior}" if behavior else ""))  # fmt: skip
        lines += [f"        {_said(each)}" for each in part.setup] or ["        pass"]
        if part.body is not None:
            lines += ["    compose:", *_text(part.body, 2)]
    places = [f"p{n} = new Object at ({n + (1.5 if row and row[n] else 0.5)}, {50 + n}), {FREE}" for n in range(ATOMS)]
    return "\n".join([*places, *lines]) + "\n"


def condition(number: int) -> str:
    """A condition in Scenic."""
    return f"p{number}.position.x > {number + 1}"


def _said(each: tuple[Any, ...]) -> str:
    match each:
        case ("always" | "eventually" as word, number):
            return f"require {word} {condition(number)}"
        case ("when", number):
            return f"terminate when {condition(number)}"
        case ("after", steps):
            return f"terminate after {steps} steps"
        case ("monitor", name):
            return f"require monitor {name}()"
        case (_, agent, behavior):
            return f"override {agent} with behavior {behavior}"
    raise AssertionError(each)


def _text(body: Body, depth: int) -> list[str]:
    indent = "    " * depth
    lines: list[str] = []
    for each in body:
        match each:
            case ("wait" | "abort" | "terminate" | "terminate simulation" as word,):
                lines.append(f"{indent}{word}")
            case ("require", number):
                lines.append(f"{indent}require {condition(number)}")
            case ("if", number, inner):
                lines += [f"{indent}if {condition(number)}:", *_text(inner, depth + 1)]
            case ("loop", number, inner):
                test = "True" if number is None else condition(number)
                lines += [f"{indent}while {test}:", *_text(inner, depth + 1)]
            case ("override", agent, behavior):
                lines.append(f"{indent}override {agent} with behavior {behavior}")
            case ("try", inner, handlers):
                lines += [f"{indent}try:", *_text(inner, depth + 1)]
                for number, handler in handlers:
                    lines += [f"{indent}interrupt when {condition(number)}:", *_text(handler, depth + 1)]
            case ("do", some, how, schedule):
                called = ", ".join(f"{name}(other)" for name in some)
                ending = ""
                if how is not None:
                    ending = f" until {condition(how[1])}" if how[0] == "until" else f" for {how[1]} steps"
                lines.append(f"{indent}do {schedule + ' ' if schedule else ''}{called}{ending}")
            case _:
                raise AssertionError(each)
    return lines


# --- running


class Rejected(Exception):
    """The run is none."""


class Open(Exception):
    """A choice that is open."""

    def __init__(self, count: int) -> None:
        super().__init__()
        self.count = count


_SCENARIO, _SIMULATION = "ends the scenario", "ends the simulation"
_ABORT, _DONE = "aborts", "is done"


@dataclass
class _Running:
    """A scenario that runs."""

    of: Part
    began: int
    runs: bool = True
    subs: list[_Running] = field(default_factory=list)
    monitors: list[Iterator[Any]] = field(default_factory=list)
    required: list[tuple[str, int, list[bool]]] = field(default_factory=list)
    composing: Iterator[Any] | None = None
    overridden: dict[str, Any] = field(default_factory=dict)
    name: str = ""
    stepped: int = -1


@dataclass
class Simulation:
    """One run: where it may end as a match.

    Attributes:
        program: The program.
        rows: What holds at each sample.
        times: When it is, in seconds.
        start: The first sample.
        chosen: Which options are taken.
    """

    program: Modular
    rows: list[list[bool]]
    times: list[float]
    start: int
    chosen: list[int]
    at: int = 0
    used: int = 0
    running: dict[int, set[tuple[str, ...]]] = field(default_factory=dict)

    def ends(self) -> tuple[set[int], bool]:
        """Where it may end as a match if it ends anywhere, else the one where it ends; whether the program ends it."""
        self.at = self.start
        self.living: list[_Running] = []
        self.doing: dict[str, Any] = dict.fromkeys(AGENTS)
        for agent, name in zip(AGENTS, self.program.given, strict=True):
            self.doing[agent] = self._behavior(name)
        found: set[int] = set()
        try:
            top = self._begun("Main")
            while True:
                over = self._step(top)
                over = self._monitored(top) or over
                if self._accepted():
                    found.add(self.at)
                elif over:
                    return set(), True
                if over:
                    return {self.at}, True
                # a run may end here as a match and be rejected by what a behavior requires next
                self.running[self.at] = set(self._that_run(top, ()))
                for agent in AGENTS:
                    running = self.doing[agent]
                    if running is not None and next(running, None) is not None:
                        return ({self.at} if self._accepted() else set()), True
                self.at += 1
                if self.at == len(self.rows):
                    return found, False
        except Rejected:
            return found, False

    def _that_run(self, each: _Running, calls: tuple[str, ...]) -> Iterator[tuple[str, ...]]:
        """The names of the scenarios that have been led through the sample and go on, each after those that run it."""
        for sub in each.subs:
            if sub.runs and sub.stepped == self.at:
                yield (*calls, sub.name)
                yield from self._that_run(sub, (*calls, sub.name))

    def _holds(self, number: int) -> bool:
        return self.rows[self.at][number]

    def _accepted(self) -> bool:
        """Whether what living scenarios require holds by now."""
        return all((all if kind == "always" else any)(seen) for each in self.living for kind, _, seen in each.required)

    def _choose(self, count: int) -> int:
        if count == 1:
            return 0
        if self.used == len(self.chosen):
            raise Open(count)
        self.used += 1
        return self.chosen[self.used - 1]

    # --- scenarios

    def _begun(self, name: str) -> _Running:
        part = self.program.parts[name]
        self._guard(part.pre, part.invariant)
        found = _Running(part, self.at, name=name)
        self.living.append(found)
        for each in part.setup:
            match each:
                case ("always" | "eventually" as kind, number):
                    found.required.append((kind, number, []))
                case ("monitor", monitor):
                    found.monitors.append(self._lines(self.program.monitors[monitor], None))
                case ("override", agent, behavior):
                    self._override(found, agent, behavior)
        if part.body is not None:
            found.composing = self._lines(part.body, found)
        elif part.pre is not None or part.invariant is not None:
            found.composing = self._lines([("loop", None, [("wait",)])], found)
        return found

    def _guard(self, *conditions: int | None) -> None:
        if not all(each is None or self._holds(each) for each in conditions):
            raise Rejected

    def _behavior(self, name: str | None) -> Iterator[Any] | None:
        return None if name is None else self._lines(self.program.behaviors[name], None)

    def _override(self, by: _Running, agent: str, behavior: str | None) -> None:
        by.overridden.setdefault(agent, self.doing[agent])
        self.doing[agent] = self._behavior(behavior)

    def _step(self, each: _Running) -> str | None:
        """Lead a scenario through a sample; why it ends."""
        each.stepped = self.at
        for kind, number, seen in each.required:
            seen.append(self._holds(number))
            if kind == "always" and not seen[-1]:
                raise Rejected
        after = [steps for word, *rest in each.of.setup if word == "after" for steps in rest]
        if after and self._is_over(each.began, after[0]):
            return self._stop(each, _DONE)
        if each.composing is not None:
            said = next(each.composing, _DONE)
            if said is not None:
                return self._stop(each, said)
        if any(word == "when" and self._holds(rest[0]) for word, *rest in each.of.setup):
            return self._stop(each, _DONE)
        return None

    def _is_over(self, began: int, steps: int) -> bool:
        return self.times[self.at] - self.times[began] >= steps * STEP_S - 1e-6

    def _stop(self, each: _Running, why: str) -> str:
        for sub in each.subs:
            if sub.runs:
                self._stop(sub, _DONE)
        each.monitors = []
        for agent, before in each.overridden.items():
            self.doing[agent] = before
        each.runs = False
        self.living.remove(each)
        for kind, _, seen in each.required:
            if not (all if kind == "always" else any)(seen):
                raise Rejected
        return why

    def _monitored(self, each: _Running) -> str | None:
        """Run the monitors of a scenario and of those that it runs; whether one of them ends the run."""
        over: str | None = None
        for monitor in each.monitors:
            over = next(monitor, None) or over
        for sub in each.subs:
            over = self._monitored(sub) or over
        return over

    def _together(self, each: _Running, names: list[str], begun: list[_Running]) -> Iterator[Any]:
        begun += [self._begun(name) for name in names]
        each.subs = list(begun)
        while True:
            left: list[_Running] = []
            for sub in each.subs:
                why = self._step(sub)
                if why == _SIMULATION:
                    yield why
                elif why is None:
                    left.append(sub)
            each.subs = left
            if not left:
                return
            yield None
            each.subs = [sub for sub in each.subs if sub.runs]

    def _enabled(self, name: str) -> bool:
        part = self.program.parts[name]
        return all(each is None or self._holds(each) for each in (part.pre, part.invariant))

    def _picked(self, names: list[str]) -> int:
        enabled = [number for number, name in enumerate(names) if self._enabled(name)]
        if not enabled:
            raise Rejected
        return enabled[self._choose(len(enabled))]

    def _do(self, each: _Running, names: list[str], how: Any, schedule: str) -> Iterator[Any]:
        if schedule == "choose":
            yield from self._together(each, [names[self._picked(names)]], [])
        elif schedule == "shuffle":
            left = list(names)
            while left:
                yield from self._together(each, [left.pop(self._picked(left))], [])
        elif how is None:
            yield from self._together(each, names, [])
        else:
            begun: list[_Running] = []
            began = self.at

            def over() -> bool:
                return self._holds(how[1]) if how[0] == "until" else self._is_over(began, how[1])

            def end() -> Iterator[Any]:
                for sub in begun:
                    if sub.runs:
                        self._stop(sub, _DONE)
                return _ABORT
                yield

            yield from self._interruptible(each, lambda: self._together(each, names, begun), [(over, end)])

    # --- statements

    def _lines(self, body: Body, each: _Running | None) -> Iterator[Any]:
        """Statements; `each` is the scenario that they compose."""

        def guard() -> None:
            if each is not None:
                self._guard(each.of.invariant)

        for line in body:
            match line:
                case ("wait",):
                    yield None
                    guard()
                case ("terminate",):
                    yield _SCENARIO
                case ("terminate simulation",):
                    yield _SIMULATION
                case ("require", number):
                    self._guard(number)
                case ("if", number, inner):
                    if self._holds(number):
                        said = yield from self._lines(inner, each)
                        if said:
                            return said
                case ("loop", number, inner):
                    while number is None or self._holds(number):
                        said = yield from self._lines(inner, each)
                        if said:
                            return said
                case ("override", agent, behavior):
                    assert each is not None
                    self._override(each, agent, behavior)
                case ("abort",):
                    return _ABORT
                case ("do", names, how, schedule):
                    assert each is not None
                    yield from self._do(each, names, how, schedule)
                    guard()
                case ("try", inner, handlers):
                    # the last one goes first
                    blocks = [
                        (lambda number=number: self._holds(number), lambda block=block: self._lines(block, each))
                        for number, block in reversed(handlers)
                    ]
                    yield from self._interruptible(each, lambda inner=inner: self._lines(inner, each), blocks)
        return None

    def _interruptible(self, each: _Running | None, body: Any, handlers: list[Any]) -> Iterator[Any]:
        running: list[Iterator[Any] | None] = [None] * (len(handlers) + 1)
        while True:
            block = next(
                (n for n, (asked, _) in enumerate(handlers) if asked() or running[n] is not None), len(handlers)
            )
            if running[block] is None:
                running[block] = (body if block == len(handlers) else handlers[block][1])()
            try:
                said = next(running[block])  # type: ignore[arg-type]
            except StopIteration as over:
                running[block] = None
                if over.value == _ABORT or block == len(handlers):
                    return
                continue
            yield said
            if each is not None:
                self._guard(each.of.invariant)


def all_ends(
    program: Modular, rows: list[list[bool]], times: list[float], start: int
) -> list[tuple[set[int], bool]] | None:
    """For each way in which a program may choose, where it may end as a match, and whether the program ends it.

    None where there are very many.
    """
    found = all_runs(program, rows, times, start)
    return None if found is None else [each[:2] for each in found]


def all_runs(
    program: Modular, rows: list[list[bool]], times: list[float], start: int
) -> list[tuple[set[int], bool, dict[int, set[tuple[str, ...]]]]] | None:
    """The same, with the scenarios that run after each sample."""
    found: list[tuple[set[int], bool, dict[int, set[tuple[str, ...]]]]] = []
    stack: list[list[int]] = [[]]
    while stack:
        chosen = stack.pop()
        if len(found) > 300:
            return None
        simulation = Simulation(program, rows, times, start, chosen)
        try:
            found.append((*simulation.ends(), simulation.running))
        except Open as choice:
            stack += [[*chosen, option] for option in range(choice.count)]
    return found
