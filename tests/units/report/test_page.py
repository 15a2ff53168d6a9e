"""The report in a browser: it works by mouse and by keyboard, and the console stays silent."""

import time

import pytest

import scenicq
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import parse_tolerance
from scenicq.query.execution.program_files import read_program
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.report import write
from scenicq.report.write import write_report
from scenicq.store.dataset import open_dataset

from .browser import CHROMIUM, DRIVER, browser

pytestmark = pytest.mark.skipif(not (CHROMIUM and DRIVER), reason="there is no Chromium with its driver")

HANGS_S = 120
"""What has not happened by then never will."""
RIGHT, LEFT, ESCAPE = "\ue014", "\ue012", "\ue00c"
STATE = """
const run = document.querySelector(arguments[0]);
return {
  at: run.querySelector('output').textContent,
  facts: [...run.querySelectorAll('.frame')].map(each => each.checkVisibility()),
  shots: [...run.querySelectorAll('g.shot')].map(each => getComputedStyle(each).display !== 'none'),
  box: run.querySelector('.picture').getAttribute('viewBox'),
  name: run.querySelector('.picture').getAttribute('aria-label'),
};
"""
SHOWN = "return [...document.querySelectorAll('.run')].filter(each => each.checkVisibility()).map(each => each.id)"


@pytest.fixture(scope="module")
def chromium():
    with browser() as found:
        yield found


@pytest.fixture(scope="module")
def report(tmp_path_factory, crossroads, scenarios):
    """A report of a scenario with matches in several recordings, everything inside; and one with pictures beside."""
    folder = tmp_path_factory.mktemp("reports")
    program = folder / "near.scenic"
    program.write_text(
        "model scenic.domains.driving.model\nego = new Car\nother = new Car offset by (Range(-9, 9), Range(3, 20))\n"
    )
    options = QueryOptions(
        match=MatchOptions(tolerance=parse_tolerance("position=0.25,heading=5deg"), classes="coarse")
    )
    query = Query(open_dataset(crossroads), read_program(program), options)
    results = list(query.results())
    inside = write_report(query, results, folder / "inside", command="scenicq match 'a b.scenic' town")
    old, write.INLINE = write.INLINE, 1
    try:
        beside = write_report(query, results, folder / "beside")
    finally:
        write.INLINE = old
    return inside, beside


@pytest.fixture
def opened(chromium, report):
    chromium.console()
    chromium.resize(1280, 900)
    chromium.open(report[0])
    yield chromium
    assert chromium.console() == []


def _state(page, run="#run-1"):
    return page.run(STATE, run)


def _long_run(page):
    """A run of at least three frames."""
    return page.run("return '#' + [...document.querySelectorAll('.run')].find(e => Number(e.dataset.length) > 2).id")


@pytest.mark.slow
def test_the_slider_shows_one_frame_after_the_other(opened):
    run = _long_run(opened)
    first = _state(opened, run)
    count = len(first["shots"])
    assert first["at"] == f"1 / {count}"
    assert first["facts"] == first["shots"] == [True] + [False] * (count - 1)
    opened.click(f"{run} .on")
    second = _state(opened, run)
    assert second["facts"] == second["shots"] == [False, True] + [False] * (count - 2)
    assert second["name"] != first["name"]
    opened.run(
        "const s = document.querySelector(arguments[0]); s.value = s.max; s.dispatchEvent(new Event('input'))",
        f"{run} input",
    )
    assert _state(opened, run)["at"] == f"{count} / {count}"
    opened.click(f"{run} .on")
    assert _state(opened, run)["at"] == f"{count} / {count}"
    for _ in range(count):
        opened.click(f"{run} .back")
    assert _state(opened, run) == first


def test_keys_walk_through_runs_and_frames(opened):
    focus = "return document.activeElement.id"
    opened.run("document.activeElement.blur()")
    opened.press("j")
    assert opened.run(focus) == "run-1"
    opened.press("j")
    assert opened.run(focus) == "run-2"
    opened.press("k")
    assert opened.run(focus) == "run-1"
    run = _long_run(opened)
    opened.run("document.querySelector(arguments[0]).focus()", run)
    opened.press(RIGHT)
    opened.press(RIGHT)
    opened.press(LEFT)
    assert _state(opened, run)["at"].startswith("2 /")
    opened.press("/")
    assert opened.run(focus) == "filter"
    opened.press("j")
    assert opened.run("return document.getElementById('filter').value") == "j"
    opened.press(ESCAPE)
    assert opened.run("return document.getElementById('filter').value") == ""


