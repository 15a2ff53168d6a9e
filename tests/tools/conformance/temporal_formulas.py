"""Random temporal formulas on random traces: does scenicq say what `rv_ltl` says, which Scenic uses?"""

from __future__ import annotations

import json
import random
import subprocess
from pathlib import Path
from typing import Any

import numpy as np

from scenicq.forest.temporal import Always, And, Atom, Eventually, Formula, Next, Not, Or, Until
from scenicq.temporal.formula_values import FormulaValues

ATOMS = 3
LONGEST = 8
_OPERANDS = {"not": 1, "always": 1, "eventually": 1, "next": 1, "and": 2, "or": 2, "implies": 2, "until": 2}


def random_formula(rng: random.Random, depth: int) -> Any:
    """A formula as nested lists."""
    if not depth or rng.random() < 0.15:
        return rng.randrange(ATOMS)
    operator = rng.choice(list(_OPERANDS))
    return [operator, *(random_formula(rng, depth - 1) for _ in range(_OPERANDS[operator]))]


def random_trace(rng: random.Random) -> list[list[bool]]:
    """Truth values of the atoms for each sample."""
    return [[rng.random() < 0.6 for _ in range(ATOMS)] for _ in range(rng.randint(1, LONGEST))]


def ours(formula: Any) -> Formula:
    """The formula of scenicq."""
    if isinstance(formula, int):
        return Atom(formula)
    operands = [ours(each) for each in formula[1:]]
    match formula[0]:
        case "not":
            return Not(operands[0])
        case "and":
            return And(tuple(operands))
        case "or":
            return Or(tuple(operands))
        case "implies":
            return Or((Not(operands[0]), operands[1]))
        case "until":
            return Until(operands[0], operands[1])
        case name:
            return {"always": Always, "eventually": Eventually, "next": Next}[name](operands[0])


def compare_formulas(python: Path, count: int, seed: int = 1) -> int:
    """How many of so many random pairs both sides decide differently, at any last sample.

    Args:
        python: The one that has `rv_ltl`.
        count: How many pairs.
        seed: Which.
    """
    rng = random.Random(seed)
    pairs = [{"formula": random_formula(rng, 4), "trace": random_trace(rng)} for _ in range(count)]
    text = "".join(json.dumps(pair) + "\n" for pair in pairs)
    done = subprocess.run(
        [str(python), str(Path(__file__).with_name("ltl_verdicts.py"))],
        input=text,
        capture_output=True,
        text=True,
        check=True,
    )
    different = 0
    for pair, line in zip(pairs, done.stdout.splitlines(), strict=True):
        columns = 2 * np.array(pair["trace"], dtype=np.int8)
        values = FormulaValues(ours(pair["formula"]))
        ends = [columns[:end] for end in range(1, len(columns) + 1)]
        found = [values.to_the_end(lambda atom, c=each: c[:, atom.number], len(each)) for each in ends]
        different += [bool(each[0]) for each in found] != json.loads(line)
    return different
