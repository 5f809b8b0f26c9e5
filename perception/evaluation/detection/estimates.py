"""Estimates of a percentage by difficulty, with their intervals: rows of a table that is read at a glance."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from perception.evaluation.detection.average_precision import NO_INTERVAL, Interval
from perception.evaluation.detection.protocol import LEVELS
from perception.evaluation.report import Column, Table


@dataclass(frozen=True)
class Estimate:
    """Average precision in percent, or a difference of two in percentage points.

    Attributes:
        points: Value; None or NaN where it is not known.
        interval: 95 % interval; NaN without resamples.
    """

    points: float | None
    interval: Interval = NO_INTERVAL


# Estimates of a row by difficulty.
EstimateRow = Mapping[str, Estimate]


def estimate_table(
    title: str,
    rows: Mapping[str, EstimateRow],
    spec: str = ".2f",
    further: Sequence[Column[EstimateRow]] = (),
) -> Table[EstimateRow]:
    """Return the estimates for each difficulty, with their intervals where a row has them.

    Args:
        title: Line above the table.
        rows: Estimates of each row by difficulty.
        spec: Format specification of the values.
        further: Columns to the right.
    """
    estimates = [one for row in rows.values() for one in row.values()]
    has_intervals = any(np.isfinite(one.interval.low) for one in estimates)
    columns = [
        column
        for level in LEVELS
        for column in (estimate_column(level, spec), _interval_column(level))
        if has_intervals or column.name == level
    ]
    return Table(title, [*columns, *further], rows)


def estimate_column(name: str, spec: str = ".2f") -> Column[EstimateRow]:
    """Return the column of an entry of the rows; rows without it have a dash."""
    return Column(name, lambda row: row[name].points if name in row else None, spec)


def _interval_column(name: str) -> Column[EstimateRow]:
    def interval(row: EstimateRow) -> str | None:
        between = row[name].interval if name in row else NO_INTERVAL
        return f"{between.low:.1f}..{between.high:.1f}" if np.isfinite(between.low) else None

    return Column("95 %", interval)
