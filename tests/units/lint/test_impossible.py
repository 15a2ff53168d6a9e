"""What no scene of a program satisfies is an error of `check`; what some scene may satisfy is not."""

import pytest
from click.testing import CliRunner

from scenicq.compiler.program import compile_scenario
from scenicq.errors import Source
from scenicq.geometry.default_street import street
from scenicq.lint.impossible import impossible_requirements
from scenicq_cli.main import cli

HEADER = "model scenic.domains.driving.model\ngap = Range(0, 3)\nego = new Car\n"
IMPOSSIBLE = (
    "require gap > 5",
    "require 2 * gap < -1 and (distance from ego to (1, 2)) < 9",
    "require not (gap < 4)",
    "require gap > 5 or gap < -1",
    "other = new Car at (gap, 5), with width 2\nrequire other.position.x > 4",
    "other = new Car at (gap, 5), with width 2\nrequire other.width > 4",
    "other = new Car at (1, 5), facing (10 * gap) deg\nrequire other.heading > 40 deg",
    "other = new Car at (gap, 5)\nrequire (distance from other to (gap, 50)) < 3",
    "def far(a): return a > 5\nrequire far(gap)",
)
ON_THE_STREET = ("require ego.position.x > 100000", "require (distance from ego to (9000, 0)) < 10")
POSSIBLE = (
    "require gap > 2",
    "require gap > 2.9999",
    "require[0.5] gap > 5",
    "require ego.speed > 9",
    "require ego.width > 9",
    "other = new Car ahead of ego by gap\nrequire (distance from ego to other) > 5",
    "other = new Car at (gap, 5)\nmutate other\nrequire other.position.x > 4",
    "require ego.heading > 170 deg",
    "require ego in intersection",
)


def lines_of(text: str, *, real: bool = True) -> list[int]:
    source = Source("test.scenic", HEADER + text)
    found = impossible_requirements([compile_scenario(source, street())], real=real)
    return [source.position(each.span.start)[0] for each in found if each.span]


@pytest.mark.parametrize("text", IMPOSSIBLE)
def test_what_no_scene_satisfies(text):
    assert lines_of(text) == lines_of(text, real=False) == [len((HEADER + text).splitlines())]


@pytest.mark.parametrize("text", ON_THE_STREET)
def test_what_no_scene_satisfies_on_a_map(text):
    assert lines_of(text) == [4]
    assert lines_of(text, real=False) == []


@pytest.mark.parametrize("text", POSSIBLE)
def test_what_some_scene_may_satisfy(text):
    assert lines_of(text) == []


def test_check_ends_with_an_error(tmp_path):
    (tmp_path / "p.scenic").write_text(HEADER + "require gap > 5\nrequire ego.position.x > 100000\n", encoding="utf-8")
    ended = CliRunner().invoke(cli, ["check", str(tmp_path / "p.scenic")])
    assert ended.exit_code == 2
    assert "error[impossible-requirement]" in ended.stderr
    assert "ok on map" not in ended.stdout
