"""The default tracker of one object: its box, fitted scan by scan to the points that it explains.

1. Motion says where the box should be: along its heading, as fast and as curved as before.
2. The points above the ground there are compared with the object's shape: the sides of its box that
   face the sensor, and what was seen of it so far.
3. What is left possible corrects the motion. Where too few points speak for the object it is
   predicted, the search widens, and a place is taken only if the shape fits it.
"""

import logging
from dataclasses import dataclass, replace

import numpy as np

from perception.errors import PerceptionError
from perception.geometry.se3 import inverse
from perception.tracking.single_object import turning_motion as motion
from perception.tracking.single_object.ground_below import (
    GroundBelow,
    lowest_around_m,
    stage_height_m,
)
from perception.tracking.single_object.object_shape import ObjectShape, ShapeRules
from perception.tracking.single_object.pose_search import (
    PoseBelief,
    SearchRules,
    Sight,
    into_frame,
    reward_at,
    search,
)
from perception.tracking.single_object.surroundings import Surroundings
from perception.tracking.single_object.tracker import FollowedObject, FollowState, Moment
from perception.tracking.single_object.turning_motion import MovingState, TurningRules
from perception.types import Boxes3D, Float64

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class FollowRules:
    """When an object is seen, and what belongs to it.

    Attributes:
        clearance_m: points so near the ground may be ground.
        headroom_m: points so far above the box are not the object's.
        thin_m: points are averaged by cells of this edge.
        own_margin_m: what lies farther outside the box is something else.
        known_weight: of a point where something else stood a moment ago.
        least_reward: of the points at the best pose, each worth up to 1, to be seen.
        least_share: of the reward that the object used to have at this distance.
        lost_after_s: without being seen.
        vehicle_m: length and width from which an object is a vehicle.
        walker_length_m: shorter objects walk.
    """

    clearance_m: float = 0.2
    headroom_m: float = 0.3
    thin_m: float = 0.1
    own_margin_m: float = 0.4
    known_weight: float = 0.1
    least_reward: float = 1.2
    least_share: float = 0.1
    lost_after_s: float = 3.0
    vehicle_m: tuple[float, float] = (2.4, 1.2)
    walker_length_m: float = 1.3


@dataclass(frozen=True)
class _Followed:
    """What is known of the object after a moment."""

    stamp_s: float
    seen_s: float
    state: MovingState
    ground: GroundBelow
    rise_m: float
    shape: ObjectShape
    surroundings: Surroundings
    usual_reward: float
    answer_state: FollowState


