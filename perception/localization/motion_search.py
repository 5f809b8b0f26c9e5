"""The motion of a scan since a keyframe: first guesses, and the alignment that is accepted from them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from operator import itemgetter

import numpy as np

from perception.geometry.se3 import from_motion_vector, inverse, rotation_angle_rad
from perception.localization.alignment import (
    Alignment,
    AlignmentKind,
    PreprocessedPoints,
    align,
    share_on_surfaces,
)
from perception.types import Float64

# Alignments. A longer reach would match what moved.
REACH_M = 0.5  # largest distance of a match
MIN_INLIER_RATIO = 0.4  # of an accepted alignment, and how far it may correct its first guess
# Below this, one without prior is compared with those from other starts.
_CERTAIN_INLIER_RATIO = 0.5
_MAX_CORRECTION_M, _MAX_CORRECTION_RAD = 1.0, float(np.radians(4))
# What a vehicle changes its motion by, in m/s2 and rad/s2: a guess by velocity may be corrected by as much more.
_MANOEUVRE_M_S2, _MANOEUVRE_RAD_S2 = 5.0, 1.0
# Without INS, where no alignment is accepted: starts around the guess, how many of the motions found from them are looked
# at closely, and how many times as many points must speak for the best as for any other. The ground speaks for every motion:
# wherever the vehicle is, its rings lie on its surface.
_START_STEP_M, _START_STEP_RAD = 1.5, float(np.radians(8))
_MIN_CONTRAST, _APART_M, _APART_RAD = 1.1, 0.3, float(np.radians(2))
_MIN_SEARCHED_RATIO, _SEARCH_CANDIDATES = 0.3, 6
_MAX_UPRIGHT = 0.8  # vertical part of the normal of a surface that stands
# Where much moves, only points so near to the surfaces of the keyframes take part.
SURFACE_M = 0.1
SEARCH_POINTS = 1000  # of a scan; fewer miss the motion by chance
# Share of the matches that, with normals along a direction, tell as much about a motion in it as the INS step does; with
# fewer, as along a fence, the INS tells more.
_INS_PRIOR_SHARE = 0.006
# First guesses without INS and history: speeds and turns that a vehicle may have, in steps that an alignment bridges.
_INITIAL_SPEED_M_S, _INITIAL_STEP_M = 30.0, 1.5
_INITIAL_TURN_RAD_S = float(np.radians(40))


@dataclass(frozen=True)
class Guess:
    """First guess of a motion.

    Attributes:
        motion: (4, 4) transform from the later scan to the earlier one.
        prior_share: Share of the matches that tell as much as it does; 0 where it is nothing but a start.
        gap_s: Time over which the motion may have changed, in seconds; 0 where an INS tells it.
    """

    motion: Float64
    prior_share: float = 0.0
    gap_s: float = 0.0

    def after(self, motion: Float64) -> "Guess":
        """Return the guess of an earlier motion and this one."""
        return replace(self, motion=motion @ self.motion)


def guess_motions(
    step_ins: Float64 | None, velocity: Float64 | None, gap_s: float, unknown_s: float
) -> list[Guess]:
    """Return guesses of the motion since the last scan.

    Args:
        step_ins: (4, 4) motion by the INS, or None.
        velocity: (6,) velocity of the last scan, or None.
        gap_s: Time since the last scan in seconds.
        unknown_s: Time since the velocity is unknown, in seconds.
    """
    if velocity is None and step_ins is None:
        turns_rad = _around(_INITIAL_TURN_RAD_S * gap_s, _START_STEP_RAD)
        ways_m = np.arange(0.0, _INITIAL_SPEED_M_S * gap_s + _INITIAL_STEP_M, _INITIAL_STEP_M)
        return [
            Guess(
                from_motion_vector(np.array([0, 0, turn_rad, way_m, turn_rad * way_m / 2, 0])),
                gap_s=unknown_s,
            )
            for turn_rad, way_m in product(turns_rad, ways_m)
        ]
    guesses = [] if step_ins is None else [Guess(step_ins, _INS_PRIOR_SHARE)]
    if velocity is not None:
        constant = extrapolate(velocity, gap_s)
        # Within reach of each other the two guesses converge to the same pose.
        if step_ins is None or _is_another(step_ins, constant):
            guesses.append(Guess(constant, gap_s=unknown_s))
    return guesses


def best_alignment(
    target: PreprocessedPoints, source: PreprocessedPoints, guesses: Sequence[Guess]
) -> Alignment | None:
    """Align from each guess, and return the best accepted alignment."""
    if len(guesses) > 2:  # at the start
        return _searched_alignment(target, source, [one.motion for one in guesses])
    alignments = [accepted_alignment(target, source, guess) for guess in guesses]
    accepted = [alignment for alignment in alignments if alignment is not None]
    best = min(accepted, key=lambda alignment: alignment.cost, default=None)
    if any(guess.prior_share for guess in guesses):
        return best
    if best is not None and best.inlier_ratio >= _CERTAIN_INLIER_RATIO:
        return best
    # What hardly matches may be another motion than the true one.
    searched = _searched_alignment(target, source, _starts(guesses[0]))
    found = [one for one in (best, searched) if one is not None]
    return min(found, key=lambda alignment: alignment.cost, default=None)


def accepted_alignment(
    target: PreprocessedPoints,
    source: PreprocessedPoints,
    guess: Guess,
    kind: AlignmentKind = "GICP",
) -> Alignment | None:
    """Align from a guess, and return the alignment where it is accepted."""
    found = align(target, source, guess.motion, REACH_M, kind, guess.prior_share)
    correction = inverse(guess.motion) @ found.target_SE3_source
    is_accepted = (
        found.is_converged
        and found.inlier_ratio >= MIN_INLIER_RATIO
        and length_m(correction) <= _MAX_CORRECTION_M + _MANOEUVRE_M_S2 * guess.gap_s**2
        and rotation_angle_rad(correction)
        <= _MAX_CORRECTION_RAD + _MANOEUVRE_RAD_S2 * guess.gap_s**2
    )
    return found if is_accepted else None


def extrapolate(velocity: Float64 | None, gap_s: float) -> Float64:
    """Return the (4, 4) motion at a constant (6,) velocity; none where that is not known."""
    return np.eye(4) if velocity is None else from_motion_vector(velocity * gap_s)


def length_m(motion: Float64) -> float:
    """Return how far a (4, 4) motion goes."""
    return float(np.linalg.norm(motion[:3, 3]))


def _searched_alignment(
    target: PreprocessedPoints, points: PreprocessedPoints, starts: Sequence[Float64]
) -> Alignment | None:
    """Align from many motions, and return the alignment that clearly more of the points speak for than for any other."""
    sample = points.thinned(SEARCH_POINTS)
    motions = [align(target, sample, start, REACH_M).target_SE3_source for start in starts]
    motions.sort(key=lambda motion: _standing_share(sample, target, motion), reverse=True)
    found: list[tuple[float, Alignment]] = []
    for motion in motions:
        if all(_is_another(motion, one.target_SE3_source) for _, one in found):
            close = align(target, points, motion, REACH_M)
            if not close.is_converged:  # far from its start, iterations run out
                close = align(target, points, close.target_SE3_source, REACH_M)
            found.append((_standing_share(points, target, close.target_SE3_source), close))
        if len(found) == _SEARCH_CANDIDATES:
            break
    share, best = max(found, key=itemgetter(0))
    others, settled = list[float](), list[Alignment]()
    for other, one in found:
        if _is_another(one.target_SE3_source, best.target_SE3_source):
            others.append(other)
        elif one.is_converged and one.inlier_ratio >= _MIN_SEARCHED_RATIO:
            settled.append(one)
    is_proven = share >= _MIN_CONTRAST * max(others, default=0.0)
    return min(settled, key=lambda one: one.cost, default=None) if is_proven else None


def _standing_share(
    points: PreprocessedPoints, target: PreprocessedPoints, motion: Float64
) -> float:
    """Return the share of the points off the ground that a motion brings onto surfaces."""
    standing = replace(
        points, surfaces=points.surfaces[np.abs(points.surfaces[:, 5]) < _MAX_UPRIGHT]
    )
    return share_on_surfaces(standing, target, motion, SURFACE_M)


def _is_another(motion: Float64, other: Float64) -> bool:
    """Return whether two alignments found different motions."""
    between = inverse(motion) @ other
    return length_m(between) > _APART_M or rotation_angle_rad(between) > _APART_RAD


def _starts(guess: Guess) -> list[Float64]:
    """Return motions around a guess, as far as a vehicle may change its motion in the gap."""
    turns_rad = _around(_MANOEUVRE_RAD_S2 * guess.gap_s**2, _START_STEP_RAD)
    ways_m = _around(_MANOEUVRE_M_S2 * guess.gap_s**2, _START_STEP_M)
    return [
        guess.motion @ from_motion_vector(np.array([0, 0, turn_rad, way_m, 0, 0]))
        for turn_rad, way_m in product(turns_rad, ways_m)
    ]


def _around(reach: float, step: float) -> Float64:
    """Return values from minus to plus a reach, in steps from 0."""
    return step * np.arange(-np.ceil(reach / step), np.ceil(reach / step) + 1)
