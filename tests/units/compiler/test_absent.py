"""Maps that lack what a program asks of them are told: whatever is asked, and whichever kind of element they lack."""

import json

import pytest
from shapely.geometry import box

from scenicq.compiler.program import compile_scenario
from scenicq.errors import ScenarioError, Source
from scenicq.exporters.sample import sample_labels
from scenicq.forest.scenario import BuiltIn
from scenicq.geometry.features import MapFeature
from scenicq.geometry.network import Network
from scenicq.importers.ingest import ingest
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.dataset import open_dataset

HEAD = "model scenic.domains.driving.model\n"
HERE = "in CircularRegion(0 @ 0, 60), facing Range(0, 360) deg"
FREE = "facing Range(0, 360) deg"
EGO = f"{HEAD}ego = new Object {HERE}\n"
LANE = {"road": "road", "group": "group"}
LEFT, RIGHT = [[2.0, -40.0], [2.0, 40.0]], [[6.0, -40.0], [6.0, 40.0]]
FEATURES = (
    ("lane", "lane", (0, -40, 4, 40), {**LANE, "centerline": [LEFT], "right": "other", "successors": ["other"]}),
    ("other", "lane", (4, -40, 8, 40), {**LANE, "centerline": [RIGHT], "left": "lane"}),
    ("group", "lane_group", (0, -40, 8, 40), {"road": "road"}),
    ("road", "road", (0, -40, 8, 40), {"forward": "group"}),
    ("crossroads", "intersection", (0, 40, 8, 50), {}),
    ("crossing", "crossing", (0, 36, 8, 40), {}),
    ("sidewalk", "sidewalk", (9, -40, 12, 40), {}),
    ("shoulder", "shoulder", (8, -40, 9, 40), {}),
    ("plaza", "drivable", (-40, -40, -20, 40), {}),
)
KINDS = tuple(dict.fromkeys(kind for _, kind, _, _ in FEATURES))
DEFAULTS = {"a default", "a deviation"}
"""What only a default asks of a map: where nothing is on it, plain words ask for no direction."""
LACKING = {"map-lacks", "impossible-requirement", "runtime-error"}

REGIONS = (
    "road", "curb", "sidewalk", "shoulder", "crossing", "roadOrShoulder", "intersection",
    *(f"network.{kind}Region" for kind in ("lane", "road", "drivable", "walkable", "intersection", "crossing",
                                           "sidewalk", "shoulder", "curb")),
)  # fmt: skip
OF_REGIONS = {
    "on": HEAD + "ego = new Object on {}\n",
    "a car on": HEAD + "ego = new Car on {}\n",
    "in": HEAD + f"ego = new Object in {{}}, {FREE}\n",
    "visible": EGO + f"new Object in visible {{}}, {FREE}, with visibleDistance 500\n",
    "a place on": EGO + "spot = new OrientedPoint on {}\nnew Object at spot\n",
    "of the centre": EGO + "require (distance from ego to {}) < 500\n",
    "common": HEAD + f"ego = new Object in {{}}.intersect(CircularRegion(0 @ 0, 500)), {FREE}\n",
    "without": HEAD + f"ego = new Object in {{}}.difference(CircularRegion(900 @ 0, 5)), {FREE}\n",
    "common of two": f"{HEAD}far = CircularRegion(900 @ 0, 5)\n"
    f"ego = new Object in {{}}.intersect(everywhere.difference(far)), {FREE}\n",
}  # fmt: skip
ELEMENTS = "lanes laneSections laneGroups roads allRoads intersections crossings sidewalks shoulders".split()
PLACES = "lane laneSection laneGroup road intersection crossing element".split()
LOOKUPS = [f"{place}At" for place in (*PLACES, "sidewalk", "shoulder")]
ASKED = {
    **{f"{how} {area}": text.format(area) for area in REGIONS for how, text in OF_REGIONS.items()},
    **{f"any of {each}": f"{HEAD}ego = new Object in Uniform(*network.{each}), {FREE}\n" for each in ELEMENTS},
    **{f"first of {each}": f"{HEAD}ego = new Object in network.{each}[0], {FREE}\n" for each in ELEMENTS},
    **{f"ego.{each}": f"{EGO.replace('Object', 'Car')}new Object in ego.{each}, {FREE}\n" for each in PLACES},
    **{f"ego._{each}": f"{EGO.replace('Object', 'Car')}require ego._{each} is not None\n" for each in PLACES},
    **{f"in {each}": f"{EGO}new Object in network.{each}(ego), {FREE}\n" for each in LOOKUPS},
    **{f"{each} must": f"{EGO}require network.{each}(ego, reject=True) is not None\n" for each in LOOKUPS},
    "along": f"{HEAD}ego = new Object in CircularRegion(0 @ 0, 60), facing roadDirection\n",
    "nearly along": f"{HEAD}ego = new Object in CircularRegion(0 @ 0, 60), facing 5 deg relative to roadDirection\n",
    "a default": f"{HEAD}ego = new Car in CircularRegion(0 @ 0, 60)\n",
    "a deviation": f"{HEAD}ego = new Car in CircularRegion(0 @ 0, 60), with roadDeviation Range(-5, 5) deg\n",
    "a heading": f"{EGO}require abs(relative heading of (roadDirection at ego) from ego.heading) < 400 deg\n",
    "a direction": f"{EGO}require (roadDirection at ego) > -10 and ego.position.x > -200\n",
    "no direction": f"{EGO}require not ((roadDirection at ego) < -10 or ego.position.x > 200)\n",
    "an item": f"{EGO}require roadDirection[ego.position] > -10\n",
    "following": f"{EGO}new Object following roadDirection from ego for Range(5, 10), {FREE}\n",
    "followed": f"{EGO}spot = follow roadDirection from ego for 5\nnew Object at spot, {FREE}\n",
    "a centreline": f"{EGO}new Object in Uniform(*network.lanes).centerline, {FREE}\n",
    "a lane's group": f"{EGO}new Object in Uniform(*network.lanes).group, {FREE}\n",
    "a lane's road": f"{EGO}new Object in Uniform(*network.lanes).road, {FREE}\n",
    "a lane's successor": f"{EGO}new Object in Uniform(*network.lanes).successor, {FREE}\n",
    "a road's lanes": f"{EGO}new Object in Uniform(*Uniform(*network.roads).lanes), {FREE}\n",
    "a group's sidewalk": f"{EGO}new Object in Uniform(*network.laneGroups).sidewalk, {FREE}\n",
    "the lane beside": f"{EGO}require network.laneSectionAt(ego)._laneToLeft is not None\n",
    "contained": f"{EGO}new Object {HERE}, with regionContainedIn road\n",
}  # fmt: skip


