"""What a label observes: values of the features of its objects, in the scenario's terms."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache, partial

from scenicq.forest.nodes import COURSE, GOING, LAST_LANE, LaneCourse, Value
from scenicq.forest.scenario import Scenario
from scenicq.geometry.driven_courses import GAP_S, CoursePlace, StoredCourse, lane_course
from scenicq.store.labels import Label, LabelObject
from scenicq.store.recorded_tracks import EGO

__all__ = [
    "IN_COLUMNS", "course_rules", "course_without_role", "observe", "observe_course", "observe_params",
    "observed_names", "rule_of_courses",
]  # fmt: skip

IN_COLUMNS = frozenset({
    "position", "heading", "width", "length", "height", "velocity", "speed", "acceleration", "angularSpeed", COURSE,
    GOING, LAST_LANE,
})  # fmt: skip
"""What a label says in columns alone: an attribute of such a name is none of these."""


def observe(label_object: LabelObject) -> Mapping[str, Value]:
    """The properties that a label object has, by Scenic's names; what the source lacks is left out."""
    seen: dict[str, Value] = {"position": (float(label_object.x), float(label_object.y))}
    # one by one: all objects of all labels come here
    seen[GOING] = None
    seen[LAST_LANE] = label_object.last_lane
    if label_object.heading is not None:
        seen["heading"] = seen[GOING] = float(label_object.heading)
    if label_object.width is not None:
        seen["width"] = float(label_object.width)
    if label_object.length is not None:
        seen["length"] = float(label_object.length)
    if label_object.height is not None:
        seen["height"] = float(label_object.height)
    velocity, motion = label_object.velocity, label_object.motion
    if velocity is None and motion is not None:
        velocity = motion.velocity
    if velocity is not None:
        seen["velocity"] = (float(velocity[0]), float(velocity[1]))
        seen["speed"] = math.hypot(*velocity)
    if motion is not None:
        if motion.acceleration is not None:
            seen["acceleration"] = float(motion.acceleration)
        if motion.yaw_rate is not None:
            seen["angularSpeed"] = float(motion.yaw_rate)
    for name, value in label_object.attributes.items():
        if name not in IN_COLUMNS:
            seen[name] = value if isinstance(value, str | bool) else float(value)
    return seen


def course_rules(scenario: Scenario) -> dict[int, LaneCourse]:
    """For objects whose course a scenario asks for, the map and the gaps by which the courses of labels are made."""
    given = {owner.index: owner.properties.get(COURSE) for owner in scenario.objects}
    return {index: each.value for index, each in given.items() if each and isinstance(each.value, LaneCourse)}


def rule_of_courses(scenario: Scenario) -> LaneCourse | None:
    """How courses are made, also those of label objects without a role; None where a scenario asks for none."""
    return next(iter(course_rules(scenario).values()), None)


def observe_course(label: Label, label_object: LabelObject, rules: LaneCourse) -> CoursePlace | None:
    """The course that a label object drives; None where nothing but the label itself is known."""
    if label.recorded is None:
        return None
    track = EGO if label_object is label.ego else None if label_object.track is None else ("track", label_object.track)
    place = (label_object.x, label_object.y, label_object.heading)
    make = partial(label.recorded.course, rules.network, rules.gap_s, label.recording, label.frame, track, place)
    if label_object is not label.ego or rules.gap_s != GAP_S:
        return make()
    return StoredCourse(
        lambda: {(each.x, each.y): each.on_ego_course for each in label.objects if each.on_ego_course is not None}, make
    )


def course_without_role(label: Label, label_object: LabelObject, rules: LaneCourse | None) -> CoursePlace | None:
    """The course of a label object that need not play a role; None where the scenario asks for none.

    Where nothing but the label itself is known, it is that of the lane, as of what is seen once.
    """
    if rules is None:
        return None
    found = observe_course(label, label_object, rules)
    return found or lane_course(rules.network, label_object.x, label_object.y, label_object.heading)


def observed_names(label_object: LabelObject) -> frozenset[str]:
    """The names of the properties that a label object has."""
    motion, velocity = label_object.motion, label_object.velocity
    # written out: all objects of all labels come here
    present: tuple[bool, ...] = (
        label_object.heading is not None,
        label_object.width is not None,
        label_object.length is not None,
        label_object.height is not None,
        velocity is not None,
    )
    if motion is not None:
        seen = velocity is not None or motion.velocity is not None
        present = (*present[:4], seen, motion.acceleration is not None, motion.yaw_rate is not None)
    return _names(present, tuple(label_object.attributes))


@lru_cache(maxsize=4096)
def _names(present: tuple[bool, ...], attributes: tuple[str, ...]) -> frozenset[str]:
    parts = (("heading",), ("width",), ("length",), ("height",), ("velocity", "speed"), ("acceleration",))
    named = zip((*parts, ("angularSpeed",)), present, strict=False)
    measured = ("position", GOING, LAST_LANE, *(name for names, there in named if there for name in names))
    return frozenset(measured).union(name for name in attributes if name not in IN_COLUMNS)


def observe_params(label: Label) -> Mapping[str, Value]:
    """The global parameters of a label."""
    return {name: value if isinstance(value, str | bool) else float(value) for name, value in label.params.items()}
