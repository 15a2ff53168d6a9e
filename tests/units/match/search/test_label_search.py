"""One label's search: what watches it changes nothing."""

from __future__ import annotations

import ast
import random
from dataclasses import dataclass, field, replace
from pathlib import Path

import pytest
from programs import HEADER, PROGRAMS
from scenes import STREET, compiled, drawn, label_of

from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.search import backtracking
from scenicq.match.search.first_fit import FirstFit


@dataclass
class Recorder:
    """Writes down what it is told."""

    told: list[tuple[object, ...]] = field(default_factory=list)

    def assigned(self, slot, candidate):
        self.told.append(("assigned", slot, candidate))
        return False

    def rejected(self, slot, candidate, blamed):
        self.told.append(("rejected", slot, candidate, blamed))
        return True

    def jumped(self, slot, back_to):
        self.told.append(("jumped", slot, back_to))
        return True


@pytest.mark.parametrize("name", ["crowd", "shared heading", "figure 3", "discrete"])
def test_a_reporter_only_watches(name, monkeypatch):
    # every label is searched, those too that first fit would have decided
    monkeypatch.setattr(FirstFit, "fill", lambda *_: iter(()))
    scenario = compiled(HEADER + PROGRAMS[name], STREET)
    matcher, recorder = Matcher(scenario, MatchOptions()), Recorder()
    for seed in range(3):
        rng = random.Random(seed)
        label = label_of(scenario, drawn(scenario, seed), rng, distractors=3)
        moved = replace(label, objects=tuple(replace(each, y=each.y + 5) for each in label.objects))
        for each in (label, moved):
            assert matcher.match(each, recorder) == matcher.match(each)
    assert recorder.told


def test_nothing_that_a_reporter_answers_is_read():
    file = Path(backtracking.__file__)
    calls = [node for node in ast.walk(ast.parse(file.read_text())) if isinstance(node, ast.Call)]
    told = [each for each in calls if isinstance(each.func, ast.Attribute) and ast.unparse(each.func.value) == "watch"]
    statements = [node.value for node in ast.walk(ast.parse(file.read_text())) if isinstance(node, ast.Expr)]
    assert told
    assert {ast.unparse(each) for each in told} <= {ast.unparse(each) for each in statements}
