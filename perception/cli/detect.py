"""`trifuse detect`: vehicles in every frame of a drive by DepthCN, as KITTI result files and images."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from perception.cli.flags import DriveFlags
from perception.detection.config import DepthCnConfig, NmsConfig
from perception.errors import PerceptionError
from perception.types import Drive, Frame, UInt8

if TYPE_CHECKING:
    from perception.cli.detectors import DepthCnOutput
    from perception.detection.depthcn.detector import DepthCn
    from perception.render.detection_composition import DetectionComposition

_DEPTHCN, _NMS = DepthCnConfig(), NmsConfig()


def detect(  # noqa: PLR0913 - flags of a command
    root: Path,
    *,
    drive: DriveFlags,
    out: Path | None = None,
    display_score: float = 0.5,
    video: bool = True,
    depthcn: DepthCnConfig = _DEPTHCN,
    nms: NmsConfig = _NMS,
) -> None:
    """Detect vehicles by DepthCN in the LiDAR scans of a drive and write KITTI result files.

    OUT/data/NNNNNN.txt holds the detections of a frame, OUT/video.mp4 the camera and the depth map with proposals
    and detections (previews/NNNNNN.jpg of object frames), OUT/config.yaml the configuration.

    Example: trifuse detect kitti/tracking --sequence 0000 --out results/vehicles

    Args:
        root: KITTI raw drive, tracking folder, object folder or synthetic drive.
        out: Folder for the results; else results/<time>, with results/latest pointing to it.
        display_score: Score from which a detection is drawn and counted in the summary.
        video: Write a video, or previews of object frames.
        depthcn: DepthCN: network and proposals.
        nms: Score threshold and suppression.
    """
    from data.open_drive import open_drive
    from data.results.documents import write_config, write_json
    from data.results.run_folder import make_results_folder
    from perception.cli.detectors import open_depthcn

    opened = open_drive(root, sequence=drive.sequence, sensor=drive.sensor)
    detector = open_depthcn(depthcn, nms, opened.sensor)
    folder = out or make_results_folder()
    metadata = dict(detector.verifier.model.metadata)
    write_config(
        folder, opened, depthcn=depthcn, nms=nms, display_score=display_score, network=metadata
    )
    summary = DetectSummary(opened.name, display_score)
    try:
        _detect_frames(opened, detector, folder, drive, summary, video=video)
    finally:
        write_json(folder / "summary.json", summary.to_json())
    print(f"{summary.text()}\nresults: {folder}")


@dataclass
class DetectSummary:
    """Counts and times over the frames of a drive.

    Attributes:
        name: Name of the drive.
        display_score: Score from which a detection is counted as displayed.
        seconds: Time by stage, one entry a frame.
        proposals: Number of proposals, one entry a frame.
        detections: Number of detections, one entry a frame.
        displayed: Number of detections from the display score on, one entry a frame.
        elapsed_s: Wall time with reading, drawing and writing.
    """

    name: str
    display_score: float
    seconds: dict[str, list[float]] = field(default_factory=dict)
    proposals: list[int] = field(default_factory=list)
    detections: list[int] = field(default_factory=list)
    displayed: list[int] = field(default_factory=list)
    elapsed_s: float = 0.0

    def add(self, output: "DepthCnOutput") -> None:
        """Add one frame."""
        for stage, seconds in output.timings_s.items():
            self.seconds.setdefault(stage, []).append(seconds)
        self.proposals.append(len(output.proposals_px))
        self.detections.append(len(output.detections))
        self.displayed.append(int((output.detections.scores >= self.display_score).sum()))

    def text(self) -> str:
        """Return the times of the stages and the counts."""
        from perception.evaluation.stage_times import median_frame_s, stage_table

        frames = len(self.detections)
        if not frames:
            return f"{self.name}: no frame could be read"
        proposals, detections, displayed = (
            sum(counts) / frames for counts in (self.proposals, self.detections, self.displayed)
        )
        return (
            f"{stage_table(f'{self.name}: {frames} frames', self.seconds).text()}\n\n"
            f"{proposals:.1f} proposals/frame, {detections:.1f} detections/frame, {displayed:.1f} of these with a "
            f"score of {self.display_score:g} or more; {1 / median_frame_s(self.seconds):.0f} frames/s for the "
            f"stages, {frames / self.elapsed_s:.1f} with reading, drawing and writing"
        )

    def to_json(self) -> dict[str, object]:
        """Return the same for summary.json."""
        from perception.evaluation.stage_times import stage_table

        return {
            "drive": self.name,
            "frames": len(self.detections),
            "elapsed_s": round(self.elapsed_s, 3),
            "stages_ms": stage_table("", self.seconds).to_json(),
            "proposals": sum(self.proposals),
            "detections": sum(self.detections),
            "displayed": {"display_score": self.display_score, "detections": sum(self.displayed)},
        }


def _detect_frames(
    drive: Drive,
    detector: "DepthCn",
    out: Path,
    flags: DriveFlags,
    summary: DetectSummary,
    *,
    video: bool,
) -> None:
    """Detect in every frame and write what is found, whole at every moment.

    Raises:
        PerceptionError: a frame cannot be used; the frames before it are written.
    """
    import logging
    import time

    from data.atomic_file import write_atomically, write_jpeg
    from data.frames import file_number, frame_count, read_frames
    from data.kitti.detection_rows import format_result_rows
    from perception.cli.detectors import run_depthcn
    from perception.cli.progress import progress_bar
    from perception.evaluation.detection.box_rows import DetectedBoxes
    from perception.geometry.threads import limit_blas_threads
    from perception.render.video import open_video

    count = frame_count(drive, flags.frames)
    frames = read_frames(drive, on_bad_frame=flags.on_bad_frame, limit=flags.frames)
    path = out / "video.mp4" if video and drive.is_sequence else None
    composer = PreviewComposer(1 / drive.sensor.rate_hz, summary.display_score)
    start_s = time.perf_counter()
    try:
        with open_video(path, drive.sensor.rate_hz) as sink:
            for frame in progress_bar(frames, drive.name, count):
                with limit_blas_threads():
                    output = run_depthcn(detector, frame)
                number = file_number(drive, frame.index)
                rows = format_result_rows(DetectedBoxes.of_frames([output.detections]))
                write_atomically(out / "data" / f"{number:06d}.txt", rows.encode())
                summary.add(output)
                if video:
                    preview = composer.draw(number, frame, output)
                    is_middle = len(summary.detections) == 1 + count // 2
                    if not drive.is_sequence:
                        write_jpeg(out / "previews" / f"{number:06d}.jpg", preview)
                        continue
                    sink.add(preview)
                    if is_middle:
                        write_jpeg(out / "preview.jpg", preview)
    except PerceptionError:
        done = len(summary.detections)
        logging.getLogger(__name__).warning("%d frames were written before this to %s", done, out)
        raise
    finally:
        summary.elapsed_s = time.perf_counter() - start_s


class PreviewComposer:
    """Draws frames with proposals and detections, all in the layout of the first."""

    def __init__(self, period_s: float, display_score: float) -> None:
        """Start without a layout.

        Args:
            period_s: Time from one frame to the next.
            display_score: Score from which a detection is drawn.
        """
        self._period_s, self._display_score = period_s, display_score
        self._composition: DetectionComposition | None = None

    def draw(self, number: int, frame: Frame, output: "DepthCnOutput") -> UInt8:
        """Return the (H, W, 3) preview of a frame."""
        from perception.render.detection_composition import DetectionComposition, DetectionScene
        from perception.render.detections import color_depth_map

        found = output.detections
        scene = DetectionScene(
            number=number,
            image=frame.image,
            depth=color_depth_map(output.dense),
            proposals_px=output.proposals_px,
            detections=found[found.scores >= self._display_score],
            timings_s=output.timings_s,
        )
        self._composition = self._composition or DetectionComposition.of(scene, self._period_s)
        return self._composition.draw(scene)
