"""Every example program of the repository that describes scenes, over a map that it can be drawn on."""

from __future__ import annotations

import re
import runpy
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from scenicq.compiler.program import compile_scenario
from scenicq.errors import ScenarioError, Source
from scenicq.forest.scenario import Scenario
from scenicq.geometry.default_street import street
from scenicq.geometry.features import read_geojson
from scenicq.geometry.network import Network

TESTS = Path(__file__).parents[2]
ROOT = TESTS.parent
CROSSROADS = next((ROOT / "sample_data" / "crossroads" / "maps").glob("*.geojson"))
_FENCE = re.compile(r"^```scenic(?P<options>[^\n]*)\n(?P<text>.*?)^```$", re.MULTILINE | re.DOTALL)
# what the papers print is a fragment in some places: the lines that they leave to the reader
_BEFORE = {
    "car left of spot": "ego = Car\nspot = OrientedPoint on curb\n",
    "soft requirement": "ego = Car\ncar2 = Car\n",
    "mutation": "ego = Car at 120 @ 290, facing 37 deg\n",
}


@dataclass(frozen=True)
class Example:
    """A program.

    Attributes:
        name: Where it is from.
        text: The program.
        version: Of Scenic; None where it is inferred.
        initial: Whether its dynamic parts are left out.
        crossroads: Whether it is about the map of the sample data rather than the built-in street.
    """

    name: str
    text: str
    version: int | None = None
    initial: bool = False
    crossroads: bool = False

    def compiled(self, network: Network | None = None) -> Scenario:
        """The scenario on a map, by default the example's own."""
        if network is None:
            network = crossroads() if self.crossroads else town()
        source = Source(f"{self.name}.scenic", self.text)
        return compile_scenario(source, network, version=self.version, initial=self.initial)


@cache
def town() -> Network:
    """The built-in street."""
    return street()


@cache
def crossroads() -> Network:
    """The map of the sample data."""
    return Network("crossroads", read_geojson(CROSSROADS, lambda identifier, message: None))


def paper_program(name: str, text: str) -> str:
    """A program of a paper, made whole: the language paper leaves out the line that imports its library."""
    whole = re.search(r"^ego *=", text, re.MULTILINE)
    named = re.search(r"^import ", text, re.MULTILINE) or "Range(" in text
    ego = _BEFORE.get(name, "" if whole else "ego = Car\n")
    return ("" if named else "import gtaLib\n") + ego + text


def paper_programs() -> dict[str, str]:
    """The programs that the two papers print, but the one that is there to show what is wrong."""
    programs = runpy.run_path(str(TESTS / "units" / "syntax" / "paper_programs.py"))["PROGRAMS"]
    return {name: paper_program(name, each[0]) for name, each in programs.items() if name != "plain constructor"}


def _everything() -> Iterator[Example]:
    for path in sorted((ROOT / "sample_data" / "scenarios").glob("*.scenic")):
        yield Example(f"sample:{path.stem}", path.read_text(encoding="utf-8"), crossroads=True)
    for name, text in paper_programs().items():
        yield Example(f"paper:{name}", text)
    for path in [ROOT / "README.md", *sorted((TESTS / "language").glob("*.md"))]:
        page = path.read_text(encoding="utf-8")
        for block in _FENCE.finditer(page):
            options = block["options"].split()
            version = next((int(word[7:]) for word in options if word.startswith("scenic=")), None)
            line = page.count("\n", 0, block.start()) + 1
            if "# error: [" not in block["text"]:
                yield Example(f"{path.stem}:{line}", block["text"], version, "initial" in options)
    for path in sorted((TESTS / "tools" / "conformance" / "programs").glob("*.scenic")):
        text = path.read_text(encoding="utf-8")
        if "# scenic refuses" not in text:
            yield Example(f"conformance:{path.stem}", text)
    programs = runpy.run_path(str(TESTS / "units" / "match" / "programs.py"))
    for name, text in programs["PROGRAMS"].items():
        yield Example(f"match:{name}", programs["HEADER"] + text)


@cache
def examples() -> dict[str, Example]:
    """All example programs by name."""
    return {each.name: each for each in _everything()}


if __name__ == "__main__":
    for each in examples().values():
        try:
            each.compiled()
        except ScenarioError as error:
            sys.stdout.write(f"{each.name}: {error.diagnostics[0].message}\n")
