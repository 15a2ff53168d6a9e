"""Plain English where Scenic has other words: the error says what to write, and what it says can be read."""

import re

import pytest

from scenicq.errors import ScenarioError, Source
from scenicq.syntax.parser import parse

HINTS = {
    "require (distance to other) < 20 m": "write `20`",
    "require (distance to other) < 20m": "write `20`",
    "require other.speed > 5 m/s": "write `5`",
    "require other.speed > 30 km/h": "write `30 / 3.6`",
    "require other.speed > 30 mph": "write `30 * 0.447`",
    "require (angle to other) < 30 degrees": "write `30 deg`",
    "require (distance to other) between 5 and 10": "`5 < a < 10`",
    "require distance between ego and other < 10": "`distance from a to b`",
    "require other is ahead of ego": "`along(ego, X) > 0`",
    "require other is behind ego": "`along(ego, X) < 0`",
    "require (other is ahead of ego) until (other is behind ego)": "`along(ego, X) > 0`",
    "require other is turning left": "`X.angularSpeed > 0.2`",
    "require other is on road": "`X.position in R`",
    "require other ahead of ego": "`along(ego, X) > 0`",
    "require other left of ego": "`beside(ego, X) > 0`",
    "require (other right of ego)": "`beside(ego, X) < 0`",
    "require other on crossing": "`X.position in R`",
    "require other facing ego": "`abs(relative heading of (angle from X to Y) from X) < 20 deg`",
    "require other faces ego": "`abs(relative heading of (angle from X to Y) from X) < 20 deg`",
    "require ego sees other": "`X can see Y`",
    "require other.speed > 3 then other.speed < 1": "`require (A) until (B)`",
    "require other occludes ego": "`hides(X, Y)`",
    "require other.lane is not ego.lane initially": "`require A`",
    "require other.speed > 3 for 4 seconds": "`require always A`",
    "terminate when (other ahead of ego)": "`along(ego, X) > 0`",
    "terminate when other sees ego": "`X can see Y`",
    "new Car left of ego by Range(1, 4) meters": "write the number alone",
    "new Car left of ego by Range(1, 4) feet": "write `(...) * 0.3048`",
    "new Car with: speed = 3": "`with speed 3, with width 2`",
    "new Car left of ego by 1 to 4": "`Range(1, 4)`",
    "new Car left of ego by 1..4": "`Range(1, 4)`",
    "new Car with speed between 5 and 10": "`Range(a, b)`",
    "new Car ahead of ego by < 10": "`by Range(a, b)`",
    "new Car in front of ego by 5": "`ahead of X by Range(0, 20)`",
    "new Car facing same direction as ego": "`facing Range(-10, 10) deg relative to X.heading`",
    "new Car facing opposite direction": "`facing Range(170, 190) deg relative to X.heading`",
    "new Car next to ego": "`at X offset by Range(1, 6) @ Range(-5, 5)`",
}


def told(line):
    with pytest.raises(ScenarioError) as caught:
        parse(Source("p.scenic", f"ego = new Car\nother = new Car\n{line}\n"), None)
    (found,) = caught.value.diagnostics
    assert found.code != "mixed-versions"
    return " ".join(found.hints)


@pytest.mark.parametrize("line", HINTS)
def test_what_to_write(line):
    assert HINTS[line] in told(line)


@pytest.mark.parametrize("line", HINTS)
def test_what_it_says_to_write_can_be_read(line):
    for text in re.findall("`([^`]+)`", told(line)):
        specifier = re.match(r"(facing|at|ahead of|behind|beyond|(left|right) of|by|with)\b", text)
        program = f"new Car left of X {text}" if text.startswith("by") else f"new Car {text}" if specifier else text
        if not specifier and not program.startswith(("require", "from")):
            program = f"require {program}"
        if text not in ("deg", "< -0.2"):
            parse(Source("p.scenic", f"ego = new Car\n{program}\n"), 3)


@pytest.mark.parametrize(
    "line", ["require other.speed > 3 nonsense", "new Car left of ego by 3 nonsense", "x = 3 nonsense", "f(3 nonsense)"]
)
def test_other_words_have_no_hint(line):
    assert told(line) == ""
