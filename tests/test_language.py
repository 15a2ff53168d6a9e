"""The pages of `tests/language`: every `scenic` block compiles, or fails with exactly the errors that it marks.

In a block `# warning: [code]` marks a line of which `scenicq check` warns, exactly these on the page of warnings, and
`# error: [code]` marks the line that is wrong, and `# value: name.property == value` states a property of
an object of which nothing is random. The fence may go on with `scenic=2` (read as that version), `initial` (dynamic
parts are left out), `ignore` (behaviors are left out, the rest is matched over time) and `coarse` (classes are folded).
"""

from __future__ import annotations

import ast
import math
import random
import re
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import dropwhile, takewhile
from pathlib import Path

import pytest
from drawing import draw_scene

from scenicq.compiler.program import compile_scenario
from scenicq.errors import CODES, ScenarioError, Source
from scenicq.forest.scenario import Scenario
from scenicq.geometry.default_street import street
from scenicq.lint.program import lint
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import Tolerance
from scenicq.syntax import ast as scenic
from scenicq.syntax.parser import parse
from scenicq.syntax.walk import walk

PAGES = Path(__file__).parent / "language"
NOT_ERRORS_OF_PROGRAMS = {"option-invalid", "soft-requirement", "not-recorded", "no-map"}
"""An error of the command line, warnings of a run, and a note where there is no map."""

_BLOCK = re.compile(r"^```scenic(?P<options>[^\n]*)\n(?P<text>.*?)^```$", re.MULTILINE | re.DOTALL)
_ERROR = re.compile(r"#\s*error:\s*\[([a-z-]+)\]")
_WARNING = re.compile(r"#\s*warning:\s*\[([a-z-]+)\]")
_VALUE = re.compile(r"^#\s*value:\s*([\w#]+)\.(\w+)\s*==\s*(.+)$", re.MULTILINE)
_LINK = re.compile(r"\]\(([\w-]+\.md)\)")


@dataclass(frozen=True)
class Block:
    """A program on a page."""

    page: str
    line: int
    options: tuple[str, ...]
    text: str

    @property
    def version(self) -> int | None:
        """The version that the block is read as, if it says so."""
        return next((int(word.removeprefix("scenic=")) for word in self.options if word.startswith("scenic=")), None)

    @property
    def marks(self) -> set[tuple[int, str]]:
        """Lines of the block with the codes of their errors."""
        return self.marked(_ERROR)

    def marked(self, mark: re.Pattern[str]) -> set[tuple[int, str]]:
        """Lines of the block with the codes that a mark gives them."""
        lines = self.text.splitlines()
        return {(number, code) for number, line in enumerate(lines, 1) for code in mark.findall(line)}

    def compiled(self) -> Scenario:
        """The scenario over the made-up street."""
        source = Source(f"{self.page}:{self.line}", self.text)
        initial, behaviors = "initial" in self.options, "ignore" if "ignore" in self.options else "guards"
        return compile_scenario(source, street(), version=self.version, initial=initial, behaviors=behaviors)


def blocks() -> list[Block]:
    """All programs of all pages."""
    found: list[Block] = []
    for page in sorted(PAGES.glob("*.md")):
        text = page.read_text(encoding="utf-8")
        for match in _BLOCK.finditer(text):
            line = text.count("\n", 0, match.start()) + 1
            found.append(Block(page.name, line, tuple(match["options"].split()), match["text"]))
    return found


BLOCKS = blocks()


def number(text: str) -> object:
    """A Python literal; a number may be given in degrees."""
    text = text.strip()
    return math.radians(float(text.removesuffix("deg"))) if text.endswith("deg") else ast.literal_eval(text)


def places(error: ScenarioError) -> set[tuple[int, str]]:
    """Lines and codes of an error's diagnostics."""
    return {(d.span.source.position(d.span.start)[0], d.code) for d in error.diagnostics if d.span is not None}


