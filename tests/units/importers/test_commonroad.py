"""CommonRoad: both versions, the choice of an ego, hostile XML."""

from __future__ import annotations

import math
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from scenicq.errors import DataError, Source
from scenicq.geometry.network import Network
from scenicq.importers.base import ImportOptions
from scenicq.importers.commonroad import CommonRoad
from scenicq.importers.ingest import ingest
from scenicq.importers.report import Report
from scenicq.match.matcher import Matcher
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import EXACT
from scenicq.match.verdict import Match, NoMatch
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.dataset import open_dataset
from scenicq.store.labels import Label

SAMPLE = Path(__file__).parents[3] / "sample_data" / "commonroad_tiny"
OLD, NEW = "ZAM_Tiny-1_1_T-1_2018b", "ZAM_Tiny-1_1_T-1_2020a"


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """A copy of the 2020a file alone."""
    (tmp_path / "source").mkdir()
    return Path(shutil.copy(SAMPLE / f"{NEW}.xml", tmp_path / "source"))


def labels_of(source: Path, target: Path, ego: str | None = None) -> list[Label]:
    ingest(source, target, ego=ego)
    return list(open_dataset(target).labels())


def test_both_versions_say_the_same(tmp_path: Path) -> None:
    labels = labels_of(SAMPLE, tmp_path / "d", "100")
    old, new = ([label for label in labels if label.recording == name] for name in (OLD, NEW))
    assert [label.objects for label in old] == [label.objects for label in new]
    assert [label.ego for label in old] == [label.ego for label in new]
    assert new[0].params == {"weather": "sunny"}


def test_what_is_not_exact_or_no_object_is_counted(file: Path, tmp_path: Path) -> None:
    shape = "<shape><rectangle><length>4.5</length><width>1.8</width></rectangle></shape>"
    start = (
        "<initialState><position><point><x>5</x><y>1</y></point></position><orientation><exact>0</exact></orientation>"
        "<time><exact>0</exact></time></initialState>"
    )
    area = "<occupancy>" + shape + "<time><exact>1</exact></time></occupancy>"
    more = (
        f'<dynamicObstacle id="900"><type>car</type>{shape}{start}<occupancySet>{area}{area}</occupancySet>'
        f'</dynamicObstacle><environmentObstacle id="901"><type>building</type>{shape}</environmentObstacle>'
        f'<phantomObstacle id="902"><occupancySet>{area}</occupancySet></phantomObstacle>'
        '<trafficLight id="903"/><newThing/>'
    )
    file.write_text(file.read_text().replace("</commonRoad>", f"{more}</commonRoad>"))
    summary = ingest(file, tmp_path / "d", ego="100")
    labels = list(open_dataset(tmp_path / "d").labels())
    assert [sum(member.track == "900" for member in label.objects) for label in labels] == [1, 0, 0, 0, 0, 0]
    counts = {entry.name: entry.count for entry in summary.left_out if entry.code == "not-read"}
    assert {
        "dynamicObstacle/occupancySet/occupancy": 2, "environmentObstacle": 1, "phantomObstacle": 1, "trafficLight": 1,
        "newThing": 1,
    }.items() <= counts.items()  # fmt: skip
    assert any("obstacle `900`: where it may be" in diagnostic.message for diagnostic in summary.diagnostics)


def test_map() -> None:
    source = CommonRoad().read(SAMPLE, ImportOptions(), Report())
    old, new = (Network(name, source.maps[name]) for name in (OLD, NEW))
    for network in (old, new):
        assert network.roadDirection.values(30, -1) == pytest.approx((-math.pi / 2,))
        assert [lane.id for lane in network.lanes] == ["1", "2", "3", "4"]
    assert (len(old.intersections), len(new.intersections)) == (0, 1)
    assert {lane.id for lane in new.intersections[0].lanes} == {"3", "4"}
    assert (len(old.crossings), len(new.crossings)) == (0, 1)
    assert new.lanes[0].group is not None
    assert new.lanes[0].group.opposite is new.lanes[1].group


