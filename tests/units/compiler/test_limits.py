"""What a program makes is limited where it is made, and what calls do has its price: no error is one of ours."""

import pytest

from scenicq.compiler.program import compile_scenario
from scenicq.errors import ScenarioError, Source
from scenicq.geometry.default_street import street
from scenicq.limits import LIMITS

HEAD = "model scenic.domains.driving.model\nego = new Car\n"
REFUSED = {
    "for i in range(0, 10, 0):\n    pass": "wrong-value",
    "x = range(10**19)": "budget-exceeded",
    "for i in range(0, -10**19, -1):\n    pass": "budget-exceeded",
    "x = range()": "wrong-arity",
    "new Car at 9 @ 9, facing 10**400 deg": "runtime-error",
    "x = hypot(10**400)": "runtime-error",
    "param p = 10**400": "runtime-error",
    "require Range(0, 1) < 10**400 deg": "runtime-error",
    "require[0.5] Range(0, 1) < 10**400 deg": "runtime-error",
    "new Car at 9 @ 9, with mood 10**400": "runtime-error",
    "x = 10**400 == Range(0, 1) @ 2": "runtime-error",
    "x = Discrete({1: 10**400})": "runtime-error",
    "new Car at 9 @ 9, with mutationScale (1, 2)": "wrong-type",
    "new Car at 9 @ 9, with mutationScale None": "wrong-type",
    "new Car at 9 @ 9, with mutationScale Uniform(*network.lanes)": "wrong-type",
    "new Car at 9 @ 9, with mutationScale 'much'\nmutate": "wrong-type",
    "new Car at 9 @ 9, with positionStdDev 'much'\nmutate": "wrong-type",
    "new Car at 9 @ 9, with mutationScale 10**400": "wrong-value",
    'param x = "\\ud800"': "wrong-value",
    'x = f"\\udfff{1}"': "wrong-value",
    "a = 'a' * 100000\nb = a.join(a)": "budget-exceeded",
    "a = ['a' * 90000] * 90\nb = ''.join(a)": "budget-exceeded",
    "a = 'a' * 90000\nb = a.replace('a', a)": "budget-exceeded",
    "a = [0] * 10**9": "budget-exceeded",
    "a = 10 ** 10 ** 10": "budget-exceeded",
    "a = pow(10, 10**10)": "budget-exceeded",
    "a = 1 << 10**10": "budget-exceeded",
    "a = f'{1:>{10**9}}'": "unsupported-construct",
    "a = str(10**5000)": "budget-exceeded",
    "for i in range(1000):\n    x = follow roadDirection from (0, 0) for 1e6": "budget-exceeded",
    "xs = list(range(90000))\nfor i in range(3000):\n    y = sum(xs)": "budget-exceeded",
    "for i in range(90000):\n    y = network.laneAt((i, i))": "budget-exceeded",
    "for i in range(90000):\n    y = distance from (i, i) to road": "budget-exceeded",
}


@pytest.mark.parametrize("text", REFUSED)
@pytest.mark.one_in(8)
def test_what_grows_or_takes_too_much_is_refused_where_it_stands(text):
    with pytest.raises(ScenarioError) as caught:
        compile_scenario(Source("p.scenic", HEAD + text), street())
    (told,) = caught.value.diagnostics
    assert told.code == REFUSED[text]
    assert told.span is not None


def test_a_program_ends_where_its_steps_take_too_long(monkeypatch):
    monkeypatch.setattr(LIMITS, "program_seconds", 0.0)
    with pytest.raises(ScenarioError, match="evaluating the program takes more than 0 s"):
        compile_scenario(Source("p.scenic", HEAD + "for i in range(9000):\n    pass"), street())


@pytest.mark.parametrize(
    "text",
    [
        "new Car beyond ego by Range(-1e308, 1e308)",
        "new Car at Range(-1e308, 1e308) @ Range(-1e308, 1e308)",
        "mutate ego by 1e308",
        "new Car at 9 @ 9, with mutationScale Range(-1, 1)",
        "new Car at 9 @ 9, with mutationScale -1",
        "x = Uniform(*network.lanes)\nnew Car on x, with lane x",
    ],
)
@pytest.mark.one_in(12)
@pytest.mark.filterwarnings("error")  # a library's complaint would land between the messages
def test_numbers_near_the_end_of_all_numbers_break_nothing(text, run, tmp_path, crossroads):
    file = tmp_path / "p.scenic"
    file.write_text(HEAD + text)
    for words in (
        ["match", file, crossroads, "--jobs", "1", "--timeout", "0.1", "--deadline", "3"],
        ["sample", file, "-n", "1", "--timeout", "2"],
        ["check", file],
    ):
        told = run(*words)
        assert told.exit_code in (0, 1, 2, 3)
        assert "internal error" not in told.stderr


def test_long_words_cost_no_more_than_their_length():
    owners = [f"car{number}" for number in range(10)]
    lines = [f"{name} = new Car\nnew Car on {name}.lane" for name in owners]
    text = "\n".join([HEAD, "# " + "a" * 190_000, *lines])
    scenario = compile_scenario(Source("test.scenic", text), street())
    told = [each.span.text for each in scenario.requirements if each.span is not None]
    assert [each for each in told if each.endswith(".lane")] == [f"{name}.lane" for name in owners]
