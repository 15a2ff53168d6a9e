"""One frame of a dataset, to be looked at."""

from __future__ import annotations

from dataclasses import dataclass

from scenicq.notebook.pictures import Picture, take_picture
from scenicq.report.backdrop import Backdrop
from scenicq.report.picture import Shot
from scenicq.store.dataset import Dataset
from scenicq.store.labels import Label, LabelObject

__all__ = ["Frame"]


@dataclass(frozen=True, slots=True)
class Frame:
    """A frame with its label.

    Attributes:
        dataset: Where it is from.
        label: Ego and objects.
    """

    dataset: Dataset
    label: Label

    @property
    def name(self) -> str:
        """Its name, as results have it."""
        return self.label.frame

    @property
    def recording(self) -> str:
        """The recording that it belongs to."""
        return self.label.recording

    @property
    def objects(self) -> tuple[LabelObject, ...]:
        """The label objects, without the ego."""
        return tuple(self.label.objects)

    def show(self, *, half: float | None = None, width: int = 600) -> Picture:
        """The frame from above.

        Args:
            half: Metres from the ego to the edges, 1 to 1,000; chosen if None.
            width: In pixels, 50 to 10,000.

        Raises:
            DataError: option-invalid.
        """
        return take_picture(Shot(self.label), Backdrop(self.dataset.network(self.label.map)), half, width)

    def _repr_svg_(self) -> str:
        return self.show().svg

    def __repr__(self) -> str:
        """Name, recording and how many objects."""
        count = len(self.label.objects)
        return f"<frame {self.name} of {self.recording}: {count} object{'' if count == 1 else 's'}>"
