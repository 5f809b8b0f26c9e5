"""Past positions and headings of objects and of the vehicle, remembered in the world frame."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from perception.geometry import se3
from perception.render import palette
from perception.render.scene import Scene, SceneObjects
from perception.tracking.single_object.tracker import TrackedObject, TrackStatus
from perception.types import Boxes3D, Float64, Result

KM_H = 3.6  # km/h of 1 m/s

# Displacements between frames above these are no motion of a vehicle: the poses have been reset.
_FASTEST_M_S = 100.0
_JUMP_M = 5.0
_STEP_M = 0.6  # minimum distance of two positions of a path
_COURSE_M = 1.5  # distance that an object has travelled before its course is known
_EGO_SPEED_S = 0.5  # time over which the speed of the vehicle is measured


@dataclass
class _Memory:
    """What is remembered of one object, in the world frame.

    Attributes:
        color: Number of its colour.
        path: Times and positions, the oldest first, the newest at most a step away.
        newest_s: Time of the last frame with the object.
        heading_rad: Heading of its front, NaN before the object has moved.
    """

    color: int
    path: list[tuple[float, Float64]] = field(default_factory=list)
    newest_s: float = 0.0
    heading_rad: float = float("nan")

    def add(self, stamp_s: float, bottom_world: Float64, since_s: float) -> None:
        """Add a position, and forget those before a time."""
        self.path = [point for point in self.path if point[0] >= since_s]
        steps_m = np.diff([*(point for _, point in self.path[-2:]), bottom_world], axis=0)
        if len(steps_m) and np.linalg.norm(steps_m[-1]) < _STEP_M:
            return
        if len(steps_m) > 1 and steps_m[0] @ steps_m[1] < 0:
            # Nothing turns back at speed: the positions before were wrong, as those of a box half in view.
            self.path = self.path[-1:]
        self.path.append((stamp_s, bottom_world))

    def turn_to_course(self, bottom_world: Float64, velocity_rad: float) -> bool:
        """Take the direction from the last position at some distance as heading; return whether there is one.

        A course against the velocity is none. One against the heading makes both unknown: either the object turned,
        or its id went to another one.
        """
        for _, point in reversed(self.path):
            x_m, y_m = (bottom_world - point)[:2].tolist()
            if np.hypot(x_m, y_m) >= _COURSE_M:
                course_rad = float(np.arctan2(y_m, x_m))
                if np.cos(course_rad - velocity_rad) < 0:
                    return False
                if np.cos(course_rad - self.heading_rad) < 0:
                    self.path, self.heading_rad = [(self.newest_s, bottom_world)], float("nan")
                    return False
                self.heading_rad = course_rad
                return True
        return False


class SceneHistory:
    """Colours, paths, headings and speeds of what is drawn, from frame to frame.

    The front of a box is the side that faces the object's course, and stays at that side while the object stands:
    which side a box calls its front may change from scan to scan. An object is forgotten after the duration of a
    path, and everything is when time runs backwards or the vehicle jumps, since ids and poses have been reset then.
    """

    def __init__(self, duration_s: float = 4.0) -> None:
        """Start without objects.

        Args:
            duration_s: Length of a path in seconds; 0 for frames of no sequence.
        """
        self._duration_s = duration_s
        self._newest: Result | None = None
        self._memories: dict[int, _Memory] = {}
        self._ego_path: list[tuple[float, Float64]] = []

    def update(self, result: Result, objects: SceneObjects) -> Scene:
        """Return the scene of the next frame.

        Args:
            result: Output of the pipeline.
            objects: (T) objects that are drawn.
        """
        self._forget(result)
        bottoms_world = _transform(result.odom_SE3_velo, objects.boxes.bottom_m)
        velocities_rad = _yaw_rad(result.odom_SE3_velo) + np.arctan2(
            *objects.velocities_m_s.T[::-1]
        )
        is_moving, colors = np.zeros(len(objects), bool), objects.colors.copy()
        headings_rad = np.full(len(objects), np.nan)
        paths: list[Float64] = [np.zeros((0, 3))] * len(objects)
        for row in np.flatnonzero(objects.ids >= 0).tolist():
            memory = self._remember(int(objects.ids[row]))
            colors[row] = memory.color
            if np.isfinite(bottoms_world[row]).all():
                velocity_rad = velocities_rad[row] if objects.is_moving[row] else None
                is_moving[row] = self._observe(memory, bottoms_world[row], velocity_rad)
                headings_rad[row] = memory.heading_rad
                path_world = [*(point for _, point in memory.path), bottoms_world[row]]
                paths[row] = _to_velo(result, path_world)
        boxes, headings_rad = _turn_fronts(objects.boxes, headings_rad, result.odom_SE3_velo)
        for track, heading_rad in zip(objects.ids.tolist(), headings_rad.tolist(), strict=True):
            if np.isfinite(heading_rad):
                self._memories[track].heading_rad = heading_rad
        has_front = np.isfinite(headings_rad)
        seen = replace(
            objects, boxes=boxes, is_moving=is_moving, has_front=has_front, colors=colors
        )
        return Scene(result, seen, paths, self._ego_speed_m_s(result))

    def _forget(self, result: Result) -> None:
        """Forget what is too old, and everything where ids and poses have been reset."""
        if self._newest is not None and _is_reset(self._newest, result):
            self._memories, self._ego_path = {}, []
        self._newest = result
        since_s = self._now_s - self._duration_s
        memories = self._memories.items()
        self._memories = {track: each for track, each in memories if each.newest_s >= since_s}

    def _remember(self, track: int) -> _Memory:
        """Return the memory of an object; a new one gets the colour that the fewest others have."""
        if track not in self._memories:
            colors = [memory.color for memory in self._memories.values()]
            color = min(range(len(palette.TRACKS)), key=colors.count)
            self._memories[track] = _Memory(color)
        self._memories[track].newest_s = self._now_s
        return self._memories[track]

    def _observe(self, memory: _Memory, bottom_world: Float64, velocity_rad: float | None) -> bool:
        """Add the position of an object; return whether it moves, at a known course.

        Args:
            memory: What is remembered of the object.
            bottom_world: (3,) position in the world frame.
            velocity_rad: Direction of its velocity in the world frame, or None of a standing object.
        """
        # A standing object has no path: its box wanders as other sides of it come into view.
        duration_s = 0.0 if velocity_rad is None else self._duration_s
        memory.add(self._now_s, bottom_world, self._now_s - duration_s)
        return velocity_rad is not None and memory.turn_to_course(bottom_world, velocity_rad)

    @property
    def _now_s(self) -> float:
        return 0.0 if self._newest is None else self._newest.frame.stamp_s

    def _ego_speed_m_s(self, result: Result) -> float:
        """Return the speed of the vehicle over the last moments, NaN in the first frame."""
        now_s, position_world = self._now_s, result.odom_SE3_velo[:3, 3]
        window_s = min(_EGO_SPEED_S, self._duration_s) + 1e-6
        self._ego_path = [point for point in self._ego_path if now_s - point[0] <= window_s]
        self._ego_path.append((now_s, position_world))
        since_s, start_world = self._ego_path[0]
        travelled_m = float(np.linalg.norm(position_world - start_world))
        return travelled_m / (now_s - since_s) if now_s > since_s else float("nan")


def _turn_fronts(
    boxes: Boxes3D, headings_rad: Float64, world_SE3_velo: Float64
) -> tuple[Boxes3D, Float64]:
    """Make that side of each box its front which faces a heading; the box stays where it is.

    Args:
        boxes: (T) boxes in the LiDAR frame.
        headings_rad: (T,) headings in the world frame, NaN where unknown.
        world_SE3_velo: (4, 4) pose of the LiDAR.

    Returns:
        (T) boxes, and their (T,) headings in the world frame, NaN where unknown.
    """
    turn_rad = _yaw_rad(world_SE3_velo)
    is_known = np.isfinite(headings_rad)
    quarters = np.rint((headings_rad - turn_rad - boxes.yaw_rad) / (np.pi / 2))
    quarters = np.where(is_known, quarters, 0.0)
    size_m = boxes.size_m.copy()
    is_across = quarters % 2 == 1
    size_m[is_across, :2] = size_m[is_across, 1::-1]
    yaw_rad = boxes.yaw_rad + quarters * np.pi / 2
    turned = replace(boxes, size_m=size_m, yaw_rad=yaw_rad)
    return turned, np.where(is_known, yaw_rad + turn_rad, np.nan)


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
        world_SE3_velo = result.odom_SE3_velo
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


def _to_velo(result: Result, points_world: Sequence[Float64] | Float64) -> Float64:
    return _transform(se3.inverse(result.odom_SE3_velo), np.array(points_world).reshape(-1, 3))


def _yaw_rad(world_SE3_velo: Float64) -> float:
    return float(np.arctan2(world_SE3_velo[1, 0], world_SE3_velo[0, 0]))


def _is_reset(before: Result, after: Result) -> bool:
    """Return whether time runs backwards or the vehicle jumps."""
    passed_s = after.frame.stamp_s - before.frame.stamp_s
    travelled_m = float(np.linalg.norm((after.odom_SE3_velo - before.odom_SE3_velo)[:3, 3]))
    return passed_s < 0 or travelled_m > _JUMP_M + _FASTEST_M_S * passed_s


def _transform(dst_SE3_src: Float64, points_src: Float64) -> Float64:
    """Transform (K, 3) points in double precision, which world coordinates need."""
    return np.asarray(points_src @ dst_SE3_src[:3, :3].T + dst_SE3_src[:3, 3])
