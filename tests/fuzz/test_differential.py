"""Random programs are decided alike in every way that there is: a short part of `differential.py`."""

from collections import Counter

import pytest
from differential import compose, contradictions


@pytest.mark.parametrize("name", ["1-1", "1-4", "1-10"])
def test_no_way_contradicts_another(name, tmp_path):
    counts = Counter()
    assert contradictions(compose(name), 1, tmp_path / "d", counts) == []
    assert counts["usual: match"] + counts["usual: unknown"] > 0
