"""Reference implementation of HOTA, CLEAR and identity metrics: frame by frame, pair by pair, as in their papers."""

from collections import Counter, defaultdict

import numpy as np
from scipy.optimize import linear_sum_assignment

from perception.evaluation.multi_object.clear import Clear
from perception.evaluation.multi_object.hota import ALPHAS, Hota
from perception.evaluation.multi_object.mot_metrics import Identity
from perception.evaluation.multi_object.sequence import TrackedFrame, TrackedSequence
from perception.types import Float64

_ROUNDING = np.finfo(np.float64).eps
_Couple = tuple[int, int]


def hota(sequence: TrackedSequence) -> Hota:
    """Match every frame by one dense assignment; count every threshold apart."""
    lengths, track_lengths = _lengths(sequence)
    together: dict[_Couple, float] = defaultdict(float)
    for frame in sequence:
        for row, truth in enumerate(frame.truth_ids):
            for column, track in enumerate(frame.track_ids):
                alike = frame.similarity[row, column]
                others = frame.similarity[row].sum() + frame.similarity[:, column].sum() - alike
                together[truth, track] += alike / others if others > 0 else 0.0
    matches: list[tuple[_Couple, float]] = []
    for frame in sequence:
        weights = np.zeros(frame.similarity.shape)
        for row, truth in enumerate(frame.truth_ids):
            for column, track in enumerate(frame.track_ids):
                shared = together[truth, track]
                fit = shared / (lengths[truth] + track_lengths[track] - shared)
                weights[row, column] = fit * frame.similarity[row, column]
        matches += _matches(frame, weights)
    metrics = [_hota_at(alpha, matches, lengths, track_lengths) for alpha in ALPHAS - _ROUNDING]
    return Hota(*(np.array(column) for column in zip(*metrics, strict=True)))


def _hota_at(
    alpha: float,
    matches: list[tuple[_Couple, float]],
    lengths: dict[int, int],
    track_lengths: dict[int, int],
) -> tuple[float, ...]:
    """Return the fields of `Hota` at one threshold."""
    counts: dict[_Couple, int] = defaultdict(int)
    alike = [similarity for _, similarity in matches if similarity >= alpha]
    for couple, similarity in matches:
        counts[couple] += similarity >= alpha
    sums = np.zeros(3)
    for (truth, track), count in counts.items():
        whole, other = lengths[truth], track_lengths[track]
        sums += count * count / np.array([whole + other - count, whole, other])
    positives = len(alike)
    missed, false = sum(lengths.values()) - positives, sum(track_lengths.values()) - positives
    return positives, missed, false, *sums, sum(alike)


def clear(sequence: TrackedSequence, threshold: float = 0.5) -> Clear:
    """Count CLEAR by the last match of each object and that of the frame before."""
    lengths, track_lengths = _lengths(sequence)
    last: dict[int, int] = {}
    before: dict[int, int] = {}
    found: dict[int, int] = defaultdict(int)
    begins: dict[int, int] = defaultdict(int)
    switches, similarity_sum = 0, 0.0
    for frame in sequence:
        if not frame.similarity.size:
            continue
        continued = [[before.get(g) == t for t in frame.track_ids] for g in frame.truth_ids]
        weights = 1000.0 * np.array(continued) + frame.similarity
        weights[frame.similarity < threshold - _ROUNDING] = 0
        now = {}
        for (truth, track), similarity in _matches(frame, weights):
            switches += truth in last and last[truth] != track
            begins[truth] += truth not in before
            found[truth] += 1
            last[truth] = now[truth] = track
            similarity_sum += similarity
        before = now
    shares = np.array([found[truth] / length for truth, length in lengths.items()])
    positives = sum(found.values())
    return Clear(
        true_positives=positives,
        false_positives=sum(track_lengths.values()) - positives,
        false_negatives=sum(lengths.values()) - positives,
        id_switches=switches,
        fragmentations=sum(count - 1 for count in begins.values()),
        mostly_tracked=int((shares > 0.8).sum()),
        partly_tracked=int(((shares <= 0.8) & (shares >= 0.2)).sum()),
        mostly_lost=int((shares < 0.2).sum()),
        similarity_sum=similarity_sum,
    )


def identity(sequence: TrackedSequence, threshold: float = 0.5) -> Identity:
    """Assign objects and tracks to each other, or to none, at the smallest sum of lost boxes."""
    lengths, track_lengths = _lengths(sequence)
    truths, tracks = list(lengths), list(track_lengths)
    height, width = len(truths), len(tracks)
    meetings = np.zeros((height, width))
    for frame in sequence:
        for row, truth in enumerate(frame.truth_ids):
            for column, track in enumerate(frame.track_ids):
                is_near = frame.similarity[row, column] >= threshold - _ROUNDING
                meetings[truths.index(truth), tracks.index(track)] += is_near
    alone = np.array([*lengths.values()], float), np.array([*track_lengths.values()], float)
    costs = np.full((height + width, height + width), 1e9)
    costs[:height, :width] = alone[0][:, None] + alone[1] - 2 * meetings
    costs[np.arange(height), width + np.arange(height)] = alone[0]
    costs[height + np.arange(width), np.arange(width)] = alone[1]
    costs[height:, width:] = 0
    rows, columns = linear_sum_assignment(costs)
    is_couple = (rows < height) & (columns < width)
    positives = int(meetings[rows[is_couple], columns[is_couple]].sum())
    return Identity(
        positives, sum(track_lengths.values()) - positives, sum(lengths.values()) - positives
    )


def _lengths(sequence: TrackedSequence) -> tuple[Counter[int], Counter[int]]:
    """Return the number of frames of each true object and of each track."""
    truths = Counter(truth for frame in sequence for truth in frame.truth_ids)
    return truths, Counter(track for frame in sequence for track in frame.track_ids)


def _matches(frame: TrackedFrame, weights: Float64) -> list[tuple[_Couple, float]]:
    """Return the pairs of the assignment of greatest weight that have a weight, and their similarity."""
    rows, columns = linear_sum_assignment(weights, maximize=True)
    return [
        ((int(frame.truth_ids[row]), int(frame.track_ids[column])), frame.similarity[row, column])
        for row, column in zip(rows, columns, strict=True)
        if weights[row, column] > 0
    ]
