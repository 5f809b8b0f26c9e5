"""State of the box-fit tracker between two scans."""

from dataclasses import dataclass, replace

import numpy as np

from perception.tracking.single_object.box.environment import BackgroundModel, LocalGround
from perception.tracking.single_object.box.object_motion import POSE, KinematicState
from perception.tracking.single_object.box.object_shape import ObjectShape, into_frame
from perception.tracking.single_object.box.observation import ObjectObservation
from perception.tracking.single_object.box.pose_search import PoseEstimate, Support
from perception.types import Float64

_LEARNING_RATE = 0.1  # gain of a correction of the expected reward and height


@dataclass(frozen=True)
class BoxTrack:
    """Track of one object in the world.

    Attributes:
        stamp_s: Time of the last scan.
        last_seen_s: Time of the last observation.
        state: Pose and motion.
        ground: Ground below the object.
        shape: Box and past observations.
        background: Background around the object.
        mean_reward: Mean reward of the object's points, times the squared distance.
        mean_top_m: Mean height of the highest point above the ground; 0 before the first observation.
    """

    stamp_s: float
    last_seen_s: float
    state: KinematicState
    ground: LocalGround
    shape: ObjectShape
    background: BackgroundModel
    mean_reward: float = 0.0
    mean_top_m: float = 0.0

    @property
    def pose(self) -> Float64:
        """(3,) x, y, yaw."""
        return self.state.mean[POSE]

    @property
    def position_world(self) -> Float64:
        """(3,) bottom centre."""
        return np.append(self.state.mean[:2], self.ground.z_world_m)

    @property
    def estimate(self) -> PoseEstimate:
        """Pose and its covariance."""
        return PoseEstimate(self.pose, self.state.covariance[POSE, POSE])

    @property
    def is_hidden(self) -> bool:
        """Whether the last scan did not show the object."""
        return self.last_seen_s < self.stamp_s

    def expected_reward(self, observation: ObjectObservation) -> float:
        """Return the expected reward of the object's points at its distance."""
        return self.mean_reward / observation.distance_m(self.pose[:2]) ** 2

    def seen(self, observation: ObjectObservation, support: Support) -> "BoxTrack":
        """Return the track after an observation at its present pose."""
        if len(observation) == 0:
            return replace(self, last_seen_s=self.stamp_s)
        reward = support.reward * observation.distance_m(self.pose[:2]) ** 2
        top_m = max(support.top_m - self.ground.z_world_m, 0.0)
        outside_m = self.shape.outside_m(*into_frame(observation.points_xy_m, self.pose).T)
        return replace(
            self,
            last_seen_s=self.stamp_s,
            shape=self.shape.with_observation(observation, self.pose),
            background=self.background.updated(
                observation.points_xy_m[outside_m > self.shape.own_margin_m], is_hidden=False
            ),
            mean_reward=_learned(self.mean_reward, reward),
            mean_top_m=_learned(self.mean_top_m, top_m),
        )

    def missed(self, observation: ObjectObservation) -> "BoxTrack":
        """Return the track after a scan that does not show the object."""
        background = self.background.updated(observation.points_xy_m, is_hidden=True)
        return replace(self, background=background)


def _learned(mean: float, value: float) -> float:
    return value if mean == 0.0 else mean + _LEARNING_RATE * (value - mean)
