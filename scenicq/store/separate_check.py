"""Check a dataset in a process of its own: a damaged file may make a library kill the process."""

from __future__ import annotations

from collections.abc import Callable

from scenicq.errors import DataError, Diagnostic
from scenicq.processes import LostTask, Workers, limit_memory
from scenicq.store.dataset import DatasetReference

__all__ = ["check_apart"]

_MEMORY = 6 << 30
"""Bytes of address space that the process may take."""


def check_apart(dataset: DatasetReference) -> None:
    """Refuse a dataset that is not sound, or that ends the process which reads it.

    Raises:
        DataError: As `DatasetReference.open` does.
    """
    with Workers(1, _start) as workers:
        for _, answer in workers.run([dataset], tries=1):
            if isinstance(answer, LostTask):
                message = f"{dataset.address}: the process that reads it dies, or needs more than {_MEMORY >> 30} GiB"
                raise DataError(Diagnostic("dataset-invalid", message))


def _start() -> Callable[[DatasetReference, Callable[[object], None]], None]:
    limit_memory(_MEMORY)

    def work(dataset: DatasetReference, _tell: Callable[[object], None]) -> None:
        dataset.open(check=True)

    return work
