"""Monitors against their definition: a Python generator that Scenic would run step by step."""

from __future__ import annotations

import itertools
import random
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from scenicq.compiler.program import compile_scenario
from scenicq.errors import Source
from scenicq.forest.nodes import Compare, Constant
from scenicq.forest.walk import postorder
from scenicq.geometry.default_street import street
from scenicq.temporal.run_lanes import follow_runs
from scenicq.temporal.run_machine import RunMachine
from scenicq.temporal.runs import Runs
from scenicq.temporal.stretches import Timeline
from scenicq.temporal.truth import FALSE, TRUE, UNKNOWN

NEVER = 1 << 60


@dataclass
class Outcome:
    """At which sample a monitor ends the run or rejects it."""

    ends: int = NEVER
    rejects: int = NEVER


Body = list[tuple[Any, ...]]
"""Statements: a word, then conditions by number, times in seconds, and bodies."""


def bodies(draw: random.Random, numbers: Iterator[int], depth: int = 2) -> Body:
    found: Body = []
    for _ in range(draw.randint(1, 3)):
        match draw.choice(["wait", "for", "steps", "until", "require", "terminate", "if", "while"]):
            case "for":
                found.append(("for", draw.choice([0.0, 0.1, 0.25, 0.4, 1.0])))
            case "steps":
                found.append(("steps", draw.randint(0, 4)))
            case ("until" | "require") as word:
                found.append((word, next(numbers)))
            case "if" if depth:
                found.append(("if", next(numbers), bodies(draw, numbers, depth - 1), bodies(draw, numbers, depth - 1)))
            case "while" if depth:
                found.append(("while", next(numbers), [*bodies(draw, numbers, depth - 1), ("wait",)]))
            case "terminate" if draw.random() < 0.3:
                found.append(("terminate",))
            case _:
                found.append(("wait",))
    return found


def lines(body: Body, indent: str = "    ") -> Iterator[str]:
    for word, *rest in body:
        match word:
            case "for":
                yield f"{indent}wait for {rest[0]} seconds"
            case "steps":
                yield f"{indent}wait for {rest[0]} steps"
            case "until":
                yield f"{indent}wait until ego.speed > {rest[0]}"
            case "require":
                yield f"{indent}require ego.speed > {rest[0]}"
            case "if":
                yield f"{indent}if ego.speed > {rest[0]}:"
                yield from lines(rest[1], indent + "    ")
                yield f"{indent}else:"
                yield from lines(rest[2], indent + "    ")
            case "while":
                yield f"{indent}while ego.speed > {rest[0]}:"
                yield from lines(rest[1], indent + "    ")
            case _:
                yield f"{indent}{word}"


def steps(body: Body, state: dict[str, Any]) -> Iterator[str]:
    """What happens: "" when a sample is over, else how the run ends."""
    for word, *rest in body:
        match word:
            case "wait":
                yield ""
            case "for" | "steps":
                until = state["time"] + rest[0] * (0.1 if word == "steps" else 1)
                while state["time"] < until - 1e-6:
                    yield ""
            case "until":
                while not state["holds"](rest[0]):
                    yield ""
            case "require":
                if not state["holds"](rest[0]):
                    yield "rejects"
            case "terminate":
                yield "ends"
            case "if":
                yield from steps(rest[1] if state["holds"](rest[0]) else rest[2], state)
            case "while":
                while state["holds"](rest[0]):
                    yield from steps(rest[1], state)


def expected(body: Body, truth: dict[int, list[bool]], times: list[float], start: int) -> Outcome:
    state: dict[str, Any] = {}
    running = steps(body, state)
    for sample in range(start, len(times)):
        state |= {"time": times[sample], "holds": lambda number, sample=sample: truth[number][sample]}
        match next(running, None):
            case None:
                return Outcome()
            case "":
                continue
            case how:
                return Outcome(**{how: sample})
    return Outcome()


def right(outcome: Outcome, start: int, n: int, *, terminates: bool) -> tuple[int, int]:
    """Whether the run from a sample matches, and where it ends."""
    if terminates:
        return (TRUE, outcome.ends) if outcome.ends < NEVER and outcome.rejects == NEVER else (FALSE, n - 1)
    last = min(outcome.rejects, n) - 1
    return (TRUE, last) if last >= start else (FALSE, start)


@pytest.mark.parametrize("seed", range(60))
@pytest.mark.one_in(16)
def test_monitors_do_what_their_text_says(seed: int) -> None:
    draw = random.Random(seed)
    body = bodies(draw, itertools.count(1))
    text = "ego = new Object\nmonitor M():\n" + "\n".join(lines(body)) + "\nrequire monitor M()\n"
    dynamics = compile_scenario(Source("m.scenic", text), street(), version=3, behaviors="guards").dynamics
    assert dynamics is not None
    numbers = {}
    for number, condition in enumerate(dynamics.conditions):
        (compare,) = (node for node in postorder((condition,)) if isinstance(node, Compare))
        numbers[number] = next(int(side.value) for side in (compare.left, compare.right) if isinstance(side, Constant))
    n = 14
    for _ in range(20):
        times = np.cumsum([draw.choice([0.1, 0.1, 0.1, 0.2, 0.5]) for _ in range(n)])
        truth = {number: [draw.random() < 0.6 for _ in range(n)] for number in range(1, 100)}
        as_array = {atom: np.where(truth[number], TRUE, FALSE).astype(np.int8) for atom, number in numbers.items()}
        timeline = Timeline(np.array([0, n]), times, np.arange(n))

        def run(known: dict[int, np.ndarray], timeline: Timeline = timeline) -> Runs:
            return follow_runs(RunMachine(dynamics), timeline, lambda each: known[each.number])

        found = run(as_array)
        for start in range(n):
            outcome = expected(body, truth, times.tolist(), start)
            truth_, end = right(outcome, start, n, terminates=dynamics.terminates)
            assert found.truth[start] == truth_, text
            assert truth_ == FALSE or found.ends[start] == end, text
        unclear = run({
            atom: np.where(np.arange(n) == draw.randrange(n), UNKNOWN, row) for atom, row in as_array.items()
        })  # fmt: skip
        sure = (unclear.truth == FALSE) | ((unclear.truth == TRUE) & ~unclear.open_)
        assert (unclear.truth[sure] == found.truth[sure]).all(), text
