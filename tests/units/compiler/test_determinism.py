"""A program compiles to the same scenario, in the same order, whatever the hash seed of the process."""

from __future__ import annotations

import os
import subprocess
import sys
from functools import cache

import pytest

SCRIPT = r"""
import re
from scenicq.compiler.program import compile_scenario
from scenicq.errors import ScenarioError, Source
from scenicq.forest.show import show_forest
from scenicq.geometry.default_street import street
from scenicq.syntax.phrases import OPERATORS, SPECIFIERS

HEAD = '''ego = new Object at (1, 2), facing 20 deg, with regionContainedIn everywhere
a = new Object at (5, 9), facing Range(0, 9) deg, with width 3
p = new OrientedPoint at (3, Range(4, 5))
things, box = Uniform(ego, a, p), Uniform(a, ego)
'''
for operand in ("things", "box"):
    for row in (*SPECIFIERS, *OPERATORS):
        text = re.sub(r"\[|\]", "", re.sub(r"\{\w+\}", f"({operand})", row.text))
        line = f"new Object {text}" if row in SPECIFIERS else f"param v = ({text}), w = {{'a', 'b', 'c'}}"
        try:
            scenario = compile_scenario(Source("x", HEAD + line + "\n"), street())
        except ScenarioError as error:
            print(line, error.diagnostics[0].message)
        else:
            print(line, [list(each.properties) for each in scenario.objects], show_forest(scenario), scenario.params)
"""


@cache
def compiled(seed: int) -> list[str]:
    environment = os.environ | {"PYTHONHASHSEED": str(seed)}
    run = subprocess.run([sys.executable, "-c", SCRIPT], env=environment, capture_output=True, text=True, check=True)
    return run.stdout.splitlines()


@pytest.mark.slow
@pytest.mark.parametrize("seed", [2, 3])
def test_the_hash_seed_changes_nothing(seed: int) -> None:
    assert compiled(seed) == compiled(1)
