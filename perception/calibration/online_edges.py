"""The calibration while driving by the edges of the last two seconds, at little cost.

The work is spread over frames, the motion of images (`online_motion`) in between:

    frame    2      8      14     20     21       26     27
    edges    found  found  found  found  aligned  found  aligned
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from perception.calibration.edge_alignment import EdgeAlignment, prior_loss
from perception.calibration.frame_edges import FrameEdges, SweepTurn, steady_motion
from perception.calibration.offset import UNKNOWN, OffsetEstimate
from perception.geometry.se3 import inverse
from perception.localization.deskew import SweepMotion
from perception.sensor import LidarModel
from perception.types import Bool, Float64, Frame

# Every sixth frame of 19: four frames. What is near looks alike in frames between, which tell little more.
_EVERY, _FIRST, _FRAMES = 6, 2, 4
_ALIGNED = _FIRST + 1  # frame of each six in which they are aligned
_NEWEST = 3  # of these frames
# Half the focal length of the recalibration's images is as good at this accuracy. Narrow maps are enough where the offset is
# about what it was; broad ones lead to it from afar.
_FOCAL_PX, _NARROW_PX, _BROAD_PX = 360.0, 1.25, 2.5
_MIN_EDGES = 400
_MAX_EDGES = 390  # of a frame, spread evenly
# What these frames do not tell stays as it is: a change by half a degree or 5 cm must gain 0.003 of score.
_PRIOR = np.full(6, 0.006)
# Beams that are far apart tell neither pitch nor roll nor height: these are held as they are. At night headlights draw level
# edges of their own, where their light ends: the same are held.
_MAX_BEAM_STEP_RAD = np.radians(1.0)
_HELD = np.array([True, False, True, False, True, False])
_HELD_PRIOR = 10.0
# Below it steps change an estimate by less than a tenth of its deviation.
_TOLERANCE = 1e-5
_MAX_GAP_S = 1.0
_TURNS = tuple(SweepTurn)
# What is tried where edges do not fit: rotations by pitch and yaw together, and shifts to the right and down.
_SEARCH_RAD = np.radians(np.arange(-6.0, 6.5, 1.5))
_SEARCH_M = np.arange(-0.6, 0.7, 0.15)
_MIN_CONTRAST, _MIN_ROLL_CONTRAST = 0.06, 0.03
# Alignments between two searches of a scene that tells nothing, such as a night: 0, 1, 3 and 7.
_MAX_REST = 7
_MEMORY = 0.9  # of earlier scores of the turns, at each alignment
# Information of street scenes on KITTI, in edges times contrast.
_USUAL_INFORMATION = np.array([150.0, 150.0, 120.0])
# Where edges fit, they score 0.40 to 0.50; trees and rails, whose edges the image shows elsewhere, 0.34 to 0.40. The least
# that counts is half as certain as the usual.
_MIN_SCORE, _USUAL_SCORE = 0.39, 0.44
# By how much estimates of drives with a true calibration differ, in usual scenes; tops of objects lie between two beams.
_DEVIATIONS = np.array([*np.radians((0.12, 0.08, 0.165)), 0.024, 0.03, 0.02])
_SHARE_OF_BEAM_STEP = 0.15
_MAX_USUAL = 2.0  # deviations of an offset that is about none


@dataclass(frozen=True)
class EdgeOffset:
    """How far the calibration is off by the edges of the last two seconds.

    Attributes:
        offset: (6,) change of the calibration with which edges fit.
        contrasts: (3,) share of the score that is lost where pitch, yaw or roll is turned by 1.5 degrees.
        edges: Number of edges.
        score: Mean of the image's edges at those of the scan, 0 to 1.
    """

    offset: Float64
    contrasts: Float64
    edges: int
    score: float

    @property
    def contrast(self) -> float:
        """The lower contrast of pitch and yaw."""
        return float(self.contrasts[:2].min())

    @property
    def is_determined(self) -> bool:
        """Whether the edges fit better here than around."""
        return self.contrast >= _MIN_CONTRAST and self.contrasts[2] >= _MIN_ROLL_CONTRAST

    @property
    def uncertainties(self) -> Float64:
        """(6,) how much less certain it is than in a usual street, from 1."""
        information = np.maximum(self.edges * self.contrasts, 1e-9)
        of_turns = np.sqrt(np.maximum(_USUAL_INFORMATION / information, 1.0))
        of_turns *= 1 + np.clip((_USUAL_SCORE - self.score) / (_USUAL_SCORE - _MIN_SCORE), 0, 1)
        # A shift to the right looks like a turn about the axis down, and one down like one about the axis to the right.
        return of_turns[[0, 1, 2, 1, 0, 0]]


class OnlineEdges:
    """Estimates how far the calibration is off by edges, from every sixth frame."""

    def __init__(self, sensor: LidarModel) -> None:
        self._sensor = sensor
        self._is_sparse = sensor.elevation_step_rad > _MAX_BEAM_STEP_RAD
        self._frames: deque[FrameEdges] = deque(maxlen=_FRAMES)
        self._pose: tuple[float, Float64] | None = None
        self._count = 0
        self._turn_scores = dict.fromkeys(_TURNS, 0.0)
        self._determined = np.zeros(6)
        self._failed = self._rest = 0  # searches without success; alignments until the next one
        self._is_due = False

    def estimate_of(self, found: EdgeOffset) -> OffsetEstimate:
        """Return an offset with its deviations."""
        beam_rad = _SHARE_OF_BEAM_STEP * self._sensor.elevation_step_rad
        deviations = np.maximum(_DEVIATIONS, [beam_rad, 0, beam_rad, 0, 0, 0]) * found.uncertainties
        counts = found.is_determined and found.score >= _MIN_SCORE
        return OffsetEstimate(found.offset, np.where(self._held, UNKNOWN, deviations), counts)

    def update(self, frame: Frame, world_SE3_velo: Float64) -> OffsetEstimate | None:
        """Take in a frame as of `OnlineCalibration`; return the estimate where there is a new one."""
        before, self._pose = self._pose, (frame.stamp_s, world_SE3_velo)
        self._count += 1
        phase = self._count % _EVERY
        if phase == _FIRST and frame.image is not None and frame.calibration is not None:
            motion = None if before is None else self._motion(frame, world_SE3_velo, *before)
            self._take_in(FrameEdges.of(frame, self._sensor, motion, _FOCAL_PX).thinned(_MAX_EDGES))
        elif phase == _ALIGNED and self._is_due:
            self._is_due = False
            return self.estimate_of(self._align())
        return None

    def gain(self, offset: Float64) -> float:
        """Return by how much edges score better with a (6,) offset than with none."""
        alignment = EdgeAlignment(self._frames, self._turn)
        with_offset, without = (
            alignment.score(one, _NARROW_PX).value for one in (offset, np.zeros(6))
        )
        return with_offset - without

    def _take_in(self, newest: FrameEdges) -> None:
        """Add the edges of a frame, and note whether they shall be aligned."""
        newest.image.smoothed(_NARROW_PX)  # now, not in the frame in which they are aligned
        self._frames.append(newest)
        edges = sum(len(one.scan) for one in self._frames)
        self._is_due = len(self._frames) == _FRAMES and edges >= _MIN_EDGES

    def _motion(
        self, frame: Frame, world_SE3_velo: Float64, before_s: float, world_SE3_before: Float64
    ) -> SweepMotion | None:
        """Return the motion of the LiDAR since the frame before, None across a gap."""
        gap_s = frame.stamp_s - before_s
        if not 0 < gap_s <= _MAX_GAP_S:
            return None
        return steady_motion(inverse(world_SE3_velo) @ world_SE3_before, -gap_s, self._sensor)

    @property
    def is_night(self) -> bool:
        """Whether much of an image was dark of late."""
        return any(one.is_night for one in self._frames)

    @property
    def _turn(self) -> SweepTurn:
        """Direction of the sweep with which edges have fitted best."""
        return max(self._turn_scores, key=lambda one: self._turn_scores[one])

    @property
    def _prior(self) -> Float64:
        return np.where(self._held, _HELD_PRIOR, _PRIOR)

    @property
    def _held(self) -> Bool:
        """Which of the (6,) changes stay as they are, as neither beams nor light tell them."""
        return _HELD if self._is_sparse or self.is_night else np.zeros_like(_HELD)

    def _align(self) -> EdgeOffset:
        turn = self._turn
        alignments = {one: EdgeAlignment(self._frames, one) for one in _TURNS}
        alignment = alignments[turn]
        found = self._estimate(alignment, self._determined, (_NARROW_PX,))
        if (np.abs(found.offset) > _MAX_USUAL * _DEVIATIONS).any():
            # Narrow maps may have led to edges beside: what broad ones lead to from no offset, where it fits better.
            broad = self._estimate(alignment, np.zeros(6), (_BROAD_PX, _NARROW_PX))
            found = max(
                found, broad, key=lambda one: one.score - prior_loss(one.offset, self._prior)
            )
        if not found.is_determined and self._rest:
            self._rest -= 1
        elif not found.is_determined:
            # The calibration may have changed meanwhile: what the newest frames alone tell.
            newest = EdgeAlignment(list(self._frames)[-_NEWEST:], turn)
            found = max(found, self._far(alignment), key=lambda one: one.contrast)
            if not found.is_determined:
                found = max(found, self._far(newest), key=lambda one: one.contrast)
            self._rest = min(2**self._failed - 1, _MAX_REST)
            self._failed += 1
        if found.is_determined:
            self._determined, self._failed, self._rest = found.offset, 0, 0
        for one in _TURNS:
            score = alignments[one].score(found.offset, _NARROW_PX).value
            self._turn_scores[one] = _MEMORY * self._turn_scores[one] + score
        return found

    def _estimate(
        self, alignment: EdgeAlignment, start: Float64, smoothings_px: Sequence[float]
    ) -> EdgeOffset:
        offset = alignment.align(start, smoothings_px, self._prior, _TOLERANCE)
        contrasts = np.ones(3)  # of axes that are held
        axes = np.flatnonzero(~self._held[:3])
        contrasts[axes] = alignment.contrasts(offset, axes, _NARROW_PX)
        score = alignment.score(offset, _NARROW_PX).value
        return EdgeOffset(offset, contrasts, alignment.edges, score)

    def _far(self, alignment: EdgeAlignment) -> EdgeOffset:
        """Estimate an offset of any size, from the best of many rotations and shifts."""
        pitches, downs = (np.zeros(1),) * 2 if self._held[0] else (_SEARCH_RAD, _SEARCH_M)
        tried = [np.array([pitch, yaw, 0, 0, 0, 0]) for pitch in pitches for yaw in _SEARCH_RAD]
        tried += [np.array([0, 0, 0, right, 0, 0]) for right in _SEARCH_M]
        tried += [np.array([0, 0, 0, 0, down, 0]) for down in downs]
        start = max(tried, key=lambda offset: alignment.score(offset, 2 * _BROAD_PX).value)
        return self._estimate(alignment, start, (_BROAD_PX, _NARROW_PX))
