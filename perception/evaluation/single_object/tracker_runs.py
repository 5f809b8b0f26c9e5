"""Trackers of one object over a drive: each frame is registered and segmented once for all of them."""

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial

from perception.errors import PerceptionError, UsageError
from perception.evaluation.report import Table, Value, value_table
from perception.evaluation.single_object.track import PredictedTrack, TargetObject
from perception.geometry.threads import limit_blas_threads
from perception.pipeline import PipelineConfig
from perception.pipeline.lidar_stages import LidarStages
from perception.sensor import LidarModel
from perception.tracking.single_object import trackers
from perception.tracking.single_object.config import SingleObjectTrackerConfig
from perception.tracking.single_object.handover import tracker_input_of
from perception.tracking.single_object.tracker import (
    SingleObjectTracker,
    TrackedObject,
    TrackerInput,
)
from perception.types import Frame

_PRINTED = (5, 4, 5, 1, 20, 8)
# Returns a new tracker, by the name of its row in a table.
TrackerMakers = Mapping[str, Callable[[], SingleObjectTracker]]


def fusion_parameters(config: SingleObjectTrackerConfig) -> Table[Mapping[str, Value]]:
    """Return Table 7.5 with the values that are used above the printed ones."""
    fusion = config.fusion
    used: dict[str, Value] = {
        "shifts in the scan": fusion.points.max_iterations,
        "shifts in the image": fusion.image.max_iterations,
        "tolerance [cm]": 100 * fusion.points.tolerance_m,
        "tolerance [px]": fusion.image.tolerance_px,
        "d_min [cm]": 100 * config.point.min_height_m,
        "bins per channel": fusion.colors.bins_per_channel,
    }
    printed: dict[str, Value] = dict(zip(used, _PRINTED, strict=True))
    rows = {"h-fus": used, "thesis": printed}
    return value_table("Table 7.5: parameters of H-Fus", rows, "g")


def named_trackers(
    names: Sequence[str], sensor: LidarModel, config: SingleObjectTrackerConfig
) -> TrackerMakers:
    """Return the trackers of these names, all with one configuration."""
    return {name: partial(trackers.single_object_tracker, name, sensor, config) for name in names}


def require_trackers(names: Sequence[str]) -> tuple[str, ...]:
    """Validate names of trackers; return all trackers where none is named.

    Raises:
        UsageError: A name is unknown, or occurs twice.
    """
    if {*names} <= {*trackers.TRACKERS} and len({*names}) == len(names):
        return tuple(names) or trackers.TRACKERS
    expected = f"some of {', '.join(trackers.TRACKERS)}, each once"
    raise UsageError("--trackers", expected=expected, found=repr(",".join(names)))


def track_objects(
    frames: Iterable[Frame],
    sensor: LidarModel,
    targets: Sequence[TargetObject],
    makers: TrackerMakers,
    pipeline: PipelineConfig,
) -> "list[dict[str, TrackerRun]]":
    """Let every tracker track every object; return the run of each tracker by name, for each object.

    Args:
        frames: Frames of the drive, from the first to the last that an object needs.
        sensor: LiDAR model of the drive.
        targets: Objects to track.
        makers: Trackers by name; each object has its own.
        pipeline: Configuration of registration and ground.

    Raises:
        PerceptionError: A frame cannot be read or used.
    """
    chain = LidarStages(sensor, pipeline)
    runs = [{name: TrackerRun(make(), one) for name, make in makers.items()} for one in targets]
    for frame in frames:
        result, _ = chain.segment(frame)
        tracker_input = tracker_input_of(result, pipeline.ego_vehicle)
        with limit_blas_threads():
            for run in (run for by_name in runs for run in by_name.values()):
                run.update(frame.index, tracker_input)
    return runs


class TrackerRun:
    """One tracker on one object, with a clock.

    Attributes:
        refusal: Reason why the tracker could not be initialised, or None.
    """

    def __init__(self, tracker: SingleObjectTracker, target: TargetObject) -> None:
        self._tracker, self._target = tracker, target
        self._frames: list[int] = []
        self._predictions: list[TrackedObject] = []
        self._seconds: list[float] = []
        self.refusal: str | None = None

    def update(self, frame: int, tracker_input: TrackerInput) -> None:
        """Initialise where the object is first labelled, then track it up to the sequence's last frame."""
        truth = self._target.truth
        box_velo = truth.boxes_velo[truth.frames == frame]
        is_over = frame > self._target.sequence.last_frame or self.refusal is not None
        if is_over or not (self._predictions or len(box_velo)):
            return
        start_s = time.perf_counter()
        try:
            if self._predictions:
                prediction = self._tracker.update(tracker_input)
            else:
                prediction = self._tracker.init(tracker_input, box_velo)
        except PerceptionError as error:
            if self._predictions:
                raise
            self.refusal = str(error)
            return
        self._seconds.append(time.perf_counter() - start_s)
        self._frames.append(frame)
        self._predictions.append(prediction)

    @property
    def track(self) -> PredictedTrack:
        """Predicted track; empty where the tracker could not be initialised."""
        return PredictedTrack.from_predictions(self._frames, self._predictions, self._seconds)
