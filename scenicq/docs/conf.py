"""How the documentation site is made (`make docs`): from the very pages that lie in the repository.

The root of the sources is that of the repository, so that links between pages are the same on the site and where the
repository is read. `CONTENTS` is the order of the pages; a page that is in no list is an error, as is a link that leads
nowhere. Nothing is fetched when pages are looked at.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, ClassVar

from pygments.lexers.python import PythonLexer  # pyright: ignore[reportMissingTypeStubs]
from pygments.token import Error, Keyword, Name, Text  # pyright: ignore[reportMissingTypeStubs]

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT))

import scenicq  # noqa: E402 - of this checkout, wherever another is installed
from scenicq.syntax.phrases import OPERATORS, SPECIFIERS  # noqa: E402

project, author = "scenicq", "the authors of scenicq"
release = version = scenicq.__version__
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
root_doc = "README"

CONTENTS = {
    "Using it": [
        "scenicq/docs/README",
        *(
            f"scenicq/docs/{name}"
            for name in ("matching", "glossary", "results", "evaluation", "data", "long-runs", "limits")
        ),
        "cli/README",
        "sample_data/README",
        "scenicq/docs/compared",
    ],
    "Cookbook": ["tests/language/cookbook", "tests/language/cookbook-over-time"],
    "Language": [
        "tests/language/README",
        *sorted(
            f"tests/language/{page.stem}"
            for page in (ROOT / "tests" / "language").glob("*.md")
            if not page.stem.startswith(("README", "cookbook"))
        ),
    ],
    "Reference": [
        "scenicq/docs/api",
        "scenicq/codes",
        "scenicq/importers/README",
        "scenicq/limits",
        "scenicq/evaluate/README",
    ],
    "What commands say": ["tests/transcripts/*"],
    "Contributing": [
        "scenicq/docs/CONTRIBUTING",
        "scenicq/README",
        "scenicq/decisions/README",
        "scenicq/decisions/*",
        "tests/tools/conformance/README",
    ],
    "Releases": [f"scenicq/docs/{name}" for name in ("CHANGELOG", "versions", "licences", "SECURITY")],
}
"""The pages, by what they are for; the first page is the README."""
FOLDERS = ("cli", "sample_data", "scenicq", "tests")
include_patterns = ["README.md", *(f"{folder}/**.md" for folder in FOLDERS)]
exclude_patterns = ["**/__pycache__"]

myst_heading_anchors = 4
default_role = "code"
autodoc_typehints = "none"
autodoc_member_order = "bysource"
napoleon_google_docstring, napoleon_numpy_docstring = True, False

html_theme = "furo"
html_title = f"scenicq {release}"
html_extra_path = ["site"]
html_copy_source = False
html_theme_options: dict[str, Any] = {"navigation_with_keys": True}


STATEMENTS = frozenset(
    "behavior compose do ego interrupt model monitor mutate new param record require scenario setup simulator take "
    "terminate try when with".split()
)


class ScenicLexer(PythonLexer):
    """Colours of Scenic: Python's, with the words of specifiers and statements."""

    name, aliases = "Scenic", ("scenic",)
    WORDS: ClassVar[frozenset[str]] = STATEMENTS | {
        part
        for row in (*SPECIFIERS, *OPERATORS)
        for part in (*row.words, *row.rest, *(operand.word for operand in row.operands))
        if isinstance(part, str)
    }

    def get_tokens_unprocessed(self, text: str) -> Iterator[tuple[int, Any, str]]:  # pyright: ignore[reportIncompatibleMethodOverride]
        """The tokens of Python, but for what is none."""
        for index, token, value in super().get_tokens_unprocessed(text):
            if token is Name and value in self.WORDS:
                yield index, Keyword, value
            else:
                yield index, Text if token is Error else token, value


def _add_contents(_app: Any, document: str, source: list[str]) -> None:
    """Where pages are read one by one, the README's own table leads to them."""
    if document == root_doc:
        for caption, pages in CONTENTS.items():
            listed = "\n".join(pages)
            glob = ":glob:\n" if "*" in listed else ""
            source[0] += f"\n\n```{{toctree}}\n:hidden:\n:caption: {caption}\n{glob}\n{listed}\n```\n"


def setup(app: Any) -> None:
    """Called by Sphinx."""
    app.add_lexer("scenic", ScenicLexer)
    app.connect("source-read", _add_contents)
