"""The class tree, into which the classes of scenarios and of datasets are translated.

An object of a scenario matches label objects of its class or below. Datasets have names of their own; a taxonomy
translates them. Nothing here reads a dataset.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Literal

__all__ = [
    "ROOT",
    "Granularity",
    "ancestors",
    "class_matches",
    "class_truth",
    "fold",
    "is_class",
    "is_subclass",
    "subclasses",
    "taxonomy",
    "taxonomy_names",
]

ROOT = "Object"
"""The class of everything, and of what no taxonomy knows."""

Granularity = Literal["fine", "coarse"]
"""`coarse` folds all vehicles into `Car` and all people into `Pedestrian`, as the query paper's experiments did."""

_SOURCES = ("argoverse2", "commonroad", "interaction", "kitti", "nuscenes", "openlabel", "waymo")
_COARSE = {"Vehicle": "Car", "Pedestrian": "Pedestrian"}


def _load(name: str) -> dict[str, str | None]:
    # importlib.resources would take as long to load as the whole of a small source to read
    return json.loads(Path(__file__).with_name("taxonomies").joinpath(f"{name}.json").read_bytes())


@cache
def _tree() -> Mapping[str, str | None]:
    return MappingProxyType(_load("tree"))


def is_class(name: str) -> bool:
    """Whether the tree has a class of that name."""
    return name in _tree()


@cache
def ancestors(name: str) -> tuple[str, ...]:
    """The class itself, its parent, and so on up to `Object`.

    Raises:
        KeyError: The tree has no such class.
    """
    path = [name]
    while (parent := _tree()[path[-1]]) is not None:
        path.append(parent)
    return tuple(path)


def is_subclass(category: str, of: str) -> bool:
    """Whether a class is another one or lies below it in the tree.

    Raises:
        KeyError: The tree has no class `category`.
    """
    return of in ancestors(category)


@cache
def subclasses(name: str) -> tuple[str, ...]:
    """The class itself and everything below it, in the tree's order.

    Raises:
        KeyError: The tree has no such class.
    """
    if not is_class(name):
        raise KeyError(name)
    return tuple(category for category in _tree() if is_subclass(category, name))


@cache
def fold(category: str, granularity: Granularity) -> str:
    """The class that stands for `category` at a granularity.

    Raises:
        KeyError: The tree has no such class.
    """
    path = ancestors(category)
    if granularity == "fine":
        return category
    return next((_COARSE[name] for name in path if name in _COARSE), category)


def taxonomy_names() -> tuple[str, ...]:
    """Names that `taxonomy` knows."""
    return (*_SOURCES, "scenic")


@cache
def taxonomy(name: str) -> Mapping[str, str]:
    """Translation of a dataset's class names into the tree.

    Args:
        name: One of `taxonomy_names()`; "scenic" is the tree's own names.

    Raises:
        KeyError: There is no such taxonomy.
    """
    if name == "scenic":
        return MappingProxyType({category: category for category in _tree()})
    if name not in _SOURCES:
        raise KeyError(name)
    return MappingProxyType({source: category for source, category in _load(name).items() if category is not None})


@cache
def class_matches(wanted: str, category: str, granularity: Granularity) -> bool:
    """Whether an object of this class can play a role of class `wanted`: both folded, it is that class or below."""
    own = fold(category, granularity) if is_class(category) else category
    role = fold(wanted, granularity) if is_class(wanted) else wanted
    return own == role or (is_class(own) and role in ancestors(own))


@cache
def class_truth(wanted: str, category: str, classes: Granularity) -> int:
    """Whether a label object is of a class: 0 for no, 1 for perhaps, as its own class is coarser, 2 for surely."""
    if not category:
        return 0
    return 2 if class_matches(wanted, category, classes) else int(class_matches(category, wanted, classes))
