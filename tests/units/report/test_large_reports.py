"""Reports as large as people make them, in a browser: real recordings, and five hundred matches."""

import json
import shutil
import time
from pathlib import Path

import pytest

from scenicq.importers.ingest import ingest
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import parse_tolerance
from scenicq.query.execution.program_files import read_program
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.query.explain.nearest_miss import nearest_misses
from scenicq.report.sheet import TILES
from scenicq.report.write import write_report
from scenicq.store.dataset import open_dataset

from .browser import CHROMIUM, DRIVER, browser

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not (CHROMIUM and DRIVER), reason="there is no Chromium with its driver"),
]

ROOT = Path(__file__).parents[3]
BOSTON = ROOT.parent / "shared" / "data" / "boston"
COMMAND = "scenicq match 'a b.scenic' town --report pages"


@pytest.fixture(scope="module")
def chromium():
    with browser() as found:
        yield found


@pytest.fixture(scope="module")
def boston(tmp_path_factory):
    """The first sample scenario on real recordings, with near misses."""
    if not BOSTON.is_dir():
        pytest.skip(f"{BOSTON} is not there")
    folder = tmp_path_factory.mktemp("boston")
    ingest(BOSTON, folder / "dataset")
    match = MatchOptions(tolerance=parse_tolerance("x=0.25,y=0.25,heading=5deg"), classes="coarse", radius=50.0)
    program = read_program(ROOT / "sample_data" / "scenarios" / "01_pedestrian_facing_ego.scenic")
    query = Query(open_dataset(folder / "dataset"), program, QueryOptions(match=match))
    results = list(query.results())
    return write_report(query, results, folder / "pages", near=nearest_misses(query, 3), command=COMMAND), len(results)


@pytest.fixture(scope="module")
def five_hundred(tmp_path_factory):
    """The sample recordings several times, and a scenario that matches the first five hundred frames."""
    folder = tmp_path_factory.mktemp("many")
    shutil.copytree(ROOT / "sample_data" / "crossroads", folder / "source")
    labels = [json.loads(line) for line in (folder / "source" / "labels.jsonl").read_text().splitlines()]
    with (folder / "source" / "labels.jsonl").open("w") as file:
        for number in range(4):
            for label in labels:
                again = {"id": f"{number}/{label['id']}", "recording": f"{number}-{label['recording']}"}
                file.write(json.dumps({**label, **again}) + "\n")
    ingest(folder / "source", folder / "dataset")
    program = folder / "any.scenic"
    program.write_text(
        "model scenic.domains.driving.model\n"
        "ego = new Car on road, facing Range(-180, 180) deg\n"
        "other = new Object offset by (Range(-60, 60), Range(-60, 60)), facing Range(-180, 180) deg\n"
    )
    query = Query(open_dataset(folder / "dataset"), read_program(program), QueryOptions(limit=500))
    results = list(query.results())
    page = write_report(query, results, folder / "pages", command=COMMAND)
    return page, len(results)


def _open(page, file):
    """Open the page, go to the first run, and wait for its picture: one far below is not loaded before."""
    page.open(file)
    page.run("document.querySelector('.run').scrollIntoView()")
    deadline = time.monotonic() + 60
    while not page.run(
        "const p = document.querySelector('.run .picture');"
        "return p.getBoundingClientRect().height > 0 && (p.tagName !== 'IMG' || (p.complete && p.naturalWidth > 0))"
    ):
        assert time.monotonic() < deadline, "no picture"


def _drive(page, file, frames):
    """Everything that a reader does, once."""
    page.console()
    page.resize(1280, 900)
    _open(page, file)
    assert f"{frames} " in page.run("return document.getElementById('shown').textContent")
    # slider and keys on the longest run
    page.run(
        "const s = document.getElementById('sort'); s.value = '-data-length'; s.dispatchEvent(new Event('change'))"
    )
    page.run("document.activeElement.blur(); scrollTo(0, 0)")
    page.press("j")
    first = page.run("return document.activeElement.id")
    shown = f"return document.querySelector('#{first} output').textContent"
    before = page.run(shown)
    page.press("\ue014")
    assert page.run(shown) != before
    page.press("\ue012")
    assert page.run(shown) == before
    page.click(f"#{first} .on")
    assert page.run(shown).startswith("2 /")
    # filter
    name = page.run(f"return document.getElementById('{first}').dataset.recording")
    page.press("/")
    page.type("#filter", name)
    left = page.run(
        "return [...document.querySelectorAll('.run')].filter(e => e.checkVisibility()).map(e => e.dataset.recording)"
    )
    assert left
    assert all(name in each for each in left)
    page.press("\ue00c")
    # the command line
    page.command("Browser.grantPermissions", permissions=["clipboardReadWrite", "clipboardSanitizedWrite"])
    page.click("#copy")
    deadline = time.monotonic() + 60
    while page.run("return document.getElementById('copied').textContent") != "Copied":
        assert time.monotonic() < deadline
        time.sleep(2)
        page.click("#copy")  # what moves while the page settles may take a click
    assert page.run("return navigator.clipboard.readText()") == COMMAND
    for width in (1280, 390):
        page.resize(width, 800, phone=width < 500)
        assert page.run("return document.documentElement.scrollWidth <= document.documentElement.clientWidth")
    assert page.console() == []


def test_real_recordings(chromium, boston):
    file, matches = boston
    assert sorted(path.name for path in file.parent.iterdir()) == ["index.html"]
    _drive(chromium, file, matches + 3)
    chromium.run("const k = document.getElementById('kind'); k.value = 'near'; k.dispatchEvent(new Event('change'))")
    assert chromium.run("return document.getElementById('shown').textContent") == "3 frames in 3 runs"


def test_five_hundred_matches(chromium, five_hundred):
    file, matches = five_hundred
    assert matches == 500
    assert len(list((file.parent / "pictures").iterdir())) == matches + TILES
    chromium.resize(1280, 900)
    _open(chromium, file)
    loaded = "return [...document.querySelectorAll('img.picture')].map(e => e.complete && e.naturalWidth > 0)"
    assert chromium.run(loaded)[0]
    assert not all(chromium.run(loaded)), "pictures far below are loaded, too"
    chromium.run("document.querySelector('.run:last-child').scrollIntoView()")
    deadline = time.monotonic() + 60
    while not chromium.run(loaded)[-1]:
        assert time.monotonic() < deadline
    _drive(chromium, file, matches)
