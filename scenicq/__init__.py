"""Find the recorded frames that match a Scenic scenario.

>>> import scenicq
>>> summary = scenicq.ingest("sample_data/crossroads", "dataset")        # doctest: +SKIP
>>> dataset = scenicq.open("dataset")                                    # doctest: +SKIP
>>> for found in dataset.match("sample_data/scenarios/02_crossing_cars.scenic"):  # doctest: +SKIP
...     print(found.frame, found.roles)

Names are loaded when first used, so that importing the package costs nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from scenicq.compiler.program import compile_scenario
    from scenicq.errors import ScenicqError, Source
    from scenicq.importers.ingest import ingest
    from scenicq.match.matcher import Matcher
    from scenicq.match.options import MatchOptions
    from scenicq.notebook.datasets import open
    from scenicq.query.execution.program_files import read_program
    from scenicq.query.execution.run import Query, QueryOptions
    from scenicq.store.dataset import open_dataset

__version__ = "1.0.0rc1"

__all__ = [
    "MatchOptions",
    "Matcher",
    "Query",
    "QueryOptions",
    "ScenicqError",
    "Source",
    "__version__",
    "compile_scenario",
    "ingest",
    "open",
    "open_dataset",
    "read_program",
]

_HOMES = {
    "MatchOptions": "scenicq.match.options",
    "Matcher": "scenicq.match.matcher",
    "Query": "scenicq.query.execution.run",
    "QueryOptions": "scenicq.query.execution.run",
    "ScenicqError": "scenicq.errors",
    "Source": "scenicq.errors",
    "compile_scenario": "scenicq.compiler.program",
    "ingest": "scenicq.importers.ingest",
    "open": "scenicq.notebook.datasets",
    "open_dataset": "scenicq.store.dataset",
    "read_program": "scenicq.query.execution.program_files",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    """The public names, whether they are loaded or not."""
    return sorted(__all__)
