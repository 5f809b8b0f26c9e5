"""The change of the calibration with which images move as the motion of the LiDAR says (hand-eye calibration, with depth).

Unknown beside it are the errors of each motion, and which way the LiDAR turns: the left and the right of an image are
measured earlier or later than its middle, so that a plane there is one that has moved by its share of the sweep. Robust
Gauss-Newton steps on the distances in the later images.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from perception.calibration.offset import OffsetEstimate
from perception.calibration.surface_corners import CornerTracks
from perception.geometry.se3 import from_motion_vector, motion_vector
from perception.kernels.corner_sums import SHARED, add_corner_sums
from perception.types import Float64

# Poses of registration: standard deviations of a motion between two of them.
_MOTION_DEVIATIONS = np.array([0.0005] * 3 + [0.005] * 3)
# Slow drives do not tell the sweep. In between both directions a drive at 5 m/s tells the calibration as well as in the true
# one, at 12 m/s 2 cm less well.
_SWEEP_DEVIATION = 0.3
# Deviations from which on a corner counts little, as one on what moves: broad at first, then narrow.
_SCALES = (6.0, 3.0, 1.5, 1.5)
_MAX_INLIER = 3.0
# What errors that are alike in all frames leave.
_MIN_DEVIATIONS = np.array([*np.radians([0.07, 0.07, 0.09]), 0.016, 0.018, 0.015])
# Planes are associated again where the calibration is found to be so far from the one of their association.
_MAX_ASSOCIATION_CHANGE = np.array([*np.radians([0.2] * 3), *[0.04] * 3])
_MAX_ASSOCIATIONS = 3
_MAX_CONTRADICTION = 2.0  # in deviations of what is known
_FIXED = np.full(6, 1e-5)  # deviations of an offset that is held as it is


@dataclass(frozen=True)
class MotionAlignment:
    """An offset, and how badly it fits.

    Attributes:
        estimate: Offset.
        cost: Half the sum of squared deviations of all that is known, robust for corners; one without a plane counts as one
            that is elsewhere.
        tracks: Corners with the planes that were associated last.
    """

    estimate: OffsetEstimate
    cost: float
    tracks: Sequence[CornerTracks]


def refine_by_motion(
    tracks: Sequence[CornerTracks], known: OffsetEstimate, start: Float64 | None = None
) -> MotionAlignment:
    """Return an estimate with what the motion of images tells beside it.

    Args:
        tracks: Corners of several frames, at least one.
        known: What is known of the offset beside their motion.
        start: (6,) offset from which it is looked for first, such as that of the planes; else the known one. Planes that are
            associated wrongly do not contradict the start: where what is known does, it is looked for from there, too, and
            the one with the lower cost is kept.
    """
    found = _refined(tracks, known, known.offset if start is None else start)
    left = np.abs(found.estimate.offset - known.offset)
    if start is not None and (left > _MAX_CONTRADICTION * known.deviations).any():
        found = min(found, _refined(tracks, known, known.offset), key=lambda one: one.cost)
    deviations = np.maximum(found.estimate.deviations, _MIN_DEVIATIONS)
    return replace(found, estimate=replace(found.estimate, deviations=deviations))


def motion_gain(tracks: Sequence[CornerTracks], offset: Float64) -> float:
    """Return by how much corners fit better with a (6,) offset than with none, half the sum of their squared deviations.

    Of each frame those count that are on a surface both with the offset and without.
    """
    tried = (np.zeros(6), offset)
    kept = []
    for one in tracks:
        both = [one.reassociated(from_motion_vector(by)) for by in tried]
        is_known = np.logical_and(*(each.corners.is_known for each in both))
        kept.append([each[is_known] for each in both])
    without, with_offset = (
        align_motion(frames, by, OffsetEstimate(by, _FIXED)).cost
        for frames, by in zip(zip(*kept, strict=True), tried, strict=True)
    )
    return without - with_offset


def _refined(
    tracks: Sequence[CornerTracks], known: OffsetEstimate, start: Float64
) -> MotionAlignment:
    offset, found = start, None
    for _ in range(_MAX_ASSOCIATIONS):
        if any(is_large(one.corners.offset - offset) for one in tracks):
            tracks = [one.reassociated(from_motion_vector(offset)) for one in tracks]
        elif found is not None:
            return found
        found = align_motion(tracks, offset, known)
        offset = found.estimate.offset
    assert found is not None
    return found


def is_large(change: Float64) -> bool:
    """Return whether planes are to be associated again after a (6,) change of the calibration."""
    return bool((np.abs(change) > _MAX_ASSOCIATION_CHANGE).any())


def align_motion(
    tracks: Sequence[CornerTracks], start: Float64, known: OffsetEstimate
) -> MotionAlignment:
    """Find the change of the calibration with which corners are where the motion brings them.

    Args:
        tracks: Corners of several frames.
        start: (6,) offset to start from.
        known: What is known of the offset beside their motion.
    """
    state = _State(from_motion_vector(start), 0.0, np.zeros((len(tracks), 6)))
    for scale in _SCALES:
        system = _System(state, known)
        for number, one in enumerate(tracks):
            system.add_tracks(number, one, scale)
        state = state.moved(system.step())
    deviations = np.sqrt(np.diag(np.linalg.inv(system.curvature))[:6])
    estimate = OffsetEstimate(motion_vector(state.offset_SE3_cam), deviations)
    return MotionAlignment(estimate, system.cost, tracks)


@dataclass(frozen=True)
class _State:
    """What is looked for: the offset, the sweep, and the (F, 6) error of each motion in the camera's frame."""

    offset_SE3_cam: Float64
    sweep: float
    motion_errors: Float64

    def moved(self, step: Float64) -> "_State":
        return _State(
            from_motion_vector(step[:6]) @ self.offset_SE3_cam,
            self.sweep + float(step[6]),
            self.motion_errors + step[SHARED:].reshape(-1, 6),
        )


class _System:
    """Normal equations of one step: the offset, the sweep, then the error of each motion."""

    def __init__(self, state: _State, known: OffsetEstimate) -> None:
        """Begin with what is known beside the corners."""
        motions = len(state.motion_errors)
        left = motion_vector(state.offset_SE3_cam) - known.offset
        errors = np.array([*left, state.sweep, *state.motion_errors.ravel()])
        of_motions = np.tile(_MOTION_DEVIATIONS, motions)
        weights = 1 / np.square([*known.deviations, _SWEEP_DEVIATION, *of_motions])
        self._state = state
        self.curvature, self.slope = np.diag(weights), weights * errors
        self.cost = float(self.slope @ errors) / 2

    def add_tracks(self, number: int, tracks: CornerTracks, scale: float) -> None:
        """Add the corners of one frame."""
        corners, state = tracks.corners, self._state
        self.cost += add_corner_sums(
            corners.planes_velo, corners.rays, tracks.later_px, tracks.deviations_px, tracks.sweep_shifts_m,
            state.offset_SE3_cam @ corners.view.cam_SE3_velo, tracks.later_SE3_velo,
            from_motion_vector(state.motion_errors[number]), corners.view.image_P_cam, corners.view.center_m,
            state.sweep, scale, _MAX_INLIER, SHARED + 6 * number, self.curvature, self.slope,
        )  # fmt: skip

    def step(self) -> Float64:
        return np.asarray(-np.linalg.solve(self.curvature, self.slope))
