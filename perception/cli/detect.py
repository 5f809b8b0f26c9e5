"""`trifuse detect`: vehicles in every frame of a drive by DepthCN, as KITTI result files and images."""

from pathlib import Path
from typing import TYPE_CHECKING

from data.results.command_config import CommandConfig
from perception.cli.flags import PartOfDriveFlags, ResultsFlags
from perception.detection.config import DepthCnConfig, DetectionConfig, NmsConfig

if TYPE_CHECKING:
    from collections.abc import Iterator

    from perception.evaluation.detection.detector_measure import FrameDetections
    from perception.maps.densify import DenseMaps
    from perception.types import Frame, Vehicles

_DEPTHCN, _NMS = DepthCnConfig(), NmsConfig()


def detect(
    root: Path,
    *,
    drive: PartOfDriveFlags,
    results: ResultsFlags,
    config: CommandConfig,
    display_score: float = DetectionConfig.display_score,
    video: bool = True,
    depthcn: DepthCnConfig = _DEPTHCN,
    nms: NmsConfig = _NMS,
) -> None:
    """Detect vehicles by DepthCN in the LiDAR scans of a drive and write KITTI result files.

    OUT/data/NNNNNN.txt holds the detections of a frame with their 3D boxes, OUT/video.mp4 the camera and the depth map
    with proposals and detections (previews/NNNNNN.jpg of object frames), OUT/config.yaml the configuration.

    Example: trifuse detect kitti/tracking --sequence 0000 --out results/vehicles

    Args:
        root: KITTI raw drive, tracking folder, object folder or synthetic drive.
        display_score: Score from which a detection is drawn and counted in the summary.
        video: Write a video, or previews of object frames.
        depthcn: DepthCN: network and proposals.
        nms: Score threshold and suppression.
    """
    import time

    from data.detections.measured_detectors import run_depthcn
    from data.detections.result_folder import DetectionFolder
    from data.frames import frame_count, read_frames
    from data.open_drive import open_drive
    from data.results.documents import write_json
    from data.results.folder import started
    from perception.cli.progress import progress_bar
    from perception.detection.networks import open_depthcn
    from perception.detection.vehicles.locate import locate
    from perception.evaluation.detection.detector_summary import DetectorSummary
    from perception.geometry.threads import limit_blas_threads
    from perception.types import FusedDetections

    opened = open_drive(root, sequence=drive.sequence, config=drive.reading)
    detection = DetectionConfig(depthcn=depthcn, nms=nms, display_score=display_score)
    detector = open_depthcn(detection, opened.sensor)
    chosen, start_s = results.folder(config), time.perf_counter()
    summary = DetectorSummary(opened.name, display_score, dict(detector.verifier.model.metadata))
    count = frame_count(opened, drive.frames)
    frames = read_frames(opened, on_bad_frame=drive.on_bad_frame, limit=drive.frames)

    def detect_all() -> "Iterator[tuple[Frame, FrameDetections, Vehicles, DenseMaps]]":
        for frame in progress_bar(frames, opened.name, count):
            with limit_blas_threads():
                output, dense = run_depthcn(detector, frame)
                fused = FusedDetections.unfused(output.detections)
                vehicles = locate(fused, frame, ground=None)
            yield frame, output, vehicles, dense

    detected = started(detect_all())
    folder = chosen.prepare()
    try:
        with DetectionFolder(folder, opened, count, display_score if video else None) as files:
            for frame, output, vehicles, dense in detected:
                files.write(frame, output, vehicles, dense)
                summary.add(output)
    finally:
        summary.elapsed_s = time.perf_counter() - start_s
        write_json(folder / "summary.json", {"sensor": opened.sensor.name, **summary.to_json()})
    print(f"{summary.text()}\nresults: {folder}")
