"""Programs over time that take long in long recordings: what they ask is open until the last sample."""

HEADER = """model scenic.domains.driving.model
ego = new Car in everywhere, facing Range(0, 360) deg
other = new Car in everywhere, facing Range(0, 360) deg
"""
PROGRAMS = {
    "next": "require eventually (other.speed > 5 and next (other.speed < 1))",
    "nested": "require always (other.speed > 3 implies eventually other.speed < 2)",
    "until": "require (other.speed > 1) until (distance from ego to other) < 8",
    "a number": "k = Range(0, 5)\nrequire eventually other.speed > k\nrequire always other.speed >= k - 1",
    "a number of the scene": "k = Range(10, 30)\nrequire (distance from ego to other) > k\n"
    "terminate when (distance from ego to other) < k - 5",
    "two numbers": "a = Range(0, 3)\nb = Range(3, 6)\nrequire always a <= other.speed or other.speed <= b\n"
    "require eventually (other.speed - a) > (b - other.speed)\nterminate after 3 seconds",
    "a choice": "side = Uniform(-1, 1)\nrequire eventually other.position.x * side > 1\nrequire always other.speed < 8",
    "a point": "p = new Point in everywhere\nrequire eventually (distance from other to p) < 3\n"
    "require always (distance from ego to p) < 10",
    "a monitor": "monitor M():\n    while True:\n        require (distance from ego to other) < 60\n        wait\n"
    "require monitor M()\nterminate when other.speed > 5",
    "a third": "third = new Car in everywhere, facing Range(0, 360) deg\n"
    "require eventually (distance from other to third) < 5\n"
    "require eventually always (distance from ego to third) < 60",
}  # fmt: skip
