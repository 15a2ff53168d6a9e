"""Affine forms agree with plain evaluation."""

from __future__ import annotations

import math
import sys
from pathlib import Path

from hypothesis import given, settings

sys.path.insert(0, str(Path(__file__).parents[2] / "forest"))
from expressions import expressions

from scenicq.forest.evaluate import evaluate
from scenicq.match.linear.affine_forms import affine_vector


@given(expressions(affine=True))
@settings(max_examples=300, deadline=None)
def test_an_affine_form_has_the_value_of_its_expression(case):
    root, values = case
    form = affine_vector(root)
    assert form is not None
    for part, expected in zip(form, evaluate(root, values), strict=True):
        total = part.constant
        for (identity, axis), coefficient in part.terms.items():
            value = values[identity]
            total += coefficient * (value[axis] if isinstance(value, tuple) else value)
        assert math.isclose(total, expected, rel_tol=1e-6, abs_tol=1e-6 * max(1.0, abs(part.constant)))
