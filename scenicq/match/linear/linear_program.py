"""Linear programs: whether a system of linear bounds over a few variables has a solution (HiGHS)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from importlib import import_module
from typing import Any

from scenicq.errors import CannotEvaluate
from scenicq.match.linear.affine_forms import Affine, VariableAxis
from scenicq.processes import discard_output

__all__ = ["LinearSystem", "Row", "not_linear"]


def not_linear() -> CannotEvaluate:
    """What is raised where constraints are not affine, or linear programs do not tell."""
    return CannotEvaluate("what linear programs do not tell")


@dataclass(frozen=True, slots=True)
class Row:
    """`low <= form <= high`; a strict row must hold with a margin.

    Attributes:
        form: The affine form.
        low, high: Its bounds, in its unit; infinite where there is none.
        strict: Whether the bounds themselves are excluded.
    """

    form: Affine
    low: float
    high: float
    strict: bool = False


@dataclass(slots=True)
class LinearSystem:
    """Rows that must hold together.

    Attributes:
        rows: The rows.
    """

    rows: list[Row] = field(default_factory=list[Row])

    def solve(self, more: list[Row]) -> Mapping[VariableAxis, float] | None:
        """Values of the variables that satisfy all rows and `more`, or None if there are none.

        Strict rows are satisfied with the largest margin there is; none at all means no solution. Exact up to the
        feasibility tolerance of the linear program, 1e-9.

        Raises:
            CannotEvaluate: The solver came to no answer.
        """
        rows = [*self.rows, *more]
        if not _settled(rows):
            return None
        rows = [row for row in rows if row.form.terms]
        variables = {variable: None for row in rows for variable in row.form.terms}
        if not rows:
            return {}
        return _solve(rows, list(variables))

    def extent(self, more: list[Row], variable: VariableAxis) -> tuple[float, float] | None:
        """The least and the greatest value of a variable where all rows and `more` hold, or None if nowhere.

        Strict rows may hold with equality.

        Raises:
            CannotEvaluate: The solver came to no answer, or nothing bounds the variable.
        """
        rows = [replace(row, strict=False) if row.strict else row for row in (*self.rows, *more)]
        if not _settled(rows):
            return None
        rows = [row for row in rows if row.form.terms]
        variables = list({each: None for row in rows for each in row.form.terms})
        if variable not in variables:
            raise not_linear()
        least = _solve(rows, variables, (variable, 1.0))
        most = None if least is None else _solve(rows, variables, (variable, -1.0))
        return None if least is None or most is None else (least[variable], most[variable])


def _settled(rows: list[Row]) -> bool:
    """Whether the rows without a variable hold."""
    for row in rows:
        fails = not row.form.terms and not row.low - 1e-9 <= row.form.constant <= row.high + 1e-9
        if fails or (row.strict and not row.form.terms and row.form.constant in (row.low, row.high)):
            return False
    return True


_MARGIN = 1e-7


@cache
def _load_highs() -> Any:
    """HiGHS, which most runs never need; the first solver of a process prints before it can be told to be silent."""
    highs: Any = import_module("highspy")
    with discard_output():
        highs.Highs()
    return highs


def _solve(
    rows: list[Row], variables: list[VariableAxis], least: tuple[VariableAxis, float] | None = None
) -> Mapping[VariableAxis, float] | None:
    """A solution, the one in which a variable times a factor is least if one is given."""
    highs = _load_highs()
    column = {variable: number for number, variable in enumerate(variables)}
    strict = any(row.strict for row in rows)
    margin = len(variables)
    count = margin + strict
    model = highs.HighsLp()
    starts: list[int] = [0]
    indices: list[int] = []
    values: list[float] = []
    lows: list[float] = []
    highs_: list[float] = []
    for row in rows:
        sides = [(row.low, row.high, 0.0)]
        if row.strict:
            sides = [(row.low, math.inf, -1.0)] * (row.low > -math.inf) + [(-math.inf, row.high, 1.0)] * (
                row.high < math.inf
            )
        for low, high, slack in sides:
            for variable, coefficient in row.form.terms.items():
                indices.append(column[variable])
                values.append(coefficient)
            if slack:
                indices.append(margin)
                values.append(slack)
            starts.append(len(indices))
            lows.append(low - row.form.constant)
            highs_.append(high - row.form.constant)
    model.num_col_, model.num_row_ = count, len(lows)
    costs = [0.0] * len(variables) + [-1.0] * strict
    if least is not None:
        costs[column[least[0]]] = least[1]
    model.col_cost_ = costs
    model.col_lower_ = [-math.inf] * len(variables) + [0.0] * strict
    model.col_upper_ = [math.inf] * len(variables) + [1.0] * strict
    model.row_lower_, model.row_upper_ = lows, highs_
    model.a_matrix_.format_ = highs.MatrixFormat.kRowwise
    model.a_matrix_.start_, model.a_matrix_.index_, model.a_matrix_.value_ = starts, indices, values
    solver = highs.Highs()
    solver.silent()
    solver.setOptionValue("primal_feasibility_tolerance", 1e-9)
    solver.setOptionValue("threads", 1)
    solver.passModel(model)
    solver.run()
    status = solver.getModelStatus()
    if status == highs.HighsModelStatus.kInfeasible:
        return None
    if status != highs.HighsModelStatus.kOptimal:
        raise not_linear()
    found = list(solver.getSolution().col_value)
    if strict and found[margin] <= _MARGIN:
        return None
    return {variable: float(found[number]) for variable, number in column.items()}
