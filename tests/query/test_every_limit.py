"""Every limit at its least: what it gives up on is unknown or refused with a reason, never another answer.

Limits are found by their names in the modules that take part in matching, so that a new one is tried as it comes.
"""

from __future__ import annotations

import ast
import functools
import importlib.util
import math
import pkgutil
import random
import re
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[1] / "temporal"))
from choices_definition import alike, random_program, random_trace
from choices_definition import recording_of as recording_of_trace
from nudged_scenes import dataset_of
from programs import HEADER, PROGRAMS

from scenicq.errors import ScenicqError, Source
from scenicq.limits import limits
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import parse_tolerance
from scenicq.match.verdict import Match, Unknown
from scenicq.query.execution.lazy_solver import LazySolver
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.smt import portable
from scenicq.store.dataset import Dataset, open_dataset
from scenicq.store.writer import write_dataset
from scenicq.temporal.interval_options import IntervalOptions

LAYERS = ("compiler", "forest", "geometry", "match", "query", "smt", "store", "temporal")
LIMIT = re.compile(r"_?(MOST|FEW|FEWEST|DEEPEST|LONGEST|LARGEST|MAX)(_[A-Z]+)*$")
AT_ONCE = re.compile(r"_?([A-Z]+_)*(AT_ONCE|BATCH|CHUNK|HALVES|RETRIES|STEPS|TRIES)$")
FACTS = {
    "scenicq.forest.step_counts.FEWEST": "how many steps Scenic takes",
    "scenicq.forest.step_counts.LONGEST": "how long Scenic's steps are",
    "scenicq.query.explain.nearest_miss.MOST_M": "how far `--near` looks",
    "scenicq.store.camera_rows.LARGEST_IMAGE": "what an image may be",
    "scenicq.store.manifest._LARGEST": "what the file may say",
    "scenicq.store.motion.LONGEST_GAP_US": "what motion means",
    "scenicq.store.value_rules._LONGEST_NUMBER": "what a number may be",
    "scenicq.store.validation._MOST_BYTES": "what a file may be",
    "scenicq.store.map_validation._DEEPEST": "what a map may be",
    "scenicq.temporal.definedness._LARGEST_EXPONENT": "where floats end",
}
LEAST = {"heading_width": math.inf, "shared_width": math.inf}
"""Where less is allowed by a greater number."""
FRAMES = (
    "figure 3", "not visible", "picked lane", "requirement", "figure 6", "shared", "hidden requirement", "nonlinear",
    "discrete", "crowd", "follow", "badly parked", "random discs",
)  # fmt: skip
BY_SOLVER = ("requirement", "shared", "hidden requirement", "discrete")
SAMPLE = {
    "frames: requirement", "frames: discrete", "frames: smt: shared", "time: 0", "time: 5", "time: 8",
}  # fmt: skip
STRICT = (
    "observation_ways", "run_modes", "direction_choices", "closed_form_choices", "signatures", "choice_tries",
    "recording_starts", "heading_cases", "field_ways", "split_cases",
)  # fmt: skip
TOLERANCE = parse_tolerance("position=0.25,heading=5deg")
Key = tuple[object, ...]
Answers = dict[Key, str]


def every_limit() -> Iterator[tuple[str, str, float]]:
    """The module, name and least value of each limit; one of a class has its name before."""
    for limit in limits():
        yield "scenicq.limits", f"LIMITS.{limit.name}", LEAST.get(limit.name, 0)
    for layer in LAYERS:
        package = importlib.import_module(f"scenicq.{layer}")
        for found in pkgutil.walk_packages(package.__path__, f"scenicq.{layer}."):
            spec = importlib.util.find_spec(found.name)
            assert spec is not None
            assert spec.origin is not None
            for name in constants(ast.parse(Path(spec.origin).read_text())):
                if f"{found.name}.{name}" not in FACTS:
                    last = name.rpartition(".")[2]
                    if LIMIT.match(last):
                        yield found.name, name, 0
                    elif AT_ONCE.match(last):
                        yield found.name, name, 1


def constants(module: ast.Module) -> Iterator[str]:
    """The names to which a module or one of its classes assigns something that is no text."""
    classes = [("", module), *((f"{each.name}.", each) for each in module.body if isinstance(each, ast.ClassDef))]
    for prefix, body in classes:
        for node in body.body:
            targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
            text = isinstance(value := getattr(node, "value", None), ast.Constant) and isinstance(value.value, str)
            yield from (prefix + each.id for each in targets if isinstance(each, ast.Name) and not text)


EVERY = sorted(every_limit())


def set_least(patch: pytest.MonkeyPatch, module: str, name: str, least: float) -> None:
    """Set a limit in its module and where it is imported from there."""
    owner, _, attribute = name.rpartition(".")
    if owner:
        patch.setattr(getattr(importlib.import_module(module), owner), attribute, least)
        return
    importlib.import_module(module)
    for each, value in list(sys.modules.items()):
        if each == module or (each.startswith("scenicq.") and (module, name) in imported(value.__file__ or "")):
            patch.setattr(value, name, least)


@functools.cache
def imported(file: str) -> frozenset[tuple[str, str]]:
    """The names that a file imports, each with its module."""
    nodes = [node for node in ast.walk(ast.parse(Path(file).read_text())) if isinstance(node, ast.ImportFrom)]
    return frozenset((node.module or "", alias.name) for node in nodes for alias in node.names)


def forget() -> None:
    """Clear what is remembered from one query to the next."""
    for name, module in list(sys.modules.items()):
        if name.startswith("scenicq."):
            for each in list(vars(module).values()):
                clear = getattr(each, "cache_clear", None)
                if callable(clear):
                    clear()


