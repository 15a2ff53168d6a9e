"""The table of limits: it is whole, each limit is read, and the page of contributors is made of it.

What becomes of answers at each limit's least is in `tests/units/query/test_every_limit.py`.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from scenicq import limits as module
from scenicq.limits import LIMITS, Beyond, Limits, limit_exceeded, limits

LIBRARY = Path(module.__file__).parent
PAGE = LIBRARY / "limits.md"
LAYERS = ("syntax", "compiler", "forest", "geometry", "match", "query", "smt", "store", "temporal")
LIKE_A_LIMIT = re.compile(r"_?(MOST|FEW|FEWEST|DEEPEST|LONGEST|LARGEST|MAX|ATTEMPTS|TRIES|PATIENCE|BUDGET)(_[A-Z]+)*$")
NO_LIMITS = {
    "forest/improvise.py": "_PATIENCE: when regions are cut, which takes none away",
    "forest/step_counts.py": "FEWEST, LONGEST: Scenic's steps",
    "geometry/direction_surroundings.py": "_LARGEST: a size of squares",
    "geometry/driven_courses.py": "_FEW: pairs that are looked at without a search tree",
    "match/decide/decomposition.py": "_FEW_OPTIONS: which of two ways comes first",
    "match/fields/witness_search.py": "_FEW: draws of a search that has nowhere to go",
    "query/execution/result_files.py": "_LONGEST: what a cell of a file may be",
    "query/execution/sql_deadline.py": "_LONGEST_WAIT_S: how long a thread waits at a time",
    "query/explain/changes.py": "MOST_M: how far `--near` looks",
    "query/explain/tolerance_share.py": "_LONGEST_S: the time of a frame that nobody asked for",
    "query/explain/violations.py": "_LONGEST_NAME: a name that is shown",
    "query/prefilter/executor.py": "_FEWEST_FRAMES, _MOST_FRAMES, _MOST_NAMED: sizes of blocks",
    "smt/smtlib.py": "_LONGEST: nesting beyond which a part has a name",
    "store/arrays.py": "FEW, MOST_BYTES: how an array is made",
    "store/camera_rows.py": "LARGEST_IMAGE: what an image may be",
    "store/map_fit.py": "MOST_MAPS, _MOST_VEHICLES, _FEWEST...: a sample that is measured",
    "store/map_validation.py": "_DEEPEST: what a map may be",
    "store/motion.py": "LONGEST_GAP_US: what motion means",
    "store/read_lock.py": "_TRIES: of a lock",
    "store/reader.py": "_FEW: how texts are decoded",
    "store/remote.py": "_PATIENCE_S: for an answer of a server",
    "store/unpacked.py": "_MOST_TIMES: what a file may be",
    "store/validation.py": "_MOST_BYTES: what a file may be",
    "store/value_rules.py": "LONGEST_NAME, LONGEST_JSON, _LONGEST_NUMBER: what values may be",
    "store/wkb.py": "_FEWEST: points of a line",
    "temporal/definedness.py": "_LARGEST_EXPONENT: where floats end",
    "temporal/run_steps.py": "_MOST_COLUMNS: columns that are remembered",
}
"""Constants with such names that end no search, by file."""


def page() -> str:
    """The table for people."""
    rows = [
        f"| `{each.name}` | {each.value:,} | {each.unit} {each.guards} | {': '.join(filter(None, words))} |"
        for each in limits()
        for words in [(each.beyond.value, each.more)]
    ]
    head = (
        "# Every limit\n\nEvery limit at which a search ends: how much is allowed, of what, and what happens beyond.\n"
        "Made from `limits.py` by `make golden`.\n\n| limit | most | of what | beyond |\n|---|---|---|---|\n"
    )
    return head + "\n".join(rows) + "\n"


def sources() -> Iterator[tuple[str, str]]:
    for path in sorted(LIBRARY.rglob("*.py")):
        yield path.relative_to(LIBRARY).as_posix(), path.read_text(encoding="utf-8")


def test_the_page_is_made_of_the_table(request):
    if request.config.getoption("--update-golden"):
        PAGE.write_text(page(), encoding="utf-8")
    assert PAGE.read_text(encoding="utf-8") == page(), "`make golden` rewrites it"


def test_each_limit_is_read_and_each_that_is_read_stands_in_the_table():
    read = {name for _, text in sources() for name in re.findall(r"\bLIMITS\.(\w+)", text)}
    assert read == {each.name for each in limits()}
    assert all(getattr(LIMITS, each.name) == each.value for each in limits())


def test_what_ends_undecided_says_why_and_which_limit_it_was():
    told = {each.name: each for each in limits()}
    assert all(bool(each.more) == (each.beyond not in (Beyond.REFUSED, Beyond.SHORTER)) for each in told.values())
    raised = {name for _, text in sources() for name in re.findall(r'\blimit_exceeded\("(\w+)"\)', text)}
    assert len(raised) > 8
    for name in raised:
        assert name in told
        error = limit_exceeded(name)
        assert error.reason
        assert error.detail == f"more than {told[name].value:,} {told[name].unit} {told[name].guards}"


def test_what_is_raised_has_the_limit_that_holds(monkeypatch):
    monkeypatch.setattr(LIMITS, "signatures", 3)
    assert limit_exceeded("signatures").detail.startswith("more than 3 signatures")


def names(tree: ast.Module) -> Iterator[str]:
    """The names of numbers that a module or one of its classes assigns, several at once, too."""
    for body in (tree.body, *(each.body for each in tree.body if isinstance(each, ast.ClassDef))):
        for node in body:
            targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
            text = isinstance(value := getattr(node, "value", None), ast.Constant) and isinstance(value.value, str)
            for target in targets:
                each = target.elts if isinstance(target, ast.Tuple) else [target]
                yield from (one.id for one in each if isinstance(one, ast.Name) and not text)


def test_no_limit_stands_elsewhere():
    found: dict[str, list[str]] = {}
    for file, text in sources():
        like = [name for name in names(ast.parse(text)) if LIKE_A_LIMIT.match(name)]
        if like and file.split("/")[0] in LAYERS:
            found[file] = like
    assert found.keys() == NO_LIMITS.keys()
    for file, like in found.items():
        assert set(like) <= set(re.findall(r"\w+", NO_LIMITS[file])) or "..." in NO_LIMITS[file], file


@pytest.mark.parametrize("name", [each.name for each in limits()])
def test_a_limit_is_a_plain_number(name):
    assert type(getattr(Limits(), name)) in (int, float)
