"""What a group about many objects demands of one or two of them alone.

Such a part is a necessary condition of the whole: where it cannot be satisfied, no correspondence with these label
objects in these roles matches, whoever plays the others. The search then takes back the two that are to blame.
"""

from __future__ import annotations

import itertools

from scenicq.forest.groups import PARAMS, Comparison, Constraint, Group, group_constraints
from scenicq.forest.walk import features
from scenicq.limits import LIMITS

__all__ = ["subgroups_of"]


def subgroups_of(group: Group, ego: int) -> tuple[Group, ...]:
    """The parts of a group, those about fewer objects first; none of a group about two objects or fewer.

    Args:
        group: A group of jointly dependent constraints.
        ego: Index of the ego, which plays no role of its own.
    """
    if len(set(group.objects) - {ego}) <= LIMITS.part_roles:
        return ()
    about = [(item, _roles(item, ego)) for item in group.constraints]
    single = dict.fromkeys(roles for _, roles in about if 0 < len(roles) <= LIMITS.part_roles)
    joined = dict.fromkeys(one | other for one, other in itertools.combinations(single, 2))
    wanted = {roles: None for roles in (*single, *joined) if len(roles) <= LIMITS.part_roles}
    if len(wanted) > LIMITS.group_parts:
        wanted = single
    found = [
        part
        for roles in wanted
        for part in group_constraints(item for item, own in about if own <= roles)
        if frozenset(part.objects) - {ego} == roles
    ]
    return tuple(sorted(found, key=lambda part: len(part.objects)))


def _roles(item: Constraint, ego: int) -> frozenset[int]:
    used = {index for index, _ in features(item.expression)}
    if isinstance(item, Comparison):
        used.add(item.object)
    return frozenset(used - {ego, PARAMS})
