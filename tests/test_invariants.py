"""What scenicq/README.md and the decisions claim of the code that no other test guards."""

from __future__ import annotations

import ast
import builtins
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[1]
LIBRARY = ROOT / "scenicq"
FILES = sorted(LIBRARY.rglob("*.py"))
README = (LIBRARY / "README.md").read_text()
DECISIONS = {page.name: page.read_text() for page in sorted((LIBRARY / "decisions").glob("*.md"))}

PASSES = ("forest/", "match/", "query/prefilter/", "temporal/")
"""Where expressions are gone through. Syntax and compiler recurse over the program's text, which the parser limits."""
RECURSIVE = {
    "forest/among.py": "what is asked of each label object asks others again, as deep as the program nests it",
    "forest/value_numbers.py": "likewise",
    "forest/unobserved.py": "choices inside one comparison, at most a stated number of them",
    "match/decide/cascade.py": "the discrete variables and truth values of a group, at most a stated number of them",
    "match/decide/decomposition.py": "each part has fewer constraints, or fewer distances of hidden points",
    "match/search/choice_search.py": "choices met only in what another choice leads to, to a stated depth",
}
"""Files with functions that call themselves, and what bounds the depth."""
DATASETS = re.compile(r"nuscenes|argoverse|waymo|lyft|kitti|interaction dataset|boston", re.IGNORECASE)
CORE = ("syntax", "geometry", "forest", "compiler", "smt", "match")
MOST_LINES = 180
PROGRAMS = ("importers/opendrive_worker.py", "processes.py", "smt/worker.py")


@cache
def tree(file: Path) -> ast.Module:
    return ast.parse(file.read_text())


def named(file: Path) -> str:
    return file.relative_to(LIBRARY).as_posix()


def functions(scope: ast.AST, prefix: str = "", owner: str = "") -> Iterator[tuple[str, str, ast.AST]]:
    """Functions with their qualified name and that of the class around them."""
    for node in ast.iter_child_nodes(scope):
        if isinstance(node, ast.ClassDef):
            yield from functions(node, f"{prefix}{node.name}.", f"{prefix}{node.name}.")
        elif isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            yield f"{prefix}{node.name}", owner, node
            yield from functions(node, f"{prefix}{node.name}.", owner)
        else:
            yield from functions(node, prefix, owner)


def calls(name: str, owner: str, function: ast.AST, known: set[str]) -> set[str]:
    """Functions of the file that a function calls by their plain name, or as methods of `self` or of a new object."""
    found: set[str] = set()
    for node in ast.walk(function):
        match node:
            case ast.Call(func=ast.Name(id=called)):
                # a name in a function is one of its own, of a function around it, or of the file
                around = [name[:end] for end, sign in enumerate(name) if sign == "."]
                scopes = [f"{each}." for each in (name, *reversed(around)) if each in known]
                found.update(next(([f"{s}{called}"] for s in (*scopes, "") if f"{s}{called}" in known), []))
            case ast.Call(func=ast.Attribute(value=ast.Call(func=ast.Name(id=made)), attr=called)):
                found.add(f"{made}.{called}")
            case ast.Call(func=ast.Attribute(value=ast.Name(id="self" | "cls"), attr=called)):
                found.add(f"{owner}{called}")
            case _:
                pass
    return found & known


def recursive(file: Path) -> set[str]:
    """Functions of a file that may call themselves, directly or through others of the file."""
    there = {name: (owner, node) for name, owner, node in functions(tree(file))}
    graph = {name: calls(name, owner, node, set(there)) for name, (owner, node) in there.items()}
    found: set[str] = set()
    for start, called in graph.items():
        todo, seen = list(called), set[str]()
        while todo:
            name = todo.pop()
            if name == start:
                found.add(start)
                break
            if name not in seen:
                seen.add(name)
                todo += graph[name]
    return found


def test_passes_over_expressions_are_iterative_or_say_what_bounds_them():
    found = {named(file) for file in FILES if named(file).startswith(PASSES) and recursive(file)}
    assert found == set(RECURSIVE)


def test_recursion_is_found(tmp_path):
    file = tmp_path / "some.py"
    file.write_text(
        "def plain(x):\n    return other(x)\n\ndef other(x):\n    return x\n\n"
        "def direct(x):\n    return direct(x)\n\n"
        "class Some:\n    def one(self):\n        return self.two()\n    def two(self):\n        return self.one()\n"
        "    def plain(self):\n        return plain(self)\n"
        "class Made:\n    def run(self):\n        return begin()\n\ndef begin():\n    return Made().run()\n"
    )
    assert recursive(file) == {"direct", "Some.one", "Some.two", "Made.run", "begin"}


