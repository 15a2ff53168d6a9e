"""The style of pages and pictures: contrast by WCAG 2.1 in light and dark, and nothing told by colour alone."""

import re
from importlib import resources

import pytest

ASSETS = resources.files("scenicq.report").joinpath("assets")
PAGE = ASSETS.joinpath("page.css").read_text(encoding="utf-8")
PICTURE = ASSETS.joinpath("picture.css").read_text(encoding="utf-8")
DARK = "@media (prefers-color-scheme: dark)"
TEXT, SIGN = 4.5, 3.0
"""Least contrast of text, and of what is not text (success criteria 1.4.3 and 1.4.11)."""
ROLES = range(8)


def _rules(css, dark):
    """Declarations by selector: the light ones, in dark surroundings overridden by those."""
    light, _, rest = css.partition(DARK)
    texts = [re.sub(r"@media[^{]*\{((?:[^{}]*\{[^{}]*\})*)\s*\}", "", light)] + [rest] * dark
    found = {}
    for text in texts:
        for selectors, body in re.findall(r"([^{}]+)\{([^{}]*)\}", text):
            for selector in selectors.split(","):
                given = dict(part.split(":", 1) for part in body.replace(" ", "").split(";") if ":" in part)
                found.setdefault(" ".join(selector.split()), {}).update(given)
    return found


def _light(colour):
    digits = colour.lstrip("#")
    digits = digits if len(digits) == 6 else "".join(2 * digit for digit in digits)
    parts = [int(digits[n : n + 2], 16) / 255 for n in (0, 2, 4)]
    red, green, blue = (part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts)
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


def _contrast(one, other):
    low, high = sorted((_light(one), _light(other)))
    return (high + 0.05) / (low + 0.05)


def test_contrast_is_what_the_standard_says():
    assert _contrast("#000", "#ffffff") == pytest.approx(21)
    assert _contrast("#777777", "#fff") == pytest.approx(4.478, abs=0.001)


@pytest.mark.parametrize("dark", [False, True])
def test_pages(dark):
    rules = _rules(PAGE, dark)
    known = rules[":root"]
    for ground in (known["--paper"], known["--card"]):
        for name in ("--ink", "--dim", "--accent", "--bad", "--good", "--warn"):
            assert _contrast(known[name], ground) >= TEXT, (name, ground)
        for role in ROLES:
            assert _contrast(rules[f".chip.c{role}"]["color"], ground) >= TEXT, (role, ground)
        for sign in (rules[".bar .fill"]["fill"], rules["input"]["border"].split("solid")[1]):
            colour = known[sign[4:-1]] if sign.startswith("var") else sign
            assert _contrast(colour, ground) >= SIGN, (sign, ground)


@pytest.mark.parametrize("dark", [False, True])
def test_pictures(dark):
    rules = _rules(PICTURE, dark)
    grounds = [
        rules[".ground"]["fill"],
        *(rules[f".map .{kind}"]["fill"] for kind in ("lane", "intersection", "sidewalk")),
    ]
    paper = rules[".paper"]["fill"]
    texts = ["text", ".caption.yes", ".caption.no", ".caption.unknown", *(f".name.c{role}" for role in ROLES)]
    for selector in texts:
        # names have a rim of the paper's colour around them
        assert _contrast(rules[selector]["fill"], paper) >= TEXT, selector
    assert rules[".name"]["stroke"] in (paper, "#fff")
    signs = [f".box.c{role} .outline" for role in ROLES] + [f".c{role}.local" for role in ROLES]
    signs += [".box .outline", ".box.blamed .outline", ".between", ".view", ".hidden-point", ".scale"]
    for selector in signs:
        for ground in grounds:
            assert _contrast(rules[selector]["stroke"], ground) >= SIGN, (selector, ground)


def test_nothing_is_told_by_colour_alone():
    page, picture = _rules(PAGE, False), _rules(PICTURE, False)
    for kind in ("match", "unknown", "near"):
        assert page[f".badge.{kind}::before"]["content"], kind
    widths = [int(picture[f".box.c{role} .outline"]["stroke-width"]) for role in ROLES]
    assert int(picture[".box.blamed .outline"]["stroke-width"]) > max(widths)
    assert picture[".box.nominal .outline"]["stroke-dasharray"]
    assert picture[".box.ego .outline"]["fill"] != picture[".box .outline"]["fill"]
    assert picture[".view"]["stroke-dasharray"]


def test_focus_is_seen():
    for dark in (False, True):
        rules = _rules(PAGE, dark)
        width, _, colour = re.fullmatch(r"(\d)px(solid)(.*)", rules[":focus-visible"]["outline"]).groups()
        assert int(width) >= 2
        assert _contrast(rules[":root"][colour[4:-1]], rules[":root"]["--paper"]) >= SIGN
    assert not re.search(r"outline:\s*(0|none)", PAGE)
