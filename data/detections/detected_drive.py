"""Vehicles in every frame of a drive by DepthCN, as result files."""

import time
from collections.abc import Iterable, Iterator

from data.detections.measured_detectors import run_depthcn
from data.detections.result_folder import DetectionFolder
from data.results.documents import write_json
from data.results.folder import ResultsFolder, started
from perception.detection.config import DetectionConfig
from perception.detection.networks import open_depthcn
from perception.detection.vehicles.locate import locate
from perception.evaluation.detection.detector_measure import DetectorSummary, FrameDetections
from perception.geometry.threads import limit_blas_threads
from perception.maps.densify import DenseMaps
from perception.types import Drive, Frame, FusedDetections, Vehicles


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
