"""Metrics of the tracks of moving objects on synthetic drives, for the studies of INS and sensor."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import reduce
from operator import add

import numpy as np

from benchmarks.studies.report import value_table
from perception.cli.evaluate_datmo import Method, compare_methods
from perception.cli.flags import DriveFlags
from perception.evaluation.config import DatmoProtocol
from perception.evaluation.datmo_measure import DatmoReport
from perception.evaluation.multi_object.mot_metrics import MotMetrics
from perception.pipeline import PipelineConfig
from perception.types import Drive, Float64

METHODS: tuple[Method, ...] = ("thesis", "author", "default")
# Everything around the vehicle counts, as synthetic truth is exact.
PROTOCOL = DatmoProtocol(view="all")


@dataclass(frozen=True)
class StudyTrackingMetrics:
    """Metrics of one method over any number of drives.

    Attributes:
        scores: HOTA, CLEAR and identity counts by centre distance.
        false_tracks: Number of tracks that match no moving object.
        duration_s: Duration of all drives in seconds.
    """

    scores: MotMetrics = field(default_factory=MotMetrics)
    false_tracks: int = 0
    duration_s: float = 0.0

    def __add__(self, other: "StudyTrackingMetrics") -> "StudyTrackingMetrics":
        """Return the metrics of both, as of one longer drive."""
        return StudyTrackingMetrics(
            self.scores + other.scores,
            self.false_tracks + other.false_tracks,
            self.duration_s + other.duration_s,
        )

    @classmethod
    def of(cls, report: DatmoReport) -> "StudyTrackingMetrics":
        """Return the metrics of an evaluation."""
        return cls(report.by_distance, len(report.false_tracks.ids), report.duration_s)

    def values(self) -> dict[str, float]:
        """Return the values that are shown, by name with unit."""
        minutes = self.duration_s / 60
        return {
            "HOTA [%]": 100 * self.scores.hota.hota.mean(),
            "MOTA [%]": 100 * self.scores.clear.mota,
            "IDF1 [%]": 100 * self.scores.identity.idf1,
            "false tracks [/min]": self.false_tracks / minutes if minutes else np.nan,
        }


MethodMetrics = Mapping[str, StudyTrackingMetrics]


def measure_methods(drive: Drive) -> dict[str, StudyTrackingMetrics]:
    """Run every method on the same segmented scans of a drive, and measure its tracks."""
    comparison = compare_methods(
        drive, DriveFlags(), PipelineConfig.for_motion(), METHODS, PROTOCOL
    )
    reports = comparison.reports
    return {method: StudyTrackingMetrics.of(report) for method, report in reports.items()}


def total(parts: Sequence[MethodMetrics]) -> dict[str, StudyTrackingMetrics]:
    """Return each method's metrics over several drives."""
    return {method: reduce(add, (part[method] for part in parts)) for method in parts[0]}


def by_metric(cases: Sequence[MethodMetrics]) -> dict[str, dict[str, Float64]]:
    """Return for each metric the (K,) values of each method over K cases."""
    shown = [{method: one.values() for method, one in case.items()} for case in cases]
    return {
        name: {m: np.array([case[m][name] for case in shown], np.float64) for m in METHODS}
        for name in StudyTrackingMetrics().values()
    }


def tracking_table(title: str, heading: str, cases: Mapping[str, MethodMetrics]) -> str:
    """Return a table with a row for each case and method."""
    rows = {
        f"{case}: {method}": list(methods[method].values().values())
        for case, methods in cases.items()
        for method in METHODS
    }
    return value_table(title, heading, list(StudyTrackingMetrics().values()), rows)
