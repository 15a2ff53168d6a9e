"""Recordings and moments in them, as `explain`, `show` and Python take them; `match` is the oracle."""

from __future__ import annotations

import html
import json
import re
from collections.abc import Mapping

import pytest

import scenicq
from scenicq.store.dataset import open_dataset

ANYWHERE = "in everywhere, facing Range(0, 360) deg"
PAIR = f"ego = new Car {ANYWHERE}\nother = new Car {ANYWHERE}\n"
OVER_TIME = f"{PAIR}require eventually (distance to other) < 12"
ALONG = f"{PAIR}require (distance to other) < 14"
MODEL = "model scenic.domains.driving.model\n"


def lines_of(done):
    return [json.loads(line) for line in done.stdout.splitlines()]


@pytest.fixture(scope="module")
def programs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("programs")
    for name, text in (("over_time", OVER_TIME), ("along", ALONG)):
        (folder / f"{name}.scenic").write_text(MODEL + text)
    return folder


@pytest.mark.parametrize("seconds", ["0.5", "2", "12"])
@pytest.mark.one_in(3)
@pytest.mark.slow
def test_a_recording_and_a_frame_match_where_match_has_an_interval(run, crossroads, programs, seconds):
    program = programs / "along.scenic"
    found = lines_of(run("match", program, crossroads, "--min-duration", seconds, "--format", "jsonl"))
    intervals = [each for each in found if each["verdict"] == "match"]
    dataset = open_dataset(crossroads)
    for recording in dataset.manifest.by_recording:
        mine = [each for each in intervals if each["recording"] == recording]
        done = run("explain", program, crossroads, recording, "--min-duration", seconds)
        assert done.exit_code == (0 if mine else 1), done.output
        if not mine and "does not match from" in done.stdout:
            assert f"--min-duration asks for {seconds} s" in done.stdout
    for label in list(dataset.labels())[::7]:
        mine = [
            each
            for each in intervals
            if each["recording"] == label.recording and each["start_us"] <= label.timestamp_us <= each["end_us"]
        ]
        done = run("explain", program, crossroads, label.frame, "--min-duration", seconds)
        assert done.exit_code == (0 if mine else 1), done.output
        for each in mine:
            assert f"{each['recording']}@{each['start_us']}: matches" in done.stdout
    for each in intervals:
        at = f"{each['recording']}@{each['start_us']}"
        assert run("explain", program, crossroads, at, "--min-duration", seconds).exit_code == 0


def test_a_frame_inside_an_interval_is_told_of_it(run, crossroads, programs):
    program = programs / "over_time.scenic"
    interval = lines_of(run("match", program, crossroads, "--limit", "1"))[0]
    last = interval["frames"]["last"]
    done = run("explain", program, crossroads, last)
    assert "the frame lies in intervals that begin before it:" in done.stdout
    assert f"{interval['recording']}@{interval['start_us']}: matches" in done.stdout


def drawn_roles(picture: str) -> dict[str, str]:
    return dict(re.findall(r"<title>role (\w+), ([^,<]+),", html.unescape(picture)))


@pytest.mark.slow
def test_a_picture_has_the_roles_of_the_interval(run, crossroads, programs):
    """It does so for any of its frames, where the initial scene alone may be played by another object."""
    program = programs / "over_time.scenic"
    found = lines_of(run("match", program, crossroads))
    dataset, others = open_dataset(crossroads), 0
    for interval in found:
        covering = [each for each in found if each["recording"] == interval["recording"]]
        frames = [
            label
            for label in dataset.labels()
            if label.recording == interval["recording"]
            and interval["start_us"] <= label.timestamp_us <= interval["end_us"]
        ]
        for label in (frames[0], frames[len(frames) // 2], frames[-1]):
            ids: Mapping[str, str] = {each.track or each.id: each.id for each in label.objects}
            here = [
                ids.get(each["correspondence"]["other"])
                for each in covering
                if each["start_us"] <= label.timestamp_us <= each["end_us"]
            ]
            picture = run("show", crossroads, label.frame, "--scenario", program).stdout
            assert drawn_roles(picture).get("other") in here
            at = f"{label.recording}@{label.timestamp_us}"
            assert run("show", crossroads, at, "--scenario", program).stdout == picture
            initial = run("show", crossroads, label.frame, "--scenario", program, "--initial").stdout
            others += drawn_roles(initial) != drawn_roles(picture)
    assert others


@pytest.mark.slow
def test_python_says_what_the_command_says(run, crossroads, programs):
    for name, options in (("over_time", {}), ("along", {"min_duration": 1})):
        program = programs / f"{name}.scenic"
        words = [f"--{option.replace('_', '-')}={value}" for option, value in options.items()]
        matches = scenicq.open(crossroads).match(program, **options)
        for named in ("06-cut-in", "06-cut-in@0.5s", "06-cut-in/03", "01-quiet-street"):
            told = run("explain", program, crossroads, named, *words).stdout
            assert f"{matches.explain(named)}".rstrip() == told.rstrip()
        first = matches[0]
        assert first.show().svg == matches.show(f"{first.recording}@{first.timestamp_us}").svg
        track = first.roles["other"]
        label = open_dataset(crossroads).label(first.frame)
        (mine,) = [each.id for each in label.objects if (each.track or each.id) == track]
        assert drawn_roles(first.show().svg)["other"] == mine


def test_a_notebook_shows_intervals_as_such(crossroads, programs):
    found = scenicq.open(crossroads).match(programs / "over_time.scenic")
    page = found._repr_html_()
    assert f"<p>{len(found)} intervals match, 0 unknown, in 156 frames of 6 recordings</p>" in page
    assert "<th>seconds</th>" in page
    first = found[0]
    assert f"<td>{(first.end_us - first.timestamp_us) / 1e6:.1f}</td><td>{first.frames} from {first.frame}</td>" in page
    none = scenicq.open(crossroads).match(OVER_TIME.replace("< 12", "< 0.01"))
    page = none._repr_html_()
    assert "<th>then failed at</th>" in page
    assert "require eventually (distance to other) &lt; 0.01" in page
    assert "matches.explain(&quot;RECORDING&quot;)" in page.replace('"', "&quot;")


@pytest.mark.parametrize("named", ["06-cut-in@99s", "06-cut-in@5", "nowhere@3s"])
def test_moments_that_are_not_there_are_refused(run, crossroads, programs, named):
    for words in (("show", crossroads, named), ("explain", programs / "over_time.scenic", crossroads, named)):
        done = run(*words)
        assert done.exit_code == 2
        assert "option-invalid" in done.stderr
