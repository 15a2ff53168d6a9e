"""The domain of columns without what rounding may decide."""

from __future__ import annotations

import numpy as np

from scenicq.forest.column_domain import ColumnDomain
from scenicq.forest.columns import UNKNOWN, Column
from scenicq.forest.nodes import CompareOp

__all__ = ["ClearColumns"]

_CLOSE = 1e-9
"""How close numbers are, beside their size, that another order of operations may turn round."""


class ClearColumns(ColumnDomain):
    """Values at many places; comparisons of numbers that are very close to each other are unknown.

    NumPy rounds some functions otherwise than the functions of one number do: what is asked of one label and of many at
    once must be told alike.
    """

    __slots__ = ()

    def compare(self, op: CompareOp, left: Column, right: Column) -> Column:
        """A comparison; whole numbers may be equal."""
        found = ColumnDomain.compare(self, op, left, right)
        a, b = left.data, right.data
        if not (isinstance(a, np.ndarray) and isinstance(b, np.ndarray)) or np.bool_ in (a.dtype, b.dtype):
            return found
        with np.errstate(invalid="ignore"):
            close = np.abs(a - b) <= _CLOSE * np.maximum(1.0, np.maximum(np.abs(a), np.abs(b)))
        close &= (a != b) | (a != np.rint(a))
        return Column(found.data, np.maximum(found.status, np.where(close, UNKNOWN, found.status)))
