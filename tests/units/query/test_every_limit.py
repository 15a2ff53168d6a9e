"""Every limit at its least: what it gives up on is unknown or refused with a reason, never another answer.

Each limit of the table (`scenicq.limits`) is reached by an input that is named here: at its least, what is told or the
way there is another one. The slow part tries all limits on all inputs, and sizes of batches, which are found by name.
"""

from __future__ import annotations

import ast
import importlib
import importlib.util
import math
import pkgutil
import random
import re
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType

import built_in
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from limit_inputs import INPUTS, Facts, Stores, stores_of

from scenicq import budget
from scenicq.errors import ScenicqError
from scenicq.limits import LIMITS, limits
from scenicq.query.execution.lazy_solver import LazySolver
from scenicq.smt.answer import Answer
from scenicq.smt.problem import Problem

LEAST = {
    "heading_width": math.inf, "shared_width": math.inf, "advice_runs": 1, "brief_runs": 1, "advice_maps": 1,
    "brief_maps": 1,
}  # fmt: skip
"""What a limit is set to, where it is not 0."""
REACHED: dict[str, str] = {
    "program_characters": "frames: figure 3",
    "bracket_nesting": "frames: figure 3",
    "expression_nesting": "frames: figure 3",
    "tree_height": "frames: figure 3",
    "reading_retries": "language: read twice",
    "number_digits": "frames: figure 3",
    "string_parts": "language: strings",
    "program_seconds": "frames: figure 3",
    "program_steps": "frames: figure 3",
    "call_nesting": "language: calls",
    "value_items": "frames: crowd",
    "value_nesting": "language: lists",
    "integer_bits": "language: whole numbers",
    "choice_options": "frames: picked lane",
    "condition_courses": "frames: figure 3",
    "region_parts": "frames: not visible",
    "random_way_steps": "frames: follow",
    "known_way_steps": "language: known way",
    "process_steps": "time: 1",
    "projection_segments": "language: projected",
    "scenario_variants": "language: variants",
    "mode_ways": "language: modes",
    "scenario_starts": "time: later",
    "arrival_combinations": "time: later",
    "arrival_questions": "time: later, bent",
    "rounded_nodes": "language: rounded",
    "unobserved_choices": "frames: who is fast",
    "difference_terms": "frames: not visible",
    "off_road_tiles": "frames: follow",
    "whole_draws": "draws",
    "cut_draws": "draws",
    "part_draws": "draws",
    "signatures": "frames: not visible",
    "replayed_directions": "replayed",
    "part_roles": "frames: figure 3",
    "group_parts": "frames: one gap for three",
    "fit_decisions": "frames: ego alone",
    "fit_decisions_a_role": "many",
    "ordered_slots": "frames: picked lane",
    "ordered_steps": "frames: picked lane",
    "arc_roles": "frames: picked lane",
    "nested_outcomes": "frames: picked lane",
    "choice_tries": "frames: picked lane",
    "choice_nesting": "frames: alternatives",
    "witness_trials": "frames: figure 6",
    "closed_form_choices": "frames: figure 3",
    "closed_form_terms": "frames: figure 3",
    "closed_form_regions": "frames: not visible",
    "cascade_outcomes": "frames: whole numbers",
    "cascade_nesting": "frames: whole numbers",
    "cascade_programs": "frames: shared",
    "outlined_box_m": "frames: near the curb",
    "asked_outcomes": "solver: discrete",
    "solver_attempts": "solver: shared",
    "heading_cases": "frames: follow",
    "heading_passes": "frames: figure 6",
    "heading_width": "fields",
    "field_halvings": "frames: follow",
    "shared_values": "fields",
    "shared_width": "fields",
    "narrowing_passes": "frames: nonlinear",
    "witness_replays": "frames: figure 6",
    "witness_places": "frames: figure 6",
    "linear_cells": "frames: near the curb",
    "extent_combinations": "fields",
    "inverted_offsets": "frames: discrete",
    "distance_edges": "solver: near the curb",
    "enclosing_edges": "question: box",
    "rounded_values": "solver: rounded",
    "integer_values": "solver: many whole numbers",
    "split_cases": "question: cases",
    "worker_starts": "worker",
    "worker_start_s": "worker",
    "worker_answer_bytes": "worker",
    "command_reply_bytes": "command",
    "start_tuples": "time: 47",
    "outcomes_over_time": "time: 47",
    "direction_choices": "time: 1",
    "observation_ways": "time: 1",
    "run_modes": "time: 2",
    "run_situations": "time: 1",
    "formula_clauses": "time: 1",
    "run_pieces": "time: 26",
    "jump_cuts": "time: 26",
    "condition_cuts": "time: 26",
    "joint_starts": "time: 26",
    "start_questions": "time: 47",
    "joined_pairs": "frames: row",
    "named_regions": "frames: one lane",
    "related_regions": "frames: looked up",
    "region_boxes": "frames: near an intersection",
    "heading_terms": "frames: figure 3",
    "sql_alternatives": "frames: figure 3",
    "sql_characters": "frames: figure 3",
    "counted_roles": "ids: crowd",
    "tied_roles": "ids: row",
    "recording_starts": "time: 1",
    "ranked_frames": "near: frames",
    "ranked_recordings": "near: duration",
    "ranked_bindings": "near: number",
    "ranked_numbers": "near: number",
    "tried_amounts": "why: interval",
    "cut_off_rounds": "why: interval",
    "told_margins": "why: frame",
    "told_choices": "why: frame",
    "told_intervals": "why: frame",
    "advice_frames": "advice",
    "advice_changes": "advice",
    "advice_pairs": "advice: pairs",
    "advice_decisions": "advice",
    "advice_runs": "advice: sampled",
    "brief_changes": "advice: brief",
    "brief_pairs": "advice: brief pairs",
    "brief_decisions": "advice: brief",
    "brief_runs": "advice: brief, sampled",
}
"""An input that reaches each limit."""
UNREACHED = {
    "field_ways": "of parts that a trial has not decided before: none of the inputs of frames since it is asked first",
    "pruned_boxes": "of groups that a trial leaves open (`tests/units/match/fields/test_branch_and_prune.py`)",
    "dreal_conjunctions": "dReal is installed nowhere (`tests/contracts/test_solvers.py` where it is)",
    "solver_memory_mb": "told to a process when it starts (`tests/units/smt/test_smtlib.py`)",
    "nearer_steps": "of searches beyond `ordered_steps` (`tests/oracles/labels/test_nearest_first.py`)",
    "advice_maps": "of datasets with several maps",
    "brief_maps": "of datasets with several maps",
    "block_tries": "of processes that die (`tests/units/query/execution/test_block_executor.py`)",
    "piece_retries": "of a cluster whose disks fail (`tests/contracts/test_executors.py`)",
}
"""Limits that no input reaches, and why."""
FAST = {
    "frames: figure 3", "frames: picked lane", "frames: not visible", "frames: ego alone", "frames: whole numbers",
    "frames: alternatives", "language: calls", "language: lists", "language: read twice", "language: strings",
    "language: whole numbers", "question: box", "question: cases", "replayed",
    "solver: rounded", "time: 2", "time: 26", "ids: figure 3", "many",
}  # fmt: skip
"""Inputs that are asked in the fast part."""
AT_ONCE = re.compile(r"_?([A-Z]+_)*(AT_ONCE|BATCH|CHUNK)$")


