"""Past positions of tracks, of one tracked object and of the vehicle, remembered in the world frame."""

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from perception.geometry import se3
from perception.tracking.single_object.tracker import TrackedObject, TrackStatus
from perception.types import Float64, Result

KM_H = 3.6  # km/h of 1 m/s

# Displacements between frames above these are no motion of a vehicle: the poses have been reset.
_FASTEST_M_S = 100.0
_JUMP_M = 5.0
_STEP_M = 0.6  # minimum distance of two positions of a path


class Trails:
    """Paths of all live tracks over the last seconds, in the world frame.

    A track that has ended is forgotten, and everything is when time runs backwards or the vehicle jumps, since ids
    and poses have been reset then.
    """

    def __init__(self, duration_s: float = 4.0) -> None:
        """Start without paths.

        Args:
            duration_s: Length of a path in seconds.
        """
        self._duration_s = duration_s
        self._newest: Result | None = None
        self._paths: dict[int, list[tuple[float, Float64]]] = {}

    def add(self, result: Result) -> None:
        """Add the positions of the tracks of the next frame."""
        if self._newest is not None and _is_reset(self._newest, result):
            self._paths = {}
        self._newest = result
        now_s = result.frame.stamp_s
        since_s = now_s - self._duration_s
        bottoms_world = _transform(result.world_SE3_velo, result.tracks.boxes.bottom_m)
        paths = {}
        for track, bottom_world in zip(result.tracks.ids.tolist(), bottoms_world, strict=True):
            path = [point for point in self._paths.get(track, []) if point[0] >= since_s]
            if not path or np.linalg.norm(bottom_world - path[-1][1]) >= _STEP_M:
                path.append((now_s, bottom_world))
            paths[track] = path
        self._paths = paths

    def paths_velo(self, result: Result) -> list[Float64]:
        """Return the (K, 3) path of each track in the LiDAR frame, the oldest position first.

        Each ends at the current bottom centre of the track's box.
        """
        velo_SE3_world = se3.inverse(result.world_SE3_velo)
        return [
            np.vstack(
                [_transform(velo_SE3_world, _points(self._paths.get(track, []))), bottom_velo]
            )
            for track, bottom_velo in zip(
                result.tracks.ids.tolist(), result.tracks.boxes.bottom_m, strict=True
            )
        ]


@dataclass
class TrackedObjectTrail:
    """Paths of one tracked object and of the vehicle in the world frame, and the object's speed and status.

    Attributes:
        speeds_km_h: Speed in km/h of each frame, NaN without a box.
        states: Tracking status of each frame.
    """

    speeds_km_h: list[float] = field(default_factory=list)
    states: list[TrackStatus] = field(default_factory=list)
    _path_world: list[Float64] = field(default_factory=list)
    _ego_path_world: list[Float64] = field(default_factory=list)

    def add(self, result: Result, tracked: TrackedObject) -> None:
        """Add one frame."""
        world_SE3_velo = result.world_SE3_velo
        ground_velo = [0.0, 0.0, float(result.ground.height_m(np.zeros((1, 2)))[0])]
        self._ego_path_world.append(_transform(world_SE3_velo, np.array([ground_velo]))[0])
        self.states.append(tracked.status)
        box = tracked.box_velo
        has_position = box is not None and tracked.status is not TrackStatus.LOST
        speed_m_s = float(np.hypot(*tracked.velocity_m_s))
        self.speeds_km_h.append(KM_H * speed_m_s if has_position else float("nan"))
        if box is not None and has_position:
            self._path_world.append(_transform(world_SE3_velo, box.bottom_m)[0])

    def path_velo(self, result: Result) -> Float64:
        """Return the (K, 3) path of the object in the LiDAR frame of a result."""
        return _to_velo(result, self._path_world)

    def ego_path_velo(self, result: Result) -> Float64:
        """Return the (E, 3) path of the vehicle on the ground in the LiDAR frame of a result."""
        return _to_velo(result, self._ego_path_world)


def _to_velo(result: Result, points_world: list[Float64]) -> Float64:
    return _transform(se3.inverse(result.world_SE3_velo), np.array(points_world).reshape(-1, 3))


def _points(path: Iterable[tuple[float, Float64]]) -> Float64:
    return np.array([point for _, point in path]).reshape(-1, 3)


def _is_reset(before: Result, after: Result) -> bool:
    """Return whether time runs backwards or the vehicle jumps."""
    passed_s = after.frame.stamp_s - before.frame.stamp_s
    travelled_m = float(np.linalg.norm((after.world_SE3_velo - before.world_SE3_velo)[:3, 3]))
    return passed_s < 0 or travelled_m > _JUMP_M + _FASTEST_M_S * passed_s


def _transform(dst_SE3_src: Float64, points_src: Float64) -> Float64:
    """Transform (K, 3) points in double precision, which world coordinates need."""
    return np.asarray(points_src @ dst_SE3_src[:3, :3].T + dst_SE3_src[:3, 3])
