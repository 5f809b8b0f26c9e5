"""nuScenes' tracking task: AMOTA and AMOTP over thresholds of the score, and CLEAR at the best of them.

Objects and tracks below the maximum distance of the class count all round, with boxes where a track has a gap. Matches are
nearer than 2 m, the score of a track is its mean. X. Weng et al., "3D multi-object tracking: a baseline and new evaluation
metrics", IROS 2020; values of tracking_nips_2019.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from perception.evaluation.nuscenes.protocol import MIN_RECALL
from perception.evaluation.report import CONTEXT, Metric, Metrics, Report, SummedMetrics, Table
from perception.tracking.association import assign_hungarian
from perception.types import ArrayTable, Bool, Float64, Int

TRACKED_CLASSES = ("bicycle", "bus", "car", "motorcycle", "pedestrian", "trailer", "truck")
MAX_DISTANCE_M = 2.0  # of the centres of a match, and AMOTP of a recall that is not reached
_RECALLS = np.linspace(MIN_RECALL, 1, 40).round(12)
_MOSTLY_TRACKED, _MOSTLY_LOST = 0.8, 0.2
_MEAN = "mean, sum"


@dataclass(frozen=True)
class TaskTracks(ArrayTable):
    """N boxes of tracks in one scene.

    Attributes:
        types: (N,) names of classes.
        frames: (N,) number of the sample in the scene.
        ids: (N,) track ids.
        places_m: (N, 2) centres over the ground.
        scores: (N,) scores; 0 of objects.
    """

    types: NDArray[np.str_]
    frames: Int
    ids: Int
    places_m: Annotated[Float64, 2]
    scores: Float64


@dataclass(frozen=True)
class TrackedScene:
    """Labelled and found tracks that count in one scene.

    Attributes:
        stamps_us: (F,) time of each sample in microseconds.
        truths: Labelled objects.
        found: Tracks.
    """

    stamps_us: Int
    truths: TaskTracks
    found: TaskTracks


@dataclass(frozen=True)
class TrackCounts(SummedMetrics):
    """Counts of one class at one threshold; those of several scenes are added.

    Attributes:
        matches: Number of boxes that are matched to the track before, or for the first time.
        switches: Number of boxes that are matched to another track than before.
        false_positives: Number of boxes of tracks without an object.
        misses: Number of boxes of objects without a track.
        fragmentations: Number of times that an object is lost between two matches.
        mostly_tracked: Number of objects matched in 80 % of their frames or more.
        mostly_lost: Number of objects matched in less than 20 % of their frames.
        distance_m: Sum of the distances of all matches.
    """

    matches: int = 0
    switches: int = 0
    false_positives: int = 0
    misses: int = 0
    fragmentations: int = 0
    mostly_tracked: int = 0
    mostly_lost: int = 0
    distance_m: float = 0.0

    @property
    def objects(self) -> int:
        """Number of boxes of objects."""
        return self.matches + self.switches + self.misses

    @property
    def mota(self) -> float:
        """Accuracy, 0 or more."""
        errors = self.misses + self.switches + self.false_positives
        return max(0.0, 1 - errors / self.objects)

    @property
    def motar(self) -> float:
        """Accuracy at the recall that is reached, 0 or more; 0 without a match."""
        return max(0.0, 1 - self.false_positives / self.matches) if self.matches else 0.0

    @property
    def motp_m(self) -> float:
        """Mean distance of the matches."""
        count = self.matches + self.switches
        return self.distance_m / count if count else MAX_DISTANCE_M


@dataclass(frozen=True)
class TrackMetrics(Metrics):
    """Metrics of one class.

    Attributes:
        objects: Number of boxes of objects, with those between their labels.
        amota: Mean of MOTAR over 40 recalls, 0 where it is not reached.
        amotp: Mean distance of matches over the same recalls in m, 2 m where it is not reached.
        recall: Share of the objects that are matched; this and the next at the threshold of the highest MOTA.
        motar: Accuracy at that recall.
        mota: Accuracy.
        motp: Mean distance of matches in m.
        mt: Number of objects matched in 80 % of their frames or more.
        ml: Number of objects matched in less than 20 % of their frames.
        tp: Number of matched boxes without switches.
        fp: Number of boxes of tracks without an object.
        fn: Number of boxes of objects without a track.
        ids: Number of switches of the id.
        frag: Number of times that an object is lost between two matches.
    """

    objects: Annotated[int, Metric("objects")]
    amota: Annotated[float, Metric("AMOTA [%]", ".1%")]
    amotp: Annotated[float, Metric("AMOTP [m]", ".3f")]
    recall: Annotated[float, Metric("recall [%]", ".1%")]
    motar: Annotated[float, Metric("MOTAR [%]", ".1%")]
    mota: Annotated[float, Metric("MOTA [%]", ".1%")]
    motp: Annotated[float, Metric("MOTP [m]", ".3f")]
    mt: Annotated[int, Metric("MT")]
    ml: Annotated[int, Metric("ML")]
    tp: Annotated[int, Metric("TP")]
    fp: Annotated[int, Metric("FP")]
    fn: Annotated[int, Metric("FN")]
    ids: Annotated[int, Metric("IDS")]
    frag: Annotated[int, Metric("Frag")]


@dataclass(frozen=True)
class TrackTaskReport(Report):
    """Metrics of the tracking task.

    Attributes:
        classes: Metrics by class, of those with objects.
        samples: Number of samples.
    """

    classes: Mapping[str, TrackMetrics]
    samples: Annotated[int, CONTEXT]

    @property
    def mean(self) -> Annotated[TrackMetrics, Metric("mean")]:
        """Means of the ratios over the classes, and sums of the counts."""
        values: dict[str, Any] = {}
        for column in TrackMetrics.columns():
            numbers = [getattr(row, str(column.key)) for row in self.classes.values()] or [np.nan]
            values[str(column.key)] = np.mean(numbers) if column.spec else np.sum(numbers)
        return TrackMetrics(**{name: value.item() for name, value in values.items()})

    def tables(self) -> list[Table[Any]]:
        """Return a row for each class and one for all."""
        title = f"nuScenes tracking task, {self.samples} samples all round, matches below {MAX_DISTANCE_M:g} m"
        rows = {**self.classes, _MEAN: self.mean}
        return [Table(title, TrackMetrics.columns(), rows, "class")]


@dataclass(frozen=True)
class _Frame:
    """Objects and tracks of one class in one sample.

    Attributes:
        truth_ids: (G,) ids of the objects.
        track_ids: (T,) ids of the tracks.
        scores: (T,) scores.
        distances_m: (G, T) distances of their centres.
    """

    truth_ids: Int
    track_ids: Int
    scores: Float64
    distances_m: Float64

    def above(self, threshold: float) -> "_Frame":
        """Return the frame with the tracks from a score on."""
        kept = self.scores >= threshold
        return _Frame(
            self.truth_ids, self.track_ids[kept], self.scores[kept], self.distances_m[:, kept]
        )


@dataclass
class _Matches:
    """Matches of one class in one scene, frame by frame.

    An object keeps the track that it was last matched to while that is near enough; the others are assigned at the
    minimum sum of distances.

    Attributes:
        counts: Counts so far, without those of whole objects.
        scores: Score of the track of each match that is no switch.
        found: Whether each object was matched, in each of its frames so far.
        last: Track that each object was last matched to.
    """

    counts: TrackCounts = field(default_factory=TrackCounts)
    scores: list[float] = field(default_factory=list)
    found: dict[int, list[bool]] = field(default_factory=dict)
    last: dict[int, int] = field(default_factory=dict)

    def add(self, frame: _Frame) -> None:
        """Match one frame."""
        is_near = frame.distances_m < MAX_DISTANCE_M
        pairs = [*self._kept(frame, is_near)]
        rows, columns = (np.array([one[side] for one in pairs], np.int64) for side in (0, 1))
        free = is_near.copy()
        free[rows] = False
        free[:, columns] = False
        if free.any():
            added = assign_hungarian(frame.distances_m, free)
            pairs += zip(added.tracks.tolist(), added.detections.tolist(), strict=True)
        switches, matched = 0, {row for row, _ in pairs}
        for row, column in pairs:
            truth, track = int(frame.truth_ids[row]), int(frame.track_ids[column])
            is_switch = self.last.get(truth, track) != track
            switches += is_switch
            if not is_switch:
                self.scores.append(float(frame.scores[column]))
            self.last[truth] = track
        for row, truth in enumerate(frame.truth_ids.tolist()):
            self.found.setdefault(truth, []).append(row in matched)
        self.counts += TrackCounts(
            matches=len(pairs) - switches,
            switches=switches,
            false_positives=len(frame.track_ids) - len(pairs),
            misses=len(frame.truth_ids) - len(pairs),
            distance_m=float(sum(frame.distances_m[one] for one in pairs)),
        )

    def _kept(self, frame: _Frame, is_near: Bool) -> Iterator[tuple[int, int]]:
        column_of = {track: column for column, track in enumerate(frame.track_ids.tolist())}
        for row, truth in enumerate(frame.truth_ids.tolist()):
            column = column_of.get(self.last.get(truth, -1), -1)
            if column >= 0 and is_near[row, column]:
                column_of.pop(self.last[truth])
                yield row, column

    def total(self) -> TrackCounts:
        """Return all counts."""
        histories = [np.array(one) for one in self.found.values()]
        shares = np.array([one.mean() for one in histories])
        lost = [np.diff(np.trim_zeros(one).astype(np.int64)) for one in histories]
        return self.counts + TrackCounts(
            fragmentations=sum(int((one < 0).sum()) for one in lost),
            mostly_tracked=int((shares >= _MOSTLY_TRACKED).sum()),
            mostly_lost=int((shares < _MOSTLY_LOST).sum()),
        )


def measure_task_tracks(scenes: Sequence[TrackedScene]) -> TrackTaskReport:
    """Measure the tracks of some scenes; classes without an object are left out."""
    filled = [
        TrackedScene(
            one.stamps_us,
            fill_gaps(one.truths, one.stamps_us),
            fill_gaps(_mean_scores(one.found), one.stamps_us),
        )
        for one in scenes
    ]
    classes = {}
    for name in TRACKED_CLASSES:
        frames = [[*_frames(one, name)] for one in filled]
        if any(len(frame.truth_ids) for of_scene in frames for frame in of_scene):
            classes[name] = _measure_class(frames)
    return TrackTaskReport(classes, sum(len(one.stamps_us) for one in scenes))


def _measure_class(scenes: Sequence[Sequence[_Frame]]) -> TrackMetrics:
    everything = _match(scenes, -np.inf)
    objects = sum(one.counts.objects for one in everything)
    scores = np.sort([score for one in everything for score in one.scores])[::-1]
    counts: dict[float, TrackCounts] = {}
    reached = []
    if len(scores):
        recalls = np.arange(1, len(scores) + 1) / objects
        is_reached = recalls[-1] >= _RECALLS
        reached = np.interp(_RECALLS, recalls, scores, right=0)[is_reached].tolist()
    for threshold in reached:
        if threshold not in counts:
            matched = _match(scenes, threshold)
            counts[threshold] = sum((one.total() for one in matched), TrackCounts())
    at = [counts[threshold] for threshold in reached]
    nothing = TrackCounts(misses=objects, mostly_lost=sum(len(one.found) for one in everything))
    # Of equal accuracies, that of the highest recall.
    best = max(reversed(at), key=lambda one: one.mota, default=nothing)
    unreached = len(_RECALLS) - len(at)
    return TrackMetrics(
        objects=objects,
        amota=sum(one.motar for one in at) / len(_RECALLS),
        amotp=(sum(one.motp_m for one in at) + unreached * MAX_DISTANCE_M) / len(_RECALLS),
        recall=(best.matches + best.switches) / objects,
        motar=best.motar,
        mota=best.mota,
        motp=best.motp_m,
        mt=best.mostly_tracked,
        ml=best.mostly_lost,
        tp=best.matches,
        fp=best.false_positives,
        fn=best.misses,
        ids=best.switches,
        frag=best.fragmentations,
    )


def _match(scenes: Sequence[Sequence[_Frame]], threshold: float) -> list[_Matches]:
    """Match the tracks of all scenes from a score on."""
    made = []
    for frames in scenes:
        matches = _Matches()
        for frame in frames:
            matches.add(frame.above(threshold))
        made.append(matches)
    return made


def _frames(scene: TrackedScene, name: str) -> Iterator[_Frame]:
    """Yield the objects and tracks of one class in each sample."""
    truths = scene.truths[scene.truths.types == name]
    found = scene.found[scene.found.types == name]
    for number in range(len(scene.stamps_us)):
        true, here = truths[truths.frames == number], found[found.frames == number]
        offsets_m = true.places_m[:, None] - here.places_m
        distances_m = np.hypot(offsets_m[..., 0], offsets_m[..., 1])
        yield _Frame(true.ids, here.ids, here.scores, distances_m)


def _mean_scores(tracks: TaskTracks) -> TaskTracks:
    """Return tracks of which every box has the mean score of the track."""
    scores = tracks.scores.copy()
    for track in np.unique(tracks.ids):
        rows = tracks.ids == track
        scores[rows] = scores[rows].mean()
    return TaskTracks(tracks.types, tracks.frames, tracks.ids, tracks.places_m, scores)


def fill_gaps(tracks: TaskTracks, stamps_us: Int) -> TaskTracks:
    """Return tracks with a box in every sample from their first to their last; those that are added come last.

    The devkit weighs the box before a gap by the time that has passed since, and the box behind by the time that is left:
    where several samples are missing, their boxes come in the opposite order. An added box has the class of the box behind.
    """
    given = tracks
    _, firsts, numbers = np.unique(tracks.ids, return_index=True, return_inverse=True)
    tracks = tracks[np.lexsort((tracks.frames, firsts[numbers]))]
    steps = np.diff(tracks.frames)
    missing = np.where(np.diff(tracks.ids) == 0, steps - 1, 0)
    before = np.repeat(np.arange(len(missing)), missing)
    if not len(before):
        return given
    after = before + 1
    starts = np.cumsum(missing) - missing
    frames = tracks.frames[before] + 1 + np.arange(len(before)) - starts[before]
    left_us = stamps_us[tracks.frames[after]] - stamps_us[frames]
    share = left_us / (stamps_us[tracks.frames[after]] - stamps_us[tracks.frames[before]])
    # Scores too, so that they are rounded in the same way.
    places_m, scores = (
        (1.0 - weights) * values[before] + weights * values[after]
        for values, weights in ((tracks.places_m, share[:, None]), (tracks.scores, share))
    )
    added = TaskTracks(tracks.types[after], frames, tracks.ids[before], places_m, scores)
    return given.joined(added)
