"""Hostile programs end soon, with a diagnostic, and reach nothing of Python."""

import pytest

from scenicq.errors import ScenarioError

from .hostile import END, HOSTILE, TOO_LONG
from .scenes import compiled, refused


@pytest.mark.timeout(60)
@pytest.mark.parametrize("name", HOSTILE)
@pytest.mark.one_in(16)
def test_a_hostile_program_ends(name: str) -> None:
    assert refused(HOSTILE[name] + END)[0] == "budget-exceeded"


@pytest.mark.timeout(60)
@pytest.mark.parametrize("name", TOO_LONG)
def test_a_text_without_end_is_not_read(name: str) -> None:
    with pytest.raises(ScenarioError, match=r"longer than|more than 1,000 parts"):
        compiled(TOO_LONG[name] + END)


@pytest.mark.parametrize(
    ("text", "code"),
    [
        ("x = ''.__class__", "unsupported-construct"),
        ("x = (lambda: 1).__globals__", "unsupported-construct"),
        ("x = '{0.__class__}'.format(1)", "unknown-attribute"),
        ("x = '%1000000000d' % 1", "unsupported-construct"),
        ("x = f'{1:>1000000000}'", "unsupported-construct"),
        ("x = round(5, -10 ** 9)", "runtime-error"),
        ("x = int('9' * 50000)", "runtime-error"),
        ("x = open('/etc/passwd')", "unsupported-construct"),
        ("x = eval('1')", "unsupported-construct"),
        ("x = getattr(1, 'real')", "unsupported-construct"),
        ("x = (1).real", "unknown-attribute"),
        ("x = str.mro", "unknown-attribute"),
        ("x = Object.ancestry", "unknown-attribute"),
        ("import os\nx = os", "unsupported-construct"),
        ("x = str([1])", "wrong-arity"),
        ("x = {}.pop(Range(0, 1))", "runtime-error"),
    ],
)
def test_python_is_out_of_reach(text: str, code: str) -> None:
    assert refused(f"{text}\n{END}")[0] == code
