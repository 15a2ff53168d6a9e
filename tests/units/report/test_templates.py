"""Pages as templates: what is put into them is escaped, and only pictures of our own writer are not."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import jinja2
import pytest
from markupsafe import Markup

import scenicq
from scenicq.report.svg import element
from scenicq.report.templates import markup

ROOT = Path(scenicq.__file__).parent
TEMPLATES = sorted((ROOT / "report" / "assets").glob("*.html"))
PICTURES = {"bar", "strip", "sign", "picture", "image", "graphs[loop.index0]"}
"""What pictures are called in templates."""
OF_THE_PAGE = {"style", "script"}
EVIL = "</td><script>alert('\"')</script>\x00&amp;"
SHOWN = "&lt;/td&gt;&lt;script&gt;alert(&#39;&quot;&#39;)&lt;/script&gt;\ufffd&amp;amp;"


def test_only_pictures_and_the_page_s_own_files_are_put_in_as_they_are():
    assert len(TEMPLATES) > 5
    safe = {name for file in TEMPLATES for name in re.findall(r"\{\{ *([^{}|]+?) *\| *safe *\}\}", file.read_text())}
    assert safe == PICTURES | OF_THE_PAGE
    for file in TEMPLATES:
        text = file.read_text()
        assert text.count("safe") == len(re.findall(r"\| *safe *\}\}", text)), file.name
        assert "autoescape" not in text, file.name


def test_text_is_escaped_and_markup_of_a_macro_is_not():
    cell = markup("frames", "badge", kind=EVIL, words=EVIL)
    assert isinstance(cell, Markup)
    assert cell == f'<span class="badge {SHOWN}">{SHOWN}</span>' == element("span", SHOWN, class_=f"badge {EVIL}")
    made = markup("tables", "text_table", title=EVIL, head=(EVIL, "b"), rows=[(EVIL, cell)])
    assert made.count(SHOWN) == 5
    assert "<script" not in made
    assert made.count("<td>") == 1
    assert f"<td>{cell}</td>" in made


def test_pages_have_no_space_but_what_templates_say():
    made = markup("tables", "text_table", title="a b", head=("c",), rows=[("d  e",)])
    assert re.sub("<[^>]*>", "", made) == "a bcd  e"


def test_what_a_template_needs_must_be_there():
    with pytest.raises(jinja2.UndefinedError, match="words"):
        markup("frames", "badge", kind="match")


def test_jinja_is_loaded_by_the_first_page_and_by_nothing_else():
    found: list[str] = []
    for file in ROOT.rglob("*.py"):
        text = file.read_text(encoding="utf-8")
        if "jinja2" not in text and "markupsafe" not in text:
            continue
        outside = [node for node in ast.parse(text).body if isinstance(node, ast.Import | ast.ImportFrom)]
        assert not any("jinja2" in ast.unparse(node) or "markupsafe" in ast.unparse(node) for node in outside), file
        found += [file.name] if "from jinja2 import" in text and "PLC0415" in text else []
    assert found == ["templates.py"]
