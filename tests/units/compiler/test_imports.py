"""Imports are resolved as Python resolves them: the same files, written as Python, are the oracle."""

from __future__ import annotations

import json
import os
import random
import subprocess
import sys
from pathlib import Path

import pytest

from scenicq.compiler.program import compile_scenario
from scenicq.errors import ScenarioError, Source
from scenicq.geometry.default_street import street
from scenicq.query.execution.program_files import SiblingFiles

Files = dict[str, str]
"""The files of a program by their names without endings; `main` is the program, which gives `result` a number."""

_PYTHON = """
import json, math, sys
results = []
for folder in sys.argv[1:]:
    known = set(sys.modules)
    sys.path.insert(0, folder)
    try:
        space = {"__name__": "main", "__package__": ""}
        exec(open(folder + "/main.py").read(), space)
        results.append(space["result"])
    except Exception as error:
        results.append(None)
    sys.path.remove(folder)
    sys.path_importer_cache.clear()
    for name in set(sys.modules) - known:
        del sys.modules[name]
print(json.dumps(results))
"""
_MODULES = ("a", "b", "p/__init__", "p/a", "p/b", "p/q/__init__", "p/q/a", "n/a", "q")
"""The folder `n` has no `__init__`."""


def _write(folder: Path, files: Files, ending: str) -> None:
    for name, text in files.items():
        path = folder / f"{name}{ending}"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")


def _by_python(folders: list[Path]) -> list[float | None]:
    done = subprocess.run(
        [sys.executable, "-B", "-I", "-c", _PYTHON, *map(str, folders)], capture_output=True, text=True, check=True
    )
    return json.loads(done.stdout)


def _by_scenic(folder: Path) -> float | None:
    path = folder / "main.scenic"
    text = path.read_text(encoding="utf-8") + "ego = new Object at (result, 0)\n"
    try:
        scenario = compile_scenario(Source(str(path), text), street(), version=3, loader=SiblingFiles(path))
    except ScenarioError as error:
        if error.diagnostics[0].code not in ("unknown-model", "unknown-name", "unknown-attribute"):
            raise
        return None
    return scenario.objects[scenario.ego].properties["position"].value.value[0]  # type: ignore[union-attr]


def _statement(draw: random.Random, package: str, number: int) -> str:
    """An import and what it is used for: the name `v<number>`."""
    names = ["a", "b", "p", "q", "n", "p.a", "p.b", "p.q", "p.q.a", "n.a"]
    match draw.randrange(6):
        case 0:
            name = draw.choice(names)
            return f"import {name}\nv{number} = {draw.choice([name, name.partition('.')[0]])}.x\n"
        case 1:
            return f"import {draw.choice(names)} as m\nv{number} = m.x\n"
        case 2:
            return f"from {draw.choice(names)} import x as v{number}\n"
        case 3:
            dots = "." * draw.randint(1, 3)
            return f"from {dots}{draw.choice(['', 'a', 'b', 'q', 'q.a'])} import x as v{number}\n"
        case 4:
            start = draw.choice(["." * draw.randint(1, 2), "p", "p.q", "n"])
            return f"from {start} import {draw.choice('abq')} as m\ndef f():\n    return m.x\nv{number} = f()\n"
        case _:
            return f"from {draw.choice(names)} import *\nv{number} = x\n"


def _drawn(seed: int) -> Files:
    draw = random.Random(seed)
    files: Files = {}
    for value, name in enumerate(_MODULES, 1):
        if draw.random() < 0.15 and name not in ("p/__init__",):
            continue
        text = f"x = {value}\n_hidden = {value}\n"
        for number in range(draw.choice([0, 0, 0, 1, 1, 2])):
            text += _statement(draw, name.rpartition("/")[0], number)
            text += draw.choice(["", "", f"x = 10 * v{number}\n"])
        files[name] = text
    files["main"] = "".join(_statement(draw, "", number) for number in range(draw.randint(1, 2))) + "result = v0\n"
    return files


def _compare(programs: list[Files], folder: Path) -> tuple[int, int]:
    """Compare all programs; the numbers of those that have a result, and of those that have none."""
    folders = [folder / str(number) for number in range(len(programs))]
    for each, files in zip(folders, programs, strict=True):
        _write(each, files, ".py")
        _write(each, files, ".scenic")
    expected = _by_python(folders)
    for each, files, result in zip(folders, programs, expected, strict=True):
        assert _by_scenic(each) == result, files
    return sum(result is not None for result in expected), sum(result is None for result in expected)


def test_random_trees_of_files_mean_what_they_mean_in_python(tmp_path: Path) -> None:
    right, wrong = _compare([_drawn(seed) for seed in range(60)], tmp_path)
    assert right >= 15
    assert wrong >= 15