class BoxFollower:
    """Follows one object by fitting its box to the points above the ground; needs no camera."""

    def __init__(
        self,
        rules: FollowRules | None = None,
        shape_rules: ShapeRules | None = None,
        search_rules: SearchRules | None = None,
    ) -> None:
        self._rules = rules or FollowRules()
        self._shape_rules = shape_rules or ShapeRules()
        self._search_rules = search_rules or SearchRules()
        self._followed: _Followed | None = None

    def start(self, moment: Moment, box_velo: Boxes3D) -> FollowedObject:
        """Begin with the box; forget any object before."""
        _check_box(box_velo)
        size_m = box_velo.size_m[0].astype(np.float64)
        self._motion = self._kind(size_m)
        world = moment.world_SE3_velo
        bottom = world[:3, :3] @ box_velo.bottom_m[0] + world[:3, 3]
        yaw = box_velo.yaw_rad[0] + np.arctan2(world[1, 0], world[0, 0])
        state = motion.begin(np.array([*bottom[:2], yaw]), np.array([0.1, 0.1, 0.08]), self._motion)
        shape = ObjectShape.of_box(size_m, self._shape_rules)
        self._followed = _Followed(
            moment.stamp_s,
            moment.stamp_s,
            state,
            GroundBelow(bottom[2], 0.05**2),
            0.0,
            shape,
            Surroundings(),
            0.0,
            FollowState.SEEN,
        )
        self._followed = self._remember(self._followed, self._sight(moment, self._followed, 4.0))
        return self._answer(moment)

    def follow(self, moment: Moment) -> FollowedObject:
        """Say where the object is at the next moment."""
        before = self._followed
        if before is None:
            raise PerceptionError("BoxFollower", expected="start before follow", found="no object")
        elapsed_s = moment.stamp_s - before.stamp_s
        if elapsed_s <= 0:
            return self._answer(moment)
        size_m = before.shape.size_m
        state = motion.predict(before.state, elapsed_s, size_m[0], self._motion)
        way_m = abs(before.state.mean[3]) * elapsed_s
        followed = replace(
            before, stamp_s=moment.stamp_s, state=state, ground=before.ground.moved(way_m)
        )
        followed = self._with_ground(moment, followed)
        reach_m = 2.5 * np.sqrt(np.linalg.eigvalsh(state.covariance[:2, :2])[-1]) + 0.3
        sight = self._sight(moment, followed, float(np.clip(reach_m, 3.0, 6.0)))
        least = max(self._rules.least_reward, self._rules.least_share * sight.usual_reward)
        belief = None
        if len(sight.weights):
            priors = self._priors(before, state)
            belief = search(followed.shape, sight, priors, self._search_rules)
            if reward_at(followed.shape, sight, belief.pose) < least:
                belief = None
        if belief is not None:
            state = motion.correct(state, belief.pose, belief.covariance)
            state = motion.facing_its_way(state, self._motion, 0.4)
            followed = replace(
                followed, state=state, seen_s=moment.stamp_s, answer_state=FollowState.SEEN
            )
            followed = self._remember(followed, sight)
        else:
            hidden_s = moment.stamp_s - followed.seen_s
            is_lost = hidden_s > self._rules.lost_after_s
            followed = replace(
                followed, answer_state=FollowState.LOST if is_lost else FollowState.PREDICTED
            )
        self._followed = followed
        return self._answer(moment)

    def _priors(self, before: _Followed, now: MovingState) -> tuple[PoseBelief, ...]:
        """Return where the object is expected: further on, or where it was if it may stand."""
        expected = PoseBelief(now.mean[:3], now.covariance[:3, :3])
        was = before.state
        if abs(was.mean[3]) > 2 * np.sqrt(was.covariance[3, 3]):
            return (expected,)
        spread = was.covariance[:3, :3] + np.diag([0.02, 0.02, 0.02]) ** 2
        return expected, PoseBelief(was.mean[:3], spread)

    def _kind(self, size_m: Float64) -> TurningRules:
        if size_m[0] >= self._rules.vehicle_m[0] and size_m[1] >= self._rules.vehicle_m[1]:
            return motion.VEHICLE
        return motion.WALKER if size_m[0] < self._rules.walker_length_m else motion.TWO_WHEELER

    def _around(self, moment: Moment, followed: _Followed, reach_m: float) -> Float64:
        """Return the points around the object in the world."""
        velo = inverse(moment.world_SE3_velo)
        center = np.array([*followed.state.mean[:2], followed.ground.z_world_m])
        x, y = (velo[:3, :3] @ center + velo[:3, 3])[:2]
        points = moment.points_velo
        near = (np.abs(points[:, 0] - np.float32(x)) < reach_m) & (
            np.abs(points[:, 1] - np.float32(y)) < reach_m
        )
        world = moment.world_SE3_velo
        return points[np.flatnonzero(near), :3].astype(np.float64) @ world[:3, :3].T + world[:3, 3]

    def _with_ground(self, moment: Moment, followed: _Followed) -> _Followed:
        size_m = followed.shape.size_m
        around = self._around(moment, followed, float(size_m[0] / 2 + 2.5))
        ground = followed.ground
        local_m = lowest_around_m(around, ground.z_world_m, 0.4)
        center = np.array([*followed.state.mean[:2], ground.z_world_m])
        velo = inverse(moment.world_SE3_velo)
        center_velo = velo[:3, :3] @ center + velo[:3, 3]
        lift = ground.z_world_m - center_velo[2]
        stage_m = stage_height_m(
            moment.ground, center_velo, None if local_m is None else local_m - lift, 0.2
        )
        if stage_m is not None:
            ground = ground.measured(stage_m + lift, 0.05)
        elif local_m is not None:
            ground = ground.measured(local_m - 0.03, 0.15)
        return replace(followed, ground=ground)

    def _sight(self, moment: Moment, followed: _Followed, reach_m: float) -> Sight:
        """Return what is seen above the ground around the object."""
        size_m = followed.shape.size_m
        around = self._around(moment, followed, float(np.hypot(*size_m[:2]) / 2 + 0.6 + reach_m))
        above_m = around[:, 2] - followed.ground.z_world_m
        keep = (above_m > self._rules.clearance_m) & (above_m < size_m[2] + self._rules.headroom_m)
        sensor = moment.world_SE3_velo[:2, 3]
        usual = followed.usual_reward / _squared_distance(sensor, followed.state.mean[:2])
        points, weights = _thinned(around[keep, :2], self._rules.thin_m)
        is_known = followed.surroundings.hold(points)
        weights = np.where(is_known, self._rules.known_weight * weights, weights)
        return Sight(points, weights, sensor, usual)

    def _remember(self, followed: _Followed, sight: Sight) -> _Followed:
        if not len(sight.weights):
            return followed
        pose, shape = followed.state.mean[:3], followed.shape
        u, v = into_frame(sight.points_xy_m, pose).T
        inside = (np.abs(u) < shape.size_m[0] / 2 + 0.1) & (np.abs(v) < shape.size_m[1] / 2 + 0.1)
        reward = reward_at(shape, sight, pose) * _squared_distance(sight.sensor_xy_m, pose[:2])
        usual = followed.usual_reward
        usual = reward if usual == 0 else usual + 0.1 * (reward - usual)
        outside_m = np.maximum(np.abs(u) - shape.size_m[0] / 2, np.abs(v) - shape.size_m[1] / 2)
        others = sight.points_xy_m[outside_m > self._rules.own_margin_m]
        return replace(
            followed,
            shape=shape.remembering(u[inside], v[inside], sight.weights[inside]),
            usual_reward=float(usual),
            surroundings=followed.surroundings.seen(others),
        )

    def _answer(self, moment: Moment) -> FollowedObject:
        followed = self._followed
        assert followed is not None
        velo = inverse(moment.world_SE3_velo)
        turn = np.arctan2(velo[1, 0], velo[0, 0])
        bottom = np.array([*followed.state.mean[:2], followed.ground.z_world_m + followed.rise_m])
        box = Boxes3D(
            (velo[:3, :3] @ bottom + velo[:3, 3])[None],
            followed.shape.size_m[None],
            np.array([followed.state.mean[2] + turn]),
        )
        velocity = velo[:2, :2] @ followed.state.velocity_world_m_s
        return FollowedObject(followed.answer_state, box, velocity, None)


