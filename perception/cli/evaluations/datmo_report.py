"""`trifuse evaluate datmo`, below the flags: tracks of moving objects against labels or exact truth."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from data.derived.moving_truth import MovingTruth, moving_truth
from perception.evaluation.config import EvaluationView, MotionLabelConfig, MovingObjectConfig
from perception.evaluation.multi_object.false_tracks import (
    FalseTracks,
    TrackOutcomes,
    find_false_tracks,
    track_outcomes,
)
from perception.evaluation.multi_object.mot_metrics import MotMetrics, evaluate_tracks
from perception.evaluation.multi_object.moving_scene import MovingScene
from perception.evaluation.multi_object.target_errors import (
    ObjectSummary,
    TargetErrors,
    TrackErrors,
    summarise_objects,
    target_errors,
    track_errors,
)
from perception.evaluation.multi_object.track_assignment import (
    SimilarityFrames,
    assign_tracks,
    similarity_frames,
)
from perception.types import Drive, Float64, Frame, Result, Tracks

PROTOCOL_WORDS = {
    "objects": (
        "an object must be tracked in every frame in which it moves, its box's bottom centre is in the "
        "area, the middle of its box is in the camera's view and its box holds min_points points from "
        "clearance_m above its bottom, from the first such frame on: frames in which a tracker makes "
        "sure are misses"
    ),
    "motion": (
        "an object moves while its box travels over the ground, by label boxes and INS poses or by exact "
        "positions of a synthetic drive, with hysteresis; its velocity is the median of those between "
        "all pairs of its positions within window_s, or exact"
    ),
    "pairs": (
        "tracks and objects that are alike by min_similarity are paired for the greatest sum of likeness: "
        "1 less the distance of the centres over max_distance_m, or the overlap (IoU) of the outlines, whichever "
        "is more"
    ),
    "excused": (
        "a track is neither right nor wrong where it follows an object that moves in some frame of the "
        "drive but need not be tracked in this one, or one of unknown motion, and is more like it than "
        "its own object; it follows it by min_similarity or where half of its outline lies on it; parked "
        "objects excuse nobody"
    ),
    "left_out": (
        "tracks without an object outside the area, outside the view, or with half of their box in the "
        "image in one DontCare region"
    ),
    "measures": (
        "HOTA, CLEAR and identity on the ground plane, twice: by distance (likeness 1 less the distance of "
        "the centres over max_distance_m) and by overlap (IoU of the outlines); CLEAR and identity at the "
        "thresholds given"
    ),
    "errors": "of the pairs; heading of tracks faster than 1 m/s; extent as mean size of the error",
    "false_tracks": (
        "ids that follow nobody in more than half of the frames in which they are judged or excused; "
        "never_matched of them follow nobody in any of these frames, on_parked lie on a parked object in one"
    ),
}


@dataclass(frozen=True)
class DatmoProtocol:
    """How tracks of moving objects are judged.

    Attributes:
        targets: which objects must be tracked.
        motion: which objects move, by the labels.
        view: judge what the camera sees, or everything around, which takes exact truth.
        distance_threshold: likeness by distance from which on CLEAR and identity take a track for right;
            0.5 is half of the rule's reach.
        overlap_threshold: the same of the overlap.
        loose_overlap_threshold: another of the overlap, for boxes that hold what was seen of an object.
    """

    targets: MovingObjectConfig = field(default_factory=MovingObjectConfig)
    motion: MotionLabelConfig = field(default_factory=MotionLabelConfig)
    view: EvaluationView = "camera"
    distance_threshold: float = 0.5
    overlap_threshold: float = 0.5
    loose_overlap_threshold: float = 0.3


@dataclass(frozen=True)
class DatmoPredictions:
    """What some methods answered at one frame.

    Attributes:
        frame: what they were given.
        tracks: by method, in the LiDAR frame of the scan.
        seconds: by method, what its detection and tracking took.
    """

    frame: Frame
    tracks: Mapping[str, Tracks]
    seconds: Mapping[str, float]


@dataclass(frozen=True)
class DatmoReport:
    """Everything measured of the tracks of one method on one drive.

    Attributes:
        protocol: how it was measured.
        frames: evaluated.
        duration_s: of these frames.
        by_distance: the measures by how near the centres are.
        by_overlap: the measures by the overlap of the outlines.
        by_loose_overlap: the same; CLEAR and identity at the loose threshold.
        errors: of the tracks that follow an object.
        objects: one summary for each object that must be tracked.
        types: class name of each labelled object.
        false_tracks: tracks of nothing that moves.
        seconds: (frames evaluated) that detection and tracking took.
    """

    protocol: DatmoProtocol
    frames: int
    duration_s: float
    by_distance: MotMetrics
    by_overlap: MotMetrics
    by_loose_overlap: MotMetrics
    errors: TrackErrors
    objects: Sequence[ObjectSummary]
    types: Mapping[int, str]
    false_tracks: FalseTracks
    seconds: Float64

    @property
    def never_tracked(self) -> list[int]:
        """Objects that no track ever followed."""
        return [summary.object_id for summary in self.objects if summary.is_never_tracked]


def measure_datmo(
    drive: Drive, results: Iterable[Result], protocol: DatmoProtocol | None = None
) -> DatmoReport:
    """Compare the tracks of each result with what moves in its drive.

    Args:
        drive: whose labels or exact truth are the measure; a `SyntheticDrive` in memory has exact truth.
        results: of the pipeline, or of whoever fills in `frame`, `tracks` and `timings_s`, in order.
        protocol: how tracks are judged.

    Raises:
        DriveError: the drive cannot say what moves.
    """
    steps = (
        DatmoPredictions(
            result.frame,
            {"tracks": result.tracks},
            {"tracks": result.timings_s.get("moving objects", np.nan)},
        )
        for result in results
    )
    return compare_datmo(drive, steps, ["tracks"], protocol)["tracks"]


def compare_datmo(
    drive: Drive,
    steps: Iterable[DatmoPredictions],
    methods: Sequence[str],
    protocol: DatmoProtocol | None = None,
) -> dict[str, DatmoReport]:
    """Compare the tracks of several methods, made from the same frames, with what moves in their drive.

    Args:
        drive: whose labels or exact truth are the measure.
        steps: one a frame, in order.
        methods: names of the methods that every step holds.
        protocol: how tracks are judged.

    Raises:
        DriveError: the drive cannot say what moves.
    """
    protocol = protocol or DatmoProtocol()
    truth = moving_truth(drive, protocol.view, protocol.motion)
    evaluators = {method: _TrackEvaluator(protocol) for method in methods}
    for step in steps:
        scene = truth.scene(step.frame, protocol.targets.clearance_m)
        if scene is None:
            continue
        for method, evaluator in evaluators.items():
            evaluator.update(step.frame, scene, step.tracks[method], step.seconds[method])
    return {method: evaluator.compute(truth) for method, evaluator in evaluators.items()}


class _TrackEvaluator:
    """Gathers what the tracks of one method are worth."""

    def __init__(self, protocol: DatmoProtocol) -> None:
        self._protocol = protocol
        self._stamps_s: list[float] = []
        self._seconds: list[float] = []
        self._similarity_frames: list[SimilarityFrames] = []
        self._target_errors: list[TargetErrors] = []
        self._outcomes: list[TrackOutcomes] = []

    def update(self, frame: Frame, scene: MovingScene, tracks: Tracks, seconds: float) -> None:
        """Judge the tracks of the next frame."""
        targets = self._protocol.targets
        assignment = assign_tracks(scene, tracks, targets)
        self._stamps_s.append(frame.stamp_s)
        self._seconds.append(seconds)
        self._similarity_frames.append(similarity_frames(scene, tracks, assignment, targets))
        self._target_errors.append(target_errors(frame.stamp_s, scene, tracks, assignment))
        self._outcomes.append(track_outcomes(tracks, assignment))

    def compute(self, truth: MovingTruth) -> DatmoReport:
        """Sum up all frames."""
        protocol, followed = self._protocol, TargetErrors.concatenate(self._target_errors)
        duration_s = _duration_s(self._stamps_s)
        by_distance = [evaluated.by_distance for evaluated in self._similarity_frames]
        by_overlap = [evaluated.by_overlap for evaluated in self._similarity_frames]
        return DatmoReport(
            protocol=protocol,
            frames=len(self._similarity_frames),
            duration_s=duration_s,
            by_distance=evaluate_tracks(by_distance, protocol.distance_threshold),
            by_overlap=evaluate_tracks(by_overlap, protocol.overlap_threshold),
            by_loose_overlap=evaluate_tracks(by_overlap, protocol.loose_overlap_threshold),
            errors=track_errors(followed),
            objects=summarise_objects(followed),
            types=truth.types(),
            false_tracks=find_false_tracks(TrackOutcomes.concatenate(self._outcomes), duration_s),
            seconds=np.array(self._seconds, np.float64),
        )


def _duration_s(stamps_s: Sequence[float]) -> float:
    """Return the time that frames last, the last as long as the others on average."""
    if len(stamps_s) < 2:
        return 0.0
    return (stamps_s[-1] - stamps_s[0]) * len(stamps_s) / (len(stamps_s) - 1)
