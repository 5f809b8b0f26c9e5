"""Configuration of a run."""

from dataclasses import dataclass, field

from data.exports.run_exports import RunExports
from perception.errors import UsageError
from perception.pipeline import PipelineConfig
from perception.tracking.single_object.config import SingleObjectTrackerConfig, TrackerName


@dataclass(frozen=True)
class RunConfig:
    """Configuration of a run.

    Attributes:
        frames: Number of frames from the start; None for all.
        video: Whether the video is drawn.
        video_views: Whether the video shows the boxes of each modality's detector.
        pipeline: Pipeline configuration.
        track: Id of the track or vehicle that a one-object tracker takes over, or None.
        tracker: Name of the one-object tracker.
        tracker_config: Parameters of the one-object trackers.
        min_vehicle_score: Score from which a detected vehicle is listed in vehicles.jsonl, 0 to 1; 0 for curves of precision and recall,
            with hundreds of rows a frame.
        exports: Exports beside the result files.
        proposes: Whether labels are proposed, in place of all other files.
    """

    frames: int | None = None
    video: bool = True
    video_views: bool = False
    pipeline: PipelineConfig = field(default_factory=PipelineConfig)
    track: int | None = None
    tracker: TrackerName = "default"
    tracker_config: SingleObjectTrackerConfig = field(default_factory=SingleObjectTrackerConfig)
    min_vehicle_score: float = 0.05
    exports: RunExports = field(default_factory=RunExports)
    proposes: bool = False

    def __post_init__(self) -> None:
        """Validate the score and the tracker."""
        if not 0 <= self.min_vehicle_score <= 1:
            raise UsageError(
                "min_vehicle_score",
                expected="a score from 0 to 1",
                found=f"{self.min_vehicle_score:g}",
            )
        if self.track is None and self.tracker != RunConfig.tracker:
            raise UsageError(
                f"--tracker {self.tracker}",
                expected="the id of a track or vehicle for it",
                found="none",
                advice="name one with --track; tracks.jsonl and vehicles.jsonl of a run hold the ids",
            )
