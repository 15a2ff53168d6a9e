"""The cookbooks of the language: each program finds the frames or intervals of the sample data that its page says."""

import json
import re
from collections import Counter
from pathlib import Path

import pytest

import scenicq

FOLDER = Path(__file__).parent / "language"
PAGE, PAGE_OVER_TIME = FOLDER / "cookbook.md", FOLDER / "cookbook-over-time.md"
_RECIPE = re.compile(
    r"^## (?P<title>.+?)\n.*?^```scenic\n(?P<program>.*?)^```\n\n(?:With `--min-duration (?P<least>\d+)`\.\n\n)?"
    r"(?P<found>Found:[^\n]*)\n\n!\[[^\n]*\]\((?P<picture>[^)]*)\)",
    re.MULTILINE | re.DOTALL,
)
RECIPES = list(_RECIPE.finditer(PAGE.read_text(encoding="utf-8")))
OVER_TIME = list(_RECIPE.finditer(PAGE_OVER_TIME.read_text(encoding="utf-8")))

LABELS = Path(__file__).parents[1] / "sample_data" / "crossroads" / "labels.jsonl"
FIRST_US: dict[str, int] = {}
for line in LABELS.read_text(encoding="utf-8").splitlines():
    label = json.loads(line)
    FIRST_US.setdefault(label["recording"][:2], label["timestamp_us"])


@pytest.fixture(scope="module")
def town(crossroads):
    return scenicq.open(crossroads)


def test_there_is_a_recipe_under_every_heading():
    assert len(RECIPES) == PAGE.read_text(encoding="utf-8").count("\n## ") == 15


@pytest.mark.parametrize("recipe", RECIPES, ids=lambda recipe: recipe["title"])
def test_recipe(town, recipe, request):
    found = town.match(recipe["program"], jobs=1)
    frames = [each.frame for each in found]
    assert frames
    counts = Counter(each.recording for each in found)
    told = "Found: " + ", ".join(f"{n} {'frame' if n == 1 else 'frames'} of {name}" for name, n in counts.items())
    picture = found.show(frames[len(frames) // 2], width=700).svg
    compare(PAGE, recipe, told, picture, update=request.config.getoption("--update-golden"))


def test_there_is_a_recipe_over_time_under_every_heading():
    assert len(OVER_TIME) == PAGE_OVER_TIME.read_text(encoding="utf-8").count("\n## ") == 14


@pytest.mark.parametrize("recipe", OVER_TIME, ids=lambda recipe: recipe["title"])
def test_recipe_over_time(town, recipe, request):
    least = {} if recipe["least"] is None else {"min_duration": float(recipe["least"])}
    found = list(town.match(recipe["program"], jobs=1, **least))
    assert found
    assert {each.verdict for each in found} == {"match"}
    told = "Found: " + "; ".join(map(said, found))
    first, last = found[0].frame, found[0].result.interval.last
    recording, start = first.rsplit("/", 1)
    middle = (int(start) + int(last.rsplit("/", 1)[1])) // 2
    picture = found[0].matches.show(f"{recording}/{middle:02}", width=700).svg
    compare(PAGE_OVER_TIME, recipe, told, picture, update=request.config.getoption("--update-golden"))


def said(result):
    """An interval in words: the recording, the seconds of it, and who plays the roles."""
    first = (result.timestamp_us - FIRST_US[result.recording[:2]]) / 1e6
    last = (result.result.interval.end_us - FIRST_US[result.recording[:2]]) / 1e6
    roles = ", ".join(f"{role} = {track}" for role, track in result.roles.items() if role != "ego")
    return f"{first:g} to {last:g} s of {result.recording}{f' ({roles})' if roles else ''}"


def compare(page, recipe, told, picture, *, update):
    """Compare what was found with the page and its picture, or write both."""
    if update:
        text = page.read_text(encoding="utf-8")
        before, mark, after = text.partition(recipe["program"])
        page.write_text(before + mark + re.sub(r"Found:[^\n]*", told, after, count=1), encoding="utf-8")
        (FOLDER / recipe["picture"]).write_text(picture + "\n", encoding="utf-8")
        return
    assert told == recipe["found"]
    assert (FOLDER / recipe["picture"]).read_text(encoding="utf-8") == picture + "\n"
