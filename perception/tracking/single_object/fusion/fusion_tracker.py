"""The thesis' fusion tracker, H-Fus: LiDAR and camera each locate the object, a Kalman filter fuses both (5.3)."""

import numpy as np

from perception.sensor import LidarModel
from perception.tracking.single_object.centroid_tracker import CentroidTracker
from perception.tracking.single_object.config import CentroidTrackerConfig, FusionTrackerConfig
from perception.tracking.single_object.fusion.back_projection import back_project
from perception.tracking.single_object.fusion.color_localizer import ColorLocalizer
from perception.tracking.single_object.localizer import LocalizerInput, ObjectLocalizer
from perception.tracking.single_object.point_motion import ConstantAcceleration
from perception.tracking.single_object.window import Window
from perception.types import Float64


class FusedLocalizer(ObjectLocalizer):
    """Locates an object in scan and image independently, and fuses both positions."""

    def __init__(self, config: FusionTrackerConfig) -> None:
        self._config = config
        self._point = ConstantAcceleration.at_rest(np.zeros(3), config.initial)
        self.colors = ColorLocalizer(config.colors, config.image)

    def init(self, localizer_input: LocalizerInput) -> Float64 | None:
        """Learn the object in its initial box."""
        self.colors = ColorLocalizer(self._config.colors, self._config.image)
        measured = localizer_input.obstacles.centroid(localizer_input.window)
        position = localizer_input.window.position_m if measured is None else measured
        self.reset(position)
        self._learn(localizer_input, localizer_input.window, position)
        return measured

    def locate(self, localizer_input: LocalizerInput) -> Float64 | None:
        """Fuse the positions within the gate; either one is enough."""
        config, self.region = self._config, None
        self._point = self._point.predicted(localizer_input.elapsed_s, config.process)
        measured = (
            (self.shift(localizer_input, config.points), config.lidar_variance),
            (self._in_image(localizer_input), config.image_variance),
        )
        in_gate = [
            (position, variance)
            for position, variance in measured
            if position is not None and bool(localizer_input.gate.contains(position[None])[0])
        ]
        if not in_gate:
            return None
        positions, variances = zip(*in_gate, strict=True)
        self._point = self._point.corrected(np.array(positions), np.array(variances))
        window = localizer_input.window.moved(self._point.position)
        self._learn(localizer_input, window, self._point.position)
        return self._point.position

    def reset(self, position_m: Float64) -> None:
        """Put the fused point at rest."""
        self.region = None
        self._point = ConstantAcceleration.at_rest(position_m, self._config.initial)

    def _in_image(self, localizer_input: LocalizerInput) -> Float64 | None:
        tracker_input, obstacles = localizer_input.tracker_input, localizer_input.obstacles
        center_px = self.colors.locate(tracker_input, localizer_input.window.position_m)
        if center_px is None or tracker_input.image_P_velo is None:
            return None
        depth_window = localizer_input.window.scaled(self._config.depth_window)
        near = depth_window.contains(obstacles.points_world)
        position_velo = back_project(
            center_px, obstacles.points_velo[near], tracker_input.image_P_velo
        )
        if position_velo is None:
            return None
        return np.asarray((tracker_input.world_SE3_velo @ np.append(position_velo, 1.0))[:3])

    def _learn(self, localizer_input: LocalizerInput, window: Window, position: Float64) -> None:
        obstacles = localizer_input.obstacles
        points_velo = obstacles.points_velo[window.contains(obstacles.points_world)]
        self.region = self.colors.learn(localizer_input.tracker_input, points_velo, position)


class FusionTracker(CentroidTracker):
    """H-Fus, a `SingleObjectTracker`. Without a camera, the LiDAR alone locates the object."""

    def __init__(
        self,
        sensor: LidarModel,
        config: FusionTrackerConfig | None = None,
        point: CentroidTrackerConfig | None = None,
    ) -> None:
        """Create a tracker without an object.

        Args:
            sensor: LiDAR model.
            config: Mean shifts, colour model and fusion.
            point: Tracking loop.
        """
        localizer = FusedLocalizer(config or FusionTrackerConfig())
        super().__init__(localizer, sensor, point)
        self._fused = localizer

    @property
    def colors(self) -> ColorLocalizer:
        """The object's colours and outline in the image."""
        return self._fused.colors