def network(kinds) -> Network:
    return Network(
        "town", [MapFeature(name, kind, box(*area), more) for name, kind, area, more in FEATURES if kind in kinds]
    )


MAPS = {
    "none": network(()),
    "areas": network(set(KINDS) - {"lane", "lane_group", "road"}),
    **{f"{kind} alone": network({kind}) for kind in KINDS},
    **{f"no {kind}": network(set(KINDS) - {kind}) for kind in KINDS},
}


def outcome(text: str, town: Network) -> str:
    """The code of an error, or whether a scene can be drawn."""
    try:
        scenario = compile_scenario(Source("p.scenic", text), town, version=3)
    except ScenarioError as error:
        return error.diagnostics[0].code
    try:
        next(sample_labels(scenario, 1, 0, waive=frozenset(BuiltIn), attempts=20_000, timeout_s=10))
    except ScenarioError:
        return "silent"
    return "drawn"


@pytest.mark.parametrize("name", ASKED)
@pytest.mark.one_in(27)
def test_on_no_map_a_program_is_without_scenes_and_without_a_word(name):
    assert outcome(ASKED[name], network(KINDS)) == "drawn"
    found = {which: outcome(ASKED[name], town) for which, town in MAPS.items()}
    assert set(found.values()) <= {"drawn", *LACKING}, found
    if name not in DEFAULTS:
        assert found["none"] in LACKING


@pytest.mark.parametrize(
    ("text", "message", "at"),
    [
        ("ego = new Car on road", "no lane whose direction `roadDirection` could be", "new Car on road"),
        ("ego = new Object in road.intersect(curb), facing 0", "nothing for `curb`", "in road.intersect(curb)"),
        ("ego = new Object in network.laneAt(0 @ 0), facing 0", "no such element", "in network.laneAt(0 @ 0)"),
        (
            f"ego = new Object {HERE}\nrequire (roadDirection at ego) > 0",
            "no lane whose direction",
            "(roadDirection at ego)",
        ),
        (
            f"ego = new Object {HERE}\nrequire network.laneAt(ego).group is None",
            "no element here, so there is no `group`",
            "group",
        ),
    ],
)
def test_what_is_lacking_is_named_where_it_is_asked_for(text, message, at):
    with pytest.raises(ScenarioError) as caught:
        compile_scenario(Source("p.scenic", f"{HEAD}{text}\n"), MAPS["areas"], version=3)
    (told,) = caught.value.diagnostics
    assert told.code == "map-lacks"
    assert f"the map `town` has {message}" in told.message
    assert told.span is not None
    assert told.span.text.strip("()") == at.strip("()")


@pytest.mark.parametrize(
    "condition",
    [
        "ego.position.x > -200 or (roadDirection at ego) > 0",
        "not (ego.position.x > 200 and (roadDirection at ego) > 0)",
        "Uniform(0, roadDirection at ego) > -10",
    ],
)
def test_what_may_hold_without_a_direction_is_no_lack(condition):
    assert outcome(f"{EGO}require {condition}\n", MAPS["areas"]) == "drawn"


def labelled(number, town):
    ego = {"id": "ego", "class": "Car", "position": [2.0, 0.0], "heading": 0.0, "length": 4.0, "width": 2.0}
    return {"id": f"{town}{number}", "recording": town, "timestamp_us": number, "map": town, "ego": ego, "objects": []}


