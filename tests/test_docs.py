"""What is written about the commands and folders is complete."""

import re
import tomllib
from pathlib import Path

import click
import pytest

from scenicq.errors import CODES
from scenicq.limits import LIMITS, Beyond, limits
from scenicq.match.options import MatchOptions
from scenicq.store.classes import ROOT as ROOT_CLASS
from scenicq.store.classes import ancestors, subclasses
from scenicq.store.schema import SCHEMA_VERSION, UPGRADABLE
from scenicq_cli.main import COMMANDS, cli

ROOT = Path(__file__).parents[1]
REFERENCE = (ROOT / "cli" / "README.md").read_text(encoding="utf-8")
PAGES = {
    page.relative_to(ROOT).as_posix(): page.read_text(encoding="utf-8")
    for page in (ROOT / "README.md", ROOT / "cli" / "README.md", *sorted((ROOT / "scenicq" / "docs").glob("*.md")))
}
"""What is written for users."""


def _command(name):
    return cli.get_command(click.Context(cli), name)


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_help_an_example_and_a_place_in_the_reference(name):
    command = _command(name)
    assert command.help
    assert re.search(rf"Examples?:\n  scenicq {name}\b", command.epilog)
    assert f"scenicq {name}" in REFERENCE


@pytest.mark.parametrize("name", COMMANDS)
def test_every_option_has_help_and_is_in_the_reference(name):
    for parameter in _command(name).params:
        if isinstance(parameter, click.Option):
            assert parameter.help, parameter.name
            assert any(f"`{option}" in REFERENCE or f" {option}" in REFERENCE for option in parameter.opts), (
                parameter.opts
            )


@pytest.mark.parametrize("name", COMMANDS)
def test_no_option_is_there_twice(name):
    words = [option for each in _command(name).params for option in (*each.opts, *each.secondary_opts)]
    assert sorted(words) == sorted(set(words))


@pytest.mark.parametrize("name", COMMANDS)
def test_examples_use_only_options_that_there_are(name):
    known = {option for parameter in _command(name).params for option in (*parameter.opts, *parameter.secondary_opts)}
    assert set(re.findall(r"(?<!\S)--?[a-z][a-z0-9-]*", _command(name).epilog)) <= known | {"--help"}


@pytest.mark.parametrize("page", PAGES)
def test_pages_for_users_name_only_options_that_there_are(page):
    known = {"--help", "--version", *OTHERS.get(page, ())}
    for name in COMMANDS:
        known |= {o for parameter in _command(name).params for o in (*parameter.opts, *parameter.secondary_opts)}
    assert set(re.findall(r"(?<![\w-])--[a-z][a-z0-9-]+", PAGES[page])) <= known


OTHERS = {"scenicq/docs/CONTRIBUTING.md": {"--spec"}, "scenicq/docs/results.md": {"--files-from"}}
"""Options of other programs, by page."""


def _reference():
    """The help of every command as a reader unfolds it, 88 columns wide whatever terminal this runs in."""
    parent = cli.make_context("scenicq", [], resilient_parsing=True)
    parent.terminal_width = 88
    parts = []
    for name in COMMANDS:
        text = _command(name).get_help(click.Context(_command(name), info_name=name, parent=parent))
        title = f"<summary><code>scenicq {name}</code>: {COMMANDS[name][0].lower()}{COMMANDS[name][1:-1]}</summary>"
        parts.append(f"<details>{title}\n\n```text\n{text.rstrip()}\n```\n\n</details>\n")
    return "\n".join(parts)


def _class_tree():
    """Each class that has others below it, with these."""
    lines = []
    for name in subclasses(ROOT_CLASS):
        below = [each for each in subclasses(name)[1:] if ancestors(each)[1] == name]
        if below:
            lines.append(f"- `{name}`: {', '.join(f'`{each}`' for each in below)}")
    return "\n".join([*lines, ""])


_BLOCK = re.compile(r"^```scenic[^\n]*\n(.*?)^```", re.DOTALL | re.MULTILINE)


CODES_PAGE = ROOT / "scenicq" / "codes.md"


def _codes():
    """Each code with its meaning, what to do, which the page itself says, and the shortest program that shows it."""
    shown = {}
    for page in sorted((ROOT / "tests" / "language").glob("*.md")):
        for block in _BLOCK.finditer(page.read_text(encoding="utf-8")):
            for code in re.findall(r"# (?:error|warning|note): \[([a-z-]+)\]", block[1]):
                shown.setdefault(code, []).append((len(block[1]), page.name, block[1]))
    said = dict(
        re.findall(r"^## (\S+)\n\n[^\n]*\n\n(What to do: [^\n]*)$", CODES_PAGE.read_text(encoding="utf-8"), re.M)
    )
    parts = []
    for code, meaning in CODES.items():
        part = f"## {code}\n\n{meaning[0].upper()}{meaning[1:]}.\n\n{said.get(code, 'What to do:')}\n"
        if code in shown:
            _, name, program = min(shown[code])
            part += f"\n```scenic\n{program}```\n\nFrom [{name.removesuffix('.md')}](../tests/language/{name}).\n"
        parts.append(part)
    return "\n".join(parts)


