"""Damped Gauss-Newton steps (Levenberg and Marquardt) of many points at once, within ends."""

from __future__ import annotations

from typing import cast

import numpy as np
from numpy.typing import NDArray

__all__ = ["damped_steps"]

_DAMPING = (1e-9, 1e-2, 1.0)
_STEPS = (1.0, 0.3)
"""Shares of each damped step."""

_Numbers = NDArray[np.float64]


def damped_steps(slopes: _Numbers, each: _Numbers, ends: tuple[NDArray[np.bool_], NDArray[np.bool_]]) -> list[_Numbers]:
    """Steps (coordinates, n) that lessen residuals, by several dampings and lengths.

    Args:
        slopes: How residuals change with coordinates, (n, residuals, coordinates).
        each: The residuals, (residuals, n).
        ends: Which coordinates are at their lower, and upper, ends, (coordinates, n).
    """
    found: list[_Numbers] = []
    for damping in _DAMPING:
        move = _solved(slopes, each, damping)
        # what an end holds back is left to the others
        held = (ends[0] & (move < 0)) | (ends[1] & (move > 0))
        if held.any():
            move = _solved(np.where(held.T[:, None, :], 0.0, slopes), each, damping)
        found += [move * share for share in _STEPS]
    return found


def _solved(slopes: _Numbers, each: _Numbers, damping: float) -> _Numbers:
    normal = np.einsum("nri,nrj->nij", slopes, slopes)
    diagonal = np.einsum("nii->ni", normal)
    diagonal += damping * diagonal + 1e-9
    right = np.einsum("nri,rn->ni", slopes, each)
    solution = cast(_Numbers, np.linalg.solve(normal, right[..., None]))
    return -solution[..., 0].T
