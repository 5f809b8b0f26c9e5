"""`trifuse track`."""

from pathlib import Path

from data.results.command_config import CommandConfig
from perception.cli.flags import DriveFlags, ResultsFlags
from perception.pipeline import PipelineConfig
from perception.tracking.single_object.config import SingleObjectTrackerConfig, TrackerName

_TRACKER_CONFIG = SingleObjectTrackerConfig()
_PIPELINE = PipelineConfig.for_motion("none")


def track(
    drive: Path,
    *,
    frames: DriveFlags,
    results: ResultsFlags,
    config: CommandConfig,
    track_id: int | None = None,
    box: str | None = None,
    start_frame: int | None = None,
    tracker: TrackerName = "default",
    video: bool = True,
    plots: bool = False,
    tracker_config: SingleObjectTrackerConfig = _TRACKER_CONFIG,
    pipeline: PipelineConfig = _PIPELINE,
) -> None:
    """Track one object through a drive by LiDAR and camera; write its trajectory and a video.

    Example: trifuse track kitti/tracking --sequence 0000 --track-id 1 --out results/cyclist

    Args:
        drive: KITTI raw drive, tracking folder, or synthetic drive.
        track_id: Track id of a labelled object, which is tracked from its first label on and compared with its labels.
        box: Box of the object as x,y,z,length,width,height,yaw in metres and radians; x y z is the centre of the
            bottom face in the LiDAR frame of the start frame.
        start_frame: Start frame; by default the first frame of the object or of the drive. --frames counts from there.
        tracker: Name of the tracker; ms-i, cbwh and opencv-* work in the image alone.
        video: Draw the video.
        plots: Draw what the tracker does in the frame in the middle: preview.jpg and, of the thesis' trackers, the
            ground, the mean shift and the colour model (Figs 5.13 to 5.16).
        tracker_config: Parameters of the trackers.
        pipeline: Configuration of registration and ground, which come before the tracker.
    """
    from data.derived.track_start import TrackStartConfig, find_start
    from data.open_drive import open_drive
    from data.results.track_object import TrackConfig, track_object
    from perception.cli.progress import progress_bar

    start_config = TrackStartConfig(track_id, box, start_frame)
    opened = open_drive(drive, sequence=frames.sequence, config=frames.reading)
    start = find_start(opened, start_config)
    track_config = TrackConfig(
        tracker, frames.frames, video, plots, frames.on_bad_frame, pipeline, tracker_config
    )
    folder = results.folder(config)
    print(track_object(opened, start, folder, track_config, progress_bar).text())