def test_the_library_never_prints_exits_or_reads_the_environment():
    names = {"print", "input", "exit", "quit", "breakpoint"}
    attributes = {("sys", "exit"), ("sys", "argv"), ("sys", "stdout"), ("sys", "stderr"), ("os", "_exit")}
    attributes |= {("os", "environ"), ("os", "getenv"), ("os", "environb")}
    found: set[str] = set()
    for file in FILES:
        for node in ast.walk(tree(file)):
            match node:
                case ast.Call(func=ast.Name(id=name)) if name in names:
                    found.add(f"{named(file)}: {name}")
                case ast.Attribute(value=ast.Name(id=module), attr=name) if (module, name) in attributes:
                    found.add(f"{named(file)}: {module}.{name}")
                case _:
                    pass
    # programs of their own, which the library starts, read their arguments, and end as processes do
    assert {each for each in found if not each.startswith(PROGRAMS)} == set()


def test_duckdb_is_connected_in_one_place_alone():
    # where Python is interactive it draws progress bars unless it is told not to
    there = [named(file) for file in FILES if re.search(r"duckdb\.connect\(", file.read_text())]
    assert there == ["store/in_memory.py"]
    code = "from scenicq.store.in_memory import connect_in_memory as c\n"
    code += "print(c().execute(\"SELECT current_setting('enable_progress_bar')\").fetchone())"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "(False,)\n"
    # DuckDB takes this for a notebook without widgets, where it draws none and refuses to be told so
    notebook = (
        "import sys, types\nkernel = types.SimpleNamespace(config={'IPKernelApp': {}})\n"
        "sys.modules['IPython'] = types.SimpleNamespace(get_ipython=lambda: kernel)\n"
    )
    refused = "import duckdb\nduckdb.connect(':memory:').execute('SET enable_progress_bar = false')"
    told = subprocess.run([sys.executable, "-c", notebook + refused], capture_output=True, text=True, check=False)
    assert "ipywidgets" in told.stderr
    done = subprocess.run([sys.executable, "-c", notebook + code], capture_output=True, text=True, check=True)
    assert done.stdout == "(False,)\n"


def test_the_core_knows_no_dataset():
    for file in FILES:
        if named(file).startswith(tuple(f"{folder}/" for folder in CORE)):
            assert not DATASETS.search(file.read_text()), named(file)


def test_no_sentence_begins_with_of():
    for file in FILES:
        assert not re.search(r'"Of |[.;] Of [a-z`]', file.read_text()), named(file)
    for page in (
        ROOT / "README.md",
        *LIBRARY.rglob("*.md"),
        *(ROOT / "tests").rglob("*.md"),
        *(ROOT / "cli").glob("*.md"),
    ):
        assert not re.search(r"(^|\n|[.;:] |[-*] )Of ", page.read_text()), page


def test_the_matcher_is_a_page():
    assert len((LIBRARY / "match" / "matcher.py").read_text().splitlines()) <= MOST_LINES


def public_types(file: Path) -> Iterator[str]:
    """Names of the classes and type aliases of a file that others may import."""
    for node in tree(file).body:
        match node:
            case ast.ClassDef(name=name) if not name.startswith("_"):
                yield name
            case ast.AnnAssign(target=ast.Name(id=name), annotation=ast.Name(id="TypeAlias")) if name[0] != "_":
                yield name
            case _:
                pass


def test_a_type_has_its_name_alone():
    found: dict[str, list[str]] = {}
    for file in (*FILES, *sorted((ROOT / "cli").rglob("*.py"))):
        for name in public_types(file):
            found.setdefault(name, []).append(file.relative_to(ROOT).as_posix())
    assert {name: files for name, files in found.items() if len(files) > 1} == {}


ENGINE = ("match/", "query/", "forest/", "temporal/")


def test_the_code_uses_what_the_engine_makes_public():
    asked: set[str] = set()
    for file in (*FILES, *sorted((ROOT / "cli").rglob("*.py")), *sorted((ROOT / "sample_data").rglob("*.py"))):
        attributes = {node.attr for node in ast.walk(tree(file)) if isinstance(node, ast.Attribute)}
        for node in ast.walk(tree(file)):
            if isinstance(node, ast.ImportFrom) and node.module:
                names = {f"{node.module}.{alias.name}" for alias in node.names}
                asked |= names | {f"{name}.{attribute}" for name in names for attribute in attributes}
    unused: list[str] = []
    for file in FILES:
        if named(file).startswith(ENGINE):
            module = ".".join(file.relative_to(ROOT).with_suffix("").parts)
            everywhere = loads(tree(file))
            for node in tree(file).body:
                inside = loads(node)
                unused += [
                    f"{module}.{name}"
                    for name in top_names(node)
                    if everywhere[name] == inside[name] and f"{module}.{name}" not in asked
                ]
    assert unused == []