_PROGRAMS: dict[str, tuple[str, Files]] = {
    "a package's own names": ("import p\nresult = p.x\n", {"p/__init__": "x = 5\n"}),
    "a module of a package": ("import p.a\nresult = p.x + p.a.y\n", {"p/__init__": "x = 5\n", "p/a": "y = 2\n"}),
    "a module of a package by from": ("from p import a\nresult = a.y\n", {"p/__init__": "", "p/a": "y = 2\n"}),
    "a module that nobody imports": ("import p\nresult = p.a.y\n", {"p/__init__": "", "p/a": "y = 2\n"}),
    "a sibling": ("from p.a import y\nresult = y\n",
                  {"p/__init__": "", "p/a": "from . import b\ny = b.z\n", "p/b": "z = 3\n"}),
    "a package above": ("from p.q import z\nresult = z\n",
                        {"p/__init__": "", "p/c": "z = 4\n", "p/q/__init__": "from ..c import z\n"}),
    "above all packages": ("import p.a\nresult = 1\n",
                           {"p/__init__": "", "p/a": "from ..c import z\n", "c": "z = 4\n"}),
    "dots in the program": ("from .c import z\nresult = z\n", {"c": "z = 4\n"}),
    "a circle by import": ("import a\nresult = a.x + a.b.y\n", {"a": "import b\nx = 1\n", "b": "import a\ny = 2\n"}),
    "a circle by from": ("import a\nresult = 1\n",
                         {"a": "from b import y\nx = 1\n", "b": "from a import x\ny = 2\n"}),
    "a circle used late": ("import a\nresult = a.b.f()\n",
                           {"a": "import b\nx = 1\n", "b": "import a\ndef f():\n    return a.x\n"}),
    "a circle in a package": ("import p.b\nresult = p.b.f()\n",
                              {"p/__init__": "from . import a\n", "p/a": "from . import b\nx = 1\n",
                               "p/b": "from . import a\ndef f():\n    return a.x\n"}),
    "dots in a function": ("from p.a import f\nresult = f()\n",
                           {"p/__init__": "", "p/a": "def f():\n    from . import b\n    return b.z\n",
                            "p/b": "z = 3\n"}),
    "a star takes no name of one's own": ("from a import *\nresult = _x\n", {"a": "_x = 1\n"}),
    "a folder without __init__": ("from n import a\nresult = a.x\n", {"n/a": "x = 7\n"}),
    "a file goes before a bare folder": ("import n.a\nresult = 1\n", {"n/a": "x = 7\n", "n": "x = 8\n"}),
    "a package goes before a file": ("import p\nresult = p.x\n", {"p/__init__": "x = 1\n", "p": "x = 2\n"}),
    "math is Python's": ("import math\nresult = math.pi\n", {"math": "pi = 3\n", "math/a": "x = 1\n"}),
}  # fmt: skip


@pytest.mark.parametrize("name", _PROGRAMS)
def test_a_tree_of_files_means_what_it_means_in_python(name: str, tmp_path: Path) -> None:
    program, files = _PROGRAMS[name]
    _compare([{"main": program, **files}], tmp_path)


@pytest.mark.parametrize("link", ["a.scenic", "p", "p/__init__.scenic", "p/a.scenic", "n"])
@pytest.mark.parametrize("to", ["outside", "inside"])
def test_a_link_leads_to_no_file_outside_of_the_folder(link: str, to: str, tmp_path: Path) -> None:
    inside, outside = tmp_path / "inside", tmp_path / "outside"
    elsewhere = (inside if to == "inside" else outside) / "elsewhere"
    text = {"a": "x = 3\n", "__init__": "x = 3\nfrom . import a\n"}
    _write(elsewhere, text, ".scenic")
    _write(inside, {f"p/{name}": each for name, each in text.items()} if link.startswith("p/") else {}, ".scenic")
    inside.mkdir(exist_ok=True)
    path = inside / link
    path.unlink(missing_ok=True)
    target = elsewhere if path.suffix == "" else elsewhere / path.name
    path.symlink_to(os.path.relpath(target, path.parent))
    name = link.removesuffix(".scenic").replace("/", ".").removesuffix(".__init__")
    (inside / "main.scenic").write_text(f"import {name}\nresult = {name}.x\n", encoding="utf-8")
    assert _by_scenic(inside) == (3 if to == "inside" else None)


def test_a_model_is_found_in_whatever_file_names_it(tmp_path: Path) -> None:
    car = "import p.a\np.a.make()\nresult = 9\n"
    files = {"p/__init__": "", "p/a": "from .b import *\ndef make():\n    return new Car at (9, 9)\n"}
    for model in ("model scenic.domains.driving.model\n", "from scenic.domains.driving.model import *\n",
                  "from scenic.domains.driving import model\nCar = model.Car\n"):  # fmt: skip
        _write(tmp_path, {"main": car, "p/b": model, **files}, ".scenic")
        assert _by_scenic(tmp_path) == 9
