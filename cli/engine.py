"""Who runs a query: this process, or an engine that runs it in pieces."""

from __future__ import annotations

import click

from scenicq.query.execution.dask_executor import dask
from scenicq.query.execution.executors import Executor

__all__ = ["parse_engine"]


def parse_engine(_ctx: click.Context, _parameter: click.Parameter, text: str | None) -> Executor | None:
    """Read `dask` or `dask=ADDRESS`.

    Raises:
        DataError: option-invalid: Dask is not installed.
    """
    if text is None:
        return None
    name, equals, address = text.partition("=")
    if name != "dask" or (equals and not address):
        raise click.BadParameter("write dask, or dask=ADDRESS of a scheduler, as in dask=tcp://10.0.0.1:8786")
    return dask(address or None)