@pytest.mark.parametrize("block", BLOCKS, ids=lambda block: f"{block.page}:{block.line}")
def test_block(block: Block) -> None:
    """The block compiles, or fails where it says."""
    if block.marks:
        with pytest.raises(ScenarioError) as caught:
            block.compiled()
        assert places(caught.value) == block.marks, str(caught.value)
        return
    scenario = block.compiled()
    values = _VALUE.findall(block.text)
    if not values:
        return
    scene = draw_scene(scenario, random.Random(0), 1000)
    assert scene is not None
    names = {each.name: each.index for each in scenario.objects}
    for name, key, expected in values:
        value, wanted = scene.values[names[name], key], number(expected)
        if key == "heading":
            assert isinstance(value, float)
            assert isinstance(wanted, int | float)
            assert math.remainder(value - wanted, math.tau) == pytest.approx(0, abs=1e-6), (name, value)
        else:
            assert value == pytest.approx(wanted, abs=1e-6), (name, key)


WARNED = [block for block in BLOCKS if block.page == "warnings.md" and not block.marks]


def warned(block: Block) -> set[tuple[int, str]]:
    """Lines and codes of the warnings of a block."""
    scenario = block.compiled()
    options = MatchOptions(tolerance=Tolerance(), classes="coarse" if "coarse" in block.options else "fine")
    found = lint(scenario.source, [(scenario, street())], options)
    return {(d.span.source.position(d.span.start)[0], d.code) for d in found if d.span}


@pytest.mark.parametrize("block", WARNED, ids=lambda block: f"{block.page}:{block.line}")
def test_warnings(block: Block) -> None:
    """What the page of warnings marks is warned of, and nothing else."""
    assert warned(block) == block.marked(_WARNING)


@pytest.mark.parametrize("block", WARNED, ids=lambda block: f"{block.page}:{block.line}")
@pytest.mark.one_in(3)
def test_every_warning_can_be_silenced(block: Block) -> None:
    """A comment in the place of each mark silences the one that it names, and no other."""
    assert warned(replace(block, text=_WARNING.sub(r"# scenicq: ignore[\1]", block.text))) == set()
    others = replace(block, text=_WARNING.sub("# scenicq: ignore[no-such-code]", block.text))
    assert warned(others) == block.marked(_WARNING)


def test_every_warning_is_shown() -> None:
    """The codes of the last part of the table."""
    expected = set(dropwhile(lambda code: code != "angle-without-deg", CODES))
    assert expected == {code for block in WARNED for _, code in block.marked(_WARNING)}


def test_every_code_that_a_program_can_cause_is_shown() -> None:
    """The codes of the program's part of the table, up to the first one of the data."""
    expected = set(takewhile(lambda code: code != "unknown-class", CODES)) - NOT_ERRORS_OF_PROGRAMS
    assert expected == {code for block in BLOCKS for _, code in block.marks}


def test_every_construct_of_the_grammar_is_shown() -> None:
    """Each kind of statement, expression and specifier occurs in some block that is read."""
    shown: set[type[scenic.SyntaxNode]] = set()
    for block in BLOCKS:
        with suppress(ScenarioError):
            shown |= {type(node) for node in walk(*parse(Source(block.page, block.text), block.version).body)}
    kinds = {kind for kind in vars(scenic).values() if isinstance(kind, type) and issubclass(kind, scenic.SyntaxNode)}
    assert kinds - {scenic.SyntaxNode} == shown


def test_the_table_lists_every_page_and_real_codes_only() -> None:
    """`README.md` is the way in."""
    text = (PAGES / "README.md").read_text(encoding="utf-8")
    assert {page.name for page in PAGES.glob("*.md")} - {"README.md"} == set(_LINK.findall(text))
    refused = {code for row in text.splitlines() if "refused" in row for code in re.findall(r"`\[([a-z-]+)\]`", row)}
    assert refused
    assert refused <= set(CODES)
