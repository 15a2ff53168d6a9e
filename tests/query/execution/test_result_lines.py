"""A line of JSON says what the record says, to the last character."""

from __future__ import annotations

import json
import math

import numpy as np
from hypothesis import assume, given
from hypothesis import strategies as st

from scenicq.match.verdict import Cause, Match, NoMatch, Unknown
from scenicq.query.execution.result_lines import json_line
from scenicq.query.execution.results import IntervalSpan, LogDensity, Result, record

texts = st.text(max_size=8)
numbers = st.floats() | st.floats().map(np.float64) | st.sampled_from([math.inf, -math.inf, math.nan, -0.0, 3])
named = st.dictionaries(texts, texts, max_size=3)
witnesses = st.dictionaries(texts, numbers | st.tuples(numbers, numbers), max_size=3)
verdicts = (
    st.builds(Match, named, witnesses)
    | st.builds(NoMatch, st.builds(Cause, texts, texts), named)
    | st.builds(Unknown, texts, st.builds(Cause, texts), named)
)
spans = st.builds(IntervalSpan, texts, st.integers(), st.integers(1), st.booleans())
densities = st.builds(LogDensity, st.none() | st.floats(allow_nan=False))
results = st.builds(Result, texts, texts, st.integers(), verdicts, named, st.none() | spans, st.none() | densities)


@given(results, named)
def test_a_line_is_the_record(result, more):
    known = record(result)
    assume(not known.keys() & more.keys())
    assert json_line(result, more) == json.JSONEncoder(ensure_ascii=False).encode(known | more)
