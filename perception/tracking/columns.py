"""Tables of parallel columns, so that a step over all tracks costs a few array operations."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from perception.tracking.kalman import Gaussians
from perception.types import Bool, Float64, Int


@dataclass(frozen=True)
class Columns:
    """Base of frozen dataclasses whose every field is an array with one row for each track."""

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(getattr(self, next(iter(self.__dataclass_fields__))))

    def __getitem__(self, rows: Bool | Int | slice) -> Self:
        """Return the tracks of a mask, of indices, or of a slice."""
        return type(self)(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))

    def joined(self, others: Self) -> Self:
        """Return these tracks and others after them."""
        return type(self)(
            *(
                np.concatenate([getattr(self, name), getattr(others, name)])
                for name in self.__dataclass_fields__
            )
        )

    def replaced(self, rows: Int, others: Self) -> Self:
        """Return these tracks with others in the place of some rows."""
        columns = [getattr(self, name).copy() for name in self.__dataclass_fields__]
        for name, column in zip(self.__dataclass_fields__, columns, strict=True):
            column[rows] = getattr(others, name)
        return type(self)(*columns)


@dataclass(frozen=True)
class GroundPlaneTracks(Columns):
    """T tracks over the ground plane of a world that stands still.

    Attributes:
        mean: (T, 4) x and y of the box's centre and its velocity.
        covariance: (T, 4, 4) of these.
    """

    mean: Float64
    covariance: Float64

    @property
    def states(self) -> Gaussians:
        """The Kalman filters."""
        return Gaussians(self.mean, self.covariance)

    @property
    def speeds_m_s(self) -> Float64:
        """(T,) over the ground."""
        return np.asarray(np.hypot(self.mean[:, 2], self.mean[:, 3]))
