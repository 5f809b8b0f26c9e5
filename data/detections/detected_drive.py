"""Vehicles in every frame of a drive by DepthCN, as result files."""

import logging
import time
from collections.abc import Iterable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Self

from data.detections.measured_detectors import run_depthcn
from data.results.documents import write_json
from data.results.folder import ResultsFolder, started
from data.results.kitti_rows import format_object_rows
from perception.atomic_file import write_atomically, write_jpeg
from perception.detection.config import DetectionConfig
from perception.detection.networks import open_depthcn
from perception.detection.vehicles.locate import locate
from perception.errors import PerceptionError
from perception.evaluation.detection.detector_measure import DetectorSummary, FrameDetections
from perception.geometry.threads import limit_blas_threads
from perception.maps.densify import DenseMaps
from perception.maps.projection import camera_of
from perception.render.detection_composition import DetectionComposition, DetectionScene
from perception.render.detections import color_depth_map
from perception.render.video import open_video
from perception.types import Drive, Frame, FusedDetections, Vehicles

log = logging.getLogger(__name__)


class DetectionFolder:
    """Writes the detections of one drive, frame by frame; a context manager.

    data/NNNNNN.txt      result rows of KITTI's object benchmark, with 3D boxes where the scan locates them; empty
                         where nothing is detected; in pixels and axes of a virtual camera where there is none
    video.mp4            of a sequence: camera and depth map with proposals and detections
    preview.jpg          the middle frame of it
    previews/NNNNNN.jpg  the same of each object frame
    """

    def __init__(self, out: Path, drive: Drive, count: int, display_score: float | None) -> None:
        """Prepare the folder.

        Args:
            out: Folder.
            drive: Drive of the frames.
            count: Number of frames.
            display_score: Score from which a detection is drawn; None to draw nothing.
        """
        self._out, self._drive, self._display_score = out, drive, display_score
        self._middle, self._written = 1 + count // 2, 0
        self._files = ExitStack()
        self._composition: DetectionComposition | None = None

    def __enter__(self) -> Self:
        draws_video = self._display_score is not None and self._drive.is_sequence
        path = self._out / "video.mp4" if draws_video else None
        self._video = self._files.enter_context(open_video(path, self._drive.sensor.rate_hz))
        return self

    def __exit__(self, kind: type[BaseException] | None, *error: object) -> None:
        if kind is not None and issubclass(kind, PerceptionError):
            log.warning("frames done: %d; their results are kept in %s", self._written, self._out)
        self._files.__exit__(kind, *error)  # type: ignore[arg-type]

    def write(
        self, frame: Frame, output: FrameDetections, vehicles: Vehicles, dense: DenseMaps
    ) -> None:
        """Write one frame.

        Args:
            frame: Frame of the drive.
            output: Detections, proposals and times.
            vehicles: The same detections, located in the scan.
            dense: Dense maps of the frame.
        """
        calibration, _ = camera_of(frame)
        rows = format_object_rows(vehicles, calibration)
        write_atomically(self._out / "data" / f"{frame.name}.txt", rows.encode())
        self._written += 1
        if self._display_score is None or output.proposals_px is None:
            return
        found = output.detections
        scene = DetectionScene(
            number=frame.number,
            image=frame.image,
            depth=color_depth_map(dense),
            proposals_px=output.proposals_px,
            detections=found[found.scores >= self._display_score],
            timings_s=output.timings_s,
        )
        # One layout for all frames, as a video needs.
        period_s = 1 / self._drive.sensor.rate_hz
        self._composition = self._composition or DetectionComposition.of(scene, period_s)
        preview = self._composition.draw(scene)
        if not self._drive.is_sequence:
            write_jpeg(self._out / "previews" / f"{frame.name}.jpg", preview)
            return
        self._video.add(preview)
        if self._written == self._middle:
            write_jpeg(self._out / "preview.jpg", preview)


def detect_drive(
    drive: Drive,
    frames: Iterable[Frame],
    count: int,
    config: DetectionConfig,
    folder: ResultsFolder,
    *,
    draws: bool,
) -> str:
    """Write the detections of the frames; return the summary that is printed.

    Args:
        drive: Drive of the frames.
        frames: Frames to detect in.
        count: Number of frames.
        config: Network and proposals of DepthCN, suppression, and the score from which a detection is drawn.
        folder: Folder of the results.
        draws: Whether to write a video, or previews of object frames.

    Raises:
        PerceptionError: A frame cannot be read or used; the results of the frames before it stay.
    """
    detector = open_depthcn(config, drive.sensor)
    score, start_s = config.display_score, time.perf_counter()
    summary = DetectorSummary(drive.name, score, dict(detector.verifier.model.metadata))

    def detect() -> Iterator[tuple[Frame, FrameDetections, Vehicles, DenseMaps]]:
        for frame in frames:
            with limit_blas_threads():
                output, dense = run_depthcn(detector, frame)
                fused = FusedDetections.unfused(output.detections)
                vehicles = locate(fused, frame, ground=None)
            yield frame, output, vehicles, dense

    detected = started(detect())
    out = folder.prepare()
    try:
        with DetectionFolder(out, drive, count, score if draws else None) as files:
            for frame, output, vehicles, dense in detected:
                files.write(frame, output, vehicles, dense)
                summary.add(output)
    finally:
        summary.elapsed_s = time.perf_counter() - start_s
        write_json(out / "summary.json", {"sensor": drive.sensor.name, **summary.to_json()})
    return f"{summary.text()}\nresults: {out}"
