"""The notebook of the sample data: runs from top to bottom, and is kept without outputs."""

import ast
import json
import shutil
from pathlib import Path

import pytest

SAMPLES = Path(__file__).parents[3] / "sample_data"
CELLS = json.loads((SAMPLES / "walkthrough.ipynb").read_text(encoding="utf-8"))["cells"]


def test_it_has_no_outputs():
    assert CELLS
    assert not [cell for cell in CELLS if cell.get("outputs") or cell.get("execution_count")]


def _shown(code, names):
    """Run a cell; its last expression, if it ends in one, as a notebook would show it."""
    tree = ast.parse(code)
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    exec(compile(tree, "<cell>", "exec"), names)
    return None if last is None else eval(compile(ast.Expression(last.value), "<cell>", "eval"), names)


def test_every_cell_runs_and_shows_something(monkeypatch, capsys):
    monkeypatch.chdir(SAMPLES)
    names = {}
    shown = [_shown("".join(cell["source"]), names) for cell in CELLS if cell["cell_type"] == "code"]
    shutil.rmtree(names["here"])
    printed = capsys.readouterr().out
    assert printed.count("03-busy-intersection/") == len(names["crossing"]) == 5
    assert [each is not None for each in shown] == [True, True, True, False, *[True] * (len(shown) - 4)]
    assert sum(hasattr(each, "_repr_svg_") or hasattr(each, "_repr_html_") for each in shown) >= 6
    assert "parkedCar" in repr(names["verdict"])
    assert "<td>" in names["verdict"]._repr_html_()


@pytest.mark.slow
def test_jupyter_runs_it(monkeypatch, tmp_path):
    nbclient = pytest.importorskip("nbclient", reason="nbclient is not installed: `make test-all` installs it")
    pytest.importorskip("ipykernel", reason="ipykernel is not installed: `make test-all` installs it")
    import nbformat

    monkeypatch.setenv("TMPDIR", str(tmp_path))
    book = nbformat.read(SAMPLES / "walkthrough.ipynb", as_version=4)
    nbclient.NotebookClient(book, timeout=300, resources={"metadata": {"path": str(SAMPLES)}}).execute()
    kinds = {kind for cell in book.cells for output in cell.get("outputs", []) for kind in output.get("data", {})}
    assert {"image/svg+xml", "text/html", "text/plain"} <= kinds
    assert not [o for cell in book.cells for o in cell.get("outputs", []) if o.output_type == "error"]
