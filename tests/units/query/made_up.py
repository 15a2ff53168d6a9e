"""Programs for the prefilter: some whose objects are tied to each other, and random ones."""

from __future__ import annotations

import random

TIED: dict[str, str] = {
    "ahead of another": "ego = new Car\nfirst = new Car offset by (Range(-6, 6), Range(4, 12))\n"
    "second = new Car ahead of first by (Range(-1, 1), Range(2, 10))",
    "beside another": "ego = new Car\nfirst = new Car offset by (Range(-6, 6), Range(4, 12))\n"
    "second = new Pedestrian left of first by Range(0.5, 3), facing Range(-20, 20) deg relative to first.heading",
    "near another": "ego = new Car\nfirst = new Car\nsecond = new Pedestrian\n"
    "require (distance from first to second) < 8",
    "facing another": "ego = new Car\nfirst = new Car\nsecond = new Car\n"
    "require abs(relative heading of first from second) > 100 deg",
    "either side": "ego = new Car\n"
    "other = new Car offset by (Uniform(-1, 1) * Range(3, 5), Range(2, 12)),\n"
    "    facing Uniform(1, -1) * Range(60, 120) deg relative to roadDirection",
    "two gaps": "gap = Uniform(Range(3, 5), Range(14, 18))\nego = new Car\nother = new Car ahead of ego by gap",
    "one or the other": "ego = new Car\nfirst = new Car\nsecond = new Pedestrian\n"
    "require first.position.x - second.position.x > 6 or not (distance from ego to second) > 10",
    "behind a walker": "ego = new Car\n"
    "walker = new Pedestrian offset by (Range(-5, 5), Range(2, 20)), facing Range(0, 180) deg\n"
    "other = new Pedestrian behind walker by Range(0.5, 2), facing Uniform(0, 90, 180) deg relative to walker.heading",
    "weather": "param weather = Uniform('rain', 'snow')\nparam hour = Range(6, 12)\nego = new Car\nother = new Car",
}
"""Programs whose objects are tied to each other, and whose bounds are unions."""

PLACES = (
    "offset by (Range({a}, {b}), Range({c}, {d}))",
    "offset by (Uniform(-1, 1) * Range({a}, {b}), Range({c}, {d}))",
    "ahead of {one} by Range({c}, {d})",
    "behind {one} by (Range({a}, {b}), Range({c}, {d}))",
    "left of {one} by Range({a}, {b})",
    "beyond {one} by Range({c}, {d})",
    "on road",
    "on intersection",
)
FACINGS = (
    "",
    ", facing Range(-{h}, {h}) deg relative to roadDirection",
    ", facing Uniform(1, -1) * Range({h}, {k}) deg relative to {one}.heading",
    ", facing Uniform(0, {h}, {k}) deg relative to ego.heading",
    ", facing -1 * Range({h}, {k}) deg",
)
DEMANDS = (
    "require (distance from {one} to {two}) < {d}",
    "require abs(relative heading of {one} from {two}) > {h} deg",
    "require {one}.position.x > {two}.position.x or {one} in road",
    "require not ({two} in intersection) and (distance to {two}) < {d} * 3",
    "require (angle from {one} to {two}) > 0",
    "require abs(apparent heading of {two}) < {k} deg",
)


def made_up(seed: int) -> str:
    """A random program of two or three objects around the ego."""
    rng = random.Random(seed)
    names, lines = ["ego"], ["ego = new Car on road"]

    def filled(text: str) -> str:
        low, near = rng.randint(0, 3), rng.randint(0, 4)
        one = rng.choice(names)
        two = rng.choice([name for name in names if name != one] or names)
        sizes = {"a": low, "b": low + rng.randint(1, 4), "c": near, "d": near + rng.randint(3, 10)}
        return text.format(one=one, two=two, h=rng.randint(10, 80), k=rng.randint(90, 170), **sizes)

    for name in ("first", "second", "third")[: rng.randint(2, 3)]:
        category = rng.choice(("Car", "Car", "Pedestrian"))
        lines.append(f"{name} = new {category} {filled(rng.choice(PLACES))}{filled(rng.choice(FACINGS))}")
        names.append(name)
    names.remove("ego")
    lines += [filled(rng.choice(DEMANDS)) for _ in range(rng.randint(0, 2))]
    return "\n".join(lines)


RANDOM = {f"random {seed}": made_up(seed) for seed in range(24)}
