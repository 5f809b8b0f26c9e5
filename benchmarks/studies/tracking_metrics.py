"""Metrics of the tracks of moving objects on synthetic drives, for the studies of INS and sensor."""

from collections.abc import Mapping, Sequence
from functools import reduce
from operator import add
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.studies.report import formatted_table
from perception.cli.evaluate_stages import Method
from perception.evaluation.config import DatmoProtocol
from perception.evaluation.report import Table
from perception.pipeline import PipelineConfig
from perception.types import Drive, Float64

if TYPE_CHECKING:
    from perception.evaluation.datmo_measure import DatmoReport

METHODS: tuple[Method, ...] = ("thesis", "author", "default")
# Everything around the vehicle counts, as synthetic truth is exact.
PROTOCOL = DatmoProtocol(view="all")

# Values by metric with unit, of each method.
MethodMetrics = Mapping[str, Mapping[str, float]]


def measure_methods(drive: Drive) -> Mapping[str, "DatmoReport"]:
    """Run every method on the same segmented scans of a drive, and measure its tracks."""
    from data.derived.moving_methods import compare_methods
    from data.labelled_drives import LabelledDrives
    from perception.cli.progress import progress_bar

    config, reader = PipelineConfig.for_motion(), LabelledDrives(progress=progress_bar)
    return compare_methods(drive, reader, config, METHODS, PROTOCOL)[1].reports


def total(drives: Sequence[Mapping[str, "DatmoReport"]]) -> MethodMetrics:
    """Return each method's metrics over several drives, as of one longer drive."""
    return {
        method: tracking_values([reports[method] for reports in drives]) for method in drives[0]
    }


def tracking_values(reports: Sequence["DatmoReport"]) -> dict[str, float]:
    """Return the metrics of one method by name with unit, over several drives as of one longer drive."""
    scores = reduce(add, (report.by_distance for report in reports))
    false_tracks = sum(len(report.false_tracks.ids) for report in reports)
    minutes = sum(report.duration_s for report in reports) / 60
    return {
        "HOTA [%]": 100 * scores.hota.hota.mean(),
        "MOTA [%]": 100 * scores.clear.mota,
        "IDF1 [%]": 100 * scores.identity.idf1,
        "false tracks [/min]": false_tracks / minutes if minutes else np.nan,
    }


def by_metric(cases: Sequence[MethodMetrics]) -> dict[str, dict[str, Float64]]:
    """Return for each metric the (K,) values of each method over K cases."""
    return {
        name: {m: np.array([case[m][name] for case in cases], np.float64) for m in METHODS}
        for name in cases[0][METHODS[0]]
    }


def tracking_table(title: str, heading: str, cases: Mapping[str, MethodMetrics]) -> Table[Any]:
    """Return a table with a row for each case and method."""
    rows = {
        f"{case}: {m}": [*values.values()] for case in cases for m, values in cases[case].items()
    }
    specs = dict.fromkeys(next(iter(cases.values()))[METHODS[0]], ".1f")
    return formatted_table(title, heading, specs, rows)
