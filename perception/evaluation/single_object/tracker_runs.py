"""Trackers of one object over a drive: each frame is registered and segmented once for all of them."""

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from perception.errors import PerceptionError
from perception.evaluation.single_object.track import ObjectSequence, PredictedTrack, TrueTrack
from perception.geometry.threads import limit_blas_threads
from perception.pipeline import PipelineConfig
from perception.pipeline.lidar_stages import LidarStages
from perception.sensor import LidarModel
from perception.tracking.single_object.handover import tracker_input_of
from perception.tracking.single_object.tracker import (
    SingleObjectTracker,
    TrackedObject,
    TrackerInput,
)
from perception.types import Frame

TrackerFactory = Callable[[str], SingleObjectTracker]


@dataclass(frozen=True)
class TargetObject:
    """Object to track in the available frames of a drive.

    Attributes:
        sequence: Object and its frames, as far as they are available.
        truth: Labelled or exact track of the object.
        total_frames: Number of frames of the sequence if all of them were available.
    """

    sequence: ObjectSequence
    truth: TrueTrack
    total_frames: int


@dataclass(frozen=True)
class TrackerRun:
    """Output of one tracker on one object.

    Attributes:
        track: Predicted track; empty where the tracker could not be initialised.
        refusal: Reason why it could not be initialised, or None.
    """

    track: PredictedTrack
    refusal: str | None = None


def track_objects(
    frames: Iterable[Frame],
    sensor: LidarModel,
    targets: Sequence[TargetObject],
    trackers: Sequence[str],
    make: TrackerFactory,
    pipeline: PipelineConfig,
) -> list[dict[str, TrackerRun]]:
    """Let every tracker track every object.

    Args:
        frames: Frames of the drive, from the first to the last that an object needs.
        sensor: LiDAR model of the drive.
        targets: Objects to track.
        trackers: Names of the trackers, each once.
        make: Returns a new tracker of a name.
        pipeline: Configuration of registration and ground.

    Returns:
        For each object, the run of each tracker by name.

    Raises:
        PerceptionError: a frame cannot be read or used.
    """
    timed = [{name: _TimedTracker(make(name), one) for name in trackers} for one in targets]
    chain = LidarStages(sensor, pipeline)
    for frame in frames:
        result, _ = chain.segment(frame)
        tracker_input = tracker_input_of(result, pipeline.ego_vehicle)
        with limit_blas_threads():
            for by_name in timed:
                for tracker in by_name.values():
                    tracker.update(frame.index, tracker_input)
    return [{name: one.run() for name, one in by_name.items()} for by_name in timed]


class _TimedTracker:
    """One tracker on one object, with a clock."""

    def __init__(self, tracker: SingleObjectTracker, target: TargetObject) -> None:
        self._tracker, self._truth, self._sequence = tracker, target.truth, target.sequence
        self._row_of_frame = {frame: row for row, frame in enumerate(target.truth.frames.tolist())}
        self._frames: list[int] = []
        self._predictions: list[TrackedObject] = []
        self._seconds: list[float] = []
        self._refusal: str | None = None

    def update(self, frame: int, tracker_input: TrackerInput) -> None:
        """Initialise where the object is first labelled, then track it up to the sequence's last frame."""
        is_over = frame > self._sequence.last_frame or self._refusal is not None
        if is_over or (not self._predictions and frame not in self._row_of_frame):
            return
        start_s = time.perf_counter()
        try:
            prediction = self._predict(frame, tracker_input)
        except PerceptionError as error:
            if self._predictions:
                raise
            self._refusal = str(error)
            return
        self._seconds.append(time.perf_counter() - start_s)
        self._frames.append(frame)
        self._predictions.append(prediction)

    def _predict(self, frame: int, tracker_input: TrackerInput) -> TrackedObject:
        if self._predictions:
            return self._tracker.update(tracker_input)
        row = self._row_of_frame[frame]
        return self._tracker.init(tracker_input, self._truth.boxes_velo[row : row + 1])

    def run(self) -> TrackerRun:
        """Return the output of the tracker."""
        track = PredictedTrack.from_predictions(self._frames, self._predictions, self._seconds)
        return TrackerRun(track, self._refusal)
