"""What the type checker is told of pyarrow is so: the names are there, and take the arguments that are said."""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[3]
TYPINGS = ROOT / "scenicq" / "typings"
MODULES = {
    ".".join(file.relative_to(TYPINGS).with_suffix("").parts).removesuffix(".__init__"): file
    for file in sorted(TYPINGS.rglob("*.pyi"))
}
BUILT = {"__init__", "__enter__", "__exit__", "__iter__", "__len__", "__getitem__"}
"""Methods without documentation of their own, whose arguments nobody knows."""
UNSEEN = {"__buffer__"}
"""What Python before 3.12 has without its name."""


def families(kind: type) -> list[type]:
    """A class and those below it: what a stub says of all types, one of them has, as lists have a type of values."""
    return [kind, *(below for each in kind.__subclasses__() for below in families(each))]


def told(file: Path) -> Iterator[tuple[str, str, ast.FunctionDef | ast.AnnAssign | None]]:
    """Each name of a stub: of which class, and what is said of it."""
    for node in ast.parse(file.read_text()).body:
        match node:
            case ast.FunctionDef():
                yield "", node.name, node
            case ast.ClassDef():
                yield "", node.name, None
                for each in node.body:
                    match each:
                        case ast.FunctionDef() if each.name not in UNSEEN:
                            yield node.name, each.name, each
                        case ast.AnnAssign(target=ast.Name(id=name)):
                            yield node.name, name, each
                        case _:
                            pass
            case _:
                pass


def arguments(real: Any) -> set[str] | None:
    """The names of arguments; None where nobody knows them or any will do."""
    try:
        known = inspect.signature(real).parameters
    except (TypeError, ValueError):
        return None
    loose = {inspect.Parameter.VAR_KEYWORD, inspect.Parameter.VAR_POSITIONAL}
    return None if any(each.kind in loose for each in known.values()) else set(known)


def wrong(name: str, file: Path) -> list[str]:
    """What a stub says, and the module of that name does not have."""
    module, found = import_module(name), list[str]()
    for inside, each, node in told(file):
        owners = families(getattr(module, inside)) if inside else [module]
        there = [getattr(owner, each) for owner in owners if hasattr(owner, each)]
        if not there:
            found.append(f"{name}: {inside}.{each} is not there".replace(": .", ": "))
        elif isinstance(node, ast.FunctionDef) and each not in BUILT:
            if any(isinstance(mark, ast.Name) and mark.id == "property" for mark in node.decorator_list):
                continue
            said = {argument.arg for argument in (*node.args.args, *node.args.kwonlyargs)} - {"self", "cls"}
            known = [have for one in there if (have := arguments(one)) is not None]
            if known and not any(said <= have for have in known):
                found.append(f"{name}: {inside}.{each} takes no {sorted(said - known[0])}".replace(": .", ": "))
    return found


@pytest.mark.parametrize("name", MODULES)
def test_what_is_said_is_there(name: str) -> None:
    assert wrong(name, MODULES[name]) == []


def test_what_is_not_there_would_be_found(tmp_path: Path) -> None:
    said = ["class Table:", " def take(self, places: int) -> Table: ...", " def vanish(self): ...", "def tabel(): ..."]
    (tmp_path / "x.pyi").write_text("\n".join(said))
    assert wrong("pyarrow", tmp_path / "x.pyi") == [
        "pyarrow: Table.take takes no ['places']", "pyarrow: Table.vanish is not there", "pyarrow: tabel is not there"
    ]  # fmt: skip


def test_pyarrow_needs_no_pragmas() -> None:
    """What the checker does not know of it belongs into the stubs."""
    pragma = re.compile(r"# (pyright|type): *(.*)")
    for folder in ("scenicq", "cli"):
        for file in (ROOT / folder).rglob("*.py"):
            text = file.read_text()
            if re.search(r"^\s*(import|from) pyarrow|ArrowTable|ArrowArray|to_arrow", text, re.M):
                assert [found[0] for found in pragma.finditer(text)] == [], file
