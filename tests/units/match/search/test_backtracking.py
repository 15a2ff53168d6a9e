"""The correspondence search against plain enumeration: no solution lost, none invented, twins once."""

from __future__ import annotations

import itertools

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenicq.budget import Exhausted
from scenicq.match.problem.bipartite_matching import Slot
from scenicq.match.search.backtracking import Consistency, find_assignments


class Recorder:
    """Remembers what the search did."""

    def __init__(self):
        self.events = []

    def assigned(self, slot, candidate):
        self.events.append(("assigned", slot, candidate))

    def rejected(self, slot, candidate, blamed):
        self.events.append(("rejected", slot, candidate, blamed))

    def jumped(self, slot, back_to):
        self.events.append(("jumped", slot, back_to))


@st.composite
def problems(draw):
    count = draw(st.integers(0, 5))
    domain = st.lists(st.integers(0, 6), max_size=6, unique=True).map(sorted)
    slots = [Slot(name, tuple(draw(domain))) for name in range(1, count + 1)]
    scopes = [
        scope for size in (2, 3) for scope in itertools.combinations(range(count + 1), size) if draw(st.booleans())
    ]
    density = draw(st.sampled_from([0.2, 0.5, 0.8]))
    rng = draw(st.randoms(use_true_random=False))
    forbidden = {
        scope: {values for values in itertools.permutations(range(8), len(scope)) if rng.random() < density}
        for scope in scopes
    }
    return slots, forbidden


def brute_force(slots, forbidden, fixed):
    found = set()
    for values in itertools.product(*(slot.candidates for slot in slots)):
        assignment = {**fixed, **{slot.name: value for slot, value in zip(slots, values, strict=True)}}
        if len(set(assignment.values())) < len(assignment):
            continue
        if all(tuple(assignment[name] for name in scope) not in bad for scope, bad in forbidden.items()):
            found.add(tuple(sorted(assignment.items())))
    return found


def checker(forbidden, doubtful=()):
    def check(slot, assignment):
        for scope, bad in forbidden.items():
            if slot not in scope or not assignment.keys() >= set(scope):
                continue
            if tuple(assignment[name] for name in scope) in bad:
                return Consistency.NO, frozenset(scope)
        return (Consistency.UNKNOWN if slot in doubtful else Consistency.YES), frozenset()

    return check


@settings(max_examples=200, deadline=None)
@given(problems(), st.booleans())
@pytest.mark.slow
def test_the_search_finds_every_assignment_once(problem, linked):
    slots, forbidden = problem
    links = {}
    for scope in forbidden if linked else ():
        for name in scope:
            links.setdefault(name, set()).update(scope)
    found = list(find_assignments(slots, checker(forbidden), fixed={0: 7}, links=links))
    keys = [tuple(sorted(assignment.items())) for assignment in found]
    assert len(keys) == len(set(keys))
    assert set(keys) == brute_force(slots, forbidden, {0: 7})


@settings(max_examples=200, deadline=None)
@given(
    st.integers(1, 4),
    st.lists(st.integers(0, 6), min_size=1, max_size=6, unique=True).map(sorted),
    st.sets(st.frozensets(st.integers(0, 6), min_size=2, max_size=2)),
    st.booleans(),
)
def test_interchangeable_slots_are_tried_in_one_order_only(count, domain, clashes, paired):
    slots = [Slot(name, tuple(domain)) for name in range(count)]
    bad = {pair for clash in clashes if paired for pair in itertools.permutations(clash)}
    forbidden = dict.fromkeys(itertools.combinations(range(count), 2), bad)
    twins = {name: name - 1 for name in range(1, count)}
    found = [frozenset(a.values()) for a in find_assignments(slots, checker(forbidden), twins=twins)]
    everything = {frozenset(dict(each).values()) for each in brute_force(slots, forbidden, {})}
    assert len(found) == len(set(found))
    assert set(found) == everything