@dataclass
class Asked:
    """What comes of an input.

    Attributes:
        facts: What is found.
        codes: The codes of what is said instead.
        calls: How often each function of the library was called.
    """

    facts: Facts
    codes: frozenset[str]
    calls: Counter[tuple[str, str]] = field(default_factory=Counter[tuple[str, str]])


def ask(stores: Stores, name: str, *, traced: bool = True) -> Asked:
    """Ask an input, with nothing remembered from before."""
    forget()
    found = Asked({}, frozenset())

    def noted(frame: FrameType, event: str, _: object) -> None:
        code = frame.f_code
        if event == "call" and "scenicq" in code.co_filename and "tests" not in code.co_filename:
            found.calls[code.co_filename, code.co_name] += 1

    before = sys.getprofile()
    if traced:
        sys.setprofile(noted)
    try:
        found.facts = INPUTS[name](stores)
    except ScenicqError as error:
        found.codes = frozenset(each.code for each in error.diagnostics)
    finally:
        sys.setprofile(before)
        forget()
    return found


def forget() -> None:
    """Clear what is remembered from one query to the next."""
    for name, module in list(sys.modules.items()):
        if name.startswith("scenicq."):
            for each in list(vars(module).values()):
                clear = getattr(each, "cache_clear", None)
                if callable(clear):
                    clear()


