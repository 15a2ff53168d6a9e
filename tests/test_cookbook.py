"""The cookbook of the language: each program finds the frames of the sample data that its page says."""

import re
from collections import Counter
from pathlib import Path

import pytest

import scenicq

FOLDER = Path(__file__).parent / "language"
PAGE = FOLDER / "cookbook.md"
_RECIPE = re.compile(
    r"^## (?P<title>.+?)\n.*?^```scenic\n(?P<program>.*?)^```\n\n"
    r"(?P<found>Found:[^\n]*)\n\n!\[[^\n]*\]\((?P<picture>[^)]*)\)",
    re.MULTILINE | re.DOTALL,
)
RECIPES = list(_RECIPE.finditer(PAGE.read_text(encoding="utf-8")))


@pytest.fixture(scope="module")
def town(crossroads):
    return scenicq.open(crossroads)


def test_there_is_a_recipe_under_every_heading():
    assert len(RECIPES) == PAGE.read_text(encoding="utf-8").count("\n## ") == 12


@pytest.mark.parametrize("recipe", RECIPES, ids=lambda recipe: recipe["title"])
def test_recipe(town, recipe, request):
    found = town.match(recipe["program"], jobs=1)
    frames = [each.frame for each in found]
    assert frames
    counts = Counter(each.recording for each in found)
    told = "Found: " + ", ".join(f"{n} {'frame' if n == 1 else 'frames'} of {name}" for name, n in counts.items())
    picture = found.show(frames[len(frames) // 2], width=700).svg
    if request.config.getoption("--update-golden"):
        text = PAGE.read_text(encoding="utf-8")
        before, mark, after = text.partition(recipe["program"])
        PAGE.write_text(before + mark + re.sub(r"Found:[^\n]*", told, after, count=1), encoding="utf-8")
        (FOLDER / recipe["picture"]).write_text(picture + "\n", encoding="utf-8")
        return
    assert told == recipe["found"]
    assert (FOLDER / recipe["picture"]).read_text(encoding="utf-8") == picture + "\n"
