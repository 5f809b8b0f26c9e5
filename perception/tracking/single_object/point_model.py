"""An object as a point with a box of fixed size around it, followed wherever its points are found.

All that the thesis' trackers share: they differ in how they find the point (`Localizer`) and in what they
remember of its motion.
"""

from dataclasses import dataclass

import numpy as np

from perception.errors import PerceptionError
from perception.geometry import se3
from perception.geometry.box_outline_px import box_outlines_px
from perception.geometry.boxes import transform_boxes
from perception.tracking.single_object.tracker import TrackedObject, TrackerInput, TrackStatus
from perception.types import Boxes3D, Float64


@dataclass(frozen=True)
class PointModel:
    """Where an object is, in the world.

    Attributes:
        position_m: (3,) the point, middle of the box.
        size_m: (3,) of the box in the first frame.
        yaw_rad: heading.
        velocity_m_s: (3,).
    """

    position_m: Float64
    size_m: Float64
    yaw_rad: float
    velocity_m_s: Float64


def check_start_box(box_velo: Boxes3D) -> None:
    """Refuse what is not one finite box of positive size.

    Raises:
        PerceptionError: it is none.
    """
    numbers = np.concatenate([box_velo.bottom_m.ravel(), box_velo.size_m.ravel(), box_velo.yaw_rad])
    if len(box_velo) == 1 and np.isfinite(numbers).all() and (box_velo.size_m > 0).all():
        return
    found = f"{len(box_velo)} boxes"
    if len(box_velo) == 1:
        found = " ".join(f"{number:g}" for number in numbers)
    raise PerceptionError(
        "start box",
        expected="one box of finite x y z, positive length width height, and finite yaw",
        found=found,
    )


def point_model_of(box_velo: Boxes3D, world_SE3_velo: Float64) -> PointModel:
    """Return the model of an object at rest in its first box."""
    box_world = transform_boxes(world_SE3_velo, box_velo)
    position_m = box_world.bottom_m[0] + (0, 0, box_world.size_m[0, 2] / 2)
    return PointModel(position_m, box_world.size_m[0], float(box_world.yaw_rad[0]), np.zeros(3))


def to_tracked_object(
    model: PointModel, tracker_input: TrackerInput, state: TrackStatus
) -> TrackedObject:
    """Say what is known of an object, as every tracker does."""
    velo_SE3_world = se3.inverse(tracker_input.world_SE3_velo)
    bottom_m = model.position_m - (0, 0, model.size_m[2] / 2)
    box_world = Boxes3D(bottom_m[None], model.size_m[None], np.array([model.yaw_rad]))
    box_velo = transform_boxes(velo_SE3_world, box_world)
    velocity_m_s = velo_SE3_world[:2, :3] @ model.velocity_m_s
    return TrackedObject(state, box_velo, velocity_m_s, _box_px(box_velo, tracker_input))


def _box_px(box_velo: Boxes3D, tracker_input: TrackerInput) -> Float64 | None:
    if tracker_input.image is None or tracker_input.image_P_velo is None:
        return None
    height, width = tracker_input.image.shape[:2]
    box_px = box_outlines_px(tracker_input.image_P_velo, box_velo, (width, height))[0]
    return box_px if np.isfinite(box_px).all() else None
