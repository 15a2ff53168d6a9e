"""What a program sets and no label has is named with its line; what some labels lack is counted."""

import json

import pytest

from scenicq.errors import ScenarioError, Source
from scenicq.importers.ingest import ingest
from scenicq.match.options import MatchOptions
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.dataset import open_dataset

MAP = {
    "type": "FeatureCollection",
    "features": [
        {
            "type": "Feature",
            "geometry": {"type": "Polygon", "coordinates": [[[-50, -50], [50, -50], [50, 50], [-50, 50], [-50, -50]]]},
            "properties": {"id": "all", "kind": "drivable"},
        }
    ],
}
PLACED = "in everywhere, facing Range(0, 360) deg"


def box(name, x, category="Car", **more):
    return {"id": name, "class": category, "position": [x, 0.0], "heading": 0.0, "length": 4.0, "width": 2.0, **more}


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    """Two frames: speeds of some cars, colours of some cars, weather in one frame, nothing of people."""
    folder = tmp_path_factory.mktemp("source")
    (folder / "maps").mkdir()
    (folder / "maps" / "town.geojson").write_text(json.dumps(MAP))
    labels = [
        {
            "id": f"f{number}", "recording": "r", "timestamp_us": number, "map": "town",
            "ego": box("ego", 0.0),
            "objects": [
                box("a", 10.0, attributes={"colour": "red"}, **({"velocity": [5.0, 0.0]} if number else {})),
                box("p", 5.0, "Pedestrian"),
            ],
            **({"params": {"weather": "rain"}} if number else {}),
        }
        for number in range(2)
    ]  # fmt: skip
    (folder / "labels.jsonl").write_text("".join(json.dumps(label) + "\n" for label in labels))
    description = {"name": "tiny", "interchange": 1, "angle": "heading", "classes": "scenic"}
    (folder / "dataset.json").write_text(json.dumps(description))
    target = tmp_path_factory.mktemp("datasets") / "tiny"
    ingest(folder, target)
    return open_dataset(target)


def asked(dataset, text, **options):
    source = Source("p.scenic", f"model scenic.domains.driving.model\nego = new Car {PLACED}\n{text}\n")
    return Query(dataset, source, QueryOptions(solver="portable", **options))


@pytest.mark.parametrize(
    ("line", "named"),
    [
        (f"new Pedestrian {PLACED}, with speed Range(0, 2)", ["Pedestrian#1.speed"]),
        (f"new Car {PLACED}, with spede 3", ["Car#2.spede"]),
        (f"new Car {PLACED}, with color (1, 0, 0)", ["Car#2.color"]),
        (f"new Car {PLACED}, with tags ['a', 'b']", ["Car#2.tags"]),
        (f"new Car {PLACED}, with colour 'red', with speed 5, with width Range(1, 3)", []),
        ("param weather = 'rain', hour = 12", ["param hour"]),
        (f"class Slow(Pedestrian):\n    speed: 1\nnew Slow {PLACED}", ["Slow#1.speed"]),
        (f"p = new Pedestrian {PLACED}\nrequire p.speed < 1", ["p.speed"]),
        (f"p = new Car {PLACED}, with gap Range(1, 2)\nrequire p.gap > 1.5", []),
        (f"new Car {PLACED}, with requireVisible False, with allowCollisions True, with viewAngle 1", []),
        # the ego has none of its own either, but that of its track
        (f"ego = new Car {PLACED}, with speed 3", []),
    ],
)
def test_what_no_label_has_is_named(dataset, line, named):
    found = asked(dataset, line).coverage()
    assert [each.message.split("`")[1] for each in found.warnings] == named
    assert {each.code for each in found.warnings} <= {"never-compared"}
    assert all(each.span is not None and each.span.source.name == "p.scenic" for each in found.warnings)


def test_it_says_what_labels_have_and_a_near_spelling(dataset):
    (found,) = asked(dataset, f"new Car {PLACED}, with color 'red'").coverage().warnings
    assert found.hints == (
        "the labels have of `Car`: heading, width, length, velocity, speed, colour",
        "`colour` is spelled nearly like it",
    )
    (found,) = asked(dataset, f"new Pedestrian {PLACED}, with spede 1").coverage().warnings
    assert found.hints[1] == "`speed` is spelled nearly like it, which the labels do not have either"


def test_what_some_labels_lack_is_counted_in_frames(dataset):
    query = asked(dataset, f"c = new Car {PLACED}, with speed Range(4, 6)\nparam weather = 'rain'")
    assert query.coverage().warnings == ()
    list(query.results())
    assert query.funnel.missing == {"c.speed": 1, "param weather": 1}


def test_a_run_has_the_warning_and_matches_as_before(dataset):
    query = asked(dataset, f"new Pedestrian {PLACED}, with speed Range(50, 60)")
    assert [result.frame for result in query.results()] == ["f0", "f1"]
    assert [each.code for each in query.funnel.warnings] == ["never-compared"]


def test_strict_makes_it_an_error(dataset):
    query = asked(dataset, f"new Pedestrian {PLACED}, with speed 1", strict=True)
    with pytest.raises(ScenarioError) as caught:
        list(query.results())
    assert [(each.code, each.severity) for each in caught.value.diagnostics] == [("never-compared", "error")]


