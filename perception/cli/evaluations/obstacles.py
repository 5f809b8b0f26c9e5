"""`trifuse evaluate obstacles`."""

from pathlib import Path

from data.frames import OnBadFrame
from perception.cli.evaluations.document import Evaluation
from perception.cli.evaluations.drive_run import DriveRun, open_labelled_drive
from perception.cli.evaluations.obstacle_report import (
    PROTOCOL_WORDS,
    ObstacleProtocol,
    measure_obstacles,
)
from perception.cli.evaluations.obstacle_tables import obstacle_results, obstacle_tables
from perception.evaluation.obstacles import ObjectMatchConfig
from perception.pipeline import PipelineConfig
from perception.types import Method


def obstacles(  # noqa: PLR0913 - flags of a command
    root: Path,
    *,
    sequence: str | None = None,
    method: Method = "default",
    sensor: str | None = None,
    frames: int | None = None,
    on_bad_frame: OnBadFrame = "stop",
    min_points: int = 20,
    moving_share: float = 0.25,
    warm_up: int = 1,
    json: Path | None = None,
) -> None:
    """Count labelled objects found, missed and mistaken, standing and moving, and false moving clusters.

    What moves is told by label boxes and INS poses. Where every point has exact truth, as in synthetic
    drives, the points called moving and static are counted too.

    Example: trifuse evaluate obstacles kitti/tracking --sequence 0000 --json obstacles.json

    Args:
        root: tracking sequences, object frames, or a synthetic drive of any layout.
        sequence: which one, where there are several.
        method: of every stage: default or thesis.
        sensor: HDL-64E, HDL-32E, VLP-16 or a .json file; else what the drive says, else HDL-64E.
        frames: only so many from the start; else all.
        on_bad_frame: stop at a damaged frame, or skip it and say so.
        min_points: that an object's box must hold to count.
        moving_share: of an object's obstacle points that must be called moving, 0 to 1.
        warm_up: first frames that are counted apart too.
        json: gets the same figures with protocol, data and configuration.
    """
    config = ObjectMatchConfig(min_points=min_points, moving_share=moving_share)
    protocol = ObstacleProtocol(objects=config, warm_up=warm_up)
    drive = open_labelled_drive(root, sequence, sensor, frames)
    run = DriveRun(drive, PipelineConfig.for_obstacles(method), frames, on_bad_frame)
    report = measure_obstacles(run.drive, run.results(), run.config.area, protocol)
    print(f"{run.describe(report.frames)}\n\n{obstacle_tables(report)}")
    if json is not None:
        words = {**PROTOCOL_WORDS, "values": protocol}
        run.write(json, report.frames, Evaluation("obstacles", words, obstacle_results(report)))
