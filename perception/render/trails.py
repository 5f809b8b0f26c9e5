"""Where tracks were: the memory of whoever makes pictures of a drive."""

from collections.abc import Iterable

import numpy as np

from perception.geometry import se3
from perception.types import Float64, Result

# Faster than this no vehicle goes: poses that leap so far belong to another world.
_FASTEST_M_S = 100.0
_LEAP_M = 5.0
# A thing that has moved less has not left its place.
_STEP_M = 0.6


class Trails:
    """The ways of all live tracks over the last seconds, kept in the world.

    A track that is no longer given is forgotten. So is everything when time runs backwards or the vehicle
    leaps, for then ids and poses have begun anew.
    """

    def __init__(self, duration_s: float = 4.0) -> None:
        self._duration_s = duration_s
        self._newest: Result | None = None
        self._paths: dict[int, list[tuple[float, Float64]]] = {}

    def add(self, result: Result) -> None:
        """Remember where the tracks of the next frame are."""
        if self._newest is not None and _is_reset(self._newest, result):
            self._paths = {}
        self._newest = result
        now_s = result.frame.stamp_s
        since_s = now_s - self._duration_s
        bottoms_world = _moved(result.world_SE3_velo, result.tracks.boxes.bottom_m)
        paths = {}
        for track, bottom_world in zip(result.tracks.ids.tolist(), bottoms_world, strict=True):
            path = [place for place in self._paths.get(track, []) if place[0] >= since_s]
            if not path or np.linalg.norm(bottom_world - path[-1][1]) >= _STEP_M:
                path.append((now_s, bottom_world))
            paths[track] = path
        self._paths = paths

    def paths_velo(self, result: Result) -> list[Float64]:
        """Return the (K, 3) path of each track, oldest place first, in the LiDAR frame of a result.

        Each ends where the track's box stands now.
        """
        velo_SE3_world = se3.inverse(result.world_SE3_velo)
        return [
            np.vstack([_moved(velo_SE3_world, _places(self._paths.get(track, []))), bottom_velo])
            for track, bottom_velo in zip(
                result.tracks.ids.tolist(), result.tracks.boxes.bottom_m, strict=True
            )
        ]


def _places(path: Iterable[tuple[float, Float64]]) -> Float64:
    return np.array([place for _, place in path]).reshape(-1, 3)


def _is_reset(before: Result, after: Result) -> bool:
    """Tell whether time runs backwards, or the vehicle has leapt."""
    passed_s = after.frame.stamp_s - before.frame.stamp_s
    travelled_m = float(np.linalg.norm((after.world_SE3_velo - before.world_SE3_velo)[:3, 3]))
    return passed_s < 0 or travelled_m > _LEAP_M + _FASTEST_M_S * passed_s


def _moved(dst_SE3_src: Float64, points_src: Float64) -> Float64:
    """Move (K, 3) points in double precision, as coordinates of a world need it."""
    return np.asarray(points_src @ dst_SE3_src[:3, :3].T + dst_SE3_src[:3, 3])
