"""Array types, the validation of shapes, and tables: frozen dataclasses of parallel arrays with one row for each object."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields
from typing import Annotated, Any, Final, Self, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from perception.errors import PerceptionError

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Complex64 = NDArray[np.complex64]
Float = NDArray[np.float32] | NDArray[np.float64]
Int = NDArray[np.int32] | NDArray[np.int64]
UInt8 = NDArray[np.uint8]
Bool = NDArray[np.bool_]
# Metadata of a field that belongs to the whole table: selecting rows leaves it as it is.
SHARED: Final = "shared"


def require_shape(what: str, array: NDArray[Any], expected: tuple[int | str, ...]) -> None:
    """Validate the shape of an array; a letter, such as N, stands for any length."""
    fits = array.ndim == len(expected)
    for have, want in zip(array.shape, expected, strict=False):
        fits &= have == want or isinstance(want, str)
    if not fits:
        shape = "(" + ", ".join(map(str, expected)) + ")"
        raise PerceptionError(what, expected=f"shape {shape}", found=f"shape {array.shape}")


@dataclass(frozen=True)
class ArrayTable:
    """Base of tables: every field is a column, an array or another table, of one length.

    The annotation of a column states its type, and the shape of its rows:

        @dataclass(frozen=True)
        class Detections(ArrayTable):
            boxes_px: Annotated[Float64, 4]              # (M, 4); (M, 4, 4) is Annotated[Float64, 4, 4]
            scores: Float64                              # (M,)
            features: Annotated[Float64, ...]            # (M, any)
            size_px: Annotated[tuple[int, int], SHARED]  # one value of the whole table

    Construction fails where a column has another length or shape than this.
    """

    def __post_init__(self) -> None:
        """Validate the lengths and the stated shapes of all columns."""
        columns, given = _columns(type(self)), self.__dict__
        length = len(given[columns[0].name])
        for column in columns:
            values, row = given[column.name], column.row
            if len(values) != length or (row is not None and values.shape[1:] != row):
                raise PerceptionError(
                    f"{type(self).__name__}.{column.name}",
                    expected=f"shape {(length, *(column.row or ()))}",
                    found=f"shape {getattr(values, 'shape', (len(values),))}",
                )

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.__dict__[_columns(type(self))[0].name])

    def __getitem__(self, rows: Bool | Int | slice) -> Self:
        """Return the rows of a mask, of indices, or of a slice; shared fields stay."""
        given = self.__dict__
        return self._with({one.name: given[one.name][rows] for one in _columns(type(self))})

    @classmethod
    def empty(cls, **shared: Any) -> Self:  # noqa: ANN401 - values of any field
        """Return a table without rows.

        Args:
            **shared: Values of the shared fields that have no default.
        """
        return cls(**{column.name: column.empty() for column in _columns(cls)}, **shared)

    @classmethod
    def concatenate(cls, parts: Iterable[Self]) -> Self:
        """Return the rows of all parts, in order; shared fields are those of the first part."""
        whole = list(parts)
        if not whole:
            return cls.empty()
        return whole[0]._with(
            {
                column.name: column.concatenate([getattr(part, column.name) for part in whole])
                for column in _columns(cls)
            }
        )

    def joined(self, others: Self) -> Self:
        """Return the rows of this table, then those of the other."""
        return type(self).concatenate((self, others))

    def replaced(self, rows: Bool | Int, others: Self) -> Self:
        """Return the table with some rows replaced by those of the other."""
        return self._with(
            {
                column.name: column.replaced(
                    getattr(self, column.name), rows, getattr(others, column.name)
                )
                for column in _columns(type(self))
            }
        )

    def _with(self, columns: dict[str, Any]) -> Self:
        """Return the table with columns taken from valid ones, which need no validation."""
        table = object.__new__(type(self))
        for name in _layout(type(self)).shared:
            columns[name] = getattr(self, name)
        table.__dict__.update(columns)
        return table


@dataclass(frozen=True)
class _Column:
    """One column of a table.

    Attributes:
        name: Name of the field.
        row: Shape of a row, () of a number; None where any shape will do, and of a table.
        dtype: Type of the numbers of an array.
        table: Class of a column that is a table itself.
    """

    name: str
    row: tuple[int, ...] | None
    dtype: Any
    table: type[ArrayTable] | None

    def empty(self) -> Any:  # noqa: ANN401 - an array or a table
        return self.table.empty() if self.table else np.zeros((0, *(self.row or ())), self.dtype)

    def concatenate(self, pieces: list[Any]) -> Any:  # noqa: ANN401 - an array or a table
        return self.table.concatenate(pieces) if self.table else np.concatenate(pieces)

    def replaced(self, values: Any, rows: Bool | Int, others: Any) -> Any:  # noqa: ANN401 - an array or a table
        if self.table:
            return values.replaced(rows, others)
        # Longer names than those of the column widen it.
        is_same = values.dtype == others.dtype
        changed = values.copy() if is_same else values.astype(np.result_type(values, others))
        changed[rows] = others
        return changed


@dataclass(frozen=True)
class _Layout:
    """Fields of a table.

    Attributes:
        columns: Columns in the order of their fields.
        shared: Names of the other fields.
    """

    columns: tuple[_Column, ...]
    shared: tuple[str, ...]


def _layout(table: type[ArrayTable]) -> _Layout:
    """Return the fields of a table by their annotations."""
    if table not in _LAYOUTS:
        columns = tuple(_read_columns(table))
        names = {column.name for column in columns}
        shared = tuple(field.name for field in fields(table) if field.name not in names)
        _LAYOUTS[table] = _Layout(columns, shared)
    return _LAYOUTS[table]


def _columns(table: type[ArrayTable]) -> tuple[_Column, ...]:
    """Return the columns of a table by the annotations of its fields."""
    return _layout(table).columns


_LAYOUTS: dict[type[ArrayTable], _Layout] = {}


def _read_columns(table: type[ArrayTable]) -> Iterator[_Column]:
    hints = get_type_hints(table, include_extras=True)
    for field in fields(table):
        hint = hints[field.name]
        kind, *stated = get_args(hint) if get_origin(hint) is Annotated else (hint,)
        if SHARED in stated:
            continue
        if isinstance(kind, type) and issubclass(kind, ArrayTable):
            yield _Column(field.name, None, None, kind)
        else:
            shape = None if ... in stated else tuple(stated)
            yield _Column(field.name, shape, _dtype(kind), None)


def _dtype(kind: Any) -> Any:  # noqa: ANN401 - any annotation
    """Return the type of the numbers of an annotated array; of several, the widest, which is the last."""
    if isinstance(kind, type) and issubclass(kind, np.generic):
        return kind
    # `NDArray[T]` is an array of some shape and `dtype[T]`, from NumPy 2.5 on a name of its own that holds T alone.
    members = get_args(kind)
    return _dtype(members[-1]) if members else np.float64
