"""Behaviors by their definition: Python generators that run them as Scenic does, on samples with known conditions."""

from __future__ import annotations

import itertools
import random
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

from scenicq.temporal.truth import TRUE, UNKNOWN

Body = list[tuple[Any, ...]]
"""Statements: a word, then conditions by number, times in seconds, and bodies."""
N = 9
ATOMS = 6


@dataclass
class Program:
    """Behaviors of one or two objects, what ends a run, and what is required.

    Attributes:
        behaviors: By name: guards and bodies; the first ones are those of the objects.
        agents: How many objects there are.
        ends: The condition of `terminate when`.
        always: That of `require always`.
    """

    behaviors: dict[str, tuple[int | None, int | None, Body]]
    agents: int
    ends: int | None
    always: int | None


class Said(tuple[Any, ...]):
    """A statement of a program, which is no other one although it says the same."""


def apart(body: Body) -> Body:
    """Statements each of which is one of its own."""
    return [
        Said(
            [(atom, apart(block)) for atom, block in part] if word in ("try", "catch") and number == 1 else apart(part)
            if isinstance(part, list) and part and isinstance(part[0], tuple) else part
            for number, part in enumerate((word, *rest), -1)
        )
        for word, *rest in body
    ]  # fmt: skip


class EndOfRun(Exception):
    """The run ends."""


class Rejection(Exception):
    """The run is none."""


class Raised(Rejection):
    """The run is none unless a handler catches what is raised."""


CAUGHT = {
    "": ("require", "precondition", "invariant"),
    " Exception": ("require", "precondition", "invariant"),
    " RejectSimulationException": ("require",),
    " GuardViolation": ("precondition", "invariant"),
    " PreconditionViolation as error": ("precondition",),
    " (ValueError, InvariantViolation)": ("invariant",),
    " KeyError": (),
}
"""What each handler catches."""


# --- drawing programs


def random_body(draw: random.Random, names: list[str], depth: int, *, loop: bool = False, inside: bool = False) -> Body:
    found: Body = []
    atom = lambda: draw.randrange(ATOMS)  # noqa: E731
    words = ["wait", "take", "flag", "if flag", "require", "terminate", "for", "until"]
    words += ["if", "while", "try", "try", "catch", "catch"] * bool(depth) + [
        "do",
        "do until",
        "do for",
        "choose",
        "shuffle",
    ] * bool(names)
    words += ["break"] * loop + ["abort", "abort"] * inside + ["return"]
    for _ in range(draw.randint(1, 3)):
        word = draw.choice(words)
        if word in ("terminate", "return", "require") and draw.random() < 0.6:
            word = "wait"
        below = lambda **more: random_body(draw, names, depth - 1, **{"loop": loop, "inside": inside} | more)  # noqa: E731
        match word:
            case "flag":
                found.append(("flag", draw.random() < 0.5))
            case "if flag":
                found.append(("if flag", [("wait",)], [("take",)] * draw.randint(0, 1)))
            case "for":
                found.append(("for", draw.choice([0.0, 0.1, 0.25, 0.4])))
            case "until" | "require":
                found.append((word, atom()))
            case "if":
                found.append(("if", atom(), below(), below()))
            case "while":
                found.append(("while", atom(), [*below(loop=True), ("wait",)]))
            case "try":
                # a loop is not left from within, so that bodies can be taken apart
                handlers = [(atom(), below(inside=True)) for _ in range(draw.randint(1, 2))]
                found.append(("try", below(inside=True), handlers))
            case "catch":
                handlers = [(kind, below()) for kind in draw.sample([*CAUGHT], draw.randint(0, 2))]
                # one without a name comes last
                handlers.sort(key=lambda each: not each[0])
                orelse = below() if handlers and draw.random() < 0.5 else []
                final = below() if not handlers or draw.random() < 0.5 else []
                found.append(("catch", below(), handlers, orelse, final))
            case "do" | "choose" | "shuffle":
                found.append(
                    (word, draw.sample(names, draw.randint(1, len(names))) if word != "do" else [draw.choice(names)])
                )
            case "do until":
                found.append((word, draw.choice(names), atom()))
            case "do for":
                found.append((word, draw.choice(names), draw.choice([0.1, 0.3])))
            case _:
                found.append((word,))
    return found


