"""Recordings that have a map each are asked as datasets of one map each, and maps are read for candidates alone."""

from __future__ import annotations

import gc
import json
import weakref
from collections import Counter
from dataclasses import replace

import pytest

from scenicq.errors import Source
from scenicq.geometry.network import Network
from scenicq.importers.ingest import ingest
from scenicq.query.execution import block_matcher, run
from scenicq.query.execution.option_texts import DRIVING, read_options
from scenicq.query.execution.pieces import partitions
from scenicq.query.execution.records import record
from scenicq.query.execution.run import Query
from scenicq.store.dataset import open_dataset
from scenicq.store.regions import MapFiles

COUNT = 7
CROSSING, WITHOUT_LANES = 2, 4
"""Maps that have what others have not, and lack what others have."""

PROGRAMS = {
    "beside the ego": "ego = new Car\nother = new Car at ego offset by Range(-2, 2) @ Range(3, 13)",
    "along the road": "ego = new Car on road\nother = new Car on road, facing Range(-9, 9) deg",
    "in the lane": "ego = new Car\nother = new Car on ego.lane\nrequire (distance to other) < 20",
    "on a crossing": "ego = new Car\nother = new Car on crossing",
    "at a hidden spot": "spot = new OrientedPoint on road\nego = new Car\nother = new Car ahead of spot by Range(0, 9)",
    "recorded": "ego = new Car\nother = new Car ahead of ego by Range(0, 9)\nrecord (distance to other) as gap",
    "ahead in the lane": "ego = new Car\nother = new Car on ego.lane, facing Range(-9, 9) deg\n"
    "require (distance to other) < 19",
    "in one lane": "ego = new Car\nother = new Car\nrequire other.lane is ego.lane",
    "of the group": "ego = new Car\nother = new Car on ego.laneGroup",
    "on the other side": "ego = new Car\nother = new Car on ego.lane.group.opposite",
    "on the road": "ego = new Car\nother = new Car on ego.road, facing Range(-180, 180) deg",
    "to the left": "ego = new Car\nother = new Car on ego.laneSection.laneToLeft, facing Range(-180, 180) deg",
    "in the left lane": "ego = new Car\nother = new Car\nrequire other.lane is ego.laneSection.laneToLeft.lane",
    "in another group": "ego = new Car\nother = new Car\nrequire other.laneGroup is ego.oppositeLaneGroup",
    "comes near": "ego = new Car\nother = new Car\nrequire eventually (distance to other) < 12",
}

LINKED = ["of the group", "on the other side", "on the road", "to the left", "in the left lane", "in another group"]
"""Programs that ask how elements hang together."""


def _square(west, south, east, north):
    corners = [[west, south], [east, south], [east, north], [west, north], [west, south]]
    return {"type": "Polygon", "coordinates": [corners]}


def _map(number):
    at = 10.0 * number
    features = [{"id": "land", "kind": "drivable", "shape": _square(at - 50, -50, at + 50, 90)}]
    if number != WITHOUT_LANES:
        # the same names mean other things on each map
        up, down = (f"group{(number + turned) % 2}" for turned in (0, 1))
        for name, west, ends, own in (("up", at - 2, (-50, 90), up), ("down", at - 6, (90, -50), down)):
            line = [[west + 2, ends[0]], [west + 2, ends[1]]]
            shape, other = _square(west, -50, west + 4, 90), {"up": "down", "down": "up"}[name]
            links = {"group": own, "left": other}
            features.append({"id": name, "kind": "lane", "shape": shape, "centerline": [line], **links})
            opposite = down if own == up else up
            features.append({"id": own, "kind": "lane_group", "shape": shape, "road": "way", "opposite": opposite})
        ways = {"forward": [up], "backward": [down]}
        features.append({"id": "way", "kind": "road", "shape": _square(at - 6, -50, at + 2, 90), **ways})
    if number == CROSSING:
        features.append({"id": "zebra", "kind": "crossing", "shape": _square(at - 9, 8, at + 9, 12)})
    listed = [{"type": "Feature", "geometry": each.pop("shape"), "properties": each} for each in features]
    return {"type": "FeatureCollection", "features": listed}


