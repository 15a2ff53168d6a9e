"""Text for people: columns, counts, times and colours."""

import io

import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st

from scenicq.errors import Diagnostic, Source, Span
from scenicq_cli.main import cli
from scenicq_cli.output import ProgressBar
from scenicq_cli.report import as_json, columns, count, moment


@given(st.lists(st.tuples(st.text("ab", min_size=1), st.text("cd", min_size=1)), min_size=1))
def test_columns_keep_every_cell_and_align(rows):
    lines = columns(rows)
    assert [tuple(line.split()) for line in lines] == rows
    assert len({line.index(row[1], 2 + len(row[0])) for line, row in zip(lines, rows, strict=True)}) == 1


def test_columns_align_numbers_to_the_right():
    assert columns([("a", "1"), ("bcd", "100")], right=frozenset({1}), indent="") == ["a      1", "bcd  100"]
    assert columns([]) == []


@pytest.mark.parametrize(
    ("number", "what", "text"),
    [(1, "frame", "1 frame"), (0, "match", "0 matches"), (12345, "object", "12,345 objects")],
)
def test_counts(number, what, text):
    assert count(number, what) == text


def test_moments():
    assert moment(1_700_000_000_250_000) == "2023-11-14 22:13:20.25"
    assert moment(2**62) == "4611686018427.39 s"


def test_json_of_a_diagnostic_over_two_lines():
    span = Span(Source("a.scenic", "one\ntwo\n"), 2, 6)
    found = as_json(Diagnostic("wrong-type", "no", span, hints=("do",)))
    assert [found[key] for key in ("line", "column", "end_line", "end_column")] == [1, 3, 2, 3]


def test_colours_are_for_terminals_and_can_be_switched_off():
    coloured = CliRunner().invoke(cli, ["info", "nowhere"], color=True)
    assert coloured.stderr.startswith("\x1b[31m")
    assert CliRunner().invoke(cli, ["info", "nowhere"]).stderr.startswith("error[store-missing]")
    for off in ({"NO_COLOR": "1"}, {"TERM": "dumb"}):
        assert "\x1b" not in CliRunner().invoke(cli, ["info", "nowhere"], color=True, env=off).stderr


class Terminal(io.StringIO):
    """What is written to a terminal."""

    def isatty(self):
        return True


def test_progress_counts_whole_frames(monkeypatch):
    """From the first second on, and however many there are."""
    sink = Terminal()
    monkeypatch.setattr("sys.stderr", sink)
    with ProgressBar(123_456, quiet=False) as bar:
        bar.reach(1_234, 123_456)
    assert "| 0/123456 [" in sink.getvalue()
    assert "1.23k" not in sink.getvalue()
    quiet = Terminal()
    monkeypatch.setattr("sys.stderr", quiet)
    with ProgressBar(10, quiet=True) as bar:
        bar.advance(5)
    assert quiet.getvalue() == ""