def random_program(draw: random.Random) -> Program:
    agents = draw.choice([1, 1, 2])
    inner = [f"Inner{number}" for number in range(draw.randint(0, 2))]
    guard = lambda: draw.choice([None, None, None, draw.randrange(ATOMS)])  # noqa: E731
    behaviors = {
        f"Outer{number}": (guard(), guard(), random_body(draw, inner, 2 - agents // 2)) for number in range(agents)
    }  # fmt: skip
    behaviors |= {
        name: (guard(), guard(), random_body(draw, inner[number + 1 :], 1)) for number, name in enumerate(inner)
    }
    behaviors = {name: (first, always, apart(body)) for name, (first, always, body) in behaviors.items()}
    optional = lambda: draw.choice([None, None, draw.randrange(ATOMS)])  # noqa: E731
    return Program(behaviors, agents, optional(), optional())


# --- as text


def holds_text(atom: int) -> str:
    return f"ego.speed > {atom + 1}"


Line = tuple[str, Any]
"""A line of text, with the statement that it begins."""


def lines(body: Body, indent: str) -> Iterator[Line]:
    inner = indent + "    "
    for said in body:
        word, *rest = said
        match word:
            case "flag":
                yield f"{indent}flag = {rest[0]}", said
            case "if flag":
                yield f"{indent}if flag:", said
                yield from lines(rest[0], inner)
                if rest[1]:
                    yield f"{indent}else:", None
                    yield from lines(rest[1], inner)
            case "take":
                yield f"{indent}take SetBrakeAction(1)", said
            case "for":
                yield f"{indent}wait for {rest[0]} seconds", said
            case "until":
                yield f"{indent}wait until {holds_text(rest[0])}", said
            case "require":
                yield f"{indent}require {holds_text(rest[0])}", said
            case "if":
                yield f"{indent}if {holds_text(rest[0])}:", said
                yield from lines(rest[1], inner)
                yield f"{indent}else:", None
                yield from lines(rest[2], inner)
            case "while":
                yield f"{indent}while {holds_text(rest[0])}:", said
                yield from lines(rest[1], inner)
            case "try":
                yield f"{indent}try:", said
                yield from lines(rest[0], inner)
                for atom, handler in rest[1]:
                    yield f"{indent}interrupt when {holds_text(atom)}:", None
                    yield from lines(handler, inner)
            case "catch":
                yield f"{indent}try:", said
                yield from lines(rest[0], inner)
                blocks = [(f"except{kind}", handler) for kind, handler in rest[1]]
                for word_, block in [*blocks, ("else", rest[2]), ("finally", rest[3])]:
                    if block:
                        yield f"{indent}{word_}:", None
                        yield from lines(block, inner)
            case "do" | "choose" | "shuffle":
                done = "do" if word == "do" else f"do {word}"
                yield f"{indent}{done} {', '.join(f'{name}()' for name in rest[0])}", said
            case "do until":
                yield f"{indent}do {rest[0]}() until {holds_text(rest[1])}", said
            case "do for":
                yield f"{indent}do {rest[0]}() for {rest[1]} seconds", said
            case _:
                yield f"{indent}{word}", said


def text_of(program: Program) -> str:
    return "".join(f"{line}\n" for line, _ in every_line(program))


def places_of(program: Program) -> dict[int, int]:
    """The line of each statement, by its identity."""
    return {id(said): number for number, (_, said) in enumerate(every_line(program), 1) if said is not None}


def every_line(program: Program) -> list[Line]:
    found: list[Line] = [("model scenic.domains.driving.model", None)]
    for name, (precondition, invariant, body) in reversed(program.behaviors.items()):
        found.append((f"behavior {name}():", None))
        found += [(f"    precondition: {holds_text(precondition)}", None)] if precondition is not None else []
        found += [(f"    invariant: {holds_text(invariant)}", None)] if invariant is not None else []
        found += [("    flag = False", None), *lines(body, "    ")]
    found.append(("ego = new Object at (0, 0), with behavior Outer0()", "Outer0"))
    found += [("new Object at (0, 9), with behavior Outer1()", "Outer1")] * (program.agents > 1)
    found += [(f"terminate when {holds_text(program.ends)}", None)] if program.ends is not None else []
    found += [(f"require always {holds_text(program.always)}", None)] if program.always is not None else []
    return found


# --- as Scenic runs them


@dataclass
class Leaves(Exception):
    """A jump out of blocks."""

    how: str


@dataclass
class World:
    """What a run sees.

    Attributes:
        program: The program.
        times: Of the samples.
        holds: Whether a condition holds at the current sample.
        choose: One of so many.
        now: The current sample.
        idle: Steps since the last sample, of which there are too many where a run never gets to the next one.
        doing: What each agent does from each sample on: the calls within which it is, by statement and name, and the
            statement at which it waits.
    """

    program: Program
    times: list[float]
    holds: Callable[[int], bool]
    choose: Callable[[int], int]
    now: int = 0
    idle: int = 0
    doing: dict[tuple[str, int], Doing] = field(default_factory=dict)


Doing = tuple[tuple[tuple[Any, str], ...], Any]


@dataclass
class Running:
    """A behavior that runs.

    Attributes:
        world: What it sees.
        name: Its name.
        calls: The calls within which it runs, and its own.
    """

    world: World
    name: str
    calls: tuple[tuple[Any, str], ...]
    flag: bool = False

    @property
    def inner(self) -> Callable[[Any, str], Running]:
        """Makes a behavior that a statement does."""
        return lambda said, name: Running(self.world, name, (*self.calls, (said, name)))

    def does(self, said: Any) -> None:
        """Write down what it waits at."""
        self.world.doing[self.calls[0][1], self.world.now] = self.calls, said

    def check(self, *, first: bool = False) -> bool:
        return not self.violated(first=first)

    def violated(self, *, first: bool = False) -> str:
        """The kind of the first guard that does not hold; "" where all do."""
        precondition, invariant, _ = self.world.program.behaviors[self.name]
        guards = [("precondition", precondition)] * first + [("invariant", invariant)]
        return next((kind for kind, each in guards if each is not None and not self.world.holds(each)), "")

    def invariant(self) -> None:
        if not self.check():
            raise Raised("invariant")

    def run(self) -> Iterator[None]:
        self.flag = False
        try:
            yield from self.block(self.world.program.behaviors[self.name][2])
        except Leaves as leaves:
            if leaves.how != "return":
                raise

    def started(self) -> Iterator[None]:
        if kind := self.violated(first=True):
            raise Raised(kind)
        yield from self.run()

    def block(self, body: Body) -> Iterator[None]:
        for said in body:
            word, *rest = said
            self.step()
            match word:
                case "wait" | "take":
                    self.does(said)
                    yield
                    self.invariant()
                case "flag":
                    self.flag = rest[0]
                case "if flag":
                    yield from self.block(rest[0] if self.flag else rest[1])
                case "for":
                    yield from self.limited(lambda said=said: self.forever(said), self.timer(rest[0]))
                case "until":
                    yield from self.limited(
                        lambda said=said: self.forever(said), lambda atom=rest[0]: self.world.holds(atom)
                    )
                case "require":
                    if not self.world.holds(rest[0]):
                        raise Raised("require")
                case "terminate":
                    raise EndOfRun
                case "if":
                    yield from self.block(rest[1] if self.world.holds(rest[0]) else rest[2])
                case "while":
                    try:
                        while self.world.holds(rest[0]):
                            self.step()
                            yield from self.block(rest[1])
                    except Leaves as leaves:
                        if leaves.how != "break":
                            raise
                case "try":
                    yield from self.interrupted(rest[0], rest[1])
                case "catch":
                    yield from self.caught(*rest)
                case "do":
                    yield from self.inner(said, rest[0][0]).started()
                    self.invariant()
                case "do until":
                    start = self.inner(said, rest[0]).started
                    yield from self.limited(start, lambda atom=rest[1]: self.world.holds(atom))
                case "do for":
                    yield from self.limited(self.inner(said, rest[0]).started, self.timer(rest[1]))
                case "choose" | "shuffle":
                    left = list(rest[0])
                    while left:
                        enabled = [each for each in left if self.inner(said, each).check(first=True)]
                        if not enabled:
                            raise Raised("require")
                        chosen = enabled[self.world.choose(len(enabled))] if len(enabled) > 1 else enabled[0]
                        left.remove(chosen)
                        yield from self.inner(said, chosen).run()
                        if word == "choose":
                            break
                    self.invariant()
                case "return" | "break" | "abort":
                    raise Leaves(word)
                case _:
                    raise AssertionError(word)

    def caught(
        self, body: Body, handlers: list[tuple[str, Body]], orelse: Body, final: Body
    ) -> Iterator[None]:  # fmt: skip
        """A `try` with `except`, `else` and `finally`; a generator that is dropped does nothing more."""
        try:
            try:
                yield from self.block(body)
            except Raised as error:
                kind = str(error)
                handler = next((block for name, block in handlers if kind in CAUGHT[name]), None)
                if handler is None:
                    raise
                yield from self.block(handler)
            else:
                yield from self.block(orelse)
        except (Leaves, Raised):
            yield from self.block(final)
            raise
        yield from self.block(final)

    def step(self) -> None:
        self.world.idle += 1
        if self.world.idle > 500:
            raise Rejection

    def forever(self, said: Any) -> Iterator[None]:
        while True:
            self.does(said)
            yield

    def timer(self, seconds: float) -> Callable[[], bool]:
        start = self.world.times[self.world.now]
        return lambda: self.world.times[self.world.now] - start >= seconds - 1e-6

    def limited(self, body: Callable[[], Iterator[None]], over: Callable[[], bool]) -> Iterator[None]:
        """`do ... until`, and the like."""
        running = None
        while not over():
            running = body() if running is None else running
            try:
                next(running)
            except StopIteration:
                break
            yield
            self.invariant()
        self.invariant()

    def interrupted(self, body: Body, handlers: list[tuple[int, Body]]) -> Iterator[None]:
        """A `try` with interrupts: which block goes on is found anew at each sample."""
        blocks: list[tuple[int | None, Body]] = [*reversed(handlers), (None, body)]
        running: dict[int, Iterator[None]] = {}
        while True:
            self.step()
            number = next(
                n for n, (atom, _) in enumerate(blocks) if atom is None or n in running or self.world.holds(atom)
            )
            if number not in running:
                running[number] = self.block(blocks[number][1])
            try:
                next(running[number])
            except StopIteration:
                del running[number]
                if blocks[number][0] is None:
                    return
                continue
            except Leaves as leaves:
                if leaves.how == "abort":
                    return
                raise
            yield
            self.invariant()


def outcome(program: Program, times: list[float], trace: list[list[bool]], start: int, chosen: list[int]) -> Any:
    """How a run ends, by its choices: the sample at which it is over, whether it is a match there, or the last sample
    at which it may be; how many there were to choose from at each choice; and what each agent did."""
    asked: list[int] = []

    def choose(count: int) -> int:
        asked.append(count)
        return chosen[len(asked) - 1] if len(asked) <= len(chosen) else 0

    world = World(program, times, lambda atom: trace[world.now][atom], choose, start)
    agents = [Running(world, f"Outer{number}", ((f"Outer{number}",) * 2,)) for number in range(program.agents)]
    last, ended = start - 1, None
    if all(each.check(first=True) for each in agents):
        running = [each.run() for each in agents]
        try:
            for world.now in range(start, len(times)):
                world.idle = 0
                if program.always is not None and not trace[world.now][program.always]:
                    break
                last = world.now
                if program.ends is not None and trace[world.now][program.ends]:
                    raise EndOfRun
                for each in running:
                    next(each, None)
        except EndOfRun:
            ended = world.now
        except Rejection:
            pass
    return ended, last, asked, world.doing


def ways(program: Program, times: list[float], trace: list[list[bool]], start: int) -> set[tuple[int | None, int]]:
    """How a run may end, for all its choices."""
    return {(ended, last) for ended, last, _ in modes(program, times, trace, start)}


def modes(
    program: Program, times: list[float], trace: list[list[bool]], start: int
) -> list[tuple[int | None, int, dict[tuple[str, int], Doing]]]:
    """How a run may end, and what each agent does, for each of its choices."""
    found: list[tuple[int | None, int, dict[tuple[str, int], Doing]]] = []
    stack: list[list[int]] = [[]]
    while stack:
        chosen = stack.pop()
        ended, last, asked, doing = outcome(program, times, trace, start, chosen)
        found.append((ended, last, doing))
        for more in range(len(chosen), len(asked)):
            before = [*chosen, *([0] * (more - len(chosen)))]
            stack += [[*before, option] for option in range(1, asked[more])]
    return found


def matching_ends(found: set[tuple[int | None, int]], start: int, *, terminates: bool) -> set[int]:
    if terminates:
        return {ended for ended, _ in found if ended is not None}
    return {last for _, last in found if last >= start}


def completions(rows: list[list[int]]) -> Iterator[list[list[bool]]]:
    gaps = [(k, a) for k, row in enumerate(rows) for a, value in enumerate(row) if value == UNKNOWN]
    for values in itertools.product((False, True), repeat=len(gaps)):
        whole = [[value == TRUE for value in row] for row in rows]
        for (k, a), value in zip(gaps, values, strict=True):
            whole[k][a] = value
        yield whole