def _dataset(folder, numbers, named=lambda number: f"map{number}"):
    (folder / "maps").mkdir(parents=True)
    header = {"name": "town", "interchange": 1, "angle": "heading", "classes": "scenic"}
    (folder / "dataset.json").write_text(json.dumps(header))
    lines = []
    box = {"class": "Car", "heading": 0, "width": 2, "length": 4}
    for number in numbers:
        (folder / "maps" / f"{named(number)}.geojson").write_text(json.dumps(_map(number)))
        for time in range(3):
            other = {
                **box,
                "id": "o",
                "track": "o",
                "position": [10 * number - 4 * (number % 2), 6 + 3 * number - time],
            }
            other["heading"] = 3.14159 * (number % 2 if number != 5 else 0)
            ego = {**box, "position": [10 * number, time]}
            lines.append(
                {"id": f"r{number}/{time}", "recording": f"r{number}", "timestamp_us": 500_000 * time,
                 "map": named(number), "ego": ego, "objects": [other]}
            )  # fmt: skip
    (folder / "labels.jsonl").write_text("\n".join(map(json.dumps, lines)) + "\n")
    ingest(folder, folder / "dataset")
    return open_dataset(folder / "dataset")


@pytest.fixture(autouse=True)
def kept(monkeypatch):
    """Few maps are many."""
    monkeypatch.setattr(run, "MAPS_KEPT", 2)


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    folder = tmp_path_factory.mktemp("alone")
    return [_dataset(folder / str(number), [number]) for number in range(COUNT)]


@pytest.fixture(scope="module")
def together(tmp_path_factory):
    return _dataset(tmp_path_factory.mktemp("together") / "all", range(COUNT))


def _asked(dataset, program, **options):
    query = Query(dataset, Source("p", program), read_options(model=DRIVING, **options))
    found = [record(each) for each in query.results()]
    return found, Counter(query.funnel.excluded), query.funnel.frames, query.funnel.candidates


def _expected(alone, program, **options):
    """What datasets of one map each give; of a map that the program does not fit, nothing."""
    found, excluded, frames, candidates = [], Counter(), 0, 0
    for dataset in alone:
        try:
            mine = _asked(dataset, program, **options)
        except Exception as error:
            if "map-lacks" not in str(error):
                raise
            excluded[f"map {dataset.maps[0]}"] += 3
            frames += 3
            continue
        found += mine[0]
        excluded += mine[1]
        frames, candidates = frames + mine[2], candidates + mine[3]
    return found, excluded, frames, candidates


@pytest.mark.parametrize("options", [{}, {"prefilter": False}, {"ego": "any"}, {"all_matches": True}], ids=str)
@pytest.mark.parametrize("program", PROGRAMS)
@pytest.mark.one_in(16)
def test_a_map_for_every_recording_gives_what_each_map_alone_does(alone, together, program, options):
    found, excluded, frames, candidates = _expected(alone, PROGRAMS[program], **options)
    asked = _asked(together, PROGRAMS[program], **options)
    assert (asked[0], asked[2]) == (found, frames)
    # links say of any map what is not said of one
    assert asked[3] <= candidates if program in LINKED else (asked[1], asked[3]) == (excluded, candidates)
    assert found


@pytest.mark.parametrize(
    "program", ["beside the ego", "along the road", "in the lane", "ahead in the lane", "in one lane", *LINKED]
)
@pytest.mark.one_in(5)
def test_frames_that_nobody_reads_proofs_of_are_the_same(alone, together, program):
    options = read_options(model=DRIVING)
    options = replace(options, proofs=False, reasons=False, interval_reasons=False)
    found = [each.frame for each in Query(together, Source("p", PROGRAMS[program]), options).results()]
    assert found == [each.frame for each in _expected(alone, PROGRAMS[program])[0]]


def test_pieces_cut_blocks_of_several_maps(together):
    source, options = Source("p", PROGRAMS["beside the ego"]), read_options(model=DRIVING)
    whole = [record(each) for each in Query(together, source, options).results()]
    for count in (2, 3, COUNT):
        pieces = partitions(together, count)
        found = [Query(together, source, options, piece.recordings).results() for piece in pieces]
        assert [record(each) for results in found for each in results] == whole


def test_maps_in_another_order_than_recordings(tmp_path, together):
    """Results come map by map; blocks of several maps are of those that follow each other in the store, too."""
    turned = _dataset(tmp_path / "turned", range(COUNT), lambda number: f"map{9 - number}")
    for program in ("beside the ego", "in the lane"):
        expected = _asked(together, PROGRAMS[program])[0]
        found = _asked(turned, PROGRAMS[program])[0]
        assert sorted(each.frame for each in found) == sorted(each.frame for each in expected)
        assert [each.recording for each in found] == sorted((each.recording for each in found), reverse=True)


