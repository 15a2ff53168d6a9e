"""Distinct candidates for slots: agrees with going through all ways, also after slots were pinned and released."""

from __future__ import annotations

import itertools

from hypothesis import given, settings
from hypothesis import strategies as st

from scenicq.match.problem.bipartite_matching import BipartiteMatching, Slot, matchable


@settings(max_examples=200, deadline=None)
@given(st.lists(st.lists(st.integers(0, 5), max_size=4, unique=True), max_size=6))
def test_matchable_agrees_with_enumeration(domains):
    slots = [Slot(name, tuple(domain)) for name, domain in enumerate(domains)]
    found = matchable(slots)
    possible = any(len(set(values)) == len(values) for values in itertools.product(*domains))
    assert (found is not None) == possible
    if found is not None:
        assert all(found[slot.name] in slot.candidates for slot in slots)
        assert len(set(found.values())) == len(slots)


def possible(domains):
    return any(len(set(values)) == len(values) for values in itertools.product(*domains))


@settings(max_examples=200, deadline=None)
@given(st.lists(st.lists(st.integers(0, 4), min_size=1, max_size=4, unique=True), min_size=1, max_size=5), st.data())
def test_a_pin_is_refused_where_it_leaves_others_without(domains, data):
    matching = BipartiteMatching([Slot(name, tuple(domain)) for name, domain in enumerate(domains)])
    if not matching.complete():
        assert not possible(domains)
        return
    pinned = {}
    for slot, domain in enumerate(domains):
        candidate = data.draw(st.sampled_from(domain))
        if candidate in pinned.values():
            continue
        left = [[pinned[n]] if n in pinned else [candidate] if n == slot else each for n, each in enumerate(domains)]
        blamed = matching.pin(slot, candidate)
        assert (not blamed) == possible(left)
        if blamed:
            continue
        if data.draw(st.booleans()):
            matching.release(candidate)
        else:
            pinned[slot] = candidate