def three_and_two(folder, lacking, few):
    """A dataset of three frames on a map with all there is, and two on one that has some kinds alone."""
    (folder / "maps").mkdir()
    for town, kinds in (("lanes", KINDS), (lacking, few)):
        features = [
            {"type": "Feature", "properties": {"id": name, "kind": kind, **more},
             "geometry": {"type": "Polygon", "coordinates": [[list(corner) for corner in box(*area).exterior.coords]]}}
            for name, kind, area, more in FEATURES if kind in kinds
        ]  # fmt: skip
        text = json.dumps({"type": "FeatureCollection", "features": features})
        (folder / "maps" / f"{town}.geojson").write_text(text)
    labels = [*(labelled(number, "lanes") for number in range(3)), *(labelled(number, lacking) for number in range(2))]
    (folder / "labels.jsonl").write_text("".join(json.dumps(label) + "\n" for label in labels))
    header = {"name": "d", "interchange": 1, "angle": "heading", "classes": "scenic"}
    (folder / "dataset.json").write_text(json.dumps(header))
    ingest(folder, folder / "d")
    return open_dataset(folder / "d")


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    """Two frames are on a map that has areas alone."""
    return three_and_two(tmp_path_factory.mktemp("source"), "areas", ("drivable", "sidewalk"))


@pytest.mark.parametrize(
    "text",
    [
        "ego = new Car on road",
        f"ego = new Car {HERE}\nrequire ego._lane is not None",
        f"ego = new Car in network.lanes[0], {FREE}",
        f"ego = new Car {HERE}\nrequire (roadDirection at ego) < 4",
        f"ego = new Car {HERE}\nrequire always ego._lane is not None",
        f"ego = new Car {HERE}\nrequire not (always ego._lane is None)",
        f"ego = new Car {HERE}\nrequire (ego.speed > -1) until (ego._lane is not None)",
        f"ego = new Car {HERE}\nrequire (eventually ego._lane is not None) and (always ego.position.x < 99)",
    ],
)
@pytest.mark.one_in(3)
def test_frames_of_a_map_that_does_not_do_are_told_and_the_others_found(dataset, text):
    source = Source("p.scenic", f"{HEAD}{text}\n")
    query = Query(dataset, source, QueryOptions(solver="portable"))
    assert len(list(query.results())) >= 1
    (told,) = (each for each in query.funnel.warnings if each.code == "map-lacks")
    assert told.message.startswith("2 frames on map `areas` cannot match: ")
    assert told.severity == "warning"
    assert query.misfits() == [told]
    assert query.funnel.excluded["map areas"] == 2


@pytest.mark.slow
def test_commands_say_it_before_anything_else(dataset, run, tmp_path):
    file = tmp_path / "p.scenic"
    file.write_text(f"{HEAD}ego = new Car on road\n")
    for more in ([], ["--quiet"], ["--summary"], ["--format", "ids"], ["--report", tmp_path / "pages"]):
        done = run("match", file, dataset.folder, *more)
        assert done.exit_code == 0
        assert done.stderr.count("warning[map-lacks]: 2 frames on map `areas` cannot match") == 1
        assert f"{file.name}:2:7" in done.stderr
    page = (tmp_path / "pages" / "index.html").read_text()
    assert "2 frames on map `areas` cannot match" in page
    done = run("check", file, dataset.folder)
    assert done.exit_code == 0
    assert "warning[map-lacks]: the map `areas` has no lane" in done.stderr
    done = run("explain", file, dataset.folder, "areas0")
    assert done.exit_code == 2
    assert "error[map-lacks]: the map `areas` has no lane" in done.stderr
    assert run("explain", file, dataset.folder, "lanes0").exit_code == 0


def test_a_map_without_the_place_where_a_class_must_be_is_told_where_that_is_enforced(run, tmp_path):
    dataset = three_and_two(tmp_path, "walks", ("sidewalk",))
    file = tmp_path / "p.scenic"
    file.write_text(f"{HEAD}ego = new Car {HERE}\n")
    waived = run("match", file, dataset.folder, "--format", "ids")
    assert (waived.stdout.split(), waived.stderr) == (["lanes0", "lanes1", "lanes2", "walks0", "walks1"], "")
    for more in ([], ["--summary"]):
        done = run("match", file, dataset.folder, "--format", "ids", "--enforce", "containment", *more)
        assert done.stdout.split() == ["lanes0", "lanes1", "lanes2"]
        told = "warning[map-lacks]: 2 frames on map `walks` cannot match: the map `walks` has nothing for `road`"
        assert done.stderr.count(told) == 1
        assert "`--enforce containment` wants `ego` inside" in done.stderr
        assert "<driving.scenic>:11:5" in done.stderr
    done = run("explain", file, dataset.folder, "walks0", "--enforce", "containment")
    assert (done.exit_code, done.stderr.startswith("error[map-lacks]: the map `walks` has nothing")) == (2, True)
    collision = run("match", file, dataset.folder, "--format", "ids", "--enforce", "collision")
    assert collision.stdout == waived.stdout