def top_names(statement: ast.stmt) -> list[str]:
    """The public names that a statement of a file defines."""
    match statement:
        case ast.FunctionDef(name=name) | ast.ClassDef(name=name) | ast.AnnAssign(target=ast.Name(id=name)):
            found = [name]
        case ast.Assign(targets=targets):
            found = [target.id for target in targets if isinstance(target, ast.Name)]
        case _:
            found = []
    return [name for name in found if not name.startswith("_")]


def loads(root: ast.AST) -> Counter[str]:
    """How often each name is read."""
    return Counter(node.id for node in ast.walk(root) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load))


def test_docstrings_name_errors_that_exist():
    known = {name for name, value in vars(builtins).items() if isinstance(value, type)}
    known |= {node.name for file in FILES for node in ast.walk(tree(file)) if isinstance(node, ast.ClassDef)}
    found: dict[str, set[str]] = {}
    for file in FILES:
        for _, _, node in functions(tree(file)):
            told = (ast.get_docstring(node) or "").partition("Raises:\n")[2].partition("\n\n")[0]
            found.setdefault(named(file), set()).update(re.findall(r"^    (\w+):", told, re.MULTILINE))
    assert {file: names - known for file, names in found.items() if names - known} == {}
    assert sum(map(len, found.values())) > 100


WORDS = 3_000
"""A page that says where things are is read whole."""


def sections(page: str) -> dict[str, str]:
    """The text under each heading of the second level."""
    return dict(zip(*[iter(re.split(r"^## (.*)$", page, flags=re.MULTILINE)[1:])] * 2, strict=True))


def test_the_map_is_short():
    assert len(README.split()) <= WORDS


def test_the_map_names_every_folder():
    told = SECTIONS["Folders, top to bottom"]
    folders = [path for path in LIBRARY.rglob("*") if path.is_dir() and any(path.glob("*.py"))]
    assert len(folders) > 20
    missing = [path.name for path in (*folders, ROOT / "cli", LIBRARY / "decisions") if f"`{path.name}/" not in told]
    assert missing == []


def test_every_path_that_pages_for_contributors_name_exists():
    folders = "|".join(path.name for path in LIBRARY.iterdir() if path.is_dir())
    guides = {page.name: page.read_text() for page in (LIBRARY / "docs").glob("*.md")}
    for name, page in [("the map", README), *DECISIONS.items(), *guides.items()]:
        paths = re.findall(r"(?<![\w/.])((?:tests|scenicq|sample_data|cli)/[\w./-]*[\w/])", page)
        assert [path for path in paths if not (ROOT / path).exists()] == [], name
        inside = re.findall(rf"`((?:{folders})/(?:[\w/]+/|[\w/]+\.\w+|))`", page)
        assert [path for path in inside if not (LIBRARY / path).exists()] == [], name


def test_decisions_say_first_what_holds_and_last_what_was():
    index = DECISIONS["README.md"]
    assert re.findall(r"\]\(([\w-]+\.md)\)", index) == sorted(
        (name for name in DECISIONS if name != "README.md"), key=lambda name: index.index(f"({name})")
    )
    for name, page in DECISIONS.items():
        if name != "README.md":
            titles = list(sections(page))
            assert titles[0].startswith("What "), name
            assert titles[-1] == "History", name


SECTIONS = sections(README)
MOST_HOPS = 3
QUESTIONS = {
    "Where is position tolerance applied?", "What happens to a random lane?", "Why was this frame no match?",
    "Where is a requirement turned into SQL?", "What runs when nothing is hidden?",
    "Which limit ended this search?",
}  # fmt: skip


def defined(file: Path) -> set[str]:
    """Names of functions, classes, methods and values of a file."""
    found: set[str] = set()
    for node in ast.walk(tree(file)):
        match node:
            case ast.FunctionDef(name=name) | ast.ClassDef(name=name):
                found.add(name)
            case ast.Name(id=name, ctx=ast.Store()):
                found.add(name)
            case _:
                pass
    return found


def rows(section: str) -> list[list[str]]:
    """The rows of a section's table, without its head."""
    lines = [line for line in section.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:]]


