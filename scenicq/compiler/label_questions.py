"""The module `scenicq.labels`: questions about labels that Scenic has no words for.

Programs import it as any module, `from scenicq.labels import NAME`, and no Python is run: a name stands for the row of
`QUESTIONS` that has it. Where real Scenic runs the program, the module of this name that Python finds answers.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING

from scenicq.compiler.other_objects import count, nearest, others
from scenicq.compiler.values import Builtin, ModelValue

if TYPE_CHECKING:
    from scenicq.compiler.interpreter import Interpreter

__all__ = ["LABELS", "QUESTIONS", "question_names"]

LABELS = "scenicq.labels"
"""What programs call the module."""

QUESTIONS: Mapping[str, Callable[..., ModelValue]] = {"others": others, "count": count, "nearest": nearest}
"""What each name of the module does: a function of the interpreter, the place of the call, and what it is given."""


def question_names(run: Interpreter) -> dict[str, ModelValue]:
    """The names of the module.

    Args:
        run: The interpreter of the program that imports it.
    """
    return {name: Builtin(name, partial(meaning, run)) for name, meaning in QUESTIONS.items()}
