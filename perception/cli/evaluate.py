"""`trifuse evaluate`: ground, obstacles and moving objects against labels or exact truth."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from data.derived.moving_truth import View
from data.drive import Drive
from data.frames import OnBadFrame, frame_count
from data.open_drive import open_drive
from perception.cli.datmo_figures import datmo_results, datmo_tables
from perception.cli.datmo_steps import datmo_steps
from perception.cli.drive_results import drive_results
from perception.cli.evaluate_datmo import PROTOCOL_WORDS as DATMO_WORDS
from perception.cli.evaluate_datmo import DatmoProtocol, compare_datmo
from perception.cli.evaluate_detection import detection
from perception.cli.evaluate_ground import PROTOCOL as GROUND_PROTOCOL
from perception.cli.evaluate_ground import ground_results, ground_tables, measure_ground
from perception.cli.evaluate_obstacles import PROTOCOL_WORDS, ObstacleProtocol, measure_obstacles
from perception.cli.evaluate_tracks import tracks
from perception.cli.evaluation_json import DataUsed, Figures, write_evaluation
from perception.cli.obstacle_figures import obstacle_results, obstacle_tables
from perception.datmo.stage import DatmoMethod
from perception.errors import DriveError, UsageError
from perception.evaluation.multi_object.moving_scene import MovingObjectRule
from perception.evaluation.obstacles import ObjectRule
from perception.pipeline import Method, PipelineConfig
from perception.types import Result


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
    drive = _open(root, sequence, sensor, frames)
    run = _Run(drive, PipelineConfig.for_obstacles(method), frames, on_bad_frame)
    report = measure_ground(run.drive, run.results(), run.config.area)
    print(f"{run.describe(report.frames)}\n\n{ground_tables(report)}")
    if json is not None:
        figures = Figures("ground", GROUND_PROTOCOL, ground_results(report))
        run.write(json, report.frames, figures)


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
    rule = ObjectRule(min_points=min_points, moving_share=moving_share)
    protocol = ObstacleProtocol(objects=rule, warm_up=warm_up)
    drive = _open(root, sequence, sensor, frames)
    run = _Run(drive, PipelineConfig.for_obstacles(method), frames, on_bad_frame)
    report = measure_obstacles(run.drive, run.results(), run.config.area, protocol)
    print(f"{run.describe(report.frames)}\n\n{obstacle_tables(report)}")
    if json is not None:
        words = {**PROTOCOL_WORDS, "values": protocol}
        run.write(json, report.frames, Figures("obstacles", words, obstacle_results(report)))


def datmo(  # noqa: PLR0913 - flags of a command
    root: Path,
    *,
    sequence: str | None = None,
    methods: tuple[DatmoMethod, ...] = ("default", "thesis", "author"),
    view: View = "camera",
    sensor: str | None = None,
    frames: int | None = None,
    on_bad_frame: OnBadFrame = "stop",
    min_points: int = 20,
    json: Path | None = None,
) -> None:
    """Measure how well moving objects are tracked on the ground plane, several methods on the same scans.

    HOTA, CLEAR and IDF1 by distance and by overlap, errors of place, velocity and extent, and each object.

    Example: trifuse evaluate datmo kitti/tracking --sequence 0000 --methods [default,thesis]

    Args:
        root: tracking sequences, or a synthetic drive in raw or tracking layout.
        sequence: which one, where there are several.
        methods: of DATMO, as [default,thesis,author]; ground and obstacles are always the default's.
        view: judge what the camera sees, or all around, which only synthetic drives know.
        sensor: HDL-64E, HDL-32E, VLP-16 or a .json file; else what the drive says, else HDL-64E.
        frames: only so many from the start; else all.
        on_bad_frame: stop at a damaged frame, or skip it and say so.
        min_points: that an object's box must hold to count.
        json: gets the same figures with protocol, data and configuration.
    """
    if not methods or len(set(methods)) < len(methods):
        raise UsageError("--methods", expected="at least one method, each once", found=str(methods))
    protocol = DatmoProtocol(rule=MovingObjectRule(min_points=min_points), view=view)
    drive = _open(root, sequence, sensor, frames)
    run = _Run(drive, PipelineConfig(datmo="none"), frames, on_bad_frame)
    steps = datmo_steps(drive, run.config, methods, limit=frames, on_bad_frame=on_bad_frame)
    reports = compare_datmo(drive, steps, methods, protocol)
    evaluated = next(iter(reports.values())).frames
    print(f"{run.describe(evaluated)}, judged: {view}\n\n{datmo_tables(reports)}")
    if json is not None:
        words = {**DATMO_WORDS, "values": protocol}
        run.write(json, evaluated, Figures("datmo", words, datmo_results(reports)))


@dataclass(frozen=True)
class _Run:
    """One drive through the pipeline.

    Attributes:
        drive: what is evaluated.
        config: of the pipeline.
        limit: only so many frames from the start, or None.
        on_bad_frame: stop or skip.
    """

    drive: Drive
    config: PipelineConfig
    limit: int | None
    on_bad_frame: OnBadFrame

    def results(self) -> Iterator[Result]:
        """Yield what the pipeline makes of each frame."""
        return drive_results(
            self.drive, self.config, limit=self.limit, on_bad_frame=self.on_bad_frame
        )

    def describe(self, evaluated: int) -> str:
        """Name what was evaluated."""
        return (
            f"{self.drive.name}: {evaluated} of {len(self.drive)} frames, "
            f"{self.drive.sensor.name}, method {self.config.method}"
        )

    def write(self, path: Path, evaluated: int, figures: Figures) -> None:
        """Write the figures and all that one needs to get them again."""
        data = DataUsed(
            root=self.drive.root.resolve(),
            drive=self.drive.name,
            sensor=self.drive.sensor.name,
            frames=len(self.drive),
            first_frames=frame_count(self.drive, self.limit),
            frames_evaluated=evaluated,
        )
        write_evaluation(path, data, self.config, figures)


def _open(
    root: Path,
    sequence: str | None,
    sensor: str | None,
    frames: int | None,
) -> Drive:
    """Open a drive that has something to measure against."""
    if frames is not None and frames < 1:
        raise UsageError("--frames", expected="at least 1", found=str(frames))
    drive = open_drive(root, sequence=sequence, sensor=sensor, images=False)
    if not drive.has_labels and drive.point_truth(0) is None:
        raise DriveError(
            drive.root,
            expected="labelled boxes or exact point truth to measure against",
            found="neither in this drive",
            advice="name the same drive in the tracking or object layout, or one that "
            "`trifuse synth` wrote",
        )
    return drive


COMMANDS = {
    "ground": ground,
    "obstacles": obstacles,
    "datmo": datmo,
    "tracks": tracks,
    "detection": detection,
}
