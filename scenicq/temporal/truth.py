"""Kleene's three truth values as whole numbers, so that columns of them are compared and combined by NumPy.

`and` is the minimum, `or` the maximum, `not` the difference from `TRUE`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["FALSE", "TRUE", "UNKNOWN", "Truth"]

Truth = NDArray[np.int8]
"""Truth values of any shape."""

FALSE, UNKNOWN, TRUE = np.int8(0), np.int8(1), np.int8(2)