@pytest.mark.parametrize("spare", [-1, 0, 1])
@pytest.mark.parametrize("paired", [False, True])
def test_many_equal_slots_take_few_steps(spare, paired):
    count = 48
    slots = [Slot(name, tuple(range(count + spare))) for name in range(count)]
    forbidden = {(name, name + 1): {(0, 1)} for name in range(count - 1)} if paired else {}
    found = next(find_assignments(slots, checker(forbidden), budget=20_000), None)
    assert (found is None) == (spare < 0)


def test_a_shortage_that_appears_late_is_seen_at_once():
    # Slot 0 must leave candidate 0 to the 30 slots that share 30 candidates.
    many = [Slot(name, tuple(range(30))) for name in range(1, 31)]
    recorder = Recorder()
    slots = [Slot(0, (0, 30)), *many]
    found = next(find_assignments(slots, checker({}), budget=2000, reporter=recorder))
    assert found[0] == 30
    assert recorder.events[0] == ("rejected", 0, 0, frozenset({0}))


def test_the_search_jumps_over_slots_that_are_not_to_blame():
    slots = [Slot(0, (0, 1)), Slot(1, (2, 3)), Slot(2, (4, 5)), Slot(3, (6, 7, 8))]
    forbidden = {(0, 3): {(0, 6), (0, 7), (0, 8)}}
    recorder = Recorder()
    found = next(find_assignments(slots, checker(forbidden), reporter=recorder))
    assert found[0] == 1
    assert ("jumped", 3, 0) in recorder.events
    assert sum(event[:2] == ("assigned", 1) for event in recorder.events) == 2


def test_most_constrained_first():
    recorder = Recorder()
    next(find_assignments([Slot(0, (0, 1, 2)), Slot(1, (0, 1)), Slot(2, (2,))], checker({}), reporter=recorder))
    assert [event[1] for event in recorder.events] == [2, 1, 0]


def test_linked_slots_follow_each_other():
    recorder = Recorder()
    slots = [Slot(0, (0,)), Slot(1, (1, 2)), Slot(2, (3, 4, 5))]
    next(find_assignments(slots, checker({}), links={0: {2}, 2: {0}}, reporter=recorder))
    assert [event[1] for event in recorder.events] == [0, 2, 1]


def test_the_budget_ends_a_search_with_an_exception_never_with_nothing():
    slots = [Slot(name, tuple(range(9))) for name in range(8)]
    everything = itertools.product(range(9), repeat=2)
    forbidden = {(6, 7): set(everything)}
    with pytest.raises(Exhausted):
        next(find_assignments(slots, checker(forbidden), budget=10), None)


def test_an_unknown_answer_rejects_nothing():
    slots = [Slot(0, (0,)), Slot(1, (1,))]
    assert list(find_assignments(slots, checker({}, doubtful={1}))) == [{0: 0, 1: 1}]


@given(st.integers(1, 4), st.integers(0, 2), st.randoms(use_true_random=False))
@settings(max_examples=150, deadline=None)
def test_twins_among_others_that_compete_with_them(alike, others, rng):
    domain = tuple(sorted(rng.sample(range(6), rng.randint(alike, 6))))
    names = range(alike, alike + others)
    slots = [Slot(name, domain) for name in range(alike)]
    slots += [Slot(name, tuple(sorted(rng.sample(range(6), rng.randint(1, 6))))) for name in names]
    forbidden = {}
    for other in names:
        pairs = {pair for pair in itertools.permutations(range(6), 2) if rng.random() < 0.3}
        forbidden |= {(one, other): pairs for one in range(alike)}
    twins = {name: name - 1 for name in range(1, alike)}
    found = [
        tuple(a[name] for name in range(alike + others))
        for a in find_assignments(slots, checker(forbidden), twins=twins)
    ]
    every = {tuple(a[1] for a in sorted(each)) for each in brute_force(slots, forbidden, {})}
    wanted = {each for each in every if list(each[:alike]) == sorted(each[:alike])}
    assert len(found) == len(set(found))
    assert set(found) == wanted


def test_twins_leave_enough_later_candidates_for_each_other():
    slots = [Slot(name, tuple(range(30))) for name in range(29)]
    twins = {name: name - 1 for name in range(1, 28)}
    found = list(find_assignments(slots, checker({}), twins=twins, budget=30_000))
    assert len(found) == 30 * 29
