"""Parallel arrays with one row an observation: the form in which figures are gathered over frames."""

from collections.abc import Iterable
from dataclasses import dataclass, fields
from typing import Self

import numpy as np

from perception.types import Bool, Int


@dataclass(frozen=True)
class Rows:
    """Base of frozen dataclasses whose every field is an array of one length."""

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(getattr(self, fields(self)[0].name))

    def __getitem__(self, rows: Bool | Int) -> Self:
        """Return the rows of a mask, or those of the numbers given, in their order."""
        return type(self)(*(getattr(self, field.name)[rows] for field in fields(self)))

    @classmethod
    def concatenate(cls, parts: Iterable[Self]) -> Self:
        """Join the rows of many frames; no part gives no row."""
        whole = list(parts)
        columns = [[getattr(part, field.name) for part in whole] for field in fields(cls)]
        return cls(*(np.concatenate(column) if column else np.zeros(0) for column in columns))