def test_filter_and_sort(opened):
    every = opened.run(SHOWN)
    recordings = opened.run("return [...document.querySelectorAll('.run')].map(each => each.dataset.recording)")
    assert len(set(recordings)) > 1
    opened.type("#filter", recordings[-1].upper())
    left = opened.run(SHOWN)
    assert left == [run for run, name in zip(every, recordings, strict=True) if name == recordings[-1]]
    assert opened.run("return document.getElementById('shown').textContent").endswith(
        f"in {len(left)} run{'s' * (len(left) > 1)}"
    )
    opened.press(ESCAPE)
    assert opened.run(SHOWN) == every
    opened.run(
        "const s = document.getElementById('sort'); s.value = '-data-length'; s.dispatchEvent(new Event('change'))"
    )
    lengths = opened.run("return [...document.querySelectorAll('.run')].map(each => Number(each.dataset.length))")
    assert lengths == sorted(lengths, reverse=True)


def test_the_command_is_copied(opened):
    address = opened.run("return location.href")
    opened.command("Browser.grantPermissions", permissions=["clipboardReadWrite", "clipboardSanitizedWrite"])
    opened.click("#copy")
    deadline = time.monotonic() + HANGS_S
    while not (told := opened.run("return document.getElementById('copied').textContent")):
        assert time.monotonic() < deadline
        time.sleep(2)
        opened.click("#copy")  # what moves while the page settles may take a click
    assert told == "Copied"
    assert opened.run("return navigator.clipboard.readText()") == "scenicq match 'a b.scenic' town"
    assert opened.run("return location.href") == address


def test_a_clipboard_that_never_answers_is_not_waited_for(opened):
    opened.run("navigator.clipboard.writeText = () => new Promise(() => {}); copied.textContent = ''")
    opened.click("#copy")
    deadline = time.monotonic() + HANGS_S
    while not (told := opened.run("return document.getElementById('copied').textContent")):
        assert time.monotonic() < deadline
    assert told in ("Copied", "Selected: copy it with the keyboard")
    assert opened.run("return getSelection().toString()").strip() == "scenicq match 'a b.scenic' town"


def test_the_first_screen_is_a_contact_sheet(opened):
    opened.resize(1400, 900)
    top = "return document.querySelector(arguments[0]).getBoundingClientRect().top"
    assert opened.run(top, ".tile") < 300 < opened.run(top, ".program") > opened.run(top, ".recordings")
    runs = opened.run("return document.querySelectorAll('.run').length")
    assert opened.run("return document.querySelectorAll('.tile').length") == min(runs, 20)
    names = opened.run("return new Set([...document.querySelectorAll('.run')].map(e => e.dataset.recording)).size")
    assert opened.run("return document.querySelectorAll('.recordings li').length") == names


def test_a_small_picture_leads_to_its_frame(opened):
    opened.resize(1280, 900)
    far = "return [...document.querySelectorAll('.tile')].findIndex(e => Number(e.dataset.frame) > 1)"
    number = opened.run(far)
    assert number >= 0
    frame, run = opened.run(
        "const t = document.querySelectorAll('.tile')[arguments[0]]; t.click(); "
        "return [t.dataset.frame, t.dataset.run]",
        number,
    )
    assert _state(opened, f"#{run}")["at"].startswith(f"{frame} /")
    assert opened.run("return location.hash") == f"#{run}"


CUT = """
return [...document.querySelectorAll('td, th, code, .told, .recordings li > *, .which, h1, h3, summary')]
  .filter(e => e.checkVisibility() && getComputedStyle(e).display !== 'inline')
  .filter(e => {
    if (e.scrollWidth > e.clientWidth + 1) return true;
    const box = e.getBoundingClientRect();
    return box.right > document.documentElement.clientWidth + 1 || box.left < -1;
  })
  .map(e => [e.tagName, e.className.baseVal ?? e.className, e.textContent.slice(0, 60)]);
"""
"""What cannot be seen whole."""


@pytest.mark.parametrize("width", [1400, 390])
def test_no_value_is_cut_off(opened, width):
    opened.resize(width, 800, phone=width < 500)
    assert opened.run(CUT) == []


@pytest.fixture(scope="module")
def long_names(tmp_path_factory, crossroads):
    """A report and what a notebook shows of a program with long names, and with warnings longer still."""
    folder = tmp_path_factory.mktemp("long")
    program = folder / "long.scenic"
    name = "neighbouring_vehicle_on_the_left"
    program.write_text(
        "model scenic.domains.driving.model\nego = new Car on road\n"
        f"{name} = new Car on road, facing Range(0, 360) deg, with colourOfTheVehicle 'what nobody would write'\n"
        f"require (distance from ego to {name}) < 30 and (distance from ego to {name}) > 3\n"
    )
    dataset = scenicq.open(crossroads)
    matches = dataset.match(program, limit=12)
    page = folder / "notebook.html"
    text = f"{matches._repr_html_()}{matches.explain(matches[0].frame)._repr_html_()}"
    page.write_text(f"<!doctype html><meta charset=utf-8><meta name=viewport content='width=device-width'>{text}")
    return matches.report(folder / "pages"), page


