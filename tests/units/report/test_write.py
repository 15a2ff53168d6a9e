"""The report of a query as a file: complete, self-contained, escaped, replaced only where it is ours."""

import json
import math
import re
import shutil
from collections import Counter
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import pytest

from scenicq.errors import DataError, ScenicqError, Source
from scenicq.importers.ingest import ingest
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import parse_tolerance
from scenicq.match.verdict import Cause, Match, NoMatch, Unknown
from scenicq.query.execution.program_files import read_program
from scenicq.query.execution.results import Result
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.query.explain.nearest_miss import nearest_misses
from scenicq.report import write
from scenicq.report.cards import best_frame
from scenicq.report.picture import Shot
from scenicq.report.runs import FrameRun, find_runs, frame_numbers
from scenicq.report.shares import program_lines
from scenicq.report.sheet import TILES, timelines_section, to_picture
from scenicq.report.write import check_target, write_report
from scenicq.store.dataset import open_dataset

OPTIONS = QueryOptions(match=MatchOptions(tolerance=parse_tolerance("position=0.25,heading=5deg")))
EVIL = "<script>alert(1)</script><img src=x onerror=alert(2)>\"'"


class Page(HTMLParser):
    """What a page is made of."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.attributes, self.texts = [], [], []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes += [(tag, name, value) for name, value in attrs]

    def handle_data(self, data):
        self.texts.append(data)

    def values(self, name):
        return [value for _, key, value in self.attributes if key == name]


@pytest.fixture
def query(crossroads, scenarios):
    found = Query(open_dataset(crossroads), read_program(scenarios / "02_crossing_cars.scenic"), OPTIONS)
    return found, list(found.results())


def _loads(page):
    """Addresses that a page loads by itself."""
    links = {("a", "href")}
    names = {"src", "href", "srcset", "data", "poster", "action", "xlink:href"}
    found = [v for tag, name, v in page.attributes if name in names and (tag, name) not in links]
    return [address for address in found if not address.startswith("#")]


def test_a_report_needs_nothing_but_itself(query, tmp_path):
    found, results = query
    page = write_report(found, results, tmp_path / "r", command="scenicq match 'a b' c")
    text = page.read_text(encoding="utf-8")
    parsed = Page(text)
    assert sorted(path.name for path in (tmp_path / "r").iterdir()) == ["index.html"]
    assert _loads(parsed) == []
    assert not re.search(r"url\((?!#)|@import|https?://", text)
    assert parsed.tags.count("script") == parsed.tags.count("style") == 1
    assert not [name for _, name, _ in parsed.attributes if name.startswith("on") or name == "style"]
    policy = parsed.values("content")[0]
    assert policy.startswith("default-src 'none'")
    assert "unsafe" not in policy
    shown = " ".join(parsed.texts)
    assert all(result.frame in shown for result in results)
    assert "scenicq match 'a b' c" in shown
    ids = parsed.values("id")
    assert len(ids) == len(set(ids))
    assert set(parsed.values("aria-labelledby")) <= set(ids)


def test_runs_are_consecutive_frames(query):
    found, results = query
    numbers = frame_numbers(found.dataset, {result.recording for result in results})
    runs = find_runs(results, numbers)
    assert [result for run in runs for result in run.results] == results
    for run in runs:
        assert [numbers[r.frame][0] for r in run.results] == list(range(run.first, run.first + len(run.results)))
        assert {r.recording for r in run.results} == {run.recording}
    gap = [r for r in results if r.frame != runs[0].results[1].frame]
    assert len(find_runs(gap, numbers)) == len(runs) + 1
    other = Result(results[0].frame, results[0].recording, 0, Unknown("timeout", Cause("x")))
    assert len(find_runs([other, *results[1:]], numbers)) == len(runs) + 1


def test_each_line_has_its_share(query):
    found, _ = query
    scenario, _ = found.compile("crossroads")
    lines, rest = program_lines(scenario, found.funnel.excluded + Counter({"something else": 3}))
    assert rest == {"something else": 3}
    assert sum(line.excluded for line in lines) == sum(found.funnel.excluded.values())
    assert sum(found.funnel.excluded.values()) + found.funnel.matches + found.funnel.unknowns == found.funnel.frames
    by_number = {line.number: line for line in lines}
    assert by_number[10].excluded == found.funnel.excluded["leftward.heading"] > 0
    assert by_number[9].text.startswith("leftward = new Car")


def test_hostile_names_are_shown_as_text(crossroads, scenarios, tmp_path):
    source = tmp_path / "source"
    shutil.copytree(Path(__file__).parents[3] / "sample_data" / "crossroads", source)
    lines = (source / "labels.jsonl").read_text().splitlines()
    evil = json.dumps(EVIL)[1:-1]
    wanted = [line.replace("car-left-1", evil).replace("03-busy-intersection", evil) for line in lines]
    wanted = [line.replace("samples/CAM_FRONT/", "javascript:alert(3)//") for line in wanted]
    (source / "labels.jsonl").write_text("\n".join(wanted) + "\n")
    ingest(source, tmp_path / "evil")
    program = tmp_path / "a'\"<b>.scenic"
    program.write_text((scenarios / "02_crossing_cars.scenic").read_text() + "# </script><b>\n")
    found = Query(open_dataset(tmp_path / "evil"), read_program(program), OPTIONS)
    results = list(found.results())
    assert any(EVIL in result.verdict.correspondence.values() for result in results)
    text = write_report(found, results, tmp_path / "r", command=EVIL).read_text(encoding="utf-8")
    page = Page(text)
    assert page.tags.count("script") == 1
    assert page.tags.count("img") == 0
    assert page.tags.count("b") == text.count("<b>")
    assert any(EVIL in shown for shown in page.texts)
    assert not [value for value in page.values("href") if "javascript" in value]
    assert not [name for _, name, _ in page.attributes if name.startswith("on")]


def test_more_frames_than_fit_have_pictures_beside(query, tmp_path, monkeypatch):
    found, results = query
    monkeypatch.setattr(write, "INLINE", 3)
    page = Page(write_report(found, results, tmp_path / "r").read_text(encoding="utf-8"))
    pictures = sorted(path.name for path in (tmp_path / "r" / "pictures").iterdir())
    # one a frame, and a small one of the run
    assert len(pictures) == len(results) + 1
    beside = [f"pictures/{name}" for name in pictures]
    assert set(beside) == {*page.values("data-picture"), *page.values("src")} - {None}
    assert set(page.values("loading")) == {"lazy"}
    monkeypatch.setattr(write, "INLINE", 300)
    write_report(found, results, tmp_path / "r")
    assert sorted(path.name for path in (tmp_path / "r").iterdir()) == ["index.html"]


def test_small_pictures_are_of_every_recording_first():
    def run(recording, first):
        return FrameRun(recording, (Result(f"{recording}/{first}", recording, 0, Match({}, {})),), first, 99)

    runs = [run("a", number) for number in range(1, 2 * TILES, 2)] + [run("b", 1), run("c", 1)]
    found = to_picture(runs)
    assert len(found) == TILES
    assert {runs[number - 1].recording for number in found} == {"a", "b", "c"}
    assert to_picture(runs[:3]) == {1, 2, 3}


def test_the_best_frame_has_its_roles_nearest(query):
    found, results = query
    scenario, _ = found.compile("crossroads")
    labels = {label.frame: label for label in found.dataset.labels([each.frame for each in results])}
    (run,) = find_runs(results, frame_numbers(found.dataset, {results[0].recording}))
    shots = [Shot(labels[each.frame], scenario, each.verdict) for each in results]

    def farthest(shot):
        ego = shot.label.ego
        return max(math.dist((role.member.x, role.member.y), (ego.x, ego.y)) for role in shot.roles)

    best = best_frame(run, shots)
    assert farthest(shots[best]) < min(map(farthest, shots)) + 0.1
    alone = [replace(shot, verdict=Match({}, {}), scenario=None) for shot in shots]
    assert best_frame(run, alone) == 2


def test_a_recording_has_one_timeline():
    def run(recording, first, count, verdict):
        results = tuple(Result(f"{recording}/{n}", recording, n, verdict) for n in range(count))
        return FrameRun(recording, results, first, 40)

    no = NoMatch(Cause("tolerance", ""), {})
    runs = [run("<b>", 3, 5, Match({}, {})), run("a", 1, 1, Match({}, {})), run("<b>", 20, 1, no)]
    page = Page(timelines_section(runs))
    assert page.tags.count("li") == 2
    text = " ".join(page.texts)
    assert "5 matches, 1 near miss in 40 frames" in text
    assert "1 match in 40 frames" in text
    assert "<b>" in page.texts
    assert page.values("href") == ["#run-1", "#run-3", "#run-2"]
    assert "match: frames 3\N{EN DASH}7" in page.values("aria-label")
    assert timelines_section([]) == ""


def test_bands_of_an_interval_say_all_of_what_holds(crossroads, tmp_path):
    program = read_program(Path(__file__).parents[3] / "sample_data" / "over_time" / "02_cut_in.scenic")
    query = Query(open_dataset(crossroads), program, OPTIONS)
    results = list(query.results())
    page = Page(write_report(query, results, tmp_path / "r").read_text(encoding="utf-8"))
    classes = page.values("class")
    assert "timeline" in classes
    assert classes.count("now") == sum(tag == "svg" and value == "strip" for tag, _, value in page.attributes) - 1
    assert "require eventually abs(to_the_left(other)) < 0.5" in page.texts
    shown = [text for text in page.texts if "always" in text or "eventually" in text]
    assert not any(text.endswith("\N{HORIZONTAL ELLIPSIS}") for text in shown)


def test_lanes_of_roles_are_coloured_by_what_they_do(crossroads, tmp_path):
    text = (
        "model scenic.domains.driving.model\nbehavior Drives(who):\n    try:\n        do FollowLaneBehavior(8)\n"
        "    interrupt when (distance from self to who) < 20:\n        take SetBrakeAction(1)\n"
        "walker = new Pedestrian\nego = new Car with behavior Drives(walker)\nterminate after 8 seconds\n"
    )
    query = Query(open_dataset(crossroads), Source("p.scenic", text), replace(OPTIONS, behaviors="guards"))
    results = [each for each in query.results() if each.recording == "04-against-traffic"]
    page = Page(write_report(query, results, tmp_path / "r").read_text(encoding="utf-8"))
    told = [value for value in page.values("aria-label") if value.startswith("ego: ")]
    assert told == ["ego: FollowLaneBehavior(8) 0.0-5.0 s; take SetBrakeAction(1) 5.0-8.0 s"]
    # one colour each, which the text beside it has, too
    lane = [value for tag, name, value in page.attributes if (tag, name) == ("rect", "class") and "chip" in value]
    assert lane == ["chip c0", "chip c1"]
    assert {"FollowLaneBehavior(8) 0.0-5.0 s", "take SetBrakeAction(1) 5.0-8.0 s"} <= set(page.texts)
    where = "FollowLaneBehavior(8) (p.scenic:4:12) in Drives(walker) (p.scenic:8:29): 0.0-5.0 s"
    assert where in page.texts


def test_each_interval_shows_what_the_label_says_of_its_own_objects(crossroads, tmp_path):
    text = "ego = new Car\nwalker = new Pedestrian\nrequire (distance to walker) < 40\nterminate after 5 seconds\n"
    program = Source("program.scenic", f"model scenic.domains.driving.model\n{text}")
    query = Query(open_dataset(crossroads), program, OPTIONS)
    results = list(query.results())
    starts = Counter(each.frame for each in results)
    assert max(starts.values()) > 1
    page = write_report(query, results, tmp_path / "r").read_text(encoding="utf-8")
    cards = page.split('<article class="run"')[1:]
    assert len(cards) == len(results)
    assert all("What the label shows" in card for card in cards)


def test_what_is_left_out_is_told(query, tmp_path, monkeypatch):
    found, results = query
    monkeypatch.setattr(write, "MOST", 2)
    text = write_report(found, results, tmp_path / "r").read_text(encoding="utf-8")
    assert f"{len(results) - 2} more frames are not shown" in text
    assert results[2].frame not in text


def test_near_misses_say_what_they_lack(query, tmp_path):
    found, results = query
    near = nearest_misses(found, 1)
    text = write_report(found, results, tmp_path / "r", near=near).read_text(encoding="utf-8")
    assert "near miss" in text
    assert 'id="kind"' in text
    assert "would match with" in text
    assert "blamed" in text.split("</style>")[1]


def test_no_match_unknowns_and_several_matches_of_a_frame(query, tmp_path):
    found, results = query
    first, second, third, *_ = results
    assert isinstance(first.verdict, Match)
    given = [
        first,
        replace(first, timestamp_us=1),
        replace(second, verdict=Unknown("timeout", Cause("leftward.position"), first.verdict.correspondence)),
        replace(third, verdict=NoMatch(Cause("leftward.class"))),
    ]
    page = Page(write_report(found, given, tmp_path / "r").read_text(encoding="utf-8"))
    shown = " ".join(page.texts)
    assert page.values("data-length") == ["1", "1"]
    assert "unknown: timeout" in shown
    assert third.frame not in shown
    empty = write_report(found, [], tmp_path / "e").read_text(encoding="utf-8")
    assert "No frame matches" in empty


def test_other_folders_are_left_alone(query, tmp_path):
    found, results = query
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "index.html").write_text("<title>mine</title>")
    for target in (tmp_path / "mine", tmp_path / "mine" / "index.html"):
        with pytest.raises(DataError, match=r"target-exists"):
            check_target(target)
        with pytest.raises(DataError, match=r"target-exists"):
            write_report(found, results, target)
    write_report(found, results, tmp_path / "r")
    (tmp_path / "r" / "notes.txt").write_text("keep")
    check_target(tmp_path / "r")
    write_report(found, results, tmp_path / "r")
    assert (tmp_path / "r" / "notes.txt").read_text() == "keep"


def test_a_failed_report_leaves_the_old_one(query, tmp_path, monkeypatch):
    found, results = query
    old = write_report(found, results, tmp_path / "r").read_text(encoding="utf-8")

    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(write, "draw_card", full)
    with pytest.raises(ScenicqError, match=r"target-unwritable"):
        write_report(found, results, tmp_path / "r")
    assert [path.name for path in (tmp_path / "r").iterdir()] == ["index.html"]
    assert (tmp_path / "r" / "index.html").read_text(encoding="utf-8") == old
