"""Two result files compared."""

import json

import pytest
from msgspec import structs

from scenicq.errors import DataError
from scenicq.query.execution.records import json_text, record_of
from scenicq.query.execution.result_files import read_results
from scenicq.report.changes import changes, changes_page, changes_text, check_datasets


def _line(frame, verdict="match", recording="r", time=0, **more):
    roles = {"ego": "ego", "car": more.pop("car", "a")} if verdict == "match" else {}
    return {
        "frame": frame,
        "recording": recording,
        "timestamp_us": time,
        "verdict": verdict,
        "correspondence": roles,
        **more,
    }


@pytest.fixture
def files(tmp_path):
    before = [_line("stay", time=3), _line("go", time=1), _line("swap", time=2), _line("no", "no_match")]
    cause = {"what": "car.position", "detail": "2 m off"}
    after = [
        _line("stay", time=3),
        _line("swap", time=2, car="b"),
        _line("new", recording="q"),
        _line("go", "no_match", time=1, cause=cause),
        _line("stay", time=3, car="z"),
    ]
    paths = (tmp_path / "a.jsonl", tmp_path / "b.jsonl")
    for path, records in zip(paths, (before, after), strict=True):
        path.write_text("\n".join(map(json.dumps, records)) + "\n")
    return paths


def test_what_came_went_and_stayed(files):
    found = changes(*map(read_results, files))
    assert [(each.kind, each.frame) for each in found] == [
        ("came", "new"),
        ("went", "go"),
        ("recast", "swap"),
        ("stayed", "stay"),
    ]
    assert found[1].why == "no match: car.position, 2 m off"
    same = changes(read_results(files[0]), read_results(files[0]))
    assert {each.kind for each in same} == {"stayed"}


def test_text_and_page(files):
    found = changes(*map(read_results, files))
    text = changes_text(found)
    assert "  - go  car=a; in B no match: car.position, 2 m off" in text
    assert "  ~ swap  car=a -> car=b" in text
    assert "stay  " not in text
    assert "  = stay  car=a" in changes_text(found, every=True)
    page = changes_page(found, ("<a>", "b"))
    assert "&lt;a&gt;" in page
    assert "script-src &#39;none&#39;" in page
    assert "<script" not in page


@pytest.mark.parametrize("text", ["{", "[1]", '{"frame": 1}', '{"frame": "a", "recording": "b"}'])
def test_other_files_are_refused(tmp_path, text):
    file = tmp_path / "x.jsonl"
    file.write_text(text)
    with pytest.raises(DataError, match=r"line 1 is"):
        read_results(file)


@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_every_format_of_match_is_read(run, crossroads, scenarios, tmp_path, kind):
    scenario = scenarios / "02_crossing_cars.scenic"
    for name in ("lines.jsonl", f"cells.{kind}"):
        assert run("match", scenario, crossroads, "--all", "-o", tmp_path / name).exit_code == 0
    lines, cells = read_results(tmp_path / "lines.jsonl"), read_results(tmp_path / f"cells.{kind}")
    found = changes(lines, cells)
    assert {each.kind for each in found} == {"stayed"}
    assert [each.frame for each in found] == [each.frame for each in changes(lines, lines)]
    lines, cells = lines.records, cells.records
    assert lines.keys() == cells.keys()
    for frame, record in lines.items():
        for key in ("recording", "timestamp_us", "verdict", "correspondence"):
            assert getattr(cells[frame], key) == getattr(record, key)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.parquet", b"PAR1 nothing of the kind"),
        ("a.csv", b"frame,recording\n1,2\n"),
        ("a.csv", b'frame,recording,verdict,correspondence\na,b,match,"{"\n'),
        ("a.csv", b'frame,recording\n"a\x00,'),
        ("a.csv", b"\xff\xfe"),
    ],
)
def test_broken_tables_are_refused(tmp_path, name, content):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(DataError, match=r"file-invalid"):
        read_results(tmp_path / name)


def test_missing_files_are_told(tmp_path):
    with pytest.raises(DataError, match=r"file-missing"):
        read_results(tmp_path / "none.jsonl")
    (tmp_path / "b.jsonl").write_bytes(b"\xff\xfe")
    with pytest.raises(DataError, match=r"UTF-8"):
        read_results(tmp_path / "b.jsonl")


