"""What scenicq/README.md claims of the code that no other test guards."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
LIBRARY = ROOT / "scenicq"
FILES = sorted(LIBRARY.rglob("*.py"))
README = (LIBRARY / "README.md").read_text()

RECURSIVE: dict[str, str] = {}
"""Functions that call themselves, with what bounds their depth."""

DATASETS = re.compile(
    r"nuscenes|argoverse|waymo|lyft|kitti|carla|lgsvl|opendrive|openlabel|boston|singapore", re.IGNORECASE
)


@cache
def tree(file: Path) -> ast.Module:
    return ast.parse(file.read_text())


def named(file: Path) -> str:
    return file.relative_to(LIBRARY).as_posix()


def functions(scope: ast.AST, prefix: str = "") -> Iterator[tuple[str, str, ast.AST]]:
    """Functions with their qualified name and that of the class or function around them."""
    for node in ast.iter_child_nodes(scope):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            name = f"{prefix}{node.name}"
            if not isinstance(node, ast.ClassDef):
                yield name, prefix, node
            yield from functions(node, f"{name}.")
        else:
            yield from functions(node, prefix)


def calls(name: str, prefix: str, function: ast.AST, known: set[str]) -> set[str]:
    """Functions of the same file that a function calls by their plain name, or as methods of `self`."""
    found: set[str] = set()
    for node in ast.walk(function):
        if not isinstance(node, ast.Call):
            continue
        match node.func:
            case ast.Name(id=called):
                scopes = [f"{name}.", *(name[: end + 1] for end, sign in enumerate(name) if sign == "."), ""]
                found.update(next(([f"{s}{called}"] for s in scopes if f"{s}{called}" in known), []))
            case ast.Attribute(value=ast.Name(id="self" | "cls"), attr=called):
                around = prefix
                while around and f"{around}{called}" not in known:
                    around = ".".join(around.split(".")[:-2]) + "." if around.count(".") > 1 else ""
                if around:
                    found.add(f"{around}{called}")
            case _:
                pass
    return found & known


def recursive(file: Path) -> set[str]:
    """Functions of a file that may call themselves, directly or through others of the file."""
    all_ = {name: (prefix, node) for name, prefix, node in functions(tree(file))}
    graph = {name: calls(name, prefix, node, set(all_)) for name, (prefix, node) in all_.items()}
    found: set[str] = set()
    for start in graph:
        todo, seen = list(graph[start]), set[str]()
        while todo:
            name = todo.pop()
            if name == start:
                found.add(start)
                break
            if name not in seen:
                seen.add(name)
                todo += graph[name]
    return found
