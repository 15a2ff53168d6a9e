"""`check --modes`: where monitors, behaviors and scenarios may stand, and where each leads."""

from scenicq.compiler.program import compile_scenario
from scenicq.errors import Source
from scenicq.forest.show_modes import show_modes
from scenicq.geometry.default_street import street

PROGRAM = """behavior Drive(limit):
    while self.speed < limit:
        wait
    do Stop() for 2 seconds
    terminate
behavior Stop():
    while True:
        take SetBrakeAction(1)
scenario Main():
    setup:
        ego = new Car with behavior Drive(5)
    compose:
        do Sub() until ego.speed > 3
        do choose Sub(), Other()
scenario Sub():
    require always ego.speed < 10
    terminate after 1 seconds
scenario Other():
    new Car ahead of ego by 5
    terminate when ego.speed < 1
"""


def shown(text: str) -> list[str]:
    model = "model scenic.domains.driving.model; "
    return show_modes(compile_scenario(Source("p.scenic", model + text), street(), version=3, behaviors="guards"))


def test_each_mode_has_a_line():
    text = PROGRAM.replace("do choose Sub(), Other()", "wait")
    assert shown(text) == [
        "requirement [line 16]: require always ego.speed < 10",
        "what composes scenarios [line 9]: 2 modes",
        "  0  begins -> 1 if (ego.speed > 3); 2 if not (ego.speed > 3)",
        "  1  wait [line 14] -> the run ends",
        "  2  do Sub() until ego.speed > 3 [line 13] -> 1 in 2 ways; 2 if not (ego.speed > 3)",
        "behavior of ego [line 11]: 2 modes",
        "  0  begins -> 1 if (self.speed < limit); 2 if not (self.speed < limit)",
        "  1  wait [line 3] -> 1 if (self.speed < limit); 2 if not (self.speed < limit)",
        "  2  take SetBrakeAction(1) [line 8] -> the run ends if its time is over; 2",
    ]


def test_each_variant_has_its_own():
    lines = shown(PROGRAM)
    assert [each for each in lines if each.startswith("with ")] == ["with ego:", "with ego, Car#2:", "with ego, Car#3:"]


def test_a_program_about_one_instant_has_none():
    assert shown("ego = new Car") == ["no modes: the program says nothing about time"]
