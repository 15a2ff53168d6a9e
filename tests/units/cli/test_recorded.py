"""`--where` and `--sort` on what a program records, and every way on which recorded values are handed on."""

from __future__ import annotations

import csv
import io
import json
import random
from collections.abc import Callable

import pytest

from scenicq.errors import DataError
from scenicq.notebook.datasets import open as open_for_python
from scenicq.query.execution.recorded_columns import RecordedColumn
from scenicq.query.execution.result_files import read_records, read_results
from scenicq.query.execution.result_selection import read_sort, read_where
from scenicq.store.labels import Label, LabelObject, Recording
from scenicq.store.writer import write_dataset

PLACE = "at (Range(-99, 99), Range(-99, 99)), facing Range(-180, 180) deg"
PROGRAM = f"""ego = new Object {PLACE}
c = new Object {PLACE}
record (distance to c) as gap
record c.speed as speed
record (distance to c) < 5 as near
record ("left" if c.position.x < 0 else "right") as side
record c.position as place
"""
UNSEEN = {2, 5}
"""Frames without a speed."""


@pytest.fixture(scope="module")
def town(tmp_path_factory):
    """Ten recordings of one frame, with something at 9, 8, 7, ... metres."""
    folder = tmp_path_factory.mktemp("recorded") / "town"
    made = []
    for n in range(10):
        ego = LabelObject("ego", "Car", "car", 0.0, 0.0, 0.0, 2.0, 4.0, velocity=(0.0, 0.0))
        moves = None if n in UNSEEN else (float(n), 0.0)
        there = LabelObject("o", "Car", "car", (9.0 - n) * (-1) ** n, 0.0, 0.0, 2.0, 4.0, velocity=moves)
        made.append(Recording(f"r{n}", "m", (Label(f"f{n}", f"r{n}", n * 1000, "m", ego, (there,)),)))
    write_dataset(folder, made, {}, name="town")
    return folder


@pytest.fixture
def program(tmp_path):
    file = tmp_path / "p.scenic"
    file.write_text(PROGRAM)
    return file


def frames(result) -> list[str]:
    return [json.loads(line)["frame"] for line in result.stdout.splitlines()]


def test_where_takes_what_is_known_to_hold(run, town, program):
    result = run("match", program, town, "--where", "gap < 5 and not (side == 'left')", "--summary")
    assert frames(result) == ["f6", "f8", "f9"]
    assert "7  left out by --where" in result.stderr
    assert result.exit_code == 0
    assert run("match", program, town, "--where", "gap < 0").exit_code == 1


def test_what_is_not_known_is_left_out_counted_and_told(run, town, program):
    result = run("match", program, town, "--where", "speed > 3", "--summary")
    assert frames(result) == ["f4", "f6", "f7", "f8", "f9"]
    assert "2 matches left out: whether --where holds is not known" in result.stderr
    assert "5  left out by --where, 2 of which it is not known" in result.stderr
    assert "`speed` is recorded as null 2 times: not observed" in result.stderr
    assert result.exit_code == 3
    # what decides it is known
    either = run("match", program, town, "--where", "speed > 3 or gap == 7")
    assert frames(either) == ["f2", "f4", "f6", "f7", "f8", "f9"]


def test_sort_goes_up_or_down_and_what_has_no_value_comes_last(run, town, program):
    assert frames(run("match", program, town, "--sort", "gap")) == [f"f{n}" for n in range(9, -1, -1)]
    down = frames(run("match", program, town, "--sort", "speed:desc"))
    assert down == ["f9", "f8", "f7", "f6", "f4", "f3", "f1", "f0", "f2", "f5"]
    assert frames(run("match", program, town, "--sort", "near:desc", "--limit", 3)) == ["f5", "f6", "f7"]


