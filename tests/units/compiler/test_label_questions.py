"""The module `scenicq.labels`: how programs come by its names, and what is said of one that it does not have."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pytest

from scenicq.compiler import label_questions
from scenicq.compiler.program import compile_scenario
from scenicq.errors import ScenarioError, Source
from scenicq.geometry.default_street import street
from scenicq.query.execution.program_files import SiblingFiles

from .scenes import compiled

_IMPORTS = {
    "from scenicq.labels import twice": "twice",
    "from scenicq.labels import twice as other": "other",
    "from scenicq.labels import *": "twice",
    "from scenicq import labels": "labels.twice",
    "import scenicq.labels": "scenicq.labels.twice",
    "import scenicq.labels as questions": "questions.twice",
}


@pytest.fixture
def names(monkeypatch: pytest.MonkeyPatch) -> None:
    """One name beside those that the module has."""
    table: Mapping[str, object] = {**label_questions.QUESTIONS, "twice": lambda run, span, value: 2 * value}
    monkeypatch.setattr(label_questions, "QUESTIONS", table)


def _place(text: str, **options: object) -> float:
    scenario = compiled(text, **options)
    return scenario.objects[scenario.ego].properties["position"].value.value[0]  # type: ignore[union-attr]


@pytest.mark.usefixtures("names")
@pytest.mark.parametrize("statement", _IMPORTS)
def test_a_name_of_the_module_is_had_by_every_import(statement: str) -> None:
    assert _place(f"{statement}\nego = new Object at ({_IMPORTS[statement]}(4), 0)\n") == 8


@pytest.mark.usefixtures("names")
@pytest.mark.parametrize(
    ("statement", "code", "hint"),
    [
        ("from scenicq.labels import twise", "unknown-name", "it has `twice`"),
        ("import scenicq.labels\nx = scenicq.labels.twise", "unknown-attribute", "`twice`"),
        ("import scenicq.label", "unknown-model", "`scenicq.labels` is the nearest that is known"),
        ("from scenicq import label", "unknown-name", "it has `labels`"),
        ("from scenicq.match import Matcher", "unknown-model", "never Python code"),
    ],
)
def test_what_the_module_does_not_have_is_refused_by_name(statement: str, code: str, hint: str) -> None:
    with pytest.raises(ScenarioError) as error:
        compiled(f"{statement}\nego = new Object\n")
    (diagnostic,) = error.value.diagnostics
    assert diagnostic.code == code
    assert any(hint in each for each in diagnostic.hints), diagnostic.hints


@pytest.mark.usefixtures("names")
def test_no_file_stands_in_for_the_module(tmp_path: Path) -> None:
    folder = tmp_path / "scenicq"
    folder.mkdir()
    (folder / "__init__.scenic").write_text("x = 1\n")
    (folder / "labels.scenic").write_text("def twice(x):\n    return 0\n")
    path = tmp_path / "main.scenic"
    path.write_text("from scenicq.labels import twice\nego = new Object at (twice(4), 0)\n")
    scenario = compile_scenario(Source(str(path), path.read_text()), street(), version=3, loader=SiblingFiles(path))
    assert scenario.objects[scenario.ego].properties["position"].value.value[0] == 8  # type: ignore[union-attr]
