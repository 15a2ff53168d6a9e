"""Do scenes that the original Scenic draws match the programs they are drawn from?

Run by `make conformance`: `python tests/tools/conformance/run_conformance.py --map Town01.xodr [PROGRAM...]`. Scenic
3.1.1 stays in an environment of its own (`draw_scenes.py` runs there). Every drawn scene becomes a label. It must match
with the default tolerance, and again with every built-in requirement in force. A program with a line `# sharp: position
heading` also says that its last object has no such freedom: moved by 3 m or turned by 1 rad, it must not match.
A program with a line `# tolerance: position=0.05 why` is matched with that tolerance.
A program with a line `# scenic refuses` is one that both sides refuse. A program with a line `# differs: why` holds a
deviation of Scenic 3.1.1 from its own manual and from the language paper: some of its scenes must not match.

`--random N --seed S` goes on with N random programs: both sides refuse them or none does, every drawn scene matches,
and none with an object displaced out of what the program allows. What fails is made smaller and printed.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from comparing import Outcome, all_match, compare, compare_random, compiled, tolerance_of
from distribution_tests import distances
from original import HERE, Original, environment
from random_programs import compose
from shrinking import shrink
from sifting import Drawing, sifted
from wrong_lines import WRONG, WRONG_ON_ROADS

from scenicq.geometry.default_street import street
from scenicq.geometry.features import read_geojson
from scenicq.geometry.network import Network

SCENIC = "scenic==3.1.1"
SCENIC_2 = "scenic==2.1.0"
RANDOM_SCENES = 4
RANDOM_SECONDS = 2.0
"""Scenes of a random program, and the processor time that Scenic may take."""

SAMPLE_SECONDS = 300.0
"""Processor time that Scenic may take for the sample of one program."""


def read_map(path: Path) -> Network:
    """The road network that Scenic has written.

    Raises:
        SystemExit: It is not sound.
    """
    problems: list[str] = []
    features = read_geojson(path, lambda name, fact: problems.append(f"{name}: {fact}"))
    if problems:
        raise SystemExit(f"the map: {problems[0]}")
    return Network("map", features)


_DEVIATES = re.compile(r"(ahead of|behind|left of|right of) (?!spot\b|\()|chosen offset by|^# differs", re.MULTILINE)
"""Where Scenic 2.1.0 does not do what its manual says: beside an object it measures from the centre, and it takes an
object chosen at random for a vector. Or where Scenic 3 does not."""


def as_scenic_2(text: str) -> str:
    """A program of Scenic 3 in the spelling of Scenic 2, if it uses nothing that only Scenic 3 has."""
    return re.sub(r"\bnew (?=[A-Z])", "", text)


def on_map(text: str, town: Network) -> Network:
    """The network that a program is compiled with."""
    return town if re.search(r"^model ", text, re.MULTILINE) else street()


class Drawn:
    """Scenes of programs, drawn now or, if one asks for it, by the last run.

    Attributes:
        version: Of the language: 2, or None to let scenicq find out.
    """

    def __init__(self, arguments: argparse.Namespace, version: int | None = None) -> None:
        """Start Scenic if scenes are to be drawn."""
        package, folder, self._work = SCENIC, arguments.environment, arguments.work
        self.version = version
        if version == 2:
            package, folder = SCENIC_2, folder.with_name(f"{folder.name}-2")
            self._work = arguments.work / "scenic2"
        self._original: Original | None = None
        if not arguments.reuse or arguments.random:
            self._original = Original(environment(folder, package), arguments.map, self._work)
        self._reuse: bool = arguments.reuse
        self._fresh: set[str] = set()

    def answer(self, name: str, text: str, count: int, seed: int, seconds: float = 60.0) -> dict[str, Any]:
        """What Scenic makes of a program."""
        kept = self._work / f"{name}.json"
        if name in self._fresh or (self._reuse and kept.exists()):
            return json.loads(kept.read_text(encoding="utf-8"))
        assert self._original is not None, f"no scenes of {name} have been drawn"
        answer = self._original.draw(text, count, seed, seconds)
        kept.write_text(json.dumps(answer), encoding="utf-8")
        self._fresh.add(name)
        return answer

    def again(self, text: str, count: int, seed: int) -> dict[str, Any]:
        """The same without keeping it."""
        assert self._original is not None
        return self._original.draw(text, count, seed, RANDOM_SECONDS)

    def town(self, first: str) -> Network:
        """The map; Scenic has written it once it has answered."""
        if self._original is not None:
            self._original.draw(first, 0, 0)
        return read_map(self._work / "map.geojson")

    def close(self) -> None:
        """End Scenic."""
        if self._original is not None:
            self._original.close()


def fixed(arguments: argparse.Namespace, drawn: Drawn, town: Network) -> Iterator[Outcome]:
    """Compare the programs of the list."""
    paths = sorted(arguments.programs or (HERE / "programs").glob("*.scenic"))
    for seed, path in enumerate(paths):
        text = path.read_text(encoding="utf-8")
        answer = drawn.answer(path.stem, text, arguments.scenes, seed)
        yield compare(path.stem, text, answer, on_map(text, town))


def prefilter(arguments: argparse.Namespace, drawn: Drawn, town: Network) -> bool:
    """Print what the prefilters of the list lose of the scenes drawn from it; whether it is nothing."""
    drawings: dict[str, Drawing] = {}
    for seed, path in enumerate(sorted((HERE / "programs").glob("*.scenic"))):
        text = path.read_text(encoding="utf-8")
        scenes = drawn.answer(path.stem, text, arguments.scenes, seed).get("scenes") if all_match(text) else None
        if scenes:
            drawings[path.stem] = Drawing(text, scenes, on_map(text, town), tolerance_of(text))
    kept = frames = lost = 0
    with tempfile.TemporaryDirectory(dir=arguments.work) as folder:
        for name, found in sifted(drawings, Path(folder) / "dataset"):
            kept, frames, lost = kept + found.kept, frames + found.frames, lost + len(found.lost)
            if found.lost:
                print(f"{name} loses {', '.join(found.lost)}")
    print(f"prefilters of {len(drawings)} programs lose {lost} scenes and keep {kept:,} of {frames:,} frames")
    return not lost


def mistakes(drawn: Drawn, town: Network) -> Iterator[Outcome]:
    """Compare programs of two lines, one of which is wrong."""
    starts = (
        ("ego = new Object at (3, -4)", WRONG),
        ("model scenic.domains.driving.model\nego = new Car", WRONG_ON_ROADS),
    )
    for start, lines in starts:
        for number, line in enumerate(lines):
            text, name = f"{start}\n{line}\n", " ".join(line.split())
            answer = drawn.answer(f"wrong-{len(lines)}-{number}", text, 1, number)
            yield compare_random(name, text, answer, on_map(text, town))


def earlier(arguments: argparse.Namespace, drawn: Drawn, town: Network) -> Iterator[Outcome]:
    """Compare the programs of Scenic 2: those of its list, and those of Scenic 3 that can be spelled in it."""
    own = sorted((HERE / "programs_2").glob("*.scenic"))
    borrowed = sorted((HERE / "programs").glob("*.scenic"))
    for seed, path in enumerate(own + borrowed):
        text, name = as_scenic_2(path.read_text(encoding="utf-8")), f"2: {path.stem}"
        answer = drawn.answer(f"{path.parent.name}-{path.stem}", text, arguments.scenes, seed)
        if path in own or (answer.get("scenes") and not _DEVIATES.search(text)):
            yield compare(name, text, answer, on_map(text, town), version=2)


def at_random(arguments: argparse.Namespace, drawn: Drawn, town: Network) -> Iterator[Outcome]:
    """Compare random programs; those that differ are made smaller and kept in the folder of intermediate files."""
    for number in range(arguments.first, arguments.first + arguments.random):
        name = f"random-{arguments.seed}-{number}"
        text = compose(f"{arguments.seed}/{number}")

        def outcome(text: str, name: str = name, number: int = number) -> Outcome:
            answer = drawn.again(text, RANDOM_SCENES, number)
            return compare_random(name, text, answer, on_map(text, town))

        answer = drawn.answer(name, text, RANDOM_SCENES, number, RANDOM_SECONDS)
        found = compare_random(name, text, answer, on_map(text, town))
        if found.faults:
            smaller = shrink(text, _same_fault(found, outcome)) if arguments.shrink else text
            (arguments.work / f"{name}.scenic").write_text(smaller, encoding="utf-8")
            found.faults += ["    " + line for line in smaller.splitlines()]
        yield found


def distributions(arguments: argparse.Namespace, drawn: Drawn, town: Network) -> bool:
    """Print how far the samples of both are apart; whether none is farther than by chance."""
    good = True
    print(f"\n{'distribution':<28}{'distance':>9}{'allowed':>9}")
    for seed, path in enumerate(sorted((HERE / "distributions").glob("*.scenic"))):
        text = path.read_text(encoding="utf-8")
        answer = drawn.answer(f"distribution-{path.stem}", text, arguments.samples, seed, SAMPLE_SECONDS)
        if len(answer.get("scenes", ())) < arguments.samples:
            print(f"{path.stem:<28} Scenic says: {answer.get('error') or answer.get('ended')}")
            good = False
            continue
        found = distances(compiled(path.stem, text, on_map(text, town)), answer["scenes"], seed)
        far = [each for each in found if each.apart > each.allowed]
        worst = max(found, key=lambda each: each.apart)
        print(
            f"{path.stem:<28}{worst.apart:>9.3f}{worst.allowed:>9.3f}  {' '.join(each.what for each in far)}",
            flush=True,
        )
        good = good and not far
    return good


def _same_fault(found: Outcome, outcome: Callable[[str], Outcome]) -> Callable[[str], bool]:
    def same(text: str) -> bool:
        other = outcome(text)
        return other.kind == found.kind and other.faults[0].split(":")[-1] == found.faults[0].split(":")[-1]

    return same


def tell(outcomes: Iterator[Outcome], *, quiet: bool) -> bool:
    """Print a table; whether everything is as it should be."""
    matched = drawn = told = moved = 0
    good, kinds = True, Counter[str]()
    print(f"{'program':<28}{'matched':>9}{'told apart':>12}")
    for outcome in outcomes:
        if outcome.faults or not quiet:
            print(f"{outcome.name:<28}{f'{outcome.matched}/{outcome.drawn}':>9}{f'{outcome.told}/{outcome.moved}':>12}")
        for fault in outcome.faults[:40] if quiet else outcome.faults[:3]:
            print(f"    {fault}")
        sys.stdout.flush()
        good = good and not outcome.faults
        kinds[outcome.kind] += 1
        matched, drawn = matched + outcome.matched, drawn + outcome.drawn
        told, moved = told + outcome.told, moved + outcome.moved
    print(f"{'all':<28}{f'{matched}/{drawn}':>9}{f'{told}/{moved}':>12}   {100 * matched / max(drawn, 1):.2f} %")
    if quiet:
        print(", ".join(f"{count} {kind}" for kind, count in kinds.most_common()))
    return good


def parse_arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("programs", nargs="*", type=Path, help="all in programs/ if none is given")
    parser.add_argument("--map", type=Path, required=True, help="OpenDRIVE file of a town")
    parser.add_argument("--environment", type=Path, default=Path(".conformance-venv"), help="where Scenic is installed")
    parser.add_argument("--work", type=Path, default=Path(".conformance"), help="folder of intermediate files")
    parser.add_argument("--reuse", action="store_true", help="match the scenes that the last run has drawn")
    parser.add_argument("--scenes", type=int, default=20, help="scenes of each program")
    parser.add_argument("--samples", type=int, default=500, help="scenes of each program whose distribution is tested")
    parser.add_argument("--random", type=int, default=0, metavar="N", help="compare N random programs too")
    parser.add_argument("--seed", type=int, default=0, help="of the random programs")
    parser.add_argument("--first", type=int, default=0, help="number of the first random program")
    parser.add_argument("--only-scenic-2", action="store_true", help="leave out all but Scenic 2")
    parser.add_argument("--only-prefilter", action="store_true", help="leave out all but the prefilters of the list")
    parser.add_argument("--only-mistakes", action="store_true", help="leave out all but the wrong programs")
    parser.add_argument("--only-random", action="store_true", help="leave out all but the random programs")
    parser.add_argument("--only-distributions", action="store_true", help="leave out all but the distributions")
    parser.add_argument("--no-shrink", dest="shrink", action="store_false", help="print failures as they are")
    return parser.parse_args()


def main() -> int:
    """Compare; 0 if everything is as it should be."""
    arguments = parse_arguments()
    parts = ("prefilter", "mistakes", "distributions", "scenic_2", "random")
    only = {name for name in parts if getattr(arguments, f"only_{name}")}
    only = only or ({"list"} if arguments.programs else {"list", *parts})
    good = True
    if only != {"scenic_2"}:
        drawn = Drawn(arguments)
        try:
            town = drawn.town("ego = new Object")
            if "list" in only:
                good = tell(fixed(arguments, drawn, town), quiet=False)
            if "prefilter" in only:
                good = prefilter(arguments, drawn, town) and good
            if "mistakes" in only:
                good = tell(mistakes(drawn, town), quiet=True) and good
            if "distributions" in only:
                good = distributions(arguments, drawn, town) and good
            if "random" in only or arguments.random:
                good = tell(at_random(arguments, drawn, town), quiet=True) and good
        finally:
            drawn.close()
    if "scenic_2" in only:
        drawn = Drawn(arguments, 2)
        try:
            good = tell(earlier(arguments, drawn, drawn.town("ego = Object")), quiet=True) and good
        finally:
            drawn.close()
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