def test_results_of_different_datasets_are_refused():
    def of(*records):
        return {each["frame"]: record_of(each) for each in records}

    mine = of(_line("a", time=1), _line("b", time=2))
    assert check_datasets(mine, of(_line("a", time=1))) is None
    assert check_datasets({}, {}) is None
    for pair, empty in (((mine, {}), "B"), (({}, mine), "A")):
        told = check_datasets(*pair)
        assert told is not None
        assert (told.severity, told.message[:1]) == ("warning", empty)
    for other in (_line("a", time=5), _line("a", time=1, recording="q")):
        with pytest.raises(DataError, match="of different datasets"):
            check_datasets(mine, of(other))
    for name, refused in (("town@1", False), ("town@2", False), ("city@1", True)):
        named = of(_line("a", time=1, dataset=name)), of(_line("a", time=1, dataset="town@1"))
        if refused:
            with pytest.raises(DataError, match=r"different datasets: A is of city \(version 1\), B of town"):
                check_datasets(*named)
        else:
            told = check_datasets(*named)
            assert (told is None) == (name == "town@1")
            assert told is None or told.severity == "warning"
    assert check_datasets(of(_line("a", time=1, dataset="town@1")), mine) is None
    with pytest.raises(DataError, match="of different datasets"):
        check_datasets(of(_line("a", time=1, dataset="town@1")), of(_line("a", time=2, dataset="town@2")))
    doubt = check_datasets(mine, of(_line("z", recording="q")))
    assert doubt is not None
    assert doubt.severity == "warning"


@pytest.mark.parametrize("kind", ["jsonl", "csv", "parquet"])
def test_every_format_names_its_dataset(run, crossroads, scenarios, tmp_path, kind):
    file = tmp_path / f"a.{kind}"
    assert run("match", scenarios / "02_crossing_cars.scenic", crossroads, "-o", file).exit_code == 0
    other = tmp_path / "b.jsonl"
    frame = next(iter(read_results(file).records.values()))
    other.write_text(json_text(structs.replace(frame, dataset="elsewhere@00000000")) + "\n")
    done = run("report", file, other)
    assert (done.exit_code, done.stdout) == (2, "")
    assert "different datasets: A is of crossroads" in done.stderr
    assert "B of elsewhere" in done.stderr


def test_the_command_refuses_them(run, tmp_path):
    paths = (tmp_path / "a.jsonl", tmp_path / "b.jsonl")
    for time, path in enumerate(paths):
        path.write_text(json.dumps(_line("f", time=time)) + "\n")
    done = run("report", *paths)
    assert (done.exit_code, done.stdout) == (2, "")
    assert "different datasets" in done.stderr


def test_intervals_are_compared_by_where_they_start(run, tmp_path):
    def interval(recording, start, end, roles):
        frames = {"first": "a", "last": "b", "count": 2}
        return {"recording": recording, "start_us": start, "end_us": end, "frames": frames, "verdict": "match",
                "correspondence": roles}  # fmt: skip

    same, other = {"ego": "ego", "car": "t"}, {"ego": "ego", "car": "u"}
    before = [interval(name, 1, 5, same) for name in "pqrs"]
    after = [interval("p", 1, 5, same), interval("q", 1, 7, same), interval("r", 1, 5, other)]
    after.append(interval("s", 2, 5, same))
    for name, records in (("a", before), ("b", after)):
        (tmp_path / f"{name}.jsonl").write_text("".join(json.dumps(each) + "\n" for each in records))
    done = run("report", tmp_path / "a.jsonl", tmp_path / "b.jsonl", "--all")
    assert done.exit_code == 0
    for line in ("= p@1  car=t", "~ q@1  car=t; in B ends at 7, in A at 5", "~ r@1  car=t -> car=u", "- s@1  car=t",
                 "+ s@2  car=t"):  # fmt: skip
        assert line in done.stdout
    (tmp_path / "c.jsonl").write_text(json.dumps(_line("f")) + "\n")
    refused = run("report", tmp_path / "a.jsonl", tmp_path / "c.jsonl")
    assert (refused.exit_code, "not comparable with intervals" in refused.stderr) == (2, True)
