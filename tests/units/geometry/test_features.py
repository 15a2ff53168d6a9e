"""Reading interchange map features: what is unsound is reported and left out, never silently mended."""

# pyright: basic

import json
from pathlib import Path
from typing import Any

import pytest

from scenicq.errors import DataError
from scenicq.geometry.features import MapFeature, names, read_geojson
from scenicq.geometry.shapes import from_geojson, plain_polygons

SQUARE = {"type": "Polygon", "coordinates": [[[0, 0], [4, 0], [4, 4], [0, 4], [0, 0]]]}
BOWTIE = {"type": "Polygon", "coordinates": [[[0, 0], [4, 4], [4, 0], [0, 4], [0, 0]]]}
LINE = {"type": "LineString", "coordinates": [[0, 0], [4, 0]]}


def feature(geometry: Any = SQUARE, **properties: Any) -> dict[str, Any]:
    return {"type": "Feature", "geometry": geometry, "properties": {"id": "a", "kind": "lane"} | properties}


def read(*entries: Any) -> tuple[tuple[MapFeature, ...], list[tuple[str, str]]]:
    problems: list[tuple[str, str]] = []
    features = read_geojson(
        {"type": "FeatureCollection", "features": list(entries)},
        lambda identifier, message: problems.append((identifier, message)),
    )
    return features, problems


def test_a_sound_feature_keeps_its_properties() -> None:
    (found,), problems = read(feature(centerline=[[[2, 0, 7], [2, 4, 7]]], speed=30))
    assert problems == []
    assert (found.id, found.kind, found.shape.area) == ("a", "lane", 16)
    assert found.properties == {"centerline": [[[2.0, 0.0], [2.0, 4.0]]], "speed": 30}


def test_a_single_polyline_is_a_list_of_one() -> None:
    (found,), _ = read(feature(centerline=[[2, 0], [2, 4]]))
    assert found.properties["centerline"] == [[[2.0, 0.0], [2.0, 4.0]]]


@pytest.mark.filterwarnings("ignore:invalid value encountered:RuntimeWarning")
@pytest.mark.parametrize(
    ("entry", "identifier", "message"),
    [
        (None, "", "no properties"),
        ({"geometry": SQUARE}, "", "no properties"),
        (feature(id=None), "", "no id"),
        (feature(id=""), "", "no id"),
        (feature(id=True), "", "no id"),
        (feature(kind=None), "a", "no kind"),
        (feature(BOWTIE), "a", "not valid: Self-intersection"),
        (feature(LINE), "a", "a lane is a Polygon or MultiPolygon, this is LineString"),
        (feature(SQUARE, kind="curb"), "a", "a curb is a LineString"),
        (feature(None), "a", "no geometry"),
        (feature({"type": "Polygon"}), "a", "cannot be read"),
        (feature({"type": "Polygon", "coordinates": [[[0, 0], [1, 1]]]}), "a", "cannot be read"),
        (feature({"type": "Polygon", "coordinates": [[["x", 0], [1, 1], [2, 0]]]}), "a", "cannot be read"),
        (feature({"type": "Polygon", "coordinates": []}), "a", "empty"),
        (feature({"type": "Polygon", "coordinates": [[[0, 0], [float("nan"), 0], [1, 1], [0, 0]]]}), "a", "not finite"),
        (feature(centerline=[[[0, 0], [float("inf"), 1]]]), "a", "not finite"),
        (feature(centerline=[[[0, 0]]]), "a", "less than two points"),
        (feature(centerline=[[[0, 0], [1]]]), "a", "less than two points"),
        (feature(centerline="north"), "a", "not a list of polylines"),
        (feature(centerline=7), "a", "not a list of polylines"),
        (feature(successors=[1, 2]), "a", "neither an id nor a list"),
        (feature(left={"id": "b"}), "a", "neither an id nor a list"),
    ],
)
def test_unsound_features_are_reported_and_left_out(entry: Any, identifier: str, message: str) -> None:
    features, ((blamed, text),) = read(entry, feature(id="sound"))
    assert [found.id for found in features] == ["sound"]
    assert blamed == identifier
    assert message in text
    assert text.startswith("feature 1: ")


RINGS: dict[str, tuple[Any, bool]] = {
    "plain": ([[[0.5, 0], [4, 0], [4, -0.0], [0, 4e300], [0.5, 0]]], True),
    "whole numbers": ([[[0, 0], [10**30, 0], [10**30, 4], [0, 0]]], True),
    "open": ([[[0, 0], [4, 0], [4, 4]]], False),
    "a hole": ([[[0, 0], [9, 0], [9, 9], [0, 0]], [[5, 2], [7, 2], [7, 4], [5, 2]]], False),
    "heights": ([[[0, 0, 1], [4, 0, 1], [4, 4, 1], [0, 0, 1]]], False),
    "bow tie": (BOWTIE["coordinates"], False),
}


@pytest.mark.parametrize(
    "spoilt", [None, [[["0", 0], [1, 0], [1, 1], ["0", 0]]], [[[10**400, 0], [1, 0], [1, 1], [10**400, 0]]]]
)
def test_plain_polygons_are_those_that_are_read_one_by_one(spoilt: Any) -> None:
    given = [{"type": "Polygon", "coordinates": rings} for rings, _ in RINGS.values()]
    found = plain_polygons([*given, None, LINE, {"type": "Polygon", "coordinates": spoilt}])
    assert [shape is not None for shape in found[:-3]] == [plain and spoilt is None for _, plain in RINGS.values()]
    assert found[-3:] == [None, None, None]
    for shape, geometry in zip(found, given, strict=False):
        assert shape is None or shape.wkb == from_geojson(geometry).wkb


def test_duplicate_ids_keep_the_first() -> None:
    (found,), ((blamed, text),) = read(feature(speed=1), feature(speed=2))
    assert found.properties["speed"] == 1
    assert blamed == "a"
    assert "used before" in text


def test_dangling_references_are_reported_and_the_feature_kept() -> None:
    features, problems = read(feature(road="r", left="b", successors=["c", "b"]), feature(id="b", kind="road"))
    assert len(features) == 2
    assert [text for _, text in problems] == [
        "`road` of lane `a`: `r` is not in the map",
        "`left` of lane `a`: `b` is a road, not a lane",
        "`successors` of lane `a`: `c` is not in the map",
        "`successors` of lane `a`: `b` is a road, not a lane",
    ]


def test_names_are_none_one_or_many() -> None:
    one = MapFeature(
        "r", "road", read(feature())[0][0].shape, {"forward": "g", "backward": ["h", "i"], "intersection": None}
    )
    assert (names(one, "forward"), names(one, "backward")) == (("g",), ("h", "i"))
    assert names(one, "intersection") == names(one, "lanes") == ()


def test_unreadable_files(tmp_path: Path) -> None:
    bad = tmp_path / "bad.geojson"
    for text in ("{", "[1]", '{"features": 3}'):
        bad.write_text(text)
        with pytest.raises(DataError) as caught:
            read_geojson(bad, lambda *_: None)
        assert caught.value.diagnostics[0].code == "file-invalid"
    bad.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(DataError):
        read_geojson(str(bad), lambda *_: None)
    with pytest.raises(DataError) as caught:
        read_geojson(tmp_path / "none.geojson", lambda *_: None)
    assert caught.value.diagnostics[0].code == "file-missing"


def test_a_file_is_read(tmp_path: Path) -> None:
    path = tmp_path / "map.geojson"
    path.write_text(json.dumps({"features": [feature(), feature(LINE, id="c", kind="curb")]}))
    assert [found.kind for found in read_geojson(path, lambda *_: None)] == ["lane", "curb"]
