"""Where a code is explained: a person is told once a command, a script never."""

import os
import pty
import subprocess

import pytest

from scenicq.errors import CODES
from scenicq_cli.codes import pages

WRONG = "model scenic.domains.driving.model\nego = new Car on rood\nother = new Car ahead of ego by Range(5, 1)\n"


@pytest.mark.parametrize("code", CODES)
def test_each_code_has_a_page_for_the_terminal(code):
    page = pages()[code]
    assert page.lower().startswith(CODES[code].lower())
    assert "\nWhat to do: " in page
    assert "](" not in page
    assert "```" not in page


@pytest.mark.parametrize("person", [True, False])
def test_a_message_names_its_page_on_a_terminal_alone(person, command, tmp_path):
    (tmp_path / "wrong.scenic").write_text(WRONG)
    outer, inner = pty.openpty()
    words = [command, "check", "wrong.scenic"]
    reader = subprocess.Popen(words, cwd=tmp_path, stderr=inner if person else subprocess.PIPE, stdout=subprocess.PIPE)
    os.close(inner)
    if person:
        said = b""
        try:
            while part := os.read(outer, 4096):
                said += part
        except OSError:
            pass  # so a terminal says that nobody writes any more
    else:
        said = reader.communicate()[1]
    os.close(outer)
    reader.communicate()
    assert reader.returncode == 2
    assert b"unknown-name" in said
    assert said.count(b"scenicq codes unknown-name") == person
    assert said.count(b"says more") == person