NAMES = """
return [...document.querySelectorAll('svg text.name')].filter(e => e.checkVisibility()).map(e => {
  const box = e.getBoundingClientRect(), frame = e.ownerSVGElement.getBoundingClientRect();
  return [box.left - frame.left, frame.right - box.right, box.height];
}).filter(([, , height]) => height);
"""
"""Pixels from names to the edges of their pictures, and their height, as far as the page is laid out."""


@pytest.mark.parametrize("width", [1400, 390])
def test_long_names_are_seen_whole(chromium, long_names, width):
    report, notebook = long_names
    chromium.resize(width, 800, phone=width < 500)
    chromium.open(report)
    assert chromium.run(CUT) == []
    found = chromium.run(NAMES)
    chromium.open(notebook)
    assert chromium.run("return document.documentElement.scrollWidth <= document.documentElement.clientWidth")
    shown = chromium.run(NAMES)
    assert len(found) > len(shown) == 6
    assert min(side for left, right, _ in (*found, *shown) for side in (left, right)) >= 0
    assert min(height for _, _, height in shown) > 9


@pytest.mark.parametrize(("width", "phone"), [(1280, False), (390, True), (320, True)])
def test_nothing_is_wider_than_the_screen(opened, width, phone):
    opened.resize(width, 800, phone=phone)
    assert opened.run("return document.documentElement.scrollWidth <= document.documentElement.clientWidth")


@pytest.mark.parametrize("dark", [False, True])
def test_text_has_contrast(opened, dark):
    opened.resize(1280, 900, dark=dark)
    ratio = """
    const level = color => {
      const [r, g, b] = color.match(/[\\d.]+/g).slice(0, 3).map(v => v / 255)
        .map(v => v <= .04045 ? v / 12.92 : ((v + .055) / 1.055) ** 2.4);
      return .2126 * r + .7152 * g + .0722 * b;
    };
    const behind = e => {
      for (; e; e = e.parentElement) {
        const found = getComputedStyle(e).backgroundColor;
        if (!found.endsWith(', 0)')) return found;
      }
    };
    return [...document.querySelectorAll('p, th, td, h1, h2, h3, span, button, .chip, .badge, label')]
      .filter(e => e.textContent && e.checkVisibility() && !e.closest('svg'))
      .map(e => [e.className || e.tagName, level(getComputedStyle(e).color), level(behind(e))])
      .map(([name, a, b]) => [name, (Math.max(a, b) + .05) / (Math.min(a, b) + .05)])
      .filter(([, contrast]) => contrast < 4.5);
    """
    assert opened.run(ratio) == []


def test_every_control_has_a_name(opened):
    nameless = """
    return [...document.querySelectorAll('button, input, select, svg[role=img], img')].filter(e =>
      !(e.getAttribute('aria-label') || e.getAttribute('alt') || e.textContent.trim() || (e.labels && e.labels.length)))
      .map(e => e.outerHTML.slice(0, 80));
    """
    assert opened.run(nameless) == []


def test_pictures_beside_the_page_are_loaded_as_they_are_seen(chromium, report):
    chromium.console()
    chromium.resize(1280, 900)
    started = time.monotonic()
    chromium.open(report[1])
    loaded = "const i = document.querySelector(arguments[0]); return i.complete && i.naturalWidth > 0"
    while not chromium.run(loaded, "#run-1 img.picture"):
        assert time.monotonic() - started < HANGS_S
    run = _long_run(chromium)
    source = "return document.querySelector(arguments[0]).getAttribute('src')"
    before = chromium.run(source, f"{run} img.picture")
    chromium.click(f"{run} .on")
    assert chromium.run(source, f"{run} img.picture") != before
    while not chromium.run(loaded, f"{run} img.picture"):
        assert time.monotonic() - started < HANGS_S
    assert chromium.console() == []


@pytest.mark.parametrize(("width", "phone"), [(1280, False), (390, True)])
def test_pages_of_one_frame_and_of_changes(chromium, run, crossroads, scenarios, tmp_path, width, phone):
    scenario = scenarios / "05_cut_in_from_right.scenic"
    run("show", crossroads, "06-cut-in/10", "--scenario", scenario, "-o", tmp_path / "frame.html")
    for name, tolerance in (("a", "heading=1deg"), ("b", "heading=20deg")):
        run("match", scenario, crossroads, "--all", "--tolerance", tolerance, "-o", tmp_path / f"{name}.jsonl")
    run("report", tmp_path / "a.jsonl", tmp_path / "b.jsonl", "-o", tmp_path / "changes.html")
    chromium.console()
    chromium.resize(width, 800, phone=phone)
    for name, wanted in (("frame.html", "excludes"), ("changes.html", "match in B only")):
        chromium.open(tmp_path / name)
        assert wanted in chromium.run("return document.body.innerText")
        assert chromium.run("return document.documentElement.scrollWidth <= document.documentElement.clientWidth")
    assert chromium.console() == []
