"""What a query finds of a drawn program, for tests to compare."""

from pathlib import Path

from interval_definition import Program, tells_apart

from scenicq.errors import ScenarioError, Source
from scenicq.query.execution.results import Result
from scenicq.query.execution.run import Query, QueryOptions
from scenicq.store.dataset import open_dataset


def found_by_query(folder: Path, program: Program, **options):
    """(recording, roles, verdict) and (i, j), of every result, whether or not somebody reads what others fail at."""
    told, untold = (_found(folder, program, interval_reasons=each, **options) for each in (True, False))
    assert told == untold, program.text()
    return told


def _roles(program: Program, result: Result):
    """Who plays whom; of two roles that nothing tells apart the first has the first track by name."""
    roles = dict(sorted(result.verdict.correspondence.items()))
    if {"a", "b"} <= roles.keys() and not tells_apart(program):
        roles["a"], roles["b"] = sorted((roles["a"], roles["b"]))
    return tuple(roles.items())


def _found(folder: Path, program: Program, **options):
    """The results of a query; none where no run satisfies the program."""
    query = Query(open_dataset(folder), Source("p.scenic", program.text()), QueryOptions(**options))
    try:
        return [
            (
                (result.recording, _roles(program, result), type(result.verdict).__name__),
                (int(result.frame.rpartition("-")[2]), int(result.interval.last.rpartition("-")[2])),
            )
            for result in query.results()
        ]
    except ScenarioError as error:
        if error.diagnostics[0].code != "impossible-requirement":
            raise
        return []