def _squared_distance(sensor_xy_m: Float64, xy_m: Float64) -> float:
    """Return the squared distance, by which the points of an object get fewer."""
    return max(float(((sensor_xy_m - xy_m) ** 2).sum()), 25.0)


def _thinned(points_xy_m: Float64, cell_m: float) -> tuple[Float64, Float64]:
    """Average (N, 2) points by cells; a cell weighs more the more points it holds."""
    if not len(points_xy_m):
        return points_xy_m, np.zeros(0)
    cells = np.floor(points_xy_m / cell_m).astype(np.int64)
    cells -= cells.min(axis=0)
    keys = cells[:, 0] * (cells[:, 1].max() + 1) + cells[:, 1]
    _, which, counts = np.unique(keys, return_inverse=True, return_counts=True)
    means = np.column_stack([np.bincount(which, column) / counts for column in points_xy_m.T])
    return means, np.sqrt(np.minimum(counts, 4.0)) / 2


def _check_box(box_velo: Boxes3D) -> None:
    if len(box_velo) != 1:
        raise PerceptionError("start box", expected="one box", found=str(len(box_velo)))
    numbers = np.concatenate([box_velo.bottom_m[0], box_velo.size_m[0], box_velo.yaw_rad])
    if not (np.isfinite(numbers).all() and (box_velo.size_m > 0).all()):
        raise PerceptionError(
            "start box", expected="finite numbers and a positive size", found=str(box_velo)
        )
