"""A drive through the pipeline once, and from there through every tracker of every object in it."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from data.derived.single_object import ObjectSequence
from data.frames import OnBadFrame, frame_count, read_frames
from perception.cli.progress import progress_bar
from perception.errors import PerceptionError
from perception.evaluation.single_object.track import PredictedTrack, TrueTrack
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
from perception.tracking.single_object.trackers import single_object_tracker
from perception.types import Drive

TrackerFactory = Callable[[str, LidarModel], SingleObjectTracker]


@dataclass(frozen=True)
class TargetObject:
    """One object of the drive at hand.

    Attributes:
        sequence: which, and in which of the frames at hand.
        truth: where it is.
        total_frames: that the sequence would have were all of its frames at hand.
    """

    sequence: ObjectSequence
    truth: TrueTrack
    total_frames: int


@dataclass(frozen=True)
class TrackerRun:
    """How one tracker did on one object.

    Attributes:
        track: what it answered; nothing where it refused.
        refusal: why it could not begin, or None.
    """

    track: PredictedTrack
    refusal: str | None = None


def track_objects(
    drive: Drive,
    objects: Sequence[TargetObject],
    trackers: Sequence[str],
    *,
    make: TrackerFactory = single_object_tracker,
    on_bad_frame: OnBadFrame = "stop",
) -> list[dict[str, TrackerRun]]:
    """Let every tracker follow every object, reading, registering and segmenting each frame once.

    Args:
        drive: what is read, from its first frame to the last that an object needs.
        objects: what is followed.
        trackers: names, each once.
        make: a tracker of a name.
        on_bad_frame: stop or skip.

    Returns:
        For each object, by name of the tracker, how it did.

    Raises:
        PerceptionError: a frame cannot be read or used.
    """
    timed_trackers = [
        {name: _TimedTracker(make(name, drive.sensor), one) for name in trackers} for one in objects
    ]
    config = pipeline_config()
    chain = LidarStages(drive.sensor, config)
    limit = max((one.sequence.last_frame + 1 for one in objects), default=0)
    frames = read_frames(drive, on_bad_frame=on_bad_frame, limit=limit)
    count = frame_count(drive, limit)
    for frame in progress_bar(frames, drive.name, count):
        result, _ = chain.segment(frame)
        tracker_input = tracker_input_of(result, config.ego_vehicle)
        with limit_blas_threads():
            for by_name in timed_trackers:
                for timed_tracker in by_name.values():
                    timed_tracker.see(frame.index, tracker_input)
    return [{name: one.run() for name, one in by_name.items()} for by_name in timed_trackers]


def pipeline_config() -> PipelineConfig:
    """Return the choices of the pipeline up to what trackers of one object are shown."""
    return PipelineConfig.for_motion("none")


class _TimedTracker:
    """One tracker on one object, with a clock."""

    def __init__(self, tracker: SingleObjectTracker, target: TargetObject) -> None:
        self._tracker, self._truth, self._sequence = tracker, target.truth, target.sequence
        self._row_of_frame = {frame: row for row, frame in enumerate(target.truth.frames.tolist())}
        self._frames: list[int] = []
        self._predictions: list[TrackedObject] = []
        self._seconds: list[float] = []
        self._refusal: str | None = None

    def see(self, frame: int, tracker_input: TrackerInput) -> None:
        """Begin where the object is first labelled, then follow up to the sequence's last frame."""
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
        """Return how the tracker did."""
        track = PredictedTrack.from_predictions(self._frames, self._predictions, self._seconds)
        return TrackerRun(track, self._refusal)
