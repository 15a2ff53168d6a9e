"""`scenicq.open` and what hangs on it: the same answers and the same errors as the command gives."""

import json
import subprocess
import sys
from xml.etree import ElementTree

import pytest

import scenicq
from scenicq.notebook.datasets import OpenedDataset

PEDESTRIAN = "ego = new Car; new Pedestrian at ego offset by Range(-10, 10) @ Range(0, 20)"


@pytest.fixture(scope="module")
def town(crossroads):
    return scenicq.open(crossroads)


@pytest.fixture
def crossing(scenarios):
    return scenarios / "02_crossing_cars.scenic"


def lines(run, *arguments):
    lines = [json.loads(line) for line in run("match", *arguments, "--exit-zero").stdout.splitlines()]
    return [{name: value for name, value in each.items() if name != "summary"} for each in lines]


def test_the_public_names_are_few_and_all_there():
    assert dir(scenicq) == sorted(scenicq.__all__)
    assert len(dir(scenicq)) <= 12
    assert all(getattr(scenicq, name) is not None for name in dir(scenicq))
    assert isinstance(scenicq.open, type(scenicq.ingest))


@pytest.mark.parametrize(
    ("options", "arguments"),
    [
        ({}, ()),
        ({"tolerance": "position=3,heading=60deg"}, ("--tolerance", "position=3,heading=60deg")),
        ({"every": True}, ("--all",)),
        ({"all_matches": True, "ego": "any"}, ("--all-matches", "--ego", "any")),
        ({"prefilter": False, "enforce": "collision"}, ("--no-prefilter", "--enforce", "collision")),
        ({"limit": 2}, ("--limit", "2")),
        ({"radius": 20.0, "classes": "coarse"}, ("--radius", "20", "--classes", "coarse")),
    ],
)
@pytest.mark.one_in(3)
def test_results_are_those_of_the_command(town, run, crossroads, crossing, options, arguments):
    expected = lines(run, crossing, crossroads, *arguments)
    found = town.match(crossing, **options)
    assert [each.record for each in found] == expected
    assert len(found) == len(expected)
    assert [each.frame for each in found[:2]] == [each["frame"] for each in expected[:2]]


def test_a_program_may_be_text_with_the_driving_model_implied(town, run, crossroads):
    expected = lines(run, "-e", PEDESTRIAN, crossroads, "--tolerance", "position=1")
    found = town.match(PEDESTRIAN, tolerance="position=1")
    assert [each.record for each in found] == expected
    assert expected
    assert str(town.match("model scenic.domains.driving.model\nego = new Car", limit=1)[0].frame)


def test_results_come_while_one_goes_through_them_and_are_kept(town, crossing):
    found = town.match(crossing)
    assert "not yet looked for" in repr(found)
    first = next(iter(found))
    assert len(found._found) == 1
    assert next(iter(found)) is first
    assert "1 results" in repr(found)
    assert first.frame in repr(first)


def test_a_table_has_a_field_a_role(town, crossing):
    found = town.match(crossing, every=True)
    table = found.to_arrow()
    assert table.column_names == [*("frame", "recording", "timestamp_us", "verdict"),
                                  *("correspondence", "witness", "lanes", "cause", "sensors")]  # fmt: skip
    assert [field.name for field in table.schema.field("correspondence").type] == ["ego", "leftward", "rightward"]
    assert table.column("frame").to_pylist() == [each.frame for each in found]
    by_hand = {"recording": found[0].recording, "verdict": found[0].verdict, "timestamp_us": found[0].timestamp_us}
    assert {name: table.column(name)[0].as_py() for name in by_hand} == by_hand


def test_pandas_is_used_where_it_is(town, crossing):
    pandas = pytest.importorskip("pandas", reason="pandas is not installed")
    frame = town.match(crossing).to_pandas()
    assert isinstance(frame, pandas.DataFrame)
    assert list(frame["correspondence"][0]) == ["ego", "leftward", "rightward"]


def test_explanations_are_those_of_the_command(town, run, crossroads, crossing):
    found = town.match(crossing)
    for frame in ("03-busy-intersection/09", "03-busy-intersection/08"):
        expected = run("explain", crossing, crossroads, frame, "--exit-zero").stdout
        assert f"{found.explain(frame)}\n" == expected
        assert repr(found.explain(frame)) == expected[:-1]
    assert found[0].explain() == found.explain(found[0].frame)
    assert found.explain("03-busy-intersection/08")._repr_html_().partition(">")[2].startswith("frame 03-busy")


