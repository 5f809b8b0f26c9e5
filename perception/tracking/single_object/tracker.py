"""What every tracker of one object offers: the first box in, one box a frame out."""

from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

from perception.errors import PerceptionError
from perception.types import Boxes3D, Float32, Float64, GroundModel, UInt8


class TrackStatus(StrEnum):
    """What an answer rests on."""

    SEEN = "seen"  # measured in this frame
    PREDICTED = "predicted"  # hidden or missed for a short while
    LOST = "lost"  # hidden or missed for too long; the answer is the last guess


@dataclass(frozen=True)
class TrackerInput:
    """What a tracker of one object is shown of one frame.

    Attributes:
        stamp_s: time of the scan.
        points_velo: (N, 4) without the vehicle's own returns; none where the scan is empty.
        world_SE3_velo: (4, 4) pose of the scan.
        ground: of the obstacle stage, or None where no stage has run.
        image: (H, W, 3) RGB, or None without a camera or where the image is missing.
        image_P_velo: (3, 4) projection from the LiDAR frame to pixels, or None without a camera.
    """

    stamp_s: float
    points_velo: Float32
    world_SE3_velo: Float64
    ground: GroundModel | None = None
    image: UInt8 | None = None
    image_P_velo: Float64 | None = None


@dataclass(frozen=True)
class TrackedObject:
    """Where the object is, as far as its tracker can say; never NaN.

    Attributes:
        state: what this answer rests on.
        box_velo: one box in the LiDAR frame of the scan, or None of a tracker in the image alone.
        velocity_m_s: (2,) over the ground, along x and y of the LiDAR frame; zero where not estimated.
        box_px: (4,) x1 y1 x2 y2 of the object in the image, or None where it is not in the image.
    """

    state: TrackStatus
    box_velo: Boxes3D | None
    velocity_m_s: Float64
    box_px: Float64 | None

    def __post_init__(self) -> None:
        """Refuse more than one box."""
        if self.box_velo is not None and len(self.box_velo) != 1:
            raise PerceptionError(
                "TrackedObject.box_velo", expected="one box", found=f"{len(self.box_velo)}"
            )


class SingleObjectTracker(Protocol):
    """Follows one object through a drive."""

    def start(self, tracker_input: TrackerInput, box_velo: Boxes3D) -> TrackedObject:
        """Begin with the object's box in the LiDAR frame of this moment; forget any object before.

        Raises:
            PerceptionError: the box is not one finite box of positive size, or the tracker lacks what it
                cannot do without, as an image tracker without an image.
        """
        ...

    def update(self, tracker_input: TrackerInput) -> TrackedObject:
        """Say where the object is at the next moment."""
        ...
