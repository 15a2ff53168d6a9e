"""Groups that are left to a solver, which are few by now: no witness is searched for, and no boxes are tried."""

from __future__ import annotations

import pytest

from scenicq.match.fields import branch_and_prune, witness_search
from scenicq.match.problem.outcome import Undecided


def leave_to_solvers(patch: pytest.MonkeyPatch) -> None:
    """Have solvers asked what is nonlinear."""
    patch.setattr(witness_search, "search_witness", lambda *_, **__: None)
    patch.setattr(branch_and_prune, "branch_and_prune", lambda items, _: Undecided(items[0][0], "nonlinear"))