@pytest.mark.parametrize(("ego", "track"), [("100", "100"), ("nearest", "101"), (None, "101")])
def test_which_object_is_the_ego(file: Path, tmp_path: Path, ego: str | None, track: str) -> None:
    labels = labels_of(file.parent, tmp_path / "d", ego)
    assert {label.ego.track for label in labels} == {track}
    assert all(label.ego.id == "ego" and len(label.objects) == 2 for label in labels)
    assert all(member.track != track for label in labels for member in label.objects)
    manifest = open_dataset(tmp_path / "d").manifest
    assert [entry.name for entry in manifest.left_out if entry.kept and entry.what == "recording"] == (
        ["no ego"] if ego is None else []
    )
    assert manifest.provenance.facts["ego"].startswith({"100": "track"}.get(ego or "", "the vehicle"))


def test_no_ego_is_no_ego(file: Path, tmp_path: Path) -> None:
    labels = labels_of(file.parent, tmp_path / "d", "none")
    assert not any(label.has_ego for label in labels)
    assert {label.ego.heading for label in labels} == {None}
    assert all({member.track for member in label.objects} == {"100", "101", "102"} for label in labels)
    dataset = open_dataset(tmp_path / "d")
    assert dataset.manifest.provenance.facts["ego"].startswith("none")
    source = Source("p", "model scenic.domains.driving.model\nego = new Car\nother = new Car\n")
    with pytest.raises(DataError, match="without an ego"):
        list(Query(dataset, source).results())
    found = list(Query(dataset, source, QueryOptions(MatchOptions(tolerance=EXACT, ego="any"))).results())
    assert len(found) == len(labels)
    for result in found:
        assert isinstance(result.verdict, Match)
        assert set(result.verdict.correspondence.values()) == {"100", "101"}
    matcher = Matcher(Query(dataset, source).compile(labels[0].map)[0], MatchOptions(tolerance=EXACT))
    verdict = matcher.match(labels[0])
    assert isinstance(verdict, NoMatch)
    assert (verdict.cause.what, verdict.cause.detail) == ("ego.class", "the source has no ego")


def test_an_ego_that_is_not_there(file: Path, tmp_path: Path) -> None:
    with pytest.raises(DataError) as error:
        ingest(file.parent, tmp_path / "d", ego="7")
    assert error.value.diagnostics[0].code == "dataset-empty"
    assert "track `7`" in str(error.value)


@pytest.mark.parametrize(
    ("old", "new", "what", "objects"),
    [
        ("<exact>2</exact>", "<exact>-2</exact>", "object", 15),
        ("<x>40.0</x><y>-5.0</y>", "", "object", 17),
        ("<width>1.9</width>", "<width>0</width>", "track", 12),
        ("<width>1.9</width>", "", "track", 12),
        ("<type>pedestrian</type>", "", "track", 12),
    ],
)
def test_an_unsound_obstacle_is_left_out(
    file: Path, tmp_path: Path, old: str, new: str, what: str, objects: int
) -> None:
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new))
    summary = ingest(file.parent, tmp_path / "d", ego="none")
    assert any(entry.what == what and entry.code == "record-invalid" for entry in summary.left_out)
    assert summary.objects == objects


def bomb(depth: int = 12) -> str:
    entities = "".join(f'<!ENTITY a{n} "{f"&a{n - 1};" * 10 if n else "ha" * 100}">' for n in range(depth))
    return f"<?xml version='1.0'?><!DOCTYPE commonRoad [{entities}]><commonRoad>&a{depth - 1};</commonRoad>"


HOSTILE: dict[str, Callable[[str], str]] = {
    "bomb": lambda text: bomb(),
    "file": lambda text: (
        '<?xml version="1.0"?><!DOCTYPE commonRoad [<!ENTITY x SYSTEM "file:///etc/passwd">]><commonRoad>&x;</commonRoad>'
    ),
    "cut": lambda text: text[: len(text) // 2],
    "deep": lambda text: text.replace("</commonRoad>", "<a>" * 200_000),
    "encoding": lambda text: text.replace("UTF-8", "no-such-encoding"),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_xml_is_one_diagnostic(file: Path, tmp_path: Path, name: str) -> None:
    file.write_text(HOSTILE[name](file.read_text()))
    with pytest.raises(DataError) as error:
        ingest(file.parent, tmp_path / "d", format="commonroad")
    assert len(error.value.diagnostics) <= 3
    assert {diagnostic.code for diagnostic in error.value.diagnostics} <= {
        "dataset-empty",
        "file-invalid",
        "file-missing",
    }
    assert "root:" not in str(error.value)