def test_maps_are_read_when_a_candidate_needs_one(together, monkeypatch):
    read: list[str] = []
    features = MapFiles.features
    monkeypatch.setattr(MapFiles, "features", lambda self, name: read.append(name) or features(self, name))
    source = Source("p", f"{PROGRAMS['beside the ego']}, facing Range(-9, 9) deg relative to roadDirection")
    ids = replace(read_options(model=DRIVING), proofs=False, reasons=False)
    assert [each.frame for each in Query(together, source, ids).results()]
    assert not read  # SQL has decided all of them
    results = list(Query(together, source, read_options(model=DRIVING)).results())
    assert set(read) == {f"map{each.recording[1:]}" for each in results} < set(together.maps)
    assert len(read) == len(set(read))


@pytest.mark.parametrize("program", ["ahead in the lane", "in one lane", *LINKED])
def test_elements_at_places_are_told_by_relations(together, monkeypatch, program):
    read: list[str] = []
    features = MapFiles.features
    monkeypatch.setattr(MapFiles, "features", lambda self, name: read.append(name) or features(self, name))
    ids = replace(read_options(model=DRIVING), proofs=False, reasons=False)
    assert [each.frame for each in Query(together, Source("p", PROGRAMS[program]), ids).results()]
    # few maps have crossings, or no lanes
    assert set(read) <= {f"map{CROSSING}", f"map{WITHOUT_LANES}"}


def test_one_query_over_time_is_asked_of_all_maps_that_are_alike(together, monkeypatch):
    asked: list[str] = []
    for name in ("run_players", "run_prefilter"):
        run_it = getattr(block_matcher, name)
        monkeypatch.setattr(block_matcher, name, lambda *given, run_it=run_it: asked.append("") or run_it(*given))
    source = Source("p", PROGRAMS["comes near"])
    results = list(Query(together, source, read_options(model=DRIVING)).results())
    assert len({each.recording for each in results}) > 2
    # the first two are alike, the last two, and no others that follow each other
    assert len(asked) <= 5 < COUNT


@pytest.mark.slow
def test_a_dataset_that_says_nothing_of_its_maps_is_asked_alike(together, tmp_path):
    earlier = _dataset(tmp_path / "earlier", range(COUNT))
    file = earlier.path / "dataset.json"
    content = json.loads(file.read_text())
    assert {len(group["maps"]) for group in content["map_groups"]} == {1, COUNT - 2}
    del content["map_groups"]
    file.write_text(json.dumps(content))
    earlier = open_dataset(earlier.path)
    for name, program in PROGRAMS.items():
        one, other = _asked(earlier, program), _asked(together, program)
        # links say of any map what is not said of one
        assert (one[0], one[2]) == (other[0], other[2]) if name in LINKED else one == other


@pytest.mark.parametrize("change", [{"directed": False}, {"kinds": ["lane"]}], ids=str)
def test_what_a_manifest_says_of_maps_must_be_so(tmp_path, change):
    dataset = _dataset(tmp_path / "lying", [0, 1])
    file = dataset.path / "dataset.json"
    content = json.loads(file.read_text())
    content["map_groups"][0] |= change
    file.write_text(json.dumps(content))
    with pytest.raises(Exception, match="map map0 what its elements do not"):
        open_dataset(dataset.path)


def test_networks_go_with_the_maps_that_are_not_kept(together, monkeypatch):
    """A network in a circle would be there until somebody looks for circles, which is seldom."""
    made: list[weakref.ref[Network]] = []
    make = Network.__init__

    def noted(self, *args):
        make(self, *args)
        made.append(weakref.ref(self))

    monkeypatch.setattr(Network, "__init__", noted)
    monkeypatch.setattr(block_matcher, "MAPS_KEPT", 2)
    gc.collect()
    gc.disable()
    try:
        query = Query(together, Source("p", PROGRAMS["along the road"]), read_options(model=DRIVING))
        assert list(query.results())
        assert len(made) > 4
        # the two, and one for each kind of maps
        assert sum(network() is not None for network in made) <= 2 + len(together.manifest.map_groups)
    finally:
        gc.enable()
