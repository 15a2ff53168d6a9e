"""A scenario that asks no more of a map than its traits, over other maps: copied, not compiled again.

All that it has of its map are the network's own parts, which are not read yet. A copy has those of another network in
their places.
"""

from __future__ import annotations

import io
import pickle
from typing import Any, cast

from scenicq.errors import Source
from scenicq.forest.scenario import Scenario
from scenicq.geometry.network import Network

__all__ = ["ScenarioCopies"]


class ScenarioCopies:
    """Makes copies of one scenario; what it shares with all of them are texts of programs."""

    def __init__(self, scenario: Scenario, network: Network) -> None:
        """Take the scenario.

        Args:
            scenario: Compiled over a network of which nothing is read.
            network: The network.
        """
        self._sources: list[Source] = []
        self._written = self._write(scenario, network)

    def over(self, network: Network) -> Scenario | None:
        """The scenario over another network with the same traits; None where only compiling makes that.

        Args:
            network: The other network.
        """
        if self._written is None:
            return None
        reader = _Reader(io.BytesIO(self._written))
        reader.network, reader.sources = network, self._sources
        return reader.load()

    def _write(self, scenario: Scenario, network: Network) -> bytes | None:
        file = io.BytesIO()
        writer = _Writer(file, pickle.HIGHEST_PROTOCOL)
        writer.parts, writer.sources = {id(part): name for name, part in network.parts.items()}, self._sources
        try:
            writer.dump(scenario)
        except (pickle.PicklingError, AttributeError, TypeError, RecursionError):
            # something of it is made by functions that nothing else can name
            return None
        return file.getvalue()


class _Writer(pickle.Pickler):
    """Writes what is not the map's."""

    parts: dict[int, str]
    sources: list[Source]

    def persistent_id(self, obj: Any) -> tuple[str, str | int] | None:
        """What stands for a part of the network, or for a text."""
        if id(obj) in self.parts:
            return "part", self.parts[id(obj)]
        if isinstance(obj, Source):
            if obj not in self.sources:
                self.sources.append(obj)
            return "source", self.sources.index(obj)
        return None


class _Reader(pickle.Unpickler):
    """Reads that for another map."""

    network: Network
    sources: list[Source]

    def persistent_load(self, pid: Any) -> object:
        """The part of the network, or the text."""
        what, which = cast("tuple[str, Any]", pid)
        return self.sources[int(which)] if what == "source" else self.network.part(str(which))
