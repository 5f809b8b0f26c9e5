"""Exact track of a scenario's object in every frame, hidden or not."""

import numpy as np

from data.synthetic.scenarios import TARGET_ID, ScenarioDrive
from perception.evaluation.single_object.track import TrueTrack
from perception.types import Boxes3D, Float64

_HIDDEN = 2  # occlusion of what is there and not labelled in the image


def true_track(drive: ScenarioDrive) -> TrueTrack:
    """Return the object in all frames.

    Its rectangle in the image is NaN where so little of it is seen that nobody would label it.
    """
    frames = range(len(drive))
    boxes = [_exact_box(drive, index) for index in frames]
    boxes_px, occlusion = np.full((len(drive), 4), np.nan), np.full(len(drive), _HIDDEN)
    for index in frames:
        seen = drive.labels(index)
        row = np.flatnonzero(seen.track_ids == TARGET_ID)
        if len(row):
            boxes_px[index], occlusion[index] = seen.boxes_px[row[0]], seen.occlusion[row[0]]
    return TrueTrack(
        frames=np.arange(len(drive)),
        stamps_s=np.array([drive.stamp_s(index) for index in frames]),
        boxes_velo=Boxes3D(
            np.concatenate([box.bottom_m for box in boxes]),
            np.concatenate([box.size_m for box in boxes]),
            np.concatenate([box.yaw_rad for box in boxes]),
        ),
        boxes_px=boxes_px,
        velocities_m_s=np.array([_velocity_m_s(drive, index) for index in frames]),
        occlusion=occlusion,
    )


def _exact_box(drive: ScenarioDrive, index: int) -> Boxes3D:
    labels = drive.labels_around(index)
    return labels.boxes_velo[labels.track_ids == TARGET_ID]


def _velocity_m_s(drive: ScenarioDrive, index: int) -> Float64:
    """Return (2,) along x and y of the LiDAR frame."""
    world_m_s = drive.world.actors[TARGET_ID].velocity_m_s(drive.world.road, drive.stamp_s(index))
    # A row vector: times the world's axes in the LiDAR frame.
    return np.asarray((world_m_s @ drive.true_world_SE3_velo(index)[:3, :3])[:2])