def test_each_question_of_a_stranger_is_answered_in_three_files_at_most():
    asked: set[str] = set()
    for question, path in rows(SECTIONS["Where to look"].partition("What is new")[0]):
        asked.add(question)
        hops = re.findall(r"`([\w/]+\.py)`(?: \(([^)]*)\))?", path)
        assert 1 <= len(hops) <= MOST_HOPS, question
        for file, told in hops:
            assert (LIBRARY / file).exists(), file
            assert set(re.findall(r"`(\w+)`", told)) <= defined(LIBRARY / file), (question, file)
    assert asked >= QUESTIONS


def test_the_places_of_what_is_new_are_there():
    table = SECTIONS["Where to look"].partition("What is new")[2]
    told = re.findall(r"`([\w/]+\.py)` \(`(\w+)`", table)
    assert len(told) > 5
    for file, name in told:
        path = ROOT / file if file.startswith("cli/") else LIBRARY / file
        assert name in defined(path), (file, name)


def imports(file: Path) -> set[str]:
    """The modules of the library that a file imports."""
    return {
        node.module
        for node in ast.walk(tree(file))
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("scenicq.")
    }


def test_backtracking_knows_no_geometry():
    known = imports(LIBRARY / "match/search/backtracking.py")
    assert known == {"scenicq.budget", "scenicq.match.problem.bipartite_matching"}
    assert imports(LIBRARY / "match/problem/bipartite_matching.py") == set()


def test_a_solver_in_a_process_of_its_own_loads_no_geometry():
    todo, seen = ["smt/dreal", "smt/worker"], set[str]()
    while todo:
        name = todo.pop()
        assert not name.startswith("geometry"), seen
        seen.add(name)
        # what is imported for the type checker alone stands deeper
        here = [node.module for node in tree(LIBRARY / f"{name}.py").body if isinstance(node, ast.ImportFrom)]
        modules = {module.removeprefix("scenicq.").replace(".", "/") for module in here if module}
        todo += {each for each in modules if (LIBRARY / f"{each}.py").exists()} - seen
    assert {"forest/nodes", "forest/scalars", "smt/problem", "smt/inverse_elimination"} <= seen


STEPS = sections(DECISIONS["matching.md"])["Steps of matching"]


def test_every_step_of_matching_is_one_that_is_measured():
    source = tree(ROOT / "tests/tools/bench/steps.py")
    (measured,) = (
        [key.value for key in node.value.keys if isinstance(key, ast.Constant)]
        for node in source.body
        if isinstance(node, ast.AnnAssign) and ast.unparse(node.target) == "STEPS" and isinstance(node.value, ast.Dict)
    )
    # without the cascade nothing is decided, and no solver is asked there
    assert {name for name, *_ in rows(STEPS)} == {*measured, "cascade", "solver"}


def test_every_step_of_matching_names_its_file():
    assert [file for _, file, *_ in rows(STEPS) if not (LIBRARY / file.strip("`")).exists()] == []


def names_of_the_code() -> set[str]:
    """Names of files, and all that stands in them."""
    known: set[str] = set()
    for file in (*FILES, *(ROOT / "cli").rglob("*.py")):
        known |= {*file.relative_to(ROOT).parts, file.stem}
        for node in ast.walk(tree(file)):
            for field in ("name", "id", "attr", "arg"):
                known.add(str(getattr(node, field, "")))
    return known


def test_every_name_in_pages_for_contributors_is_one_of_the_code():
    known = names_of_the_code()
    for page, text in {"README.md": README, **DECISIONS}.items():
        # what was tried, and what was, has names that are gone
        today = "".join(
            part for title, part in sections(text).items() if title not in ("Tried and left out", "History")
        )
        told = {name for name in re.findall(r"`([^`]+)`", today) if re.fullmatch(r"[\w./]+", name)}
        missing = {name for name in told if not known.issuperset(re.split(r"[./]", name.strip("/")))}
        missing = {name for name in missing if not (ROOT / name).exists() and not re.search(r"\.(py|md|json)$", name)}
        assert missing == ALIEN.get(page, set()), page


ALIEN = {
    "execution.md": {"print", "_SUCCESS", "ProcessPoolExecutor", "httpfs"},
    "language.md": {"if", "and", "or", "Object", "OrientedPoint"},
    "store.md": {"numpy.polyfit"},
    "testing.md": {"one_in"},
}
"""Names on a page that are not of the code: of Scenic, of Python, of packages and of the tests."""
