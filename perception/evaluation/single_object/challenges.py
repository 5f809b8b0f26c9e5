"""Challenges of tracking an object, from its labels: the flags of Table A.1, which were not published.

Table 3.2 states the same factors for eight sequences in words. The limits agree with all eight of its entries on
occlusion and on pose, with seven on relative velocity, and with six on distance, where the table calls 7.5 m to 22 m
near, and 6.3 m to 14 m near to middle.
"""

from dataclasses import astuple, dataclass
from enum import StrEnum

import numpy as np

from perception.evaluation.single_object.track import TrueTrack
from perception.types import Float64

_SECOND_S = 1.0 - 1e-3  # stamps a second apart differ by rounding


class Challenge(StrEnum):
    """Challenges by the abbreviations of the thesis, in the order of the fields of `Variations`."""

    OCC = "OCC"  # occlusion
    POS = "POS"  # object pose relative to the vehicle varies
    DIS = "DIS"  # distance varies
    RVL = "RVL"  # relative velocity varies


CHALLENGE_DESCRIPTIONS = {
    "OCC": "labelled partly or largely occluded, or not at all, in occluded_share of its frames",
    "POS": "its heading in the LiDAR frame covers turn_deg",
    "DIS": "its greatest distance over the ground is distance_ratio times its smallest",
    "RVL": "its radial speed, over one second each, covers speed_change_m_s",
}


@dataclass(frozen=True)
class Variations:
    """Variation of an object from its first frame to its last; the defaults are the limits of the challenges.

    Attributes:
        occluded_share: Share of the frames in which the object is occluded or not labelled.
        turn_deg: Angle between its outermost headings in the LiDAR frame, in degrees.
        distance_ratio: Ratio of its greatest to its smallest distance.
        speed_change_m_s: Difference between its greatest and its smallest radial speed in m/s; 0 for less than a second.
    """

    occluded_share: float = 0.1
    turn_deg: float = 50.0
    distance_ratio: float = 2.0
    speed_change_m_s: float = 3.0

    def challenges(self, limits: "Variations | None" = None) -> tuple[Challenge, ...]:
        """Return the challenges whose limit is reached."""
        pairs = zip(Challenge, astuple(self), astuple(limits or Variations()), strict=True)
        return tuple(challenge for challenge, value, limit in pairs if value >= limit)


def variations(track: TrueTrack) -> Variations:
    """Measure the variation of an object with at least one labelled frame."""
    span = track.frames[-1] - track.frames[0] + 1
    visible = np.count_nonzero((track.occlusion == 0) | (track.occlusion == 3))
    distances_m = np.hypot(*track.boxes_velo.bottom_m[:, :2].T)
    return Variations(
        occluded_share=float((span - visible) / span),
        turn_deg=float(np.degrees(np.ptp(np.unwrap(track.boxes_velo.yaw_rad)))),
        distance_ratio=float(distances_m.max() / max(distances_m.min(), 1e-3)),
        speed_change_m_s=_speed_change_m_s(track.stamps_s, distances_m),
    )


def _speed_change_m_s(stamps_s: Float64, distances_m: Float64) -> float:
    """Compare each frame with the first that is a second later, so that jitter of boxes is not speed."""
    later = np.searchsorted(stamps_s, stamps_s + _SECOND_S)
    earlier = np.flatnonzero(later < len(stamps_s))
    later = later[earlier]
    if len(earlier) == 0:
        return 0.0
    elapsed_s = stamps_s[later] - stamps_s[earlier]
    return float(np.ptp((distances_m[later] - distances_m[earlier]) / elapsed_s))
