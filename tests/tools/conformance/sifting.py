"""Scenes that Scenic has drawn, put into a dataset: the prefilter of a program must keep every one of its scenes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from comparing import compiled, label_of

from scenicq.geometry.network import Network
from scenicq.match.options import MatchOptions
from scenicq.match.tolerance import Tolerance
from scenicq.query.prefilter.executor import blocks, extents, run_prefilter
from scenicq.query.prefilter.plan import make_plan
from scenicq.query.prefilter.survivors import candidates
from scenicq.store.dataset import Dataset, open_dataset
from scenicq.store.labels import Recording
from scenicq.store.writer import write_dataset

__all__ = ["Drawing", "Sifted", "sifted"]


@dataclass(frozen=True, slots=True)
class Drawing:
    """What Scenic drew from a program.

    Attributes:
        text: The program.
        scenes: The scenes.
        network: What the program is compiled with.
        tolerance: That of the program.
    """

    text: str
    scenes: Sequence[dict[str, Any]]
    network: Network
    tolerance: Tolerance


@dataclass(frozen=True, slots=True)
class Sifted:
    """What the prefilter of a program leaves.

    Attributes:
        lost: The program's own frames that it drops.
        kept: How many frames it leaves, of all programs.
        frames: How many there are on the program's map.
    """

    lost: tuple[str, ...]
    kept: int
    frames: int


def sifted(drawings: Mapping[str, Drawing], folder: Path) -> Iterator[tuple[str, Sifted]]:
    """Sift all scenes by each program.

    Args:
        drawings: By the names of the programs.
        folder: Where the dataset is made; it must not be there yet.
    """
    maps = {each.network.name: each.network.features for each in drawings.values()}
    write_dataset(folder, (_recording(name, each) for name, each in drawings.items()), maps, name="drawn")
    dataset = open_dataset(folder)
    for name, drawing in drawings.items():
        yield name, _sifted(dataset, name, drawing)


def _recording(name: str, drawing: Drawing) -> Recording:
    labels = [label_of(scene, number) for number, scene in enumerate(drawing.scenes)]
    return Recording(
        name,
        drawing.network.name,
        tuple(
            replace(
                label,
                frame=f"{name}-{number}",
                recording=name,
                timestamp_us=number,
                map=drawing.network.name,
                ego=replace(label.ego, id="ego"),
            )
            for number, label in enumerate(labels)
        ),
    )


def _sifted(dataset: Dataset, name: str, drawing: Drawing) -> Sifted:
    network = dataset.network(drawing.network.name)
    plan = make_plan(compiled(name, drawing.text, network), network, MatchOptions(tolerance=drawing.tolerance))
    kept: list[str] = []
    frames = 0
    with closing(dataset.connect()) as connection:
        for block in blocks(extents(dataset, connection), plan.map):
            frames += len(run_prefilter(dataset, connection, plan, block))
            kept += [each.label.frame for each in candidates(connection, plan)]
    own = {f"{name}-{number}" for number in range(len(drawing.scenes))}
    return Sifted(tuple(sorted(own.difference(kept))), len(kept), frames)