def traces(folder: Path) -> Dataset:
    """Recordings of which something is missing here and there."""
    draw = random.Random(7)
    write_dataset(
        folder, [recording_of_trace(f"r{number:02}", random_trace(draw)) for number in range(10)], {}, name="traces"
    )
    return open_dataset(folder)


def programs_over_time() -> list[str]:
    """Programs with choices, hidden numbers and monitors."""
    draw = random.Random(11)
    found = [random_program(draw) for _ in range(9)]
    return [(alike(each) if number % 3 == 0 else each).text() for number, each in enumerate(found)]


OVER_TIME = programs_over_time()
PROGRAM = {
    **{f"frames: {name}": HEADER + PROGRAMS[name] for name in FRAMES},
    **{f"time: {number}": text for number, text in enumerate(OVER_TIME)},
    **{f"frames: smt: {name}": HEADER + PROGRAMS[name] for name in BY_SOLVER},
    "time: smt: 1": OVER_TIME[1],
}


def answers(dataset: Dataset, program: str, **limited: float) -> Answers:
    """What is told of each frame, or of each interval and start."""
    method = "smt" if ": smt: " in program else "auto"
    usual = MatchOptions(tolerance=TOLERANCE, timeout_s=20.0, method=method)
    options = QueryOptions(replace(usual, **limited), solver="portable", time=IntervalOptions(intervals="all"))
    found: Answers = {}
    for each in Query(dataset, Source("p.scenic", PROGRAM[program]), options).results():
        verdict = each.verdict
        roles = () if each.interval is None else tuple(sorted(verdict.correspondence.items()))
        if isinstance(verdict, Match):
            found[each.frame, roles, each.interval and each.interval.last] = "match"
        elif isinstance(verdict, Unknown):
            found[each.frame, "open"] = "unknown"
            found[each.frame, roles, "open"] = "unknown"
    return found


def told(dataset: Dataset, program: str, **limited: float) -> tuple[Answers, set[str]]:
    """The answers, or the codes of what is said instead."""
    try:
        return answers(dataset, program, **limited), set()
    except ScenicqError as error:
        return {}, {each.code for each in error.diagnostics}


def changes(before: Answers, after: Answers) -> list[str]:
    """Matches that are none any more, without a word, and those that are new."""
    lost = [
        f"lost: {key}" for key, value in before.items()
        if value == "match" and after.get(key) != "match" and (key[0], "open") not in after
    ]  # fmt: skip
    new = [
        f"new: {key}" for key, value in after.items()
        if value == "match" and before.get(key) != "match" and (key[0], "open") not in before
    ]  # fmt: skip
    return lost + new


@pytest.fixture(scope="module")
def datasets(tmp_path_factory) -> dict[str, Dataset]:
    folder = tmp_path_factory.mktemp("limits")
    return {"frames": dataset_of({each: PROGRAMS[each] for each in FRAMES}, folder), "time": traces(folder / "t")}


@pytest.fixture(autouse=True)
def solver_here(monkeypatch):
    """The solver's limits are those of this process."""

    def check(self: LazySolver, problem: portable.Problem, *, precision: float, timeout_s: float) -> portable.Answer:
        return portable.check(problem, precision=precision, timeout_s=timeout_s)

    monkeypatch.setattr(LazySolver, "check", check)


@pytest.fixture(scope="module")
def usual(datasets) -> dict[str, Answers]:
    return {}


class Compared:
    """Answers with limits as they are, and what becomes of them with one at its least."""

    def __init__(self, datasets: dict[str, Dataset]) -> None:
        self.datasets = datasets
        self.usual: dict[str, Answers] = {}
        self.seen: Counter[str] = Counter()

    def compare(self, program: str, *limit: tuple[str, str, float], **limited: float) -> None:
        dataset = self.datasets[program.partition(":")[0]]
        if program not in self.usual:
            self.usual[program] = answers(dataset, program)
        usual = self.usual[program]
        with pytest.MonkeyPatch.context() as patch:
            for each in limit:
                set_least(patch, *each)
            forget()
            found, codes = told(dataset, program, **limited)
        forget()
        about = (limit, limited, program, PROGRAM[program])
        assert not codes & {"internal", "impossible-requirement"}, (*about, codes)
        assert codes or changes(usual, found) == [], about
        self.seen["refused" if codes else "the same" if found == usual else "another answer"] += 1


@pytest.fixture(scope="module")
def compared(datasets) -> Compared:
    return Compared(datasets)


def test_limits_are_found():
    assert len(EVERY) > 60
    for each in FACTS:
        module, _, name = each.rpartition(".")
        assert isinstance(getattr(importlib.import_module(module), name), int | float), each


def test_a_few_limits_change_no_answer(compared):
    before = compared.seen["another answer"]
    for limit in EVERY:
        if limit[1].removeprefix("LIMITS.") in STRICT:
            for program in PROGRAM:
                if program in SAMPLE:
                    compared.compare(program, limit)
    assert compared.seen["another answer"] > before


@pytest.mark.parametrize("limited", [{"budget": 0}, {"correspondences": 1}, {"timeout_s": 1e-9}])
def test_no_option_that_limits_changes_an_answer(compared, limited):
    for program in PROGRAM:
        if program in SAMPLE:
            compared.compare(program, **limited)


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.parametrize("limit", EVERY, ids=lambda each: ".".join(map(str, each)))
def test_no_limit_changes_an_answer(compared, limit):
    for program in PROGRAM:
        compared.compare(program, limit)
