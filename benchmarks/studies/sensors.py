"""What the LiDAR's beams do for the tracks of moving objects."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.studies.report import Study
from benchmarks.studies.tracking_metrics import (
    METHODS,
    StudyTrackingMetrics,
    by_measure,
    drives_named,
    measure_methods,
    study_protocol,
    total,
)
from data.synthetic.drive import SyntheticDrive
from perception.cli.table import Cell, format_table
from perception.render.measure_panels import plot_groups
from perception.sensor import HDL_32E, HDL_64E, VLP_16, LidarModel


@dataclass(frozen=True)
class SensorsConfig:
    """What to measure.

    Attributes:
        frames: of each drive.
        seeds: of each drive.
        sensors: the LiDARs, each on the same streets.
    """

    frames: int = 80
    seeds: Sequence[int] = (0,)
    sensors: Sequence[LidarModel] = (HDL_64E, HDL_32E, VLP_16)


def study_sensors(plot_path: Path, config: SensorsConfig) -> Study:
    """Measure all methods on the same streets seen by one LiDAR after another, and draw bars."""
    metrics = {
        sensor.name: total(
            [
                measure_methods(SyntheticDrive(config.frames, seed=s, sensor=sensor, images=False))
                for s in config.seeds
            ]
        )
        for sensor in config.sensors
    }
    title = f"Tracks of moving objects by LiDAR, {drives_named(config.seeds, config.frames)}"
    plot_groups(plot_path, title, list(metrics), by_measure(list(metrics.values())))
    return Study(
        name="sensors",
        repeats="none: the thesis has one sensor",
        table=_table(title, metrics),
        numbers={
            sensor: {method: found.measures() for method, found in methods.items()}
            for sensor, methods in metrics.items()
        },
        conditions={"plan": config, "protocol": study_protocol()},
    )


def _table(title: str, metrics: dict[str, dict[str, StudyTrackingMetrics]]) -> str:
    rows: list[list[Cell]] = [
        [sensor, method, *(f"{value:.1f}" for value in methods[method].measures().values())]
        for sensor, methods in metrics.items()
        for method in METHODS
    ]
    return format_table(title, ("LiDAR", "method", *StudyTrackingMetrics().measures()), rows)
