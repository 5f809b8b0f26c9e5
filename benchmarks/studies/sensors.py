"""Effect of the LiDAR's number of beams on the tracks of moving objects."""

from collections.abc import Sequence
from pathlib import Path

from benchmarks.studies.report import RESULTS, StreetFlags, Study, publish
from benchmarks.studies.tracking_metrics import (
    PROTOCOL,
    by_metric,
    measure_methods,
    total,
    tracking_table,
)
from data.synthetic.drive import SyntheticDrive
from perception.render.bar_plots import plot_groups
from perception.sensor import HDL_32E, HDL_64E, VLP_16, LidarModel

_SENSORS = (HDL_64E, HDL_32E, VLP_16)


def sensors(*, streets: StreetFlags, out: Path = RESULTS / "sensors.png") -> None:
    """Measure the tracks of moving objects on the same streets by HDL-64E, HDL-32E and VLP-16.

    Example: trifuse study sensors --frames 20

    Args:
        out: Figure; a JSON file with the numbers is written beside it.
    """
    publish(study_sensors(out, streets), out)


def study_sensors(
    plot_path: Path, streets: StreetFlags, models: Sequence[LidarModel] = _SENSORS
) -> Study:
    """Measure all methods on the same streets by one LiDAR after another, and draw bars."""
    metrics = {
        sensor.name: total(
            [
                measure_methods(
                    SyntheticDrive(streets.frames, seed=seed, sensor=sensor, images=False)
                )
                for seed in streets.seeds
            ]
        )
        for sensor in models
    }
    title = f"Tracks of moving objects by LiDAR, {streets.title}"
    plot_groups(plot_path, title, list(metrics), by_metric(list(metrics.values())))
    return Study(
        name="sensors",
        repeats="none: the thesis has one sensor",
        table=tracking_table(title, "LiDAR: method", metrics),
        numbers={
            sensor: {method: one.values() for method, one in methods.items()}
            for sensor, methods in metrics.items()
        },
        conditions={"drives": streets, "sensors": models, "protocol": PROTOCOL},
    )