def test_each_code_has_a_page_that_says_what_to_do():
    page = CODES_PAGE.read_text(encoding="utf-8")
    assert set(re.findall(r"^## (\S+)\n\n[^\n]+\n\nWhat to do: \S[^\n]*\.$", page, re.MULTILINE)) == set(CODES)


@pytest.mark.parametrize(
    ("page", "start", "end", "written"),
    [
        ("scenicq/codes.md", "<!-- codes: `make golden` writes this -->\n", "<!-- end of codes -->", _codes),
        ("cli/README.md", "<!-- commands: `make golden` writes this -->\n", "<!-- end of commands -->", _reference),
        (
            "tests/language/world-model.md",
            "<!-- classes: `make golden` writes this -->\n",
            "<!-- end of classes -->",
            _class_tree,
        ),
    ],
)
def test_what_pages_have_from_the_code_is_so(page, start, end, written, request):
    before, _, rest = (ROOT / page).read_text(encoding="utf-8").partition(start)
    shown, found, after = rest.partition(end)
    assert found
    if request.config.getoption("--update-golden"):
        shown = written()
        (ROOT / page).write_text(f"{before}{start}{shown}{end}{after}", encoding="utf-8")
    assert shown == written(), "`make golden` writes it again"


def test_help_fits_a_page_and_has_every_section():
    for name in COMMANDS:
        command = _command(name)
        text = command.get_help(click.Context(command, info_name=name, parent=click.Context(cli, info_name="scenicq")))
        shown = [line.removesuffix(":") for line in text.splitlines() if line.endswith(":") and line[0] != " "]
        assert shown[-2] == "Exit codes", name
        assert shown[-1] in ("Example", "Examples"), name
        named = {word for key in command.arguments for word in key.split(", ")}
        assert named == {
            p.make_metavar(click.Context(command)).strip("[]") for p in command.params if isinstance(p, click.Argument)
        }, name


@pytest.mark.parametrize(
    ("sentence", "limit"),
    [
        ("At most {:,} correspondences are reported per frame", MatchOptions().correspondences),
        ("an interval may begin in {:,} ways a recording", LIMITS.recording_starts),
        ("it has {:,} characters", LIMITS.program_characters),
    ],
)
def test_limits_are_those_that_the_page_names(sentence, limit):
    assert sentence.format(limit) in " ".join(PAGES["scenicq/docs/limits.md"].split())


def test_the_page_of_matches_explains_every_reason_of_an_unknown():
    page = " ".join(PAGES["scenicq/docs/matching.md"].partition("is unknown\n")[2].replace("`", "").split())
    reasons = {each.more for each in limits() if each.beyond is Beyond.UNDECIDED} | {"unobserved"}
    assert len(reasons) > 10
    short = {reason.removesuffix(" to tell apart").removeprefix("too many ") for reason in reasons}
    assert [reason for reason in short if reason not in page] == []


def test_the_glossary_is_short_and_in_order():
    parts = PAGES["scenicq/docs/glossary.md"].split("\n## ")[1:]
    words = [re.findall(r"^\| (.+?) \|", part, re.MULTILINE)[1:] for part in parts]
    assert all(part == sorted(part, key=str.lower) for part in words)
    assert 40 <= sum(map(len, words)) <= 60


def test_every_make_target_is_explained():
    text = (ROOT / "Makefile").read_text()
    targets = set(re.search(r"\.PHONY: (.*)", text).group(1).split())
    assert targets == set(re.findall(r"^([a-z-]+):.*## ", text, re.MULTILINE))


EVERYWHERE = [
    ROOT / "README.md",
    *(page for folder in ("cli", "sample_data", "scenicq", "tests") for page in sorted((ROOT / folder).rglob("*.md"))),
]


@pytest.mark.parametrize("page", EVERYWHERE, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_links_lead_to_files(page):
    text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
    links = [link for link in re.findall(r"\]\(([^)\s]+)\)", text) if not re.match(r"https?:|#", link)]
    assert [link for link in links if not (page.parent / link.partition("#")[0]).exists()] == []


def test_the_page_of_licences_names_every_package():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    wanted = [
        *project["dependencies"],
        *(each for extra in project["optional-dependencies"].values() for each in extra),
    ]
    names = {re.match(r"[\w.-]+", each)[0] for each in wanted} - {"scenicq"}
    told = set(re.findall(r"[\w.-]+\w", PAGES["scenicq/docs/licences.md"]))
    assert names - told == set()


def test_the_page_of_versions_says_what_becomes_of_each():
    rows = dict(re.findall(r"^\| (\d+) \|(.*)\|$", PAGES["scenicq/docs/versions.md"], re.MULTILINE))
    assert {int(number) for number in rows} == set(range(1, SCHEMA_VERSION + 1))
    # what came with a version is in the row of that version, and what brings older datasets to it
    assert {int(number) - 1 for number, text in rows.items() if "`scenicq index`" in text} == UPGRADABLE
