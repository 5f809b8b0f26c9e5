"""`trifuse detect`: vehicles in every frame of a drive by DepthCN, as KITTI result files and images."""

from pathlib import Path

from data.results.command_config import CommandConfig
from perception.cli.flags import PartOfDriveFlags, ResultsFlags
from perception.detection.config import DepthCnConfig, DetectionConfig, NmsConfig

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
    from data.detections.detected_drive import detect_drive
    from data.frames import frame_count, read_frames
    from data.open_drive import open_drive
    from perception.cli.progress import progress_bar

    opened = open_drive(root, sequence=drive.sequence, config=drive.reading)
    detection = DetectionConfig(depthcn=depthcn, nms=nms, display_score=display_score)
    frames = read_frames(opened, on_bad_frame=drive.on_bad_frame, limit=drive.frames)
    count = frame_count(opened, drive.frames)
    shown = progress_bar(frames, opened.name, count)
    folder = results.folder(config)
    print(detect_drive(opened, shown, count, detection, folder, draws=video))
