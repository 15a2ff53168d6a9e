"""Necessary conditions on a frame, from the global parameters (`param`) that a program sets."""

from __future__ import annotations

from scenicq.forest.groups import PARAMS
from scenicq.forest.nodes import Constant, Node, Select
from scenicq.forest.scenario import Scenario
from scenicq.match.options import MatchOptions
from scenicq.query.prefilter.condition_reader import EGO, ColumnCondition
from scenicq.query.prefilter.sql_bounds import SqlBounds
from scenicq.query.prefilter.sql_ends import SqlTruth, any_of, between
from scenicq.store.sql import sql_text

__all__ = ["param_conditions"]


def param_conditions(scenario: Scenario, options: MatchOptions) -> list[ColumnCondition]:
    """SQL conditions that every matching frame meets: its label has parameter values that the program allows.

    Args:
        scenario: The scenario.
        options: Which parameters are ignored, and the tolerance of numbers.
    """
    found: list[ColumnCondition] = []
    for name, given in scenario.params.items():
        if not given.explicit or name in options.ignore_params or not name.isidentifier():
            continue
        path = sql_text(f'$."{name}"')
        seen = f"json_extract_string({EGO}.params, {path})"
        texts = _texts(given.value)
        if texts is not None:
            sql: SqlTruth = f"{seen} IN ({', '.join(map(sql_text, texts))})"
        else:
            value = f"TRY_CAST({seen} AS DOUBLE)"
            sql = any_of(
                [
                    between(value, limits, options.tolerance.of(PARAMS, name).size)
                    for limits in SqlBounds({}).intervals(given.value)
                ]
            )
        if isinstance(sql, str):
            found.append(ColumnCondition((), sql, what=f"param {name}", span=given.span))
    return found


def _texts(node: Node) -> list[str] | None:
    """The texts that a value can be, None if it can be something else."""
    options = node.options if isinstance(node, Select) else (node,)
    texts = [option.value for option in options if isinstance(option, Constant) and isinstance(option.value, str)]
    return texts if len(texts) == len(options) else None
