"""`trifuse run`: every stage on a drive, its results in a folder, its summary on the screen."""

import logging
import time
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from data.drive import Drive, PointTruth
from data.frames import OnBadFrame, frame_count
from data.open_drive import open_drive
from perception.cli.confusion_figures import confusion_table, with_ratios
from perception.cli.documents import write_configuration
from perception.cli.drive_results import drive_results
from perception.cli.follow_on import Following, FollowOn, NobodyFollowed
from perception.cli.results_folder import ResultsFolder, new_results_folder
from perception.cli.stage_times import STAGE_HEADER, median_frame_s, stage_document, stage_rows
from perception.cli.table import format_table
from perception.errors import PerceptionError, UsageError
from perception.evaluation.confusion import Confusion
from perception.evaluation.ground import PointClasses, ground_confusion
from perception.evaluation.obstacles import PointMotion, point_motion
from perception.geometry.grids import LocalArea
from perception.pipeline import PipelineConfig
from perception.render.composition import Composition
from perception.render.trails import Trails
from perception.render.video import video_or_none
from perception.tracking.single_object.hand_over import HandOver
from perception.tracking.single_object.trackers import TRACKERS, single_object_tracker
from perception.types import PointState, Result

log = logging.getLogger(__name__)


def run(  # noqa: PLR0913 - flags of a command
    drive: Path,
    *,
    out: Path | None = None,
    sequence: str | None = None,
    sensor: str | None = None,
    frames: int | None = None,
    video: bool = True,
    follow: int | None = None,
    on_bad_frame: OnBadFrame = "stop",
    pipeline: PipelineConfig = PipelineConfig(),  # noqa: B008 - frozen
) -> None:
    """Find ground and obstacles in every frame of a drive, and follow what moves.

    Example: trifuse run 2011_09_26/2011_09_26_drive_0005_sync --out results/0005

    Args:
        drive: a KITTI raw drive, tracking folder, object folder, or synthetic drive.
        out: folder for the results; else results/<time>, with results/latest pointing to it.
        sequence: which one, where there are several.
        sensor: HDL-64E, HDL-32E, VLP-16 or a .json file; else what the drive says, else HDL-64E.
        frames: only so many from the start; else all.
        video: whether to draw the video.
        follow: id of a track that the default tracker of one object takes over in its first frame.
        on_bad_frame: stop at a damaged frame, keeping what was done, or skip it and say so.
        pipeline: choices of the pipeline; --pipeline.method thesis for the thesis' own.
    """
    # A tracker of one object may look at images that nobody draws.
    has_use = video or follow is not None
    opened = open_drive(drive, sequence=sequence, sensor=sensor, images=has_use)
    plan = RunPlan(frames, video, on_bad_frame, pipeline, follow)
    summary = run_drive(opened, out or new_results_folder(Path("results")), plan)
    print(summary.table())


@dataclass(frozen=True)
class RunPlan:
    """How a drive is run.

    Attributes:
        frames: only so many from the start, or None.
        video: whether to draw the video.
        on_bad_frame: stop or skip.
        pipeline: choices of the pipeline.
        follow: id of the track that is followed by itself, or None.
    """

    frames: int | None = None
    video: bool = True
    on_bad_frame: OnBadFrame = "stop"
    pipeline: PipelineConfig = field(default_factory=PipelineConfig)
    follow: int | None = None

    def __post_init__(self) -> None:
        """Refuse a run of no frames."""
        if self.frames is not None and self.frames < 1:
            raise UsageError("--frames", expected="at least 1", found=str(self.frames))


