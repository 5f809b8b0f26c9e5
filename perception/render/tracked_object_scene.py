"""One followed object at one moment, and the memory of where it was: what pictures of it show."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from perception.geometry import se3
from perception.tracking.single_object.fusion.image_region import ImageRegion
from perception.tracking.single_object.tracker import TrackedObject, TrackStatus
from perception.types import Boxes3D, Float64, Result

KM_H = 3.6  # metres a second


@dataclass(frozen=True)
class TrackedObjectScene:
    """What is known of one object at one moment, in the LiDAR frame of the scan.

    Attributes:
        result: pose and ground of the frame.
        tracked: what the tracker says.
        path_velo: (K, 3) where the object was, oldest first.
        ego_path_velo: (E, 3) where the vehicle stood on the ground, oldest first.
        speeds_km_h: (F,) of each frame up to this one; NaN where there was no box.
        states: (F,) of the same frames.
        seconds: that the tracker took.
        region: where the tracker sees the object in the image, or None of one that does not look there.
        truth: one labelled box, or None where it is not known.
    """

    result: Result
    tracked: TrackedObject
    path_velo: Float64
    ego_path_velo: Float64
    speeds_km_h: Sequence[float]
    states: Sequence[TrackStatus]
    seconds: float
    region: ImageRegion | None = None
    truth: Boxes3D | None = None


@dataclass
class TrackedObjectTrail:
    """Remembers, in the world, where a followed object and the vehicle were.

    Attributes:
        speeds_km_h: one a frame; NaN where there was no box.
        states: one a frame.
    """

    speeds_km_h: list[float] = field(default_factory=list)
    states: list[TrackStatus] = field(default_factory=list)
    _path_world: list[Float64] = field(default_factory=list)
    _ego_path_world: list[Float64] = field(default_factory=list)

    def add(self, result: Result, tracked: TrackedObject) -> None:
        """Remember one frame more."""
        world_SE3_velo = result.world_SE3_velo
        under = [0.0, 0.0, float(result.ground.height_m(np.zeros((1, 2)))[0])]
        self._ego_path_world.append(_moved(world_SE3_velo, np.array([under]))[0])
        self.states.append(tracked.state)
        box = tracked.box_velo
        has_place = box is not None and tracked.state is not TrackStatus.LOST
        speed_m_s = float(np.hypot(*tracked.velocity_m_s))
        self.speeds_km_h.append(KM_H * speed_m_s if has_place else float("nan"))
        if box is not None and has_place:
            self._path_world.append(_moved(world_SE3_velo, box.bottom_m)[0])

    def path_velo(self, result: Result) -> Float64:
        """Return (K, 3) where the object was, in the LiDAR frame of a result."""
        return _moved(se3.inverse(result.world_SE3_velo), np.array(self._path_world).reshape(-1, 3))

    def ego_path_velo(self, result: Result) -> Float64:
        """Return (E, 3) where the vehicle stood, in the LiDAR frame of a result."""
        places = np.array(self._ego_path_world).reshape(-1, 3)
        return _moved(se3.inverse(result.world_SE3_velo), places)


def _moved(dst_SE3_src: Float64, points_src: Float64) -> Float64:
    """Move (K, 3) points in double precision, as coordinates of a world need it."""
    return np.asarray(points_src @ dst_SE3_src[:3, :3].T + dst_SE3_src[:3, 3])
