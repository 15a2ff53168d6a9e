"""Scenic's soft keywords as names of a program: accepted and refused where Scenic 3.1.1 does, with the same values.

What Scenic says is recorded in `soft_keywords.json`, by `tests/tools/conformance/soft_keywords.py`, which has the
contexts.
"""

from __future__ import annotations

import importlib.util
import json
import random
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from drawing import draw_scene

from scenicq.errors import ScenarioError

from .scenes import compiled

HERE = Path(__file__).parent
RECORDED: dict[str, Any] = json.loads((HERE / "soft_keywords.json").read_text(encoding="utf-8"))
WORDS: list[str] = RECORDED["words"]

SHADOWED = "Scenic compiles the statement to a call of its own function of that name, which the program has overwritten"
SCENE = "in Scenic the word always stands for the ego or workspace of the scene; here a parameter may be called so"
TAKEN = "an attribute of Scenic's own objects, which no property may hide; here it is a property like others"
DIFFERENT: dict[tuple[str, str], str] = {
    ("mutate", "a statement of its own"): SHADOWED,
    ("record", "a call as a statement"): SHADOWED,
    ("param", "a call as a statement"): "here a name that is called is a function, as in Python",
    ("ego", "class"): SCENE,
    ("ego", "keyword argument"): SCENE,
    ("behavior", "property of a class"): "Scenic demands a behavior or None; behaviors say nothing of one instant",
    ("visible", "before relative to"): "Scenic reads `visible` of a region called `relative`",
}
"""Words and contexts in which the outcome is another one, and why."""
DIFFERENT |= {(word, kind): TAKEN for word in "back bottom front intersects left right top".split()
              for kind in ("property", "property of a class")}  # fmt: skip
CALLED = ("called", "called without arguments", "keyword argument", "parameter", "parameter of a lambda",
          "a call as a statement", "after visible")  # fmt: skip
DIFFERENT |= {("workspace", context): SCENE for context in CALLED}


@cache
def conformance() -> Any:
    """The module that asks Scenic."""
    path = HERE.parents[1] / "tools" / "conformance" / "soft_keywords.py"
    spec = importlib.util.spec_from_file_location("soft_keywords", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def outcome(text: str) -> Any:
    """The answer of a program, None where it is refused."""
    try:
        scene = draw_scene(compiled(text, 3), random.Random(0))
    except ScenarioError:
        return None
    assert scene is not None
    return conformance().plain(scene.params.get("answer"))


def recorded(word: str, context: str) -> Any:
    """What Scenic says."""
    return RECORDED["others"][context].get(word, RECORDED["usual"][context])


def is_different(word: str, context: str) -> bool:
    """Whether a difference is known; `param` cannot be followed by a statement of that name in Scenic."""
    return (word, context) in DIFFERENT or (word == "param" and recorded(word, context) is None)


def test_all_soft_keywords_are_recorded_in_all_contexts() -> None:
    assert len(WORDS) == 77
    assert len(RECORDED["usual"]) == len(conformance().CONTEXTS) > 50
    assert RECORDED["usual"].keys() == conformance().CONTEXTS.keys()
    assert None not in RECORDED["usual"].values()


@pytest.mark.parametrize("context", RECORDED["usual"])
@pytest.mark.one_in(12)
def test_a_soft_keyword_is_a_name_where_scenic_takes_it_as_one(context: str) -> None:
    program = conformance().program
    found = {word: outcome(program(context, word)) for word in WORDS if not is_different(word, context)}
    assert found == {word: recorded(word, context) for word in found}


def test_known_differences_are_differences() -> None:
    program = conformance().program
    for word, context in DIFFERENT:
        assert outcome(program(context, word)) != recorded(word, context), (word, context)


def test_of_is_never_a_name() -> None:
    assert all(recorded("of", context) is None for context in RECORDED["usual"])