@dataclass
class RunSummary:
    """What a run found, added up frame by frame.

    Attributes:
        drive: its name.
        out: where the results are.
        seconds: by stage, one entry a frame.
        points: by `PointState`, over all frames.
        moving_voxels: one entry a frame.
        track_ids: of every track so far.
        live_tracks: one entry a frame.
        ground: points called ground against exact truth, where the drive has it.
        motion: points called static or moving against exact truth, where the drive has it.
        elapsed_s: wall time with reading, drawing and writing.
    """

    drive: str
    out: Path
    seconds: dict[str, list[float]] = field(default_factory=dict)
    points: np.ndarray = field(default_factory=lambda: np.zeros(len(PointState), np.int64))
    moving_voxels: list[int] = field(default_factory=list)
    track_ids: set[int] = field(default_factory=set)
    live_tracks: list[int] = field(default_factory=list)
    ground: Confusion = field(default_factory=Confusion)
    motion: PointMotion = field(default_factory=PointMotion)
    elapsed_s: float = 0.0

    def add(self, result: Result, truth: PointTruth | None, area: LocalArea) -> None:
        """Count one frame."""
        for stage, seconds in result.timings_s.items():
            self.seconds.setdefault(stage, []).append(seconds)
        self.points += np.bincount(result.obstacles.point_states, minlength=len(PointState))
        self.moving_voxels.append(len(result.obstacles.moving))
        self.track_ids.update(result.tracks.ids.tolist())
        self.live_tracks.append(len(result.tracks))
        if truth is not None:
            states = result.obstacles.point_states
            scan = PointClasses(result.frame.points_velo, states, truth.classes)
            self.ground = sum(ground_confusion(scan, area), self.ground)
            self.motion += point_motion(states, truth.classes, truth.is_moving)

    @property
    def frames(self) -> int:
        """Frames done."""
        return len(self.moving_voxels)

    def table(self) -> str:
        """Return what is printed at the end."""
        if not self.frames:
            return f"{self.drive}: no frame was done"
        stages = format_table(
            f"{self.drive}: {self.frames} frames",
            STAGE_HEADER,
            stage_rows(self.seconds),
        )
        seen = self.points / self.frames
        lines = [
            stages,
            "",
            f"a frame: {seen[PointState.GROUND]:.0f} ground, {seen[PointState.STATIC]:.0f} static, "
            f"{seen[PointState.MOVING]:.0f} moving points; "
            f"{1 / median_frame_s(self.seconds):.0f} frames/s for the stages, "
            f"{self.frames / self.elapsed_s:.1f} with reading, drawing and writing",
            f"tracks: {len(self.track_ids)} in all, {np.mean(self.live_tracks):.1f} at a time",
            f"results: {self.out}",
        ]
        if self.ground.true_positives:
            lines.insert(1, f"\n{self._truth_table()}")
        return "\n".join(lines)

    def _truth_table(self) -> str:
        """Return how the points compare with the exact truth of a synthetic drive."""
        return confusion_table(
            "points against the exact truth of this synthetic drive",
            {"ground": self.ground, "static": self.motion.static, "moving": self.motion.moving},
        )

    def to_json(self) -> dict[str, object]:
        """Return the same figures for summary.json."""
        return {
            "drive": self.drive,
            "frames": self.frames,
            "elapsed_s": round(self.elapsed_s, 3),
            "stages_ms": stage_document(self.seconds),
            "points_against_truth": {
                "ground": with_ratios(self.ground),
                "static": with_ratios(self.motion.static),
                "moving": with_ratios(self.motion.moving),
            }
            if self.ground.true_positives
            else None,
            "tracks": {
                "ids": len(self.track_ids),
                "mean_alive": float(np.mean(self.live_tracks)) if self.frames else None,
            },
            "points": {state.name.lower(): int(self.points[state]) for state in PointState},
        }


def run_drive(drive: Drive, out: Path, plan: RunPlan) -> RunSummary:
    """Run the pipeline over a drive and write its results, whole at every moment.

    Raises:
        PerceptionError: a frame cannot be used; what was done before it stays in the folder.
    """
    area = plan.pipeline.area
    summary = RunSummary(drive.name, out)
    composition = Composition(area=area, turn_s=1 / drive.sensor.rate_hz)
    results = drive_results(drive, plan.pipeline, limit=plan.frames, on_bad_frame=plan.on_bad_frame)
    trails = Trails()
    start = time.perf_counter()
    with ExitStack() as files:
        folder = files.enter_context(ResultsFolder(out, drive, area))
        write_configuration(out, drive, plan=plan)
        path = out / "video.mp4" if plan.video else None
        video = files.enter_context(video_or_none(path, drive.sensor.rate_hz))
        following = files.enter_context(_following(drive, out, plan))
        try:
            for result in map(following.see, results):
                folder.write(result)
                summary.add(result, drive.point_truth(result.frame.index), area)
                if plan.video:
                    trails.add(result)
                    picture = composition.draw(following.shown(result), trails, following.figure)
                    video.add(picture)
                    if summary.frames == 1 + frame_count(drive, plan.frames) // 2:
                        folder.write_picture(picture)
        except PerceptionError:
            log.warning("%d frames were done before this; they are in %s", summary.frames, out)
            raise
        finally:
            summary.elapsed_s = time.perf_counter() - start
            folder.write_summary(summary.to_json())
    return summary


def _following(drive: Drive, out: Path, plan: RunPlan) -> Following:
    """Return who follows the object of a plan, or nobody."""
    if plan.follow is None:
        return NobodyFollowed()
    tracker = single_object_tracker(TRACKERS[0], drive.sensor)
    hand_over = HandOver(plan.follow, tracker, plan.pipeline.body)
    return FollowOn(out / "followed.jsonl", hand_over)