def test_the_limit_counts_what_is_shown_and_the_summary_says_what_is_not(run, town, program, tmp_path):
    file = tmp_path / "a.jsonl"
    assert frames(run("match", program, town, "--where", "gap < 6", "--limit", 2)) == ["f4", "f5"]
    result = run("match", program, town, "--where", "gap < 6", "--sort", "gap", "--limit", 2, "-o", file)
    assert [each.frame for each in read_records(file)] == ["f9", "f8"]
    summary = read_results(file).completeness.summary
    assert not summary.complete
    assert (summary.left_out, summary.where, summary.sort, summary.limit) == (8, "gap < 6", "gap", 2)
    assert read_results(file).completeness.why_silent("r0", 0, "f0").startswith("may be left out by --where 'gap < 6'")
    assert result.exit_code == 0


@pytest.mark.parametrize(
    ("option", "value", "told"),
    [
        ("--where", "gapp < 5", "the program records no `gapp`"),
        ("--where", "gap", "--where needs a condition"),
        ("--where", "gap < 'x'", "a number is compared with a text"),
        ("--where", "side < 'x'", "a text is neither less nor greater"),
        ("--where", "gap < 5; near", "--where takes one condition"),
        ("--where", "gap in (1, 2)", "`in` cannot stand in --where"),
        ("--where", "open('x')", "this cannot stand in --where"),
        ("--where", "().__class__ == 3", "this cannot stand in --where"),
        ("--where", "gap.__class__ == 3", "the program records no `gap.__class__`"),
        ("--where", "gap + 1 < 5", "this cannot stand in --where"),
        ("--where", "gap <", "an expression is missing"),
        ("--where", "(" * 5000, ""),
        ("--sort", "place", "`place` is no number"),
        ("--sort", "gap:down", "--sort goes up or down"),
        ("--sort", "nothing", "the program records no `nothing`"),
    ],
)
def test_what_makes_no_sense_is_refused(run, town, program, option, value, told):
    result = run("match", program, town, option, value)
    assert (result.exit_code, result.stdout) == (2, "")
    assert told in result.stderr
    assert "error[" in result.stderr
    assert "Traceback" not in result.stderr


def test_an_interval_has_parts(run, town, program):
    told = run("match", program, town, "--min-duration", "0.1", "--where", "gap < 5")
    assert told.exit_code == 2
    assert "`gap` has a value at each sample of an interval" in told.stderr
    assert "`gap.minimum`" in told.stderr
    assert run(
        "match", program, town, "--min-duration", "0", "--where", "gap.minimum < 3", "--sort", "gap.mean"
    ).exit_code in (0, 1)


Truth = bool | None
COLUMNS = (
    RecordedColumn("a", "number", series=False), RecordedColumn("b", "number", series=False),
    RecordedColumn("t", "truth", series=False), RecordedColumn("s", "number", series=True),
)  # fmt: skip


def drawn(draw: random.Random, depth: int) -> tuple[str, Callable[[dict], Truth]]:
    """A condition, and what it is by tables of three truth values."""
    kind = draw.randrange(2 if depth == 0 else 5)
    if kind == 0:
        return "t", lambda cells: cells["t"]
    if kind == 1:
        sign, (left, right) = draw.choice(["<", "<=", "==", "!="]), draw.sample(["a", "b", "s.maximum", "2"], 2)

        def compared(cells: dict) -> Truth:
            one, other = (2 if each == "2" else cells[each] for each in (left, right))
            if one is None or other is None:
                return None
            return {"<": one < other, "<=": one <= other, "==": one == other, "!=": one != other}[sign]

        return f"{left} {sign} {right}", compared
    text, holds = drawn(draw, depth - 1)
    if kind == 2:
        return f"not ({text})", lambda cells: {True: False, False: True, None: None}[holds(cells)]
    other_text, other_holds = drawn(draw, depth - 1)
    word, order = ("and", [False, None, True]) if kind == 3 else ("or", [True, None, False])
    return f"({text}) {word} ({other_text})", lambda c: order[min(order.index(holds(c)), order.index(other_holds(c)))]