def changes(before: Facts, after: Facts) -> list[str]:
    """Matches that are none any more, without a word, and those that are new."""
    lost = [f"lost: {key}" for key, value in before.items() if value == "match" and not is_held(key, after)]
    new = [f"new: {key}" for key, value in after.items() if value == "match" and not is_held(key, before)]
    return lost + new


def is_held(key: tuple[object, ...], facts: Facts) -> bool:
    """Whether what is a match elsewhere is one or unknown, as where it is told that an interval may be longer.

    What is open of a frame is so of all about it.
    """
    return facts.get(key) in ("match", "unknown") or (key[0], "open") in facts or (*key[:2], "longer") in facts


@pytest.fixture(scope="module")
def stores(tmp_path_factory, crossroads) -> Stores:
    return stores_of(tmp_path_factory.mktemp("limits"), crossroads)


@pytest.fixture(autouse=True)
def solver_here(monkeypatch):
    """Where a solver is asked that is not the built-in one, there is one, and its limits are those of this process."""

    def check(self: LazySolver, problem: Problem, *, precision: float, timeout_s: float) -> Answer:
        return built_in.check(problem, precision=precision, timeout_s=timeout_s)

    monkeypatch.setattr(LazySolver, "loads", lambda self: self.name != "portable")
    monkeypatch.setattr(LazySolver, "check", check)


class Compared:
    """What inputs come to with limits as they are, and what becomes of it with one at its least."""

    def __init__(self, stores: Stores) -> None:
        self.stores = stores
        self.usual: dict[str, Asked] = {}

    def compare(self, name: str, limited: Callable[[pytest.MonkeyPatch], None], *, traced: bool = False) -> bool:
        """Whether something is another way; never a match that is none any more, or a new one."""
        if name not in self.usual:
            ask(self.stores, name)  # what is made once is there
            self.usual[name] = ask(self.stores, name)
        usual = self.usual[name]
        with pytest.MonkeyPatch.context() as patch:
            limited(patch)
            found = ask(self.stores, name, traced=traced)
        assert not found.codes & {"internal", "impossible-requirement"}, (name, found.codes)
        assert found.codes or changes(usual.facts, found.facts) == [], (name, found.facts)
        changed = found.codes != usual.codes or found.facts != usual.facts
        return changed or (traced and found.calls != usual.calls)


@pytest.fixture(scope="module")
def compared(stores) -> Compared:
    return Compared(stores)


def at_least(limit: str) -> Callable[[pytest.MonkeyPatch], None]:
    return lambda patch: patch.setattr(LIMITS, limit, LEAST.get(limit, 0))


def test_each_limit_is_reached_or_it_is_said_why_not():
    assert REACHED.keys() | UNREACHED.keys() == {each.name for each in limits()}
    assert not REACHED.keys() & UNREACHED.keys()
    assert len(UNREACHED) <= 10
    assert set(REACHED.values()) <= INPUTS.keys()


