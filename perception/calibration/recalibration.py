"""The calibration with which the edges of scans lie best on those of images, how sure it is, and when it cannot be told."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from perception.calibration.edge_alignment import SMOOTHINGS_PX, EdgeAlignment
from perception.calibration.frame_edges import FrameEdges, SweepTurn
from perception.calibration.motion_alignment import refine_by_motion
from perception.calibration.offset import OffsetEstimate
from perception.calibration.surface_corners import CornerTracks
from perception.errors import CalibrationError
from perception.geometry.se3 import from_motion_vector, motion_vector
from perception.sensor import LidarModel
from perception.types import Float64

# Rotations that are tried: pitch and yaw of the camera, and its roll.
_SEARCH_DEG = (np.arange(-3.0, 3.5), np.arange(-3.0, 3.5), np.arange(-2.0, 2.5, 2.0))
_STARTS = 4  # the best of them, from which edges are aligned
_MIN_EDGES = 300
_MAX_DEVIATION_RAD = np.radians(0.15)
# Edges on top lie anywhere between two beams: what their mean is off by, as a share of the angle between them.
_SHARE_OF_BEAM_STEP = 0.2
# What edges are off by beside it, as the scenes of one drive are alike.
_SCENES = np.array([*np.radians([0.08, 0.05, 0.08]), 0.015, 0.015, 0.02])
_MIN_CONTRAST = 0.12  # of the turns about the camera's first two axes


@dataclass(frozen=True)
class Recalibration:
    """A calibration that was found, and how sure it is.

    Attributes:
        cam_SE3_velo: (4, 4) LiDAR to rectified reference camera.
        offset: (6,) change of the calibration that the frames came with: rotation vector in rad, translation in m,
            along the axes of the camera.
        covariance: (6, 6) covariance of the offset.
        given_score: Score of the calibration that the frames came with: how strong the image's edges are at those of
            the scan, 0 to 1.
        score: Score of the calibration that was found.
        contrast: Share of the score that is lost where the calibration is turned by 1.5 degrees.
        turn: Direction in which the LiDAR turns, where that lays the edges better.
        frames: Number of frames.
        edges: Number of edges in all scans.
    """

    cam_SE3_velo: Float64
    offset: Float64
    covariance: Float64
    given_score: float
    score: float
    contrast: float
    turn: SweepTurn
    frames: int
    edges: int

    @property
    def rotation_deg(self) -> Float64:
        """(3,) rotation about the camera's axes in degrees: pitch, yaw, roll."""
        return np.degrees(self.offset[:3])

    @property
    def translation_m(self) -> Float64:
        """(3,) translation along the camera's axes in metres: right, down, ahead."""
        return self.offset[3:]

    @property
    def deviations(self) -> Float64:
        """(6,) standard deviations of the offset in rad and metres."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))


def recalibrate(
    frames: Sequence[FrameEdges],
    sensor: LidarModel,
    source: str = "calibration",
    tracks: Sequence[CornerTracks] = (),
) -> Recalibration:
    """Find the calibration of frames that came with one calibration.

    Args:
        frames: Edges of each frame, whose images have one size.
        sensor: LiDAR model.
        source: File of the calibration, for error messages.
        tracks: Corners of some frames that were tracked into later ones, in a drive.

    Raises:
        CalibrationError: The scenes do not determine the calibration.
    """
    edges = sum(len(frame.scan) for frame in frames)
    if edges < _MIN_EDGES:
        raise CalibrationError(
            source,
            expected=f"at least {_MIN_EDGES} edges of near objects in the scans, to find the calibration",
            found=f"{edges} in {len(frames)} frames",
            advice="take frames of a street with parked cars, poles or houses",
        )
    best, turn = _align(frames)
    alignment = EdgeAlignment(frames, turn)
    covariance = alignment.covariance(best)
    beam_rad = _SHARE_OF_BEAM_STEP * sensor.elevation_step_rad
    covariance[range(3), range(3)] += np.array([beam_rad, 0.0, beam_rad]) ** 2
    if tracks:
        deviations = np.sqrt(np.diag(covariance) + np.square(_SCENES))
        refined = refine_by_motion(tracks, OffsetEstimate(best, deviations)).estimate
        best, covariance = refined.offset, np.diag(np.square(refined.deviations))
    score = alignment.score(best, SMOOTHINGS_PX[-1]).value
    contrasts = alignment.contrasts(best, (0, 1), SMOOTHINGS_PX[-1])
    found = Recalibration(
        from_motion_vector(best) @ frames[0].cam_SE3_velo,
        motion_vector(from_motion_vector(best)),
        covariance,
        alignment.score(np.zeros(6), SMOOTHINGS_PX[-1]).value,
        score,
        float(contrasts.min()),
        turn,
        len(frames),
        edges,
    )
    _require_determined(found, source)
    return found


def _align(frames: Sequence[FrameEdges]) -> tuple[Float64, SweepTurn]:
    """Return the best offset and the turn of the LiDAR with which it is so good."""
    alignment = EdgeAlignment(frames)
    starts = [np.zeros(6), *_search(alignment)]
    offsets = [alignment.align(start) for start in starts]
    by_turn = {SweepTurn.NONE: max(offsets, key=lambda one: _score(alignment, one))}
    scores = {SweepTurn.NONE: _score(alignment, by_turn[SweepTurn.NONE])}
    if any(frame.motion is not None for frame in frames):
        for turn in (SweepTurn.CLOCKWISE, SweepTurn.COUNTER_CLOCKWISE):
            turned = EdgeAlignment(frames, turn)
            by_turn[turn] = turned.align(by_turn[SweepTurn.NONE], SMOOTHINGS_PX[1:])
            scores[turn] = _score(turned, by_turn[turn])
    best = max(scores, key=lambda turn: scores[turn])
    return by_turn[best], best


def _search(alignment: EdgeAlignment) -> list[Float64]:
    """Return the rotations around with the best scores of broad maps, the best first."""
    tried = [np.radians([*angles, 0.0, 0.0, 0.0]) for angles in product(*_SEARCH_DEG)]
    scores = [alignment.score(offset, SMOOTHINGS_PX[0]).value for offset in tried]
    return [tried[index] for index in np.argsort(scores)[::-1][:_STARTS]]


def _score(alignment: EdgeAlignment, offset: Float64) -> float:
    return alignment.score(offset, SMOOTHINGS_PX[-1]).value


def _require_determined(found: Recalibration, source: str) -> None:
    deviation_rad = float(found.deviations[:3].max())
    if found.contrast < _MIN_CONTRAST:
        reason = f"{100 * found.contrast:.0f} %"
        expected = (
            f"a calibration at which edges of scan and image lie on each other better by {100 * _MIN_CONTRAST:.0f} % "
            "than turned by 1.5 degrees"
        )
    elif deviation_rad > _MAX_DEVIATION_RAD:
        reason = f"{np.degrees(deviation_rad):.2f} degrees"
        expected = (
            f"a calibration that the scenes determine to {np.degrees(_MAX_DEVIATION_RAD):.2f} degrees "
            "(standard deviation)"
        )
    else:
        return
    raise CalibrationError(
        source,
        expected=expected,
        found=reason,
        advice="take more frames, of streets with near objects on all sides of the image, in daylight",
    )
