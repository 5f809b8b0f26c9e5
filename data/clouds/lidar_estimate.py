"""Which LiDAR took some scans: a known model by its beams, else a table of the beams that were seen."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import find_peaks

from data.beam_pattern import BeamPattern
from perception.sensor import SENSORS, LidarModel
from perception.types import Float32, Float64, Int

_NEAREST_M = 2.5  # the beams of one sensor do not start from one point
_BIN_RAD = np.radians(0.02)
_SMOOTH_BINS = 2
_MIN_SHARE_OF_PEAK = 0.02  # of the usual beam's returns
_MIN_PROMINENCE = 0.5  # of a peak, so that it is a beam, and not the smear between two of them
# Where scans are moved to one time, steep beams end so close by that each direction has its own elevations.
_SECTORS, _MIN_SHARPNESS = 24, 0.9
_BLUR_BINS = 8  # a sharp beam is narrower
_MIN_SEEN_SHARE = 0.5  # of the beams of a model
_MIN_POINTS = 2_000
_MATCH_SHARE = 0.3  # of the distance of neighbouring beams
_MIN_MATCH_RAD = np.radians(0.06)
_MIN_SCORE = 0.85
_MIN_PATTERN_SHARE = 0.93  # of the number of beams, where their elevations do not agree
_MAX_SCATTER_RAD = np.radians(1.5)
_MAX_SHIFT_RAD = np.radians(0.6)
_MAX_OFF_BEAMS = 0.42  # calibrated beams that come in blocks: 0.36
_VIEW_QUANTILES, _VIEW_TOLERANCE_RAD = (0.005, 0.995), np.radians(2.5)
_MIN_RING_POINTS = 20
_MAX_BEAMS = 256


@dataclass(frozen=True)
class LidarEstimate:
    """A LiDAR by its beams.

    Attributes:
        elevations_rad: (L,) elevations of the beams that have returns, highest first.
        azimuth_step_rad: Angle between two firings of one beam, or None where it is not clear.
        fitting: Names of known models, the best first, with the share of beams that agree, 0 to 1.
        has_rings: Whether the beams are those that the files number.
        scatter_rad: Range of the elevations of most returns of one numbered beam; much where points are not given about
            the origin of the LiDAR, or are of several LiDARs.
        is_on_beams: Whether returns lie at the elevations of beams; False for a LiDAR without rings.
    """

    elevations_rad: Float64
    azimuth_step_rad: float | None
    fitting: tuple[tuple[str, float], ...]
    has_rings: bool
    scatter_rad: float = 0.0
    is_on_beams: bool = True

    @property
    def is_about_lidar(self) -> bool:
        """Whether returns of one beam have one elevation, as they have about the origin of the LiDAR."""
        return bool(self.scatter_rad <= _MAX_SCATTER_RAD)

    @property
    def model(self) -> LidarModel | None:
        """The known model that fits best, or None."""
        return SENSORS[self.fitting[0][0]] if self.fitting else None


def estimate_lidar(
    scans: Sequence[Float32], rings: Sequence[Int | None] | None = None, up: Float64 | None = None
) -> LidarEstimate | None:
    """Estimate the LiDAR from some scans; None where there are too few returns.

    Args:
        scans: (N, 3) points of each scan around the origin of the LiDAR.
        rings: (N,) number of the beam of each point, where the files have it.
        up: (3,) direction of the axis of rotation; else z.
    """
    vertical = np.array([0.0, 0.0, 1.0]) if up is None else up
    elevations, azimuths, numbers = [], [], []
    for place, points in enumerate(scans):
        along_m = points @ vertical
        flat = points - along_m[:, None] * vertical
        across_m = np.linalg.norm(flat, axis=1)
        first, second = _across(vertical)
        is_far = np.hypot(along_m, across_m) > _NEAREST_M
        elevations.append(np.arctan2(along_m, across_m)[is_far])
        azimuths.append(np.arctan2(flat @ second, flat @ first)[is_far] + 4 * np.pi * place)
        ring = rings[place] if rings is not None else None
        numbers.append(np.full(int(is_far.sum()), -1) if ring is None else ring[is_far])
    elevation, ring = np.concatenate(elevations), np.concatenate(numbers)
    if len(elevation) < _MIN_POINTS:
        return None
    has_rings = bool((ring >= 0).all() and 1 < len(np.unique(ring)) <= _MAX_BEAMS)
    azimuth = np.concatenate(azimuths)
    beams = _ring_elevations(elevation, ring) if has_rings else _seen_elevations(elevation, azimuth)
    if len(beams) < 2:
        return None
    step = _azimuth_step(elevation, azimuth, beams)
    scatter_rad = _ring_scatter(elevation, ring) if has_rings else 0.0
    fitting = fitting_models(beams)
    if not fitting and not has_rings:
        first, second = _across(vertical)
        turn = np.stack([first, second, vertical]).astype(np.float32)
        fitting = _models_by_pattern(scans[0] @ turn.T, len(beams))
    is_on_beams = bool(fitting) or has_rings or _off_beams(elevation, beams) <= _MAX_OFF_BEAMS
    if not is_on_beams:
        fitting = _models_by_view(elevation, azimuth)
    return LidarEstimate(beams, step, fitting, has_rings, scatter_rad, is_on_beams)


def _across(vertical: Float64) -> tuple[Float64, Float64]:
    first = np.eye(3)[int(np.abs(vertical).argmin())]
    first = first - (first @ vertical) * vertical
    first /= np.linalg.norm(first)
    return first, np.cross(vertical, first)


def _ring_scatter(elevations_rad: Float64, ring: Int) -> float:
    """Return the median over the beams of the range that holds 80 % of their elevations."""
    ranges = [
        np.ptp(np.quantile(elevations_rad[ring == one], (0.1, 0.9))) for one in np.unique(ring)
    ]
    return float(np.median(ranges))


def _seen_elevations(elevations_rad: Float64, azimuths_rad: Float64) -> Float64:
    """Return the elevations of the beams: below the horizon those that most directions agree on, above it all."""
    sector = np.floor(azimuths_rad % (2 * np.pi) / (2 * np.pi) * _SECTORS).astype(int) % _SECTORS
    is_below = elevations_rad < 0
    sharpness = _sharpness(elevations_rad[~is_below], sector[~is_below])
    is_sharp = ~is_below & (sharpness >= _MIN_SHARPNESS * sharpness.max())[sector]
    above = beam_peaks(elevations_rad[is_sharp])
    found = [beam_peaks(elevations_rad[is_below & (sector == one)]) for one in range(_SECTORS)]
    counts = [len(peaks) for peaks in found if len(peaks)]
    usual = max(sorted(set(counts), reverse=True), key=counts.count, default=0)
    agreeing = [peaks for peaks in found if len(peaks) == usual]
    below = np.median(agreeing, axis=0) if usual else np.zeros(0)
    # A beam at the horizon may be seen on both sides of it.
    is_twice = len(above) > 0 and len(below) > 0 and above[-1] - below[0] < 3 * _BIN_RAD
    return np.concatenate([above, below[1:] if is_twice else below])


def _sharpness(elevations_rad: Float64, sector: Int) -> Float64:
    """Return the share of the returns around a return that are within its beam, of each sector."""
    bins = np.floor((elevations_rad + np.pi / 2) / _BIN_RAD).astype(int)
    sharpness = np.zeros(_SECTORS)
    for number in range(_SECTORS):
        counts = np.bincount(bins[sector == number]).astype(np.float64)
        if counts.sum() >= _MIN_POINTS // (2 * _SECTORS):
            near = np.convolve(counts, np.ones(3), mode="same")
            around = np.convolve(counts, np.ones(2 * _BLUR_BINS + 1), mode="same")
            sharpness[number] = (counts * near / np.maximum(around, 1)).sum() / counts.sum()
    return sharpness


def _ring_elevations(elevations_rad: Float64, ring: Int) -> Float64:
    """Return the median elevation of each beam, highest first; beams that are alike are one."""
    medians = [
        float(np.median(of_beam))
        for number in np.unique(ring)
        if len(of_beam := elevations_rad[ring == number]) >= _MIN_RING_POINTS
    ]
    falling = np.unique(np.array(medians))[::-1]
    return np.asarray(falling)


def beam_peaks(elevations_rad: Float64) -> Float64:
    """Return the elevations at which returns are dense, highest first."""
    if len(elevations_rad) == 0:
        return np.zeros(0)
    low, high = elevations_rad.min() - 10 * _BIN_RAD, elevations_rad.max() + 10 * _BIN_RAD
    bins = int((high - low) / _BIN_RAD) + 1
    counts = np.histogram(elevations_rad, bins, (low, low + bins * _BIN_RAD))[0].astype(np.float64)
    offsets = np.arange(-3 * _SMOOTH_BINS, 3 * _SMOOTH_BINS + 1)
    kernel = np.exp(-0.5 * np.square(offsets / _SMOOTH_BINS))
    smooth = np.convolve(counts, kernel / kernel.sum(), mode="same")
    peaks, found = find_peaks(smooth, prominence=0)
    peaks = peaks[found["prominences"] >= _MIN_PROMINENCE * smooth[peaks]]
    if len(peaks) == 0:
        return np.zeros(0)
    kept = peaks[smooth[peaks] >= _MIN_SHARE_OF_PEAK * np.quantile(smooth[peaks], 0.75)]
    # The median of the returns around a peak is finer than a bin.
    centers = low + (kept + 0.5) * _BIN_RAD
    return np.asarray(_medians_around(elevations_rad, centers)[::-1])


def _medians_around(elevations_rad: Float64, centers: Float64) -> Float64:
    rising = np.sort(elevations_rad)
    starts = np.searchsorted(rising, centers - 2 * _BIN_RAD)
    ends = np.searchsorted(rising, centers + 2 * _BIN_RAD)
    return np.array(
        [
            np.median(rising[a:b]) if b > a else c
            for a, b, c in zip(starts, ends, centers, strict=True)
        ]
    )


def fitting_models(beams_rad: Float64) -> tuple[tuple[str, float], ...]:
    """Return the known models whose beams agree with those that were seen, the best first."""
    scores = {name: _agreement(beams_rad, model.elevations_rad) for name, model in SENSORS.items()}
    fitting = [(name, score) for name, score in scores.items() if score >= _MIN_SCORE]
    # Of two models that fit, one with every second beam of the other, that with fewer beams unseen.
    return tuple(sorted(fitting, key=lambda one: (-round(one[1], 2), SENSORS[one[0]].beams)))


def _models_by_pattern(points: Float32, seen: int) -> tuple[tuple[str, float], ...]:
    """Return the models with the range, the spacing and the number of the beams, which calibration moves off the data sheet."""
    pattern = BeamPattern.of(points)
    if pattern is None:
        return ()
    shares = {
        name: min(seen, model.beams) / max(seen, model.beams)
        for name, model in SENSORS.items()
        if pattern.fits(model)
    }
    fitting = [(name, share) for name, share in shares.items() if share >= _MIN_PATTERN_SHARE]
    return tuple(sorted(fitting, key=lambda one: -one[1]))


def _off_beams(elevations_rad: Float64, beams_rad: Float64) -> float:
    """Return how far returns are off the nearest beam: on average 0 at beams, 0.5 where there are none, 1 between two."""
    rising = beams_rad[::-1]
    inside = elevations_rad[(elevations_rad > rising[0]) & (elevations_rad < rising[-1])]
    above = np.clip(np.searchsorted(rising, inside), 1, len(rising) - 1)
    gap_rad = rising[above] - rising[above - 1]
    away_rad = np.minimum(inside - rising[above - 1], rising[above] - inside)
    return float(np.mean(2 * away_rad / gap_rad)) if len(inside) else 0.0


def _models_by_view(
    elevations_rad: Float64, azimuths_rad: Float64
) -> tuple[tuple[str, float], ...]:
    """Return the models without rings that see as far to the sides, and as far up and down as there are returns."""
    low_rad, high_rad = np.quantile(elevations_rad, _VIEW_QUANTILES)
    around_rad = np.sort(azimuths_rad % (2 * np.pi))
    view_rad = 2 * np.pi - np.diff(around_rad, append=around_rad[0] + 2 * np.pi).max()
    shares = {
        name: min(view_rad, model.field_of_view_rad) / max(view_rad, model.field_of_view_rad)
        for name, model in SENSORS.items()
        if not model.has_rings
        and model.elevations_rad[-1] - _VIEW_TOLERANCE_RAD <= low_rad
        and high_rad <= model.elevations_rad[0] + _VIEW_TOLERANCE_RAD
    }
    fitting = [(name, share) for name, share in shares.items() if share >= _MIN_PATTERN_SHARE]
    return tuple(sorted(fitting, key=lambda one: -one[1]))


def _agreement(seen_rad: Float64, model_rad: Float64) -> float:
    """Return the harmonic mean of the shares of beams of either side that the other has, 0 to 1.

    Beams of the model beyond those that were seen, which met nothing or the vehicle itself, do not count, if they are
    not most of them.
    """
    spacing = np.abs(np.diff(model_rad))
    limit = np.maximum(
        _MATCH_SHARE
        * np.minimum(np.append(spacing, spacing[-1]), np.insert(spacing, 0, spacing[0])),
        _MIN_MATCH_RAD,
    )
    reach = (model_rad <= seen_rad.max() + limit) & (model_rad >= seen_rad.min() - limit)
    matched = sum(
        _matched(side, model_rad, limit)
        for side in (seen_rad[seen_rad >= 0][::-1], seen_rad[seen_rad < 0])
    )
    seen_share = min(1.0, float(reach.mean()) / _MIN_SEEN_SHARE)
    return min(1.0, seen_share * 2 * matched / (len(seen_rad) + int(reach.sum())))


def _matched(seen_rad: Float64, model_rad: Float64, limit_rad: Float64) -> int:
    """Return how many beams, from the horizon outwards, are those of a model.

    Steep beams meet the road so close that the motion of the vehicle shifts them, the next one nearly as far.
    """
    matched, offset_rad = set(), 0.0
    for angle_rad in seen_rad:
        away_rad = angle_rad - offset_rad - model_rad
        beam = int(np.abs(away_rad).argmin())
        if np.abs(away_rad[beam]) <= limit_rad[beam] and beam not in matched:
            matched.add(beam)
            offset_rad += away_rad[beam] / 2
            offset_rad = min(max(offset_rad, -_MAX_SHIFT_RAD), _MAX_SHIFT_RAD)
    return len(matched)


def _azimuth_step(
    elevations_rad: Float64, azimuths_rad: Float64, beams_rad: Float64
) -> float | None:
    """Return the usual step from one return of a beam to the next."""
    rising = beams_rad[::-1]
    edges = (rising[1:] + rising[:-1]) / 2
    beam = np.searchsorted(edges, elevations_rad)
    order = np.lexsort((azimuths_rad, beam))
    steps = np.diff(azimuths_rad[order])[np.diff(beam[order]) == 0]
    steps = steps[(steps > np.radians(0.02)) & (steps < np.radians(3))]
    return float(np.median(steps)) if len(steps) >= _MIN_POINTS // 4 else None