@pytest.mark.parametrize(
    ("limit", "name"),
    [pytest.param(*each, marks=[] if each[1] in FAST else [pytest.mark.slow]) for each in REACHED.items()],
)
@pytest.mark.timeout(300)
@pytest.mark.one_in(6)
def test_a_limit_is_reached_and_changes_no_answer(compared, limit, name):
    assert compared.compare(name, at_least(limit), traced=True)


@pytest.mark.parametrize("name", sorted(FAST & {each for each in INPUTS if each.startswith(("frames", "time"))}))
@pytest.mark.parametrize("limited", [{"budget": 0}, {"correspondences": 1}, {"timeout_s": 1e-9}], ids=str)
@pytest.mark.one_in(6)
def test_no_option_that_limits_changes_an_answer(stores, compared, name, limited):
    usual = ask(stores, name, traced=False)
    found = INPUTS[name](stores, **limited)
    assert changes(usual.facts, found) == []


@pytest.mark.slow
@pytest.mark.timeout(1800)
@pytest.mark.parametrize(
    ("limit", "number"), [pytest.param(each.name, number, id=each.name) for number, each in enumerate(limits())]
)
def test_no_limit_changes_an_answer(compared, limit, number):
    # every limit meets an eighth of the inputs, every input an eighth of the limits
    for name in sorted(INPUTS)[number % 8 :: 8]:
        compared.compare(name, at_least(limit))


# --- the time of a label


class Clocks:
    """Those of a thread and of the wall, which jump when one has looked at that of the wall so many times."""

    def __init__(self, looks: float) -> None:
        self.looks, self.seen = looks, 0

    def perf_counter(self) -> float:
        self.seen += 1
        return time.perf_counter() + self._late()

    def thread_time(self) -> float:
        return time.thread_time() + self._late()

    def monotonic(self) -> float:
        return time.monotonic()

    def _late(self) -> float:
        return 1e9 if self.seen >= self.looks else 0.0


@pytest.mark.timeout(1800)
@pytest.mark.parametrize(
    "name", [pytest.param(each, marks=[] if each in FAST else [pytest.mark.slow]) for each in sorted(INPUTS)]
)
@pytest.mark.one_in(12)
def test_the_time_may_be_used_up_at_any_moment(compared, name, rounds):
    counting = Clocks(math.inf)
    compared.compare(name, lambda patch: patch.setattr(budget, "time", counting))
    moments = random.Random(name).sample(range(1, counting.seen + 1), min(rounds(24), counting.seen))
    for moment in sorted({*moments, counting.seen}):
        compared.compare(name, lambda patch, moment=moment: patch.setattr(budget, "time", Clocks(moment)))


# --- sizes of batches


def sizes() -> Iterator[tuple[str, str]]:
    """The module and name of each size of what is done at once."""
    for layer in ("forest", "geometry", "match", "query", "store", "temporal"):
        package = importlib.import_module(f"scenicq.{layer}")
        for found in pkgutil.walk_packages(package.__path__, f"scenicq.{layer}."):
            spec = importlib.util.find_spec(found.name)
            assert spec is not None
            assert spec.origin is not None
            for node in ast.parse(Path(spec.origin).read_text()).body:
                for target in node.targets if isinstance(node, ast.Assign) else []:
                    names = target.elts if isinstance(target, ast.Tuple) else [target]
                    for each in names:
                        if isinstance(each, ast.Name) and AT_ONCE.match(each.id):
                            yield found.name, each.id


@pytest.mark.slow
@pytest.mark.timeout(1800)
@pytest.mark.parametrize(
    ("module", "name", "number"), [pytest.param(*each, number) for number, each in enumerate(sorted(sizes()))]
)
def test_no_size_of_a_batch_changes_an_answer(compared, module, name, number):
    found = importlib.import_module(module)
    for each in sorted(INPUTS)[number % 4 :: 4]:
        compared.compare(each, lambda patch: patch.setattr(found, name, 1))
