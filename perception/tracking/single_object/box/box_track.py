"""What the box tracker knows of its object from one scan to the next."""

from dataclasses import dataclass, replace

import numpy as np

from perception.tracking.single_object.box.background_model import BackgroundModel
from perception.tracking.single_object.box.local_ground import LocalGround
from perception.tracking.single_object.box.object_motion import POSE, MotionState
from perception.tracking.single_object.box.object_shape import ObjectShape, into_frame
from perception.tracking.single_object.box.observation import ObjectObservation
from perception.tracking.single_object.box.pose_search import (
    PoseEstimate,
    Support,
    support_at,
)
from perception.types import Float64

_LEARNING = 0.1  # share of what is usual that one scan replaces


@dataclass(frozen=True)
class BoxTrack:
    """One object in the world.

    Attributes:
        stamp_s: of the last scan.
        last_seen_s: when it was seen last.
        state: where it is and how it moves.
        ground: below it.
        shape: of its box, and what was seen in it.
        background: what stands around it.
        reference_reward: what its points are worth, times the squared distance.
        reference_top_m: of its highest point over the ground; 0 before any.
    """

    stamp_s: float
    last_seen_s: float
    state: MotionState
    ground: LocalGround
    shape: ObjectShape
    background: BackgroundModel
    reference_reward: float = 0.0
    reference_top_m: float = 0.0

    @property
    def pose(self) -> Float64:
        """(3,) x, y, yaw."""
        return self.state.mean[POSE]

    @property
    def position_world(self) -> Float64:
        """(3,) middle of the bottom."""
        return np.append(self.state.mean[:2], self.ground.z_world_m)

    @property
    def estimate(self) -> PoseEstimate:
        """What the state says of the pose."""
        return PoseEstimate(self.pose, self.state.covariance[POSE, POSE])

    @property
    def is_hidden(self) -> bool:
        """Whether the last scan did not show it."""
        return self.last_seen_s < self.stamp_s

    def reference_reward_in(self, observation: ObjectObservation) -> float:
        """Return what its points should be worth where it is expected."""
        return self.reference_reward / observation.distance_m(self.pose[:2]) ** 2

    def support(self, observation: ObjectObservation, pose: Float64) -> Support:
        """Return what speaks for and against (3,) a pose."""
        return support_at(self.shape, observation, pose)

    def seen(self, observation: ObjectObservation, support: Support) -> "BoxTrack":
        """Return what is known after the object was seen where it is now, with that support."""
        if len(observation) == 0:
            return replace(self, last_seen_s=self.stamp_s)
        reward = support.reward * observation.distance_m(self.pose[:2]) ** 2
        top_m = max(support.top_m - self.ground.z_world_m, 0.0)
        outside_m = self.shape.outside_m(*into_frame(observation.points_xy_m, self.pose).T)
        return replace(
            self,
            last_seen_s=self.stamp_s,
            shape=self.shape.with_observation(observation, self.pose),
            background=self.background.seen(
                observation.points_xy_m[outside_m > self.shape.own_margin_m], is_hidden=False
            ),
            reference_reward=_learned(self.reference_reward, reward),
            reference_top_m=_learned(self.reference_top_m, top_m),
        )

    def missed(self, observation: ObjectObservation) -> "BoxTrack":
        """Return what is known after the object was not seen."""
        background = self.background.seen(observation.points_xy_m, is_hidden=True)
        return replace(self, background=background)


def _learned(reference: float, news: float) -> float:
    return news if reference == 0.0 else reference + _LEARNING * (news - reference)