def test_the_command_says_it_always_and_strict_stops_it(dataset, run, tmp_path):
    file = tmp_path / "p.scenic"
    file.write_text(f"model scenic.domains.driving.model\nego = new Car {PLACED}\nnew Car {PLACED}, with spede 3\n")
    for more in ([], ["--quiet"], ["--summary"]):
        done = run("match", file, dataset.folder, *more)
        assert done.exit_code == 0
        assert done.stdout.count("\n") == 2
        assert done.stderr.count("warning[never-compared]: `Car#2.spede` is never compared") == 1
        assert "p.scenic:3:" in done.stderr
    done = run("match", file, dataset.folder, "--strict")
    assert (done.exit_code, done.stdout) == (2, "")
    assert "error[never-compared]" in done.stderr
    assert "never-compared" in run("explain", file, dataset.folder, "f1").stderr
    done = run("check", file, dataset.folder)
    assert (done.exit_code, "warning[never-compared]" in done.stderr) == (0, True)
    assert "unknown-property" not in done.stderr
    assert run("check", file, dataset.folder, "--strict").exit_code == 2
    assert "warning[unknown-property]" in run("check", file).stderr


def test_match_says_in_a_line_what_cannot_be_meant(dataset, run, tmp_path):
    file = tmp_path / "p.scenic"
    file.write_text("model scenic.domains.driving.model\nego = new Car in everywhere, facing 90\nspare = 1\n")
    done = run("match", file, dataset.folder, "--exit-zero")
    lines = done.stderr.splitlines()
    assert lines[0].startswith("warning[angle-without-deg]: ")
    assert lines[1].startswith("warning[unused-variable]: ")
    assert "scenicq check" in lines[2]
    assert run("match", file, dataset.folder, "--strict").exit_code == 2


def test_a_heading_along_lanes_that_the_map_has_not_is_told(dataset, run, tmp_path):
    file = tmp_path / "p.scenic"
    file.write_text(f"model scenic.domains.driving.model\nego = new Car {PLACED}\nnew Car at ego offset by 0 @ 5\n")
    done = run("match", file, dataset.folder)
    assert done.exit_code == 2
    assert "error[map-lacks]: the map `town` has no lane whose direction `roadDirection` could be" in done.stderr
    assert "the default heading of `Car` needs lanes" in done.stderr
    assert "`facing Range(0, 360) deg` needs nothing from the map" in done.stderr
    file.write_text(file.read_text().replace("0 @ 5", "0 @ 5, facing Range(0, 360) deg"))
    assert run("match", file, dataset.folder, "--exit-zero").exit_code == 0


def over_time(tmp_path, text, **more):
    source = tmp_path / "source"
    (source / "maps").mkdir(parents=True)
    (source / "maps" / "town.geojson").write_text(json.dumps(MAP))
    labels = [
        {
            "id": f"f{number}", "recording": "r", "timestamp_us": 500_000 * number, "map": "town",
            "ego": box("ego", 0.0), "objects": [box(f"a{number}", 10.0, **more)],
        }
        for number in range(4)
    ]  # fmt: skip
    (source / "labels.jsonl").write_text("".join(json.dumps(label) + "\n" for label in labels))
    header = {"name": "d", "interchange": 1, "angle": "heading", "classes": "scenic"}
    (source / "dataset.json").write_text(json.dumps(header))
    ingest(source, tmp_path / "d")
    return [
        (each.code, each.message)
        for each in Query(open_dataset(tmp_path / "d"), Source("p.scenic", text), QueryOptions()).coverage().warnings
    ]


PAIR = f"ego = new Object {PLACED}\nother = new Object {PLACED}\n"


def test_objects_without_tracks_are_told_where_they_matter(tmp_path):
    distance = PAIR + "require always (distance to other) < 20"
    assert [code for code, _ in over_time(tmp_path / "1", distance)] == ["no-tracks"]
    assert over_time(tmp_path / "2", distance, track="t") == []
    assert over_time(tmp_path / "3", PAIR) == []
    assert over_time(tmp_path / "4", f"ego = new Object {PLACED}\nterminate when ego.position.x > 3") == []


def test_what_a_condition_over_time_reads_and_no_label_has_is_told(tmp_path):
    speed = PAIR + "terminate when other.speed > 2"
    assert [code for code, _ in over_time(tmp_path / "1", speed)] == ["no-tracks", "never-compared"]
    assert over_time(tmp_path / "2", speed, track="t") == []


def test_the_report_names_it_with_its_line(dataset, run, tmp_path):
    file = tmp_path / "p.scenic"
    file.write_text(f"model scenic.domains.driving.model\nego = new Car {PLACED}\nnew Car {PLACED}, with spede 3\n")
    assert run("match", file, dataset.folder, "--report", tmp_path / "pages").exit_code == 0
    page = (tmp_path / "pages" / "index.html").read_text()
    assert "`Car#2.spede` is never compared" in page
    assert "p.scenic:3:" in page
    assert "the labels have of `Car`: heading, width, length, velocity, speed, colour" in page


@pytest.mark.parametrize(("category", "classes", "hints"), [
    ("Vehicle", "fine", None), ("Car", "fine", None), ("Pedestrian", "fine", None),
    ("Child", "fine", ["2 are of class `Pedestrian`", "`--classes coarse`"]), ("Bus", "fine", ["`--classes coarse`"]),
    ("Cone", "fine", []), ("Child", "coarse", None), ("Bus", "coarse", None), ("Cone", "coarse", []),
])  # fmt: skip
def test_a_class_that_no_label_object_has_is_told_with_what_may_be_such(dataset, category, classes, hints):
    query = asked(dataset, f"new {category} {PLACED}", match=MatchOptions(classes=classes))
    found = query.coverage().warnings
    assert [each.code for each in found] == ([] if hints is None else ["class-absent"])
    for each in found:
        assert len(each.hints) == len(hints)
        assert all(hint.startswith(start) for hint, start in zip(each.hints, hints, strict=True))
    if hints is not None:
        assert not list(query.results())


def test_the_ego_of_a_label_is_no_label_object(dataset):
    query = Query(
        dataset, Source("p.scenic", f"model scenic.domains.driving.model\nego = new Bus {PLACED}\n"), QueryOptions()
    )
    assert query.coverage().warnings == ()
