"""A change reaches functions that exist already, wherever they are kept."""

import ast
import importlib.util
import sys

import pytest

pytest.importorskip("coverage", reason="the tools of `make mutate` are not installed")
from mutate import Survey, exchange, mutants

TEXT = """
from functools import lru_cache

def plain(a, b):
    return a + b

class Holder:
    @property
    def value(self):
        return [each for each in (1, 2) if each < 2]

@lru_cache
def kept(a):
    def inner():
        return a * 2
    return inner()
"""


def test_functions_get_the_code_of_a_changed_file(tmp_path):
    file = tmp_path / "changing.py"
    file.write_text(TEXT)
    spec = importlib.util.spec_from_file_location("changing", file)
    module = importlib.util.module_from_spec(spec)
    sys.modules.pop("changing", None)
    spec.loader.exec_module(module)
    plain, holder = module.plain, module.Holder()
    tree = ast.parse(TEXT)
    seen = set()
    for _, what in mutants(tree):
        ast.fix_missing_locations(tree)
        exchange(compile(tree, str(file), "exec"))
        module.kept.cache_clear()
        seen.add((what, plain(1, 2), str(holder.value), module.kept(5)))
    assert {
        ("Add -> Sub", -1, "[1]", 10), ("Lt -> LtE", 3, "[1, 2]", 10), ("Mult -> Add", 3, "[1]", 7),
        ("returns None", None, "[1]", 10), ("returns None", 3, "None", 10), ("2 -> 3", 3, "[1]", 15),
    } <= seen  # fmt: skip
    exchange(compile(ast.parse(TEXT), str(file), "exec"))
    assert (plain(1, 2), holder.value) == (3, [1])


def test_annotations_are_no_code():
    tree = ast.parse(
        "def f(a: int | None, *, b: dict[1, 2] = 3) -> str | None:\n    c: int | str = a | b\n    return c\n"
    )
    assert sorted(what for _, what in mutants(tree)) == ["3 -> 4", "BitOr -> BitAnd", "returns None"]


def test_what_changes_no_value_is_left_alone():
    tree = ast.parse(
        "@dataclass(frozen=True, slots=True, eq=False)\nclass A:\n    b: int = field(default=1, repr=False)\n"
        "@dataclass(frozen=True)\nclass B:\n    pass\n"
        "@lru_cache(maxsize=8)\ndef f(a):\n    zip(a, a, strict=True)\n    zip(a, a, strict=False)\n"
    )
    assert sorted(what for _, what in mutants(tree)) == ["1 -> 2", "False -> True", "False -> True", "True -> False"]


def told(cost, **lines):
    return {"cost": cost, "lines": {"f.py": f"{sum(1 << each for each in lines['f']):x}"} if lines else {}}


def test_one_test_of_each_function_comes_before_the_next_of_any():
    survey = Survey(
        {
            "t.py::a[1]": told(1.0, f=[3]), "t.py::a[2]": told(0.5, f=[3, 4]), "t.py::b": told(2.0, f=[3]),
            "t.py::c": told(3.0, f=[9]), "t.py::d": told(4.0),
        },
        4.0,
    )  # fmt: skip
    assert survey.tests("f.py", range(3, 4)) == ["t.py::a[2]", "t.py::b", "t.py::a[1]"]
    assert survey.tests("f.py", range(4, 5)) == ["t.py::a[2]"]
    assert survey.tests("f.py", range(7, 8)) == ["t.py::a[2]", "t.py::b", "t.py::a[1]"]
    assert survey.tests("g.py", range(7, 8)) == ["t.py::a[2]", "t.py::b", "t.py::a[1]"]


def test_what_returns_nothing_already_is_not_changed():
    assert [what for _, what in mutants(ast.parse("def f(a):\n    if a:\n        return None\n    return a\n"))] == [
        "condition inverted", "returns None",
    ]  # fmt: skip
