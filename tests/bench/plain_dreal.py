"""dReal on a formula as it is, without the adapter's splitting of disjunctions; for worker processes only."""

from __future__ import annotations

from scenicq.smt import dreal

__all__ = ["check"]

dreal.CASES = 0
check = dreal.check
