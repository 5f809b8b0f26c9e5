"""`trifuse evaluate ground`."""

from pathlib import Path

from data.frames import OnBadFrame
from perception.cli.evaluations.document import Evaluation
from perception.cli.evaluations.drive_run import DriveRun, open_labelled_drive
from perception.cli.evaluations.ground_report import (
    PROTOCOL,
    ground_results,
    ground_tables,
    measure_ground,
)
from perception.pipeline import PipelineConfig
from perception.types import Method


def ground(  # noqa: PLR0913 - flags of a command
    root: Path,
    *,
    sequence: str | None = None,
    method: Method = "default",
    sensor: str | None = None,
    frames: int | None = None,
    on_bad_frame: OnBadFrame = "stop",
    json: Path | None = None,
) -> None:
    """Measure how far the estimated ground is from the feet of labelled objects, in metres.

    Where every point has an exact class, as in synthetic drives, the points called ground are counted too.

    Example: trifuse evaluate ground kitti/tracking --sequence 0000 --json ground.json

    Args:
        root: tracking sequences, object frames, or a synthetic drive of any layout.
        sequence: which one, where there are several.
        method: of every stage: default or thesis.
        sensor: HDL-64E, HDL-32E, VLP-16 or a .json file; else what the drive says, else HDL-64E.
        frames: only so many from the start; else all.
        on_bad_frame: stop at a damaged frame, or skip it and say so.
        json: gets the same figures with protocol, data and configuration.
    """
    drive = open_labelled_drive(root, sequence, sensor, frames)
    run = DriveRun(drive, PipelineConfig.for_obstacles(method), frames, on_bad_frame)
    report = measure_ground(run.drive, run.results(), run.config.area)
    print(f"{run.describe(report.frames)}\n\n{ground_tables(report)}")
    if json is not None:
        figures = Evaluation("ground", PROTOCOL, ground_results(report))
        run.write(json, report.frames, figures)