def test_pictures_are_those_of_the_command(town, run, crossroads, crossing, tmp_path):
    shown = town.match(crossing).show("03-busy-intersection/09", width=900)
    expected = run("show", crossroads, "03-busy-intersection/09", "--scenario", crossing).stdout
    assert shown.svg == expected.rstrip("\n")
    plain = town["03-busy-intersection/09"]
    assert plain.show(width=900).svg == run("show", crossroads, "03-busy-intersection/09").stdout.rstrip("\n")
    shown.save(tmp_path / "frame.svg")
    ElementTree.parse(tmp_path / "frame.svg")
    assert len(repr(shown)) < 80
    for each in (plain, town.match(crossing)[0]):
        ElementTree.fromstring(each._repr_svg_())


def test_a_report_is_written(town, crossing, tmp_path):
    page = town.match(crossing).report(tmp_path / "pages")
    assert page == tmp_path / "pages" / "index.html"
    assert "03-busy-intersection" in page.read_text(encoding="utf-8")
    with pytest.raises(scenicq.ScenicqError, match="target-exists"):
        town.match(crossing).report(page.parent.parent)


def test_a_notebook_shows_counts_pictures_and_rows(town, crossing):
    shown = town.match(crossing)._repr_html_()
    assert "5 of 156 frames match, 0 unknown" in shown
    assert shown.count("<svg") >= 3
    assert shown.count("<tr>") == 1 + 5
    assert "<b>" not in town.match("ego = new Car; x = '<b>'")._repr_html_()


def test_frames_are_found_by_name(town):
    assert len(town) == 156
    assert len(list(town)) == 156
    assert "03-busy-intersection/09" in town
    assert "nowhere" not in town
    assert 3 not in town
    frame = town["03-busy-intersection/09"]
    assert (frame.name, frame.recording) == ("03-busy-intersection/09", "03-busy-intersection")
    assert f"{len(frame.objects)} objects" in repr(frame)
    assert town.maps == ("crossroads",)


def test_tables_can_be_asked_in_sql(town):
    assert town.sql("SELECT count(*) FROM labels").fetchall() == [(156,)]
    assert town.sql("SELECT count(*) FROM labels WHERE recording LIKE '03%'").fetchall() == [(26,)]


@pytest.mark.parametrize(
    ("question", "code"),
    [
        (lambda town: town.match("ego = new Caar"), "unknown-name"),
        (lambda town: town.match("nowhere.scenic"), "file-missing"),
        (lambda town: town.match(PEDESTRIAN, tolerance="position=x"), "option-invalid"),
        (lambda town: town.match(PEDESTRIAN, tolerence="position=1"), "option-invalid"),
        (lambda town: town.match(PEDESTRIAN, scenic="4"), "option-invalid"),
        (lambda town: town["nowhere"], "option-invalid"),
        (lambda town: town.sql("SELECT x FROM nowhere"), "sql-invalid"),
        (lambda town: town.sql("COPY labels TO 'stolen.csv'"), "sql-invalid"),
        (lambda town: scenicq.open("nowhere"), "store-missing"),
    ],
)
def test_every_error_is_a_scenicq_error_with_its_code(town, question, code):
    with pytest.raises(scenicq.ScenicqError) as caught:
        question(town)
    assert caught.value.diagnostics[0].code == code
    assert f"[{code}]" in str(caught.value)


def test_a_mistake_is_told_in_the_words_of_the_command(town, run, crossroads):
    with pytest.raises(scenicq.ScenicqError) as caught:
        town.match("ego = new Caar")
    assert run("match", "-e", "ego = new Caar", crossroads).stderr.strip() == str(caught.value)


@pytest.mark.slow
def test_a_script_needs_no_main_guard_for_several_processes(crossroads, tmp_path):
    script = tmp_path / "script.py"
    script.write_text(
        f"import scenicq\nprint('once')\nprint(len(scenicq.open({str(crossroads)!r}).match({PEDESTRIAN!r}, "
        "tolerance='position=1', jobs=2)))\n"
    )
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, timeout=200, check=False)
    assert done.stderr == ""
    assert done.stdout.splitlines() == ["once", str(len(OpenedDataset.match(scenicq.open(crossroads), PEDESTRIAN,
                                                                           tolerance="position=1")))]  # fmt: skip
