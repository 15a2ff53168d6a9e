"""`scenicq doctor`: which solvers load here, and what is missing."""

from __future__ import annotations

import json
import platform
from dataclasses import asdict
from importlib.metadata import PackageNotFoundError, version

import click

from scenicq import __version__
from scenicq.smt.solver import available

from .main import ERROR
from .manual import Manual
from .report import columns
from .streams import say

__all__ = ["doctor"]

_PACKAGES = ("click", "duckdb", "highspy", "msgspec", "numpy", "pyarrow", "shapely", "tqdm", "dreal")


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None


@click.command(
    cls=Manual,
    arguments={},
    exits={0: "at least one solver loads"},
    epilog="\b\nExamples:\n  scenicq doctor\n  scenicq doctor --format json",
)
@click.option("--format", "format_", type=click.Choice(["text", "json"]), default="text",
              help="json is for programs.")  # fmt: skip
@click.pass_context
def doctor(ctx: click.Context, *, format_: str) -> None:
    """Say which solvers load here and what is missing.

    dReal is preferred where it loads; the portable solver needs nothing.
    """
    versions = {"python": platform.python_version(), "scenicq": __version__}
    versions |= {package: _version(package) for package in _PACKAGES}
    solvers = available()
    if format_ == "json":
        content = {"platform": platform.platform(), "versions": versions, "solvers": [asdict(each) for each in solvers]}
        say(json.dumps(content, indent=1))
    else:
        say(f"on {platform.platform()}")
        say("\n".join(columns([(name, number or "not installed") for name, number in versions.items()])))
        say("solvers")
        for solver in solvers:
            mark = click.style("loads", fg="green") if solver.ok else click.style("does not load", fg="yellow")
            say(f"  {solver.name} {mark}: {solver.detail}")
            for hint in filter(None, solver.hint.split("; ")):
                say(f"    hint: {hint}")
    if not any(solver.ok for solver in solvers):
        ctx.exit(ERROR)
