"""The measures of moving objects' tracks on synthetic drives, for the studies that change something."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import reduce
from operator import add

import numpy as np

from perception.cli.evaluations.datmo_report import DatmoProtocol, DatmoReport, compare_datmo
from perception.cli.evaluations.datmo_steps import datmo_steps
from perception.datmo.config import DatmoMethod
from perception.evaluation.multi_object.mot_metrics import MotMetrics
from perception.pipeline import PipelineConfig
from perception.types import Drive, Float64

METHODS: tuple[DatmoMethod, ...] = ("thesis", "author", "default")


@dataclass(frozen=True)
class StudyTrackingMetrics:
    """What the tracks of one method are worth, over any number of drives.

    Attributes:
        scores: by distance of the centres.
        false_tracks: of nothing that moves.
        duration_s: of all drives.
    """

    scores: MotMetrics = field(default_factory=MotMetrics)
    false_tracks: int = 0
    duration_s: float = 0.0

    def __add__(self, other: "StudyTrackingMetrics") -> "StudyTrackingMetrics":
        """Return the figures of both, as of one longer drive."""
        return StudyTrackingMetrics(
            self.scores + other.scores,
            self.false_tracks + other.false_tracks,
            self.duration_s + other.duration_s,
        )

    @classmethod
    def of(cls, report: DatmoReport) -> "StudyTrackingMetrics":
        """Take them out of an evaluation."""
        return cls(report.by_distance, len(report.false_tracks.ids), report.duration_s)

    def measures(self) -> dict[str, float]:
        """Return what is shown, by name with unit."""
        minutes = self.duration_s / 60
        return {
            "HOTA [%]": 100 * self.scores.hota.hota,
            "MOTA [%]": 100 * self.scores.clear.mota,
            "IDF1 [%]": 100 * self.scores.identity.idf1,
            "false tracks a minute": self.false_tracks / minutes if minutes else np.nan,
        }


def drives_named(seeds: Sequence[int], frames: int) -> str:
    """Name the synthetic drives of a study, for its title."""
    return f"synthetic drives of seed {', '.join(map(str, seeds))}, {frames} frames each"


def study_protocol() -> DatmoProtocol:
    """Return the protocol of the studies: everything around counts, as synthetic truth is exact."""
    return DatmoProtocol(view="all")


def measure_methods(drive: Drive) -> dict[str, StudyTrackingMetrics]:
    """Run every method on the same segmented scans of a drive, and measure its tracks."""
    steps = datmo_steps(
        drive, PipelineConfig.for_motion(), METHODS, limit=None, on_bad_frame="stop"
    )
    reports = compare_datmo(drive, steps, METHODS, study_protocol())
    return {method: StudyTrackingMetrics.of(report) for method, report in reports.items()}


def total(parts: Sequence[Mapping[str, StudyTrackingMetrics]]) -> dict[str, StudyTrackingMetrics]:
    """Return each method's figures over several drives."""
    return {method: reduce(add, (part[method] for part in parts)) for method in parts[0]}


def by_measure(
    cases: Sequence[Mapping[str, StudyTrackingMetrics]],
) -> dict[str, dict[str, Float64]]:
    """Return for each measure the (K,) values of each method over K cases."""
    shown = [{method: metrics.measures() for method, metrics in case.items()} for case in cases]
    names = StudyTrackingMetrics().measures()
    return {
        name: {m: np.array([case[m][name] for case in shown], np.float64) for m in METHODS}
        for name in names
    }
