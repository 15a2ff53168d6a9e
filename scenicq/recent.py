"""What is kept of the last few things that were made."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from contextlib import suppress
from typing import Generic, TypeVar

__all__ = ["Recent"]

_Key = TypeVar("_Key", bound=Hashable)
_Value = TypeVar("_Value")


class Recent(Generic[_Key, _Value]):
    """Values by key, of which those that were asked for last are kept."""

    def __init__(self, most: int) -> None:
        """Keep so many."""
        self._most = most
        self._values: OrderedDict[_Key, _Value] = OrderedDict()

    def get(self, key: _Key, make: Callable[[], _Value]) -> _Value:
        """The value of a key, made where it is not there any more; threads that ask at once may each make it.

        Args:
            key: The key.
            make: Makes the value.
        """
        try:
            value = self._values[key]
        except KeyError:
            value = self._values[key] = make()
            while len(self._values) > self._most:
                with suppress(KeyError):
                    self._values.popitem(last=False)
        with suppress(KeyError):  # another thread may have dropped it
            self._values.move_to_end(key)
        return value
