"""Interface of every tracker of one object: the initial box in, one box a frame out."""

from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol, Self

import numpy as np

from perception.errors import PerceptionError
from perception.geometry import se3
from perception.geometry.boxes import transform_boxes
from perception.geometry.camera import box_outlines_px
from perception.tracking.single_object.image_region import ImageRegion
from perception.types import Boxes3D, Float32, Float64, GroundModel, UInt8


class TrackStatus(StrEnum):
    """Evidence for a tracked object's box."""

    SEEN = "seen"  # measured in this frame
    PREDICTED = "predicted"  # occluded or missed for a short time
    LOST = "lost"  # occluded or missed for too long; the box is the last estimate


@dataclass(frozen=True)
class TrackerInput:
    """Input of a tracker of one object, one frame.

    Attributes:
        stamp_s: Time of the scan.
        points_velo: (N, 4) points without the returns of the vehicle itself.
        world_SE3_velo: (4, 4) pose of the scan.
        ground: Ground model of the ground stage, or None without that stage.
        image: (H, W, 3) RGB image, or None without a camera or for a missing image.
        image_P_velo: (3, 4) projection from the LiDAR frame to pixels, or None without a camera.
    """

    stamp_s: float
    points_velo: Float32
    world_SE3_velo: Float64
    ground: GroundModel | None = None
    image: UInt8 | None = None
    image_P_velo: Float64 | None = None

    def points_near(self, position_world: Float64, reach_m: float) -> Float32:
        """Return the (N, 3) points in the LiDAR frame within a square around (3,) a position in the world."""
        velo_SE3_world = se3.inverse(self.world_SE3_velo)
        x, y, _ = velo_SE3_world[:3, :3] @ position_world + velo_SE3_world[:3, 3]
        # One column, then the other of the remaining points: a third of the time of both over all points.
        near = np.flatnonzero(np.abs(self.points_velo[:, 0] - np.float32(x)) < reach_m)
        near = near[np.abs(self.points_velo[near, 1] - np.float32(y)) < reach_m]
        return self.points_velo[near, :3]

    def in_world(self, points_velo: Float32) -> Float64:
        """Return (N, 3) points in the world."""
        rotation, origin_m = self.world_SE3_velo[:3, :3], self.world_SE3_velo[:3, 3]
        return np.asarray(points_velo.astype(np.float64) @ rotation.T + origin_m)

    def box_px(self, box_velo: Boxes3D) -> Float64 | None:
        """Return the (4,) outline of one box in the image, or None where the image does not show it."""
        if self.image is None or self.image_P_velo is None:
            return None
        height, width = self.image.shape[:2]
        box_px = box_outlines_px(self.image_P_velo, box_velo, (width, height))[0]
        return box_px if np.isfinite(box_px).all() else None


@dataclass(frozen=True)
class TrackedObject:
    """Estimate of the object in one frame; never NaN.

    Attributes:
        status: Evidence for the estimate.
        box_velo: One box in the LiDAR frame of the scan, or None of a tracker in the image alone.
        velocity_m_s: (2,) velocity over the ground along x and y of the LiDAR frame; zero where not estimated.
        box_px: (4,) x1 y1 x2 y2 of the object in the image, or None where it is not in the image.
        next_bottom_velo: (3,) predicted centre of the bottom face one scan later, in the LiDAR frame of this
            scan; None of a lost object, and of a tracker in the image alone.
        region: Object's pixels in the image and the ring around them, or None of a tracker without a colour
            model, and where the object is not measured in the image.
    """

    status: TrackStatus
    box_velo: Boxes3D | None
    velocity_m_s: Float64
    box_px: Float64 | None
    next_bottom_velo: Float64 | None = None
    region: ImageRegion | None = None

    def __post_init__(self) -> None:
        """Validate that there is at most one box."""
        if self.box_velo is not None and len(self.box_velo) != 1:
            raise PerceptionError(
                "TrackedObject.box_velo", expected="one box", found=f"{len(self.box_velo)}"
            )


class SingleObjectTracker(Protocol):
    """Tracks one object through a drive."""

    def init(self, tracker_input: TrackerInput, box_velo: Boxes3D) -> TrackedObject:
        """Initialize the tracker with the object's box, in the LiDAR frame of the input.

        Raises:
            PerceptionError: The box is not one finite box of positive size, or the tracker lacks a required
                input, as an image tracker without an image.
        """
        ...

    def update(self, tracker_input: TrackerInput) -> TrackedObject:
        """Track the object into the next frame.

        Raises:
            PerceptionError: The tracker has not been initialized.
        """
        ...


@dataclass(frozen=True)
class WorldBox:
    """Box and velocity of an object in the world.

    Attributes:
        position_m: (3,) middle of the box.
        size_m: (3,) length, width and height.
        yaw_rad: Heading.
        velocity_m_s: (3,) velocity.
        next_position_m: (3,) predicted middle of the box one scan later, or None.
    """

    position_m: Float64
    size_m: Float64
    yaw_rad: float
    velocity_m_s: Float64
    next_position_m: Float64 | None = None

    @classmethod
    def at_rest(cls, box_velo: Boxes3D, world_SE3_velo: Float64) -> Self:
        """Return a box of the LiDAR frame at rest in the world."""
        box_world = transform_boxes(world_SE3_velo, box_velo)
        position_m = box_world.bottom_m[0] + (0, 0, box_world.size_m[0, 2] / 2)
        return cls(position_m, box_world.size_m[0], float(box_world.yaw_rad[0]), np.zeros(3))

    def observed_in(self, tracker_input: TrackerInput, status: TrackStatus) -> TrackedObject:
        """Return the object in the LiDAR frame and the image of a frame."""
        velo_SE3_world = se3.inverse(tracker_input.world_SE3_velo)
        half_height_m = np.array([0, 0, self.size_m[2] / 2])
        bottom_m = self.position_m - half_height_m
        box_world = Boxes3D(bottom_m[None], self.size_m[None], np.array([self.yaw_rad]))
        box_velo = transform_boxes(velo_SE3_world, box_world)
        velocity_m_s = velo_SE3_world[:2, :3] @ self.velocity_m_s
        next_bottom_velo = None
        if self.next_position_m is not None:
            next_bottom_m = self.next_position_m - half_height_m
            next_bottom_velo = (velo_SE3_world @ np.append(next_bottom_m, 1.0))[:3]
        box_px = tracker_input.box_px(box_velo)
        return TrackedObject(status, box_velo, velocity_m_s, box_px, next_bottom_velo)


def validate_initial_box(box_velo: Boxes3D) -> None:
    """Validate that there is one finite box of positive size.

    Raises:
        PerceptionError: There is not.
    """
    numbers = np.concatenate([box_velo.bottom_m.ravel(), box_velo.size_m.ravel(), box_velo.yaw_rad])
    if len(box_velo) == 1 and np.isfinite(numbers).all() and (box_velo.size_m > 0).all():
        return
    found = f"{len(box_velo)} boxes"
    if len(box_velo) == 1:
        found = " ".join(f"{number:g}" for number in numbers)
    raise PerceptionError(
        "initial box",
        expected="one box of finite x y z, positive length width height, and finite yaw",
        found=found,
    )


def not_initialized(tracker: str) -> PerceptionError:
    """Return the error of a tracker that is updated before it has been initialized."""
    return PerceptionError(tracker, expected="a call of init before update", found="no object")