def test_conditions_are_those_of_three_truth_values():
    draw = random.Random(4)
    for _ in range(400):
        text, holds = drawn(draw, 3)
        condition = read_where(text, COLUMNS)
        for _ in range(6):
            cells = {name: draw.choice([None, 1.0, 2.0, 3.0]) for name in ("a", "b", "s.maximum")}
            cells["t"] = draw.choice([None, True, False])
            assert condition.truth(cells) is holds(cells), (text, cells)


def test_sort_reads_names_of_parts():
    assert read_sort("s.mean:desc", COLUMNS).descending
    with pytest.raises(DataError, match="has a value at each sample"):
        read_sort("s", COLUMNS)


def test_pieces_carry_what_is_recorded(run, town, program, tmp_path):
    plain = run("match", program, town).stdout
    folder = tmp_path / "pieces"
    for shard in ("1/2", "2/2"):
        run("match", program, town, "--shard", shard, "-o", folder)
    assert run("gather", folder).stdout == plain
    kept = tmp_path / "kept.jsonl"
    assert run("match", program, town, "--resume", "-o", kept).exit_code == 0
    assert kept.read_text() == plain
    told = [json.loads(line)["recorded"] for line in plain.splitlines()]
    rows = list(csv.DictReader(io.StringIO(run("gather", folder, "--format", "csv").stdout)))
    assert [json.loads(row["recorded.gap"]) for row in rows] == [each["gap"] for each in told]
    assert [row["recorded.speed"] for row in rows].count("") == len(UNSEEN)
    assert rows[2]["recorded.side"] == '"right"'
    found = open_for_python(town).match(PROGRAM)
    assert [each.recorded["gap"] for each in found] == [each["gap"] for each in told]
    table = found.to_arrow()
    assert table.column("recorded").to_pylist()[0]["gap"] == told[0]["gap"]


def test_ids_need_none_and_where_needs_them(run, town, program):
    assert run("match", program, town, "--format", "ids").stdout.split() == [f"f{n}" for n in range(10)]
    assert run("match", program, town, "--format", "ids", "--where", "near").stdout.split() == [
        "f5",
        "f6",
        "f7",
        "f8",
        "f9",
    ]


def test_what_cannot_be_recorded_is_told(run, town, tmp_path):
    file = tmp_path / "q.scenic"
    file.write_text(f"{PROGRAM}record ego as me\nrecord c.speed every 2 seconds as gap\n")
    told = run("match", file, town)
    assert told.exit_code == 0
    assert told.stderr.count("warning[not-recorded]") == 3
    for part in ("`me` is not recorded", "two values are recorded as `gap`", "`every` of `record` is left out"):
        assert part in told.stderr
    assert "me" not in json.loads(told.stdout.splitlines()[0])["recorded"]
    assert "warning[not-recorded]" in run("check", file).stderr
    strict = run("match", file, town, "--strict")
    assert strict.exit_code in (0, 2)


def test_a_report_shows_values_and_curves(run, tmp_path):
    folder = tmp_path / "moves"
    labels = []
    for k in range(6):
        ego = LabelObject("ego", "Car", "car", 0.0, 0.0, 0.0, 2.0, 4.0, velocity=(0.0, 0.0))
        there = LabelObject(f"o{k}", "Car", "car", 9.0 - k, 0.0, 0.0, 2.0, 4.0, velocity=(1.0, 0.0), track="t")
        labels.append(Label(f"f{k}", "r", k * 500_000, "m", ego, (there,)))
    write_dataset(folder, [Recording("r", "m", tuple(labels))], {}, name="moves")
    file = tmp_path / "p.scenic"
    file.write_text(PROGRAM)
    run("match", file, folder, "--min-duration", "1", "--report", tmp_path / "a", "-o", tmp_path / "a.jsonl")
    page = (tmp_path / "a" / "index.html").read_text()
    assert page.count('class="curve"') == 3  # gap, speed, near
    assert "gap: 4 to 9" in page
    run("match", file, folder, "--report", tmp_path / "b", "-o", tmp_path / "b.jsonl")
    assert "<code>side</code>" in (tmp_path / "b" / "index.html").read_text()
