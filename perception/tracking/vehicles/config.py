"""Configuration of the tracker of detected vehicles."""

from dataclasses import dataclass


@dataclass(frozen=True)
class VehicleTrackerConfig:
    """Tracker of detected vehicles, in the image and on the ground.

    Attributes:
        min_existence: Minimum existence of a detection that is located in the scan and may continue a track.
        new_track_existence: Minimum existence of a detection that may begin a track.
        min_confirmed_evidence: Minimum log-odds of the existence of a confirmed track; one detection of an existence of
            0.82 is enough.
        max_unseen_unconfirmed_s: Time without a detection after which a frame that misses an unconfirmed track deletes it.
        max_unseen_s: Time without a detection after which a frame that misses a confirmed track deletes it.
    """

    min_existence: float = 0.2
    new_track_existence: float = 0.5
    min_confirmed_evidence: float = 1.5
    max_unseen_unconfirmed_s: float = 0.15
    max_unseen_s: float = 1.4
