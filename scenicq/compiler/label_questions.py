"""The module `scenicq.labels`: questions about labels that Scenic has no words for.

Programs import it as any module, `from scenicq.labels import NAME`, and no Python is run: a name stands for the row of
`QUESTIONS` that has it. Where real Scenic runs the program, the module of this name that Python finds answers.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING

from scenicq.compiler.lanes_ahead import ahead
from scenicq.compiler.measures import (
    box_distance,
    course_change,
    deceleration_to_avoid,
    hides,
    jerk,
    post_encroachment_time,
    time_headway,
    time_to_collision,
)
from scenicq.compiler.other_objects import count, nearest, others
from scenicq.compiler.random_values import is_choice
from scenicq.compiler.road_courses import along, beside, corridor, course
from scenicq.compiler.values import Builtin, ModelValue

if TYPE_CHECKING:
    from scenicq.compiler.interpreter import Interpreter

__all__ = ["LABELS", "QUESTIONS", "question_names"]

LABELS = "scenicq.labels"
"""What programs call the module."""

QUESTIONS: Mapping[str, Callable[..., ModelValue]] = {
    "ahead": ahead,
    "along": along,
    "beside": beside,
    "box_distance": box_distance,
    "corridor": corridor,
    "count": count,
    "course": course,
    "course_change": course_change,
    "deceleration_to_avoid": deceleration_to_avoid,
    "hides": hides,
    "jerk": jerk,
    "nearest": nearest,
    "others": others,
    "post_encroachment_time": post_encroachment_time,
    "time_headway": time_headway,
    "time_to_collision": time_to_collision,
}
"""What each name of the module does: a function of the interpreter, the place of the call, and what it is given."""


def question_names(run: Interpreter) -> dict[str, ModelValue]:
    """The names of the module.

    Args:
        run: The interpreter of the program that imports it.
    """
    return {name: Builtin(name, partial(meaning, run), spread=is_choice) for name, meaning in QUESTIONS.items()}
