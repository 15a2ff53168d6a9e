"""Scenes that Scenic draws from the programs of its own repository, kept in files so that they are drawn once."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from original import Original

from scenicq.compiler.named_map import named_map
from scenicq.errors import Source

FOLDERS = ("examples/driving", "examples/carla")
SECOND = ("Town05", "Town10HD", "Town03", "Town01")
"""Towns on which programs are drawn besides their own, in this order."""
SECONDS = 45.0
"""Processor time that Scenic may take for the scenes of one program on one town."""


@dataclass(frozen=True, slots=True)
class Drawing:
    """A program on a town.

    Attributes:
        program: Its path in the checkout.
        town: The name of the map.
        own: Whether the program names this map.
    """

    program: str
    town: str
    own: bool

    @property
    def name(self) -> str:
        """A name for its file of scenes."""
        inner = self.program.removeprefix("examples/").removesuffix(".scenic")
        return f"{inner.replace('/', '-')}.{self.town}"


def maps_of(folders: list[Path]) -> dict[str, Path]:
    """The OpenDRIVE maps in some folders, by their names."""
    return {path.stem: path for folder in folders for path in sorted(folder.rglob("*.xodr"))}


def published_programs(checkout: Path) -> Iterator[tuple[str, str]]:
    """The path in the checkout of every published program, and the name of its map."""
    for path in sorted(path for folder in FOLDERS for path in (checkout / folder).rglob("*.scenic")):
        named = named_map(Source(path.name, path.read_text(encoding="utf-8")))
        if named is not None:  # else a library of the others
            yield path.relative_to(checkout).as_posix(), Path(named.file).stem


def drawings(checkout: Path, towns: dict[str, Path], count: int) -> list[Drawing]:
    """Every published program on its own town, if it is there, and on others up to `count` towns; town by town."""
    found: list[Drawing] = []
    for program, own in published_programs(checkout):
        names = [name for name in dict.fromkeys((own, *SECOND)) if name in towns]
        found += [Drawing(program, name, name == own) for name in names[:count]]
    return sorted(found, key=lambda each: (not each.own, each.town, each.program))


def draw_all(
    wanted: list[Drawing], checkout: Path, towns: dict[str, Path], python: Path, work: Path, count: int
) -> Iterator[tuple[Drawing, str]]:
    """Draw what is not drawn yet, one process a town, and tell what came of each."""
    (work / "scenes").mkdir(parents=True, exist_ok=True)
    for town in dict.fromkeys(each.town for each in wanted):
        missing = [each for each in wanted if each.town == town and not _enough(work, each, count)]
        # also where nothing is missing: it writes the map afresh, so that none of an older conversion is matched with
        original = Original(python, towns[town], work / town)
        try:
            for seed, each in enumerate(missing):
                answer = original.draw_file(checkout / each.program, count, seed, SECONDS)
                kept = {"program": each.program, "town": each.town, "wanted": count, **answer}
                _file(work, each).write_text(json.dumps(kept), encoding="utf-8")
                yield each, answer.get("error") or answer.get("ended") or f"{len(answer['scenes'])} scenes"
        finally:
            original.close()


def is_drawn(work: Path, drawing: Drawing) -> bool:
    """Whether Scenic has drawn, or said, anything of a program on a town."""
    return _file(work, drawing).exists()


def scenes_of(work: Path, drawing: Drawing) -> dict[str, Any]:
    """What Scenic drew, or said."""
    return json.loads(_file(work, drawing).read_text(encoding="utf-8"))


def _file(work: Path, drawing: Drawing) -> Path:
    return work / "scenes" / f"{drawing.name}.json"


def _enough(work: Path, drawing: Drawing, count: int) -> bool:
    return is_drawn(work, drawing) and scenes_of(work, drawing)["wanted"] >= count
