"""The files of a program's folder, as modules: found by dotted names as Python finds them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from scenicq.errors import Source
from scenicq.syntax import ast
from scenicq.syntax.parser import parse
from scenicq.syntax.walk import walk

__all__ = ["ImportedFiles", "Loader", "ModuleFile", "absolute", "packages"]

Loader = Callable[[str], Source | None]
"""Gives the text of a file of the program's folder, by its path there; None if there is none. The text of a
folder, whose path ends with `/`, is empty."""

_OWN = frozenset({"math", "scenic", "scenicq"})
"""Packages that no file stands in for."""
_ENDINGS = (".scenic", ".sc")


@dataclass(frozen=True, slots=True)
class ModuleFile:
    """A file that can be imported: its syntax, and the package that dots in it begin at."""

    program: ast.Program
    package: str


class ImportedFiles:
    """The files that a program can import, each read once."""

    def __init__(self, loader: Loader | None, version: int | None) -> None:
        """Take what reads files, and the version of Scenic that they are written in."""
        self._loader = loader
        self._version = version
        self._files: dict[str, ModuleFile | None] = {}

    def find(self, name: str) -> ModuleFile | None:
        """The file of a module, a package's own before one of the same name; None where there is none.

        Raises:
            ScenarioError: What is wrong with its syntax.
        """
        if name not in self._files:
            self._files[name] = self._read(name)
        return self._files[name]

    def is_folder(self, name: str) -> bool:
        """Whether a folder has this name."""
        return self._load(name, "/") is not None

    def reach(self, program: ast.Program) -> Iterator[tuple[str, ModuleFile | None]]:
        """The modules that a program may import, and those that these may import, each with its file if it has one.

        Raises:
            ScenarioError: What is wrong with the syntax of one.
        """
        todo, seen = [*_named_modules(program, "")], set[str]()
        while todo:
            name = todo.pop()
            if name in seen:
                continue
            seen.add(name)
            file = self.find(name)
            yield name, file
            if file is not None:
                todo += _named_modules(file.program, file.package)

    def _read(self, name: str) -> ModuleFile | None:
        for around in [*packages(name)][:-1]:
            file = self.find(around)
            if file is not None and file.package != around:
                return None
        for inner, package in (("/__init__", name), ("", name.rpartition(".")[0])):
            for ending in _ENDINGS:
                source = self._load(name, inner + ending)
                if source is not None:
                    return ModuleFile(parse(source, self._version), package)
        return None

    def _load(self, name: str, ending: str) -> Source | None:
        if self._loader is None or name.partition(".")[0] in _OWN:
            return None
        return self._loader(name.replace(".", "/") + ending)


def packages(name: str) -> Iterator[str]:
    """The packages that a module lies in, outermost first, and the module."""
    parts = name.split(".")
    return (".".join(parts[: end + 1]) for end in range(len(parts)))


def absolute(name: str, level: int, package: str) -> str | None:
    """The whole name of a module that is named with leading dots in a package; None where they lead out of it."""
    if level == 0:
        return name
    parts = package.split(".") if package else []
    if level > len(parts):
        return None
    return ".".join([*parts[: len(parts) - level + 1], *([name] if name else [])])


def _named_modules(program: ast.Program, package: str) -> Iterator[str]:
    """The modules that a file of a package may import, those in whose packages they lie included."""
    for node in walk(*program.body):
        match node:
            case ast.Model():
                yield from packages(node.name)
            case ast.Import():
                for alias in node.aliases:
                    yield from packages(alias.path)
            case ast.ImportFrom():
                name = absolute(node.module, node.level, package)
                if name is not None:
                    yield from packages(name)
                    yield from (f"{name}.{alias.path}" for alias in node.aliases)
            case _:
                pass
