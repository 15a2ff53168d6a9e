"""Random programs are decided alike in every way that there is: a short part of `differential.py`."""

import random
from collections import Counter

import pytest
from differential import compose, contradictions, labels_of


@pytest.mark.parametrize("name", ["1-1", "1-4", "1-10"])
@pytest.mark.one_in(2)
def test_no_way_contradicts_another(name, tmp_path):
    counts = Counter()
    text = compose(name)
    labels = labels_of(text, random.Random(name))
    assert contradictions(text, labels, 1, tmp_path / "d", counts) == []
    assert counts["usual: match"] + counts["usual: unknown"] > 0
