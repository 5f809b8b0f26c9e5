"""What the error of the INS does to the tracks of moving objects (7.1.1: up to 1 m is claimed harmless)."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

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
from data.synthetic.cached_drive import CachedDrive
from data.synthetic.ins import InsNoise
from perception.cli.table import Cell, format_table
from perception.render.measure_panels import Condition, plot_conditions
from perception.sensor import HDL_64E, LidarModel


@dataclass(frozen=True)
class InsErrorConfig:
    """What to measure.

    Attributes:
        frames: of each drive.
        seeds: of each drive.
        sensor: the LiDAR.
        positions_m: standard deviations of the position along each axis, without any of the angles.
        angles_deg: standard deviations of the angle about each axis, without any of the position.
    """

    frames: int = 80
    seeds: Sequence[int] = (0,)
    sensor: LidarModel = field(default_factory=lambda: HDL_64E)
    positions_m: Sequence[float] = (0.0, 0.1, 0.25, 0.5, 1.0)
    angles_deg: Sequence[float] = (0.0, 0.5, 1.0, 2.0)

    def cases(self) -> list[InsNoise]:
        """Return every INS, each once."""
        by_position = [InsNoise(position_m, 0.0) for position_m in self.positions_m]
        by_angle = [InsNoise(0.0, angle_deg) for angle_deg in self.angles_deg]
        return list(dict.fromkeys([*by_position, *by_angle]))


MetricsByNoise = dict[InsNoise, dict[str, StudyTrackingMetrics]]


def study_ins_error(plot_path: Path, config: InsErrorConfig) -> Study:
    """Measure all methods on the same streets and scans with one INS after another, and draw curves."""
    metrics = _measure(config)
    drives = drives_named(config.seeds, config.frames)
    title = f"Tracks of moving objects over the error of the INS, {config.sensor.name}, {drives}"
    positions = [metrics[InsNoise(position_m, 0.0)] for position_m in config.positions_m]
    angles = [metrics[InsNoise(0.0, angle_deg)] for angle_deg in config.angles_deg]
    plot_conditions(
        plot_path,
        title,
        [
            Condition(
                "position error of the INS, σ [m]", config.positions_m, by_measure(positions)
            ),
            Condition("angle error of the INS, σ [°]", config.angles_deg, by_measure(angles)),
        ],
    )
    return Study(
        name="ins-error",
        repeats="7.1.1, tolerance to localization error",
        table=_table(title, metrics),
        numbers=_numbers(metrics),
        conditions={"plan": config, "protocol": study_protocol()},
    )


def _measure(config: InsErrorConfig) -> MetricsByNoise:
    parts: dict[InsNoise, list[dict[str, StudyTrackingMetrics]]] = {
        case: [] for case in config.cases()
    }
    for seed in config.seeds:
        drive = CachedDrive(
            config.frames, seed=seed, sensor=config.sensor, noise=InsNoise(0.0, 0.0)
        )
        for noise, drives in parts.items():
            drives.append(measure_methods(drive.with_ins(noise)))
    return {noise: total(drives) for noise, drives in parts.items()}


def _table(title: str, metrics: MetricsByNoise) -> str:
    names = list(StudyTrackingMetrics().measures())
    rows: list[list[Cell]] = [
        [
            f"{noise.position_m:g} m, {noise.angle_deg:g}°",
            method,
            *(f"{value:.1f}" for value in methods[method].measures().values()),
        ]
        for noise, methods in metrics.items()
        for method in METHODS
    ]
    return format_table(title, ("INS error", "method", *names), rows)


def _numbers(metrics: MetricsByNoise) -> list[dict[str, Any]]:
    return [
        {"ins": noise, "methods": {m: f.measures() for m, f in methods.items()}}
        for noise, methods in metrics.items()
    ]
