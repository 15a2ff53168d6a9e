"""Every limit at which a search ends: what it guards, and what happens beyond it.

Whatever may take long, or grow large, ends at a limit that stands here. None of them makes a match a no, or a no a
match: beyond it an answer is unknown, a program is refused, another way is gone, less is known or people are told less
(`tests/units/query/test_every_limit.py`). They are read as plain attributes of `LIMITS`; the time that one label may
take is in `scenicq.budget`, what users say of both in `scenicq.match.options`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from enum import Enum
from typing import Any, cast

from scenicq.budget import Exhausted

__all__ = ["LIMITS", "Beyond", "Limit", "Limits", "limit_exceeded", "limits"]


class Beyond(Enum):
    """What happens beyond a limit."""

    UNDECIDED = "unknown, with the reason"
    REFUSED = "refused"
    OTHERWISE = "another way gives the same answer"
    COARSER = "less is known, which leaves more to other ways, or unknown"
    SHORTER = "less is reported"


@dataclass(frozen=True, slots=True)
class Limit:
    """One limit.

    Attributes:
        name: The attribute of `Limits`.
        value: How much is allowed.
        unit: What is counted.
        guards: Whose.
        beyond: What happens beyond it.
        more: The reason, or the other way, or what less is known; empty where nothing is to be said.
    """

    name: str
    value: float
    unit: str
    guards: str
    beyond: Beyond
    more: str


def _limit(value: float, unit: str, guards: str, beyond: Beyond, more: str) -> Any:
    return field(default=value, metadata={"unit": unit, "guards": guards, "beyond": beyond, "more": more})


def _undecided(value: float, unit: str, guards: str, reason: str) -> Any:
    return _limit(value, unit, guards, Beyond.UNDECIDED, reason)


def _refused(value: float, unit: str, guards: str) -> Any:
    return _limit(value, unit, guards, Beyond.REFUSED, "")


def _otherwise(value: float, unit: str, guards: str, way: str) -> Any:
    return _limit(value, unit, guards, Beyond.OTHERWISE, way)


def _coarser(value: float, unit: str, guards: str, how: str) -> Any:
    return _limit(value, unit, guards, Beyond.COARSER, how)


def _shorter(value: float, unit: str, guards: str) -> Any:
    return _limit(value, unit, guards, Beyond.SHORTER, "")


@dataclass(eq=False, repr=False, slots=True)
class Limits:
    """The limits, folder by folder."""

    # syntax
    program_characters: int = _refused(200_000, "characters", "of a program")
    bracket_nesting: int = _refused(100, "levels", "of brackets and blocks in one another")
    expression_nesting: int = _refused(220, "levels", "of expressions that are read inside one another")
    tree_height: int = _refused(256, "levels", "of a program's tree")
    reading_retries: int = _refused(200_000, "times", "a phrase is read anew because it was none")
    number_digits: int = _refused(4000, "characters", "of a number")
    string_parts: int = _refused(1000, "parts", "of an f-string")

    # compiler
    program_seconds: float = _refused(
        60.0, "processor seconds", "of evaluating a program; what it does has its price in steps, but maps differ"
    )
    program_steps: int = _refused(400_000, "steps", "of evaluating a program")
    call_nesting: int = _refused(40, "calls", "in one another")
    value_items: int = _refused(
        100_000, "items or characters", "of a list or string that a program makes or goes through"
    )
    value_nesting: int = _refused(40, "levels", "of a list or dict that a program goes through")
    integer_bits: int = _refused(2048, "bits", "of a whole number")
    choice_options: int = _refused(20_000, "options", "of a random choice, those of choices inside it included")
    condition_courses: int = _refused(2_000, "courses", "that a condition on the scene takes, as its `if`s come out")
    region_parts: int = _refused(5_000, "parts", "of a region that is combined from others")
    random_way_steps: int = _refused(100, "steps", "along a field over a random distance")
    known_way_steps: int = _refused(2_000, "steps", "along a field over a known distance")
    projection_segments: int = _refused(200, "segments", "of a line onto which a point is projected that is not known")
    scenario_variants: int = _refused(
        16, "combinations", "of scenarios that make objects and begin in some runs of a program alone"
    )
    process_steps: int = _refused(4_000, "steps", "of a monitor or behavior, of all that it can be in")
    rounded_nodes: int = _otherwise(
        16, "nodes", "of a number to be rounded that are looked at for a half that may be hit", "the general formula"
    )

    # forest, geometry
    unobserved_choices: int = _coarser(
        8,
        "choices",
        "inside one comparison with what is not observed, and conditions of that kind asked for twice, told apart",
        "the comparison, or each place where it is asked for, may hold and may not",
    )
    difference_terms: int = _undecided(
        4096,
        "terms",
        "of a region that others are removed from: each separate disc can double them",
        "the region removes too many separate discs",
    )
    off_road_tiles: int = _coarser(
        64, "tiles", "of a box that is looked at for places off the road", "the box counts as partly off the road"
    )
    whole_draws: int = _otherwise(
        32, "draws", "in a disc or sector before the polygons that it meets are cut to it", "the polygons are cut"
    )
    cut_draws: int = _otherwise(
        1_000,
        "draws",
        "in polygons before the region is taken apart, which takes as long as hundreds of draws",
        "the region is taken apart",
    )
    part_draws: int = _refused(100_000, "draws", "in the parts of a region; what they miss is as good as empty")

    # match/problem
    signatures: int = _undecided(1024, "signatures", "of one label: which candidates observe what", "budget")
    replayed_directions: int = _coarser(
        1024,
        "combinations",
        "of directions that a witness is replayed with, where a field allows several",
        "the witness proves nothing",
    )
    part_roles: int = _otherwise(
        2, "roles", "of a part of a group that is decided before the group", "the group is decided as a whole"
    )
    group_parts: int = _otherwise(300, "parts", "of a group that are decided before it", "parts are not joined")

    # match/search
    fit_decisions: int = _otherwise(
        64, "decisions", "of groups for a batch of labels by first fit", "each label gets a search of its own"
    )
    fit_decisions_a_role: int = _otherwise(
        16,
        "decisions",
        "more for each role but the first: what is given up costs as much as half a search at most",
        "each label gets a search of its own",
    )
    ordered_slots: int = _otherwise(
        8, "roles", "that are filled in the order of the program", "the most constrained first"
    )
    ordered_steps: int = _otherwise(
        64,
        "candidates",
        "that are tried in the order of the program, from one correspondence to the next",
        "the most constrained first",
    )
    nearer_steps: int = _shorter(
        1000, "candidates", "that are tried for a correspondence with nearer objects than one that is found"
    )
    arc_roles: int = _otherwise(
        2, "roles", "of a group whose candidates are thinned by intervals", "the search decides the group"
    )
    nested_outcomes: int = _undecided(50_000, "outcomes", "of choices nested in each other", "budget")
    choice_tries: int = _undecided(20_000, "outcomes", "of choices that are tried for one group of one label", "budget")
    choice_nesting: int = _undecided(
        16,
        "searches",
        "inside one another: of alternatives that are met only in what an alternative leads to",
        "budget",
    )
    witness_trials: int = _otherwise(
        400,
        "trials",
        "in vain that searches for witnesses have for one label: some seconds, a hundred draws or more at a time",
        "a solver is asked",
    )

    # match/decide
    closed_form_choices: int = _otherwise(8, "outcomes", "of the choices in a closed form", "no closed form")
    closed_form_terms: int = _otherwise(
        400,
        "terms",
        "of a closed form: what is shared in an expression is worked out anew for each use of it",
        "no closed form",
    )
    closed_form_regions: int = _otherwise(
        40, "regions", "that the region of a closed form is made of", "no closed form"
    )
    cascade_outcomes: int = _undecided(
        4096, "outcomes", "of discrete variables in one decision without a solver", "nonlinear"
    )
    cascade_nesting: int = _undecided(100, "variables", "that are discrete and chosen one below the other", "nonlinear")
    cascade_programs: int = _undecided(
        20_000, "linear programs", "of one decision: some seconds, after which a solver does no worse", "nonlinear"
    )
    outlined_box_m: float = _otherwise(
        500.0, "metres", "along a box in which the area within a distance is outlined", "a solver is asked"
    )
    asked_outcomes: int = _otherwise(
        64, "outcomes", "of discrete variables that a solver is asked about one by one", "the solver has the variables"
    )
    solver_attempts: int = _undecided(
        3, "questions", "to a solver whose witness does not replay, each more precise", "precision"
    )

    # match/fields
    heading_cases: int = _undecided(100_000, "cases", "of one part, by which way its fields point", "nonlinear")
    heading_passes: int = _coarser(12, "passes", "in which places and headings narrow each other", "cases are parted")
    heading_width: float = _undecided(
        1e-5, "metres, radians, ...", "below which a range is not divided any more", "nonlinear"
    )
    field_ways: int = _undecided(256, "ways", "of one part that are put to the linear program", "nonlinear")
    field_halvings: int = _undecided(64, "ways", "of one part that are divided", "nonlinear")
    shared_values: int = _undecided(256, "values", "of a number that parts share, which are tried", "nonlinear")
    shared_width: float = _undecided(
        1e-7,
        "metres, radians, ...",
        "below which an interval of the number that parts share is not divided any more",
        "nonlinear",
    )
    pruned_boxes: int = _undecided(4096, "boxes", "that a group is divided into, of which something is left", "budget")
    narrowing_passes: int = _coarser(
        6, "passes", "in which the ranges of random variables are narrowed", "the ranges stay wider"
    )
    witness_replays: int = _coarser(
        6, "draws", "of one search for a witness that are put to the test", "no witness is found"
    )
    witness_places: int = _coarser(
        16_384, "places", "at which the map is asked at once in a search for a witness", "no witness is found"
    )

    # match/linear
    linear_cells: int = _undecided(2000, "cells", "of a region that a linear program chooses from", "nonlinear")
    extent_combinations: int = _coarser(
        16,
        "combinations",
        "of cells of which the ends of a number are looked for",
        "the number's interval stays as it is",
    )
    inverted_offsets: int = _otherwise(
        6, "random offsets", "of one position whose box is taken corner by corner", "a linear program"
    )

    # smt
    distance_edges: int = _undecided(
        200, "edges or pieces", "of a region whose distance from something random is written out", "unsupported"
    )
    enclosing_edges: int = _undecided(400, "edges", "of a region that holds a random box", "unsupported")
    rounded_values: int = _undecided(1000, "values", "of a number that is rounded down", "unsupported")
    integer_values: int = _undecided(1000, "values", "of a random whole number", "unsupported")
    split_cases: int = _coarser(
        64, "alternatives", "of a question that is asked again one by one", "the question is not asked again"
    )
    dreal_conjunctions: int = _otherwise(
        1_000_000,
        "conjunctions",
        "that a question to dReal is split into; most of them are never looked at",
        "dReal has the alternatives",
    )
    worker_starts: int = _undecided(3, "times", "that a solver's process is started for one question", "crash")
    worker_start_s: float = _undecided(60.0, "seconds", "that a solver's process takes to start", "timeout")
    worker_answer_bytes: int = _undecided(16 * 2**20, "bytes", "of an answer from a solver's process", "garbage")
    command_reply_bytes: int = _undecided(4 * 2**20, "bytes", "of a reply of a solver that is a command", "garbage")
    solver_memory_mb: int = _undecided(4096, "MiB", "of memory of a solver's process", "crash")

    # temporal
    start_tuples: int = _otherwise(
        64, "correspondences", "of one label that arrays decide side by side", "the matcher decides the label"
    )
    outcomes_over_time: int = _undecided(
        3000,
        "outcomes",
        "of the choices that conditions over time depend on",
        "too many outcomes of random choices to tell apart",
    )
    direction_choices: int = _undecided(
        64,
        "combinations",
        "of directions that are tried for one condition, beside the first, where a field allows several",
        "budget",
    )
    observation_ways: int = _undecided(
        1024, "ways", "in which what is not observed at one sample may come out", "budget"
    )
    scenario_starts: int = _undecided(
        8, "times", "that one call of a scenario that makes objects begins in a run", "budget"
    )
    arrival_combinations: int = _undecided(
        200_000, "combinations", "of starts with tracks for objects that come later, in one block", "budget"
    )
    mode_ways: int = _shorter(2_000, "steps", "of the ways from one mode to others that are shown")
    arrival_questions: int = _undecided(
        2_000, "labels", "at which objects may come, in one process, that arrays do not decide", "budget"
    )
    run_modes: int = _undecided(256, "modes", "in which one run may be at once", "budget")
    run_situations: int = _undecided(20_000, "situations", "of one program", "budget")
    formula_clauses: int = _undecided(512, "clauses", "of what is left of one formula", "budget")
    run_pieces: int = _undecided(256, "pieces", "of one run at once, by the values of hidden numbers", "budget")
    jump_cuts: int = _otherwise(
        6,
        "cuts",
        "that a situation reads, between which it is worked out where it stays",
        "the run goes sample by sample",
    )
    condition_cuts: int = _undecided(
        24, "cuts", "of one condition on a hidden number", "too many values of random variables to tell apart"
    )
    joint_starts: int = _undecided(
        32,
        "starts",
        "of one binding that are matched again with values of random variables that the initial scene has, too",
        "budget",
    )
    start_questions: int = _undecided(
        128, "questions", "to the matcher for one start", "a hidden random point in a condition over time"
    )

    # query/prefilter
    joined_pairs: int = _coarser(
        12, "pairs", "of roles whose objects are joined", "objects are left that have no partner"
    )
    named_regions: int = _coarser(2000, "regions", "named one by one in a condition", "the region excludes nothing")
    related_regions: int = _coarser(
        20_000, "pairs", "of elements of the map and what a program makes of them", "the look-up excludes nothing"
    )
    region_boxes: int = _coarser(
        500, "boxes", "around pieces of a region to which SQL measures distances", "the distance excludes nothing"
    )
    heading_terms: int = _coarser(64, "terms", "of a heading that is a sum", "the sum is one term")
    sql_alternatives: int = _coarser(16, "alternatives", "of one value that are kept apart", "they are one interval")
    sql_characters: int = _coarser(6000, "characters", "of an end of an interval", "the interval has no end")
    counted_roles: int = _otherwise(6, "roles", "that SQL fills by counting", "the matcher decides the frames")
    tied_roles: int = _otherwise(
        3, "roles", "that SQL fills where conditions tie two of them together", "the matcher decides the frames"
    )

    # query/execution
    recording_starts: int = _undecided(
        10_000,
        "starts",
        "that the matcher may find in one recording, sure ones or open ones: they are held until it is decided",
        "budget",
    )
    block_tries: int = _undecided(3, "processes", "that a block, and then a frame alone, may cost", "crash")
    piece_retries: int = _refused(
        2,
        "times",
        "that a piece is done again after an error of the operating system, such as a disk that does not answer",
    )

    # query/explain
    ranked_frames: int = _shorter(5000, "frames", "that `--near` looks at")
    ranked_recordings: int = _shorter(
        200, "recordings", "that `--near` looks at for each of the two ways to let one through"
    )
    ranked_bindings: int = _shorter(
        1000, "bindings", "of all these for which numbers are looked for, those that come furthest first"
    )
    ranked_numbers: int = _shorter(10, "numbers", "that are tried on a recording, the least first")
    tried_amounts: int = _shorter(400, "amounts", "that are tried for one comparison")
    cut_off_rounds: int = _shorter(8, "times", "that starts are left out whose runs are cut off")
    told_margins: int = _shorter(200, "features and requirements", "that a match is told to hold by")
    told_choices: int = _shorter(16, "outcomes", "of choices whose values are told")
    told_intervals: int = _shorter(4, "intervals", "that a value may lie in")
    advice_frames: int = _shorter(5_000, "frames", "of a dataset beyond which advice looks at a sample")
    advice_changes: int = _shorter(24, "changes", "of the program that advice tries")
    advice_pairs: int = _shorter(6, "changes", "of which advice tries pairs")
    advice_decisions: int = _shorter(300, "frames", "that the matcher decides for one change")
    advice_runs: int = _shorter(8, "runs", "of frames of each map that a large dataset is sampled by")
    advice_maps: int = _shorter(16, "maps", "whose frames advice looks at")
    brief_changes: int = _shorter(5, "changes", "that brief advice tries")
    brief_pairs: int = _shorter(4, "changes", "of which brief advice tries pairs")
    brief_decisions: int = _shorter(16, "frames", "that the matcher decides for one change of brief advice")
    brief_runs: int = _shorter(3, "runs", "of frames of each map that brief advice samples a large dataset by")
    brief_maps: int = _shorter(4, "maps", "whose frames brief advice looks at")


LIMITS = Limits()
"""The limits that hold."""


def limits() -> Iterator[Limit]:
    """All limits, as they are without a change."""
    for each in fields(Limits):
        told = each.metadata
        value = cast("float", each.default)
        yield Limit(each.name, value, told["unit"], told["guards"], told["beyond"], told["more"])


def limit_exceeded(name: str) -> Exhausted:
    """What ends a search at a limit that leaves it undecided: the reason, and in words which limit it was."""
    told = Limits.__dataclass_fields__[name].metadata
    return Exhausted(told["more"], f"more than {getattr(LIMITS, name):,} {told['unit']} {told['guards']}")
