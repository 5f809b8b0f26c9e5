"""`trifuse detect`: the vehicles in every frame of a drive, as KITTI's result files and as pictures."""

import logging
import time
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path

from data.atomic_file import write_atomically, write_jpeg
from data.frames import OnBadFrame, file_number, frame_count
from data.kitti.detection_rows import format_result_rows
from data.open_drive import open_drive
from data.results.documents import write_config, write_json
from data.results.run_folder import make_results_folder
from perception.cli.detect_summary import DetectSummary
from perception.cli.flags import require_positive
from perception.cli.vehicle_detector import (
    DepthCnConfig,
    VehicleDetector,
    VehicleDetectorOutput,
    detect_frames,
)
from perception.detection.config import NmsConfig, ProposalConfig
from perception.errors import PerceptionError
from perception.evaluation.detection.box_rows import DetectedBoxes
from perception.render.detection_composition import DetectionComposition, DetectionScene
from perception.render.detections import color_depth_map
from perception.render.video import VideoSink, open_video
from perception.types import Drive, Method

log = logging.getLogger(__name__)


def detect(  # noqa: PLR0913 - flags of a command
    drive: Path,
    *,
    out: Path | None = None,
    sequence: str | None = None,
    sensor: str | None = None,
    frames: int | None = None,
    method: Method = "default",
    model: Path | None = None,
    rules: ProposalConfig | None = None,
    min_score: float = NmsConfig.min_score,
    shown_score: float = 0.5,
    video: bool = True,
    on_bad_frame: OnBadFrame = "stop",
) -> None:
    """Detect vehicles by DepthCN, which looks at the LiDAR alone, and write them as KITTI's result files.

    Example: trifuse detect kitti/tracking --sequence 0000 --out results/vehicles

    Args:
        drive: a KITTI raw drive, tracking folder, object folder, or synthetic drive.
        out: folder for the results; else results/<time>, with results/latest pointing to it.
        sequence: which one, where there are several.
        sensor: HDL-64E, HDL-32E, VLP-16 or a .json file; else what the drive says, else HDL-64E.
        frames: only so many from the start; else all.
        method: default, or thesis for its own network, of which --model has to name a file.
        model: a network that you trained and exported; goes before method.
        rules: how proposals are found; --rules.radius_m 0.6 for one of them.
        min_score: of what is written, low, since the measure draws the whole curve.
        shown_score: of what is drawn.
        video: whether to draw: a video of a sequence, a picture of each frame of others.
        on_bad_frame: stop at a damaged frame, keeping what was done, or skip it and say so.
    """
    choice = DepthCnConfig(method, model, rules, min_score)
    plan = DetectConfig(choice, frames, shown_score, video, on_bad_frame)
    opened = open_drive(drive, sequence=sequence, sensor=sensor)
    detector = choice.open(opened.sensor)
    summary = detect_in_drive(opened, detector, out or make_results_folder(), plan)
    print(summary.table())


@dataclass(frozen=True)
class DetectConfig:
    """How vehicles are detected in a drive.

    Attributes:
        choice: of the detector.
        frames: only so many from the start, or None.
        shown_score: of what is drawn.
        video: whether to draw.
        on_bad_frame: stop or skip.
    """

    choice: DepthCnConfig = field(default_factory=DepthCnConfig)
    frames: int | None = None
    shown_score: float = 0.5
    video: bool = True
    on_bad_frame: OnBadFrame = "stop"

    def __post_init__(self) -> None:
        """Refuse to look at no frames."""
        require_positive("--frames", self.frames)


def detect_in_drive(
    drive: Drive, detector: VehicleDetector, out: Path, plan: DetectConfig
) -> DetectSummary:
    """Detect in every frame and write what is found, whole at every moment.

    config.yaml          the effective configuration, and what the network's file says of itself
    data/NNNNNN.txt      result rows of KITTI's object benchmark, named as the frame; empty where nothing is found
    video.mp4            of a sequence: camera and depth map with proposals and detections
    pictures/NNNNNN.jpg  the same of frames that are no sequence
    summary.json         the table that was printed

    Raises:
        PerceptionError: a frame cannot be used; what was done before it stays in the folder.
    """
    summary = DetectSummary(drive.name, out, plan.shown_score)
    write_config(out, drive, plan=plan, network=dict(detector.metadata))
    found = detect_frames(drive, detector, limit=plan.frames, on_bad_frame=plan.on_bad_frame)
    start = time.perf_counter()
    with ExitStack() as files:
        is_film = plan.video and drive.is_sequence
        path = out / "video.mp4" if is_film else None
        video = files.enter_context(open_video(path, drive.sensor.rate_hz))
        pictures = _PreviewWriter(out, video, drive, plan)
        try:
            for output in found:
                number = file_number(drive, output.frame.index)
                rows = format_result_rows(DetectedBoxes.of_frames([output.detections]))
                write_atomically(out / "data" / f"{number:06d}.txt", rows.encode())
                summary.add(output)
                if plan.video:
                    pictures.add(number, output)
        except PerceptionError:
            log.warning("%d frames were done before this; see %s", len(summary.detections), out)
            raise
        finally:
            summary.elapsed_s = time.perf_counter() - start
            write_json(out / "summary.json", summary.to_json())
    return summary


class _PreviewWriter:
    """Draws a video of a sequence and a picture of its middle, or a picture of each other frame."""

    def __init__(self, out: Path, video: VideoSink, drive: Drive, plan: DetectConfig) -> None:
        self._out, self._video, self._config = out, video, plan
        self._is_sequence, self._turn_s = drive.is_sequence, 1 / drive.sensor.rate_hz
        self._middle = 1 + frame_count(drive, plan.frames) // 2
        self._composition: DetectionComposition | None = None
        self._count = 0

    def add(self, number: int, output: VehicleDetectorOutput) -> None:
        """Draw one frame."""
        self._count += 1
        found = output.detections
        scene = DetectionScene(
            number=number,
            image=output.frame.image,
            depth=color_depth_map(output.dense),
            proposals_px=output.proposals_px,
            detections=found[found.scores >= self._config.shown_score],
            timings_s=output.timings_s,
        )
        # One layout for all, as a video needs.
        self._composition = self._composition or DetectionComposition.of(scene, self._turn_s)
        preview = self._composition.draw(scene)
        if not self._is_sequence:
            write_jpeg(self._out / "pictures" / f"{number:06d}.jpg", preview)
            return
        self._video.add(preview)
        if self._count == self._middle:
            write_jpeg(self._out / "picture.jpg", preview)
