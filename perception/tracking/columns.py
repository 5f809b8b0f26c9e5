"""Tables of parallel columns, so that a step over all tracks costs a few array operations."""

from dataclasses import dataclass, fields
from typing import Self

import numpy as np

from perception.types import Bool, Int


@dataclass(frozen=True)
class Columns:
    """Base of frozen dataclasses whose every field is an array with one row for each track."""

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(getattr(self, fields(self)[0].name))

    def __getitem__(self, rows: Bool | Int | slice) -> Self:
        """Return the tracks of a mask, of indices, or of a slice."""
        return type(self)(
            **{column.name: getattr(self, column.name)[rows] for column in fields(self)}
        )

    def joined(self, others: Self) -> Self:
        """Return these tracks and others after them."""
        return type(self)(
            **{
                column.name: np.concatenate(
                    [getattr(self, column.name), getattr(others, column.name)]
                )
                for column in fields(self)
            }
        )

    def replaced(self, rows: Int, others: Self) -> Self:
        """Return these tracks with others in the place of some rows."""
        columns = {column.name: getattr(self, column.name).copy() for column in fields(self)}
        for name, column in columns.items():
            column[rows] = getattr(others, name)
        return type(self)(**columns)
