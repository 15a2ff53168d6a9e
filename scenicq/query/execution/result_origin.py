"""Which dataset results come from: every file of results names it, so that results of different ones do not mix."""

from __future__ import annotations

from collections.abc import Iterable

from scenicq.errors import DataError, Diagnostic
from scenicq.store.dataset import Dataset

__all__ = ["check_origins", "name_origin"]

_DIGITS = 8


def name_origin(dataset: Dataset) -> str:
    """The dataset's own name and its version, as `town@1f5c02ab`.

    The name is the source's, so that copies and another folder do not change it; the version is a digest of all tables.
    """
    return f"{dataset.manifest.name}@{dataset.manifest.digest[:_DIGITS]}"


def check_origins(first: tuple[str, Iterable[str]], second: tuple[str, Iterable[str]]) -> Diagnostic | None:
    """Refuse results of different datasets; those that do not say which are taken as they are.

    Args:
        first: What messages call it, and the datasets that its records name; "" where they name none.
        second: The same of the other.

    Returns:
        A warning where the versions of one dataset differ; None where they are the same or not known.

    Raises:
        DataError: option-invalid: the datasets have different names.
    """
    (one, mine), (other, theirs) = ((told, _origins(names)) for told, names in (first, second))
    if not mine or not theirs or mine == theirs:
        return None
    told = f"{one} is of {_listed(mine)}, {other} of {_listed(theirs)}"
    if {name for name, _ in mine} != {name for name, _ in theirs}:
        raise DataError(Diagnostic("option-invalid", f"these are different datasets: {told}"))
    hint = "frames that only one version has count as frames that do not match in the other"
    return Diagnostic("option-invalid", f"the dataset has changed: {told}", hints=(hint,), severity="warning")


def _origins(names: Iterable[str]) -> set[tuple[str, str]]:
    return {(name, version) for name, _, version in (each.rpartition("@") for each in {*names} - {""})}


def _listed(origins: set[tuple[str, str]]) -> str:
    return " and ".join(sorted(f"{name} (version {version})" for name, version in origins))
