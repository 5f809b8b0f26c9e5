"""The thesis' fusion tracker, H-Fus: LiDAR and camera each find the object, a filter fuses both (5.3)."""

from dataclasses import dataclass, field

import numpy as np

from perception.sensor import LidarModel
from perception.tracking.single_object.centroid_tracker import (
    CentroidTracker,
    CentroidTrackerConfig,
    PointMotionConfig,
)
from perception.tracking.single_object.constant_acceleration import (
    ConstantAcceleration,
    NoiseLevels,
)
from perception.tracking.single_object.fusion.back_projection import back_project
from perception.tracking.single_object.fusion.color_localizer import ColorLocalizer
from perception.tracking.single_object.localizer import LocalizerInput, ObjectLocalizer
from perception.tracking.single_object.mean_shift_3d import MeanShiftConfig, mean_shift_3d
from perception.tracking.single_object.window import Window
from perception.types import Float64


@dataclass(frozen=True)
class FusedLocalizerConfig:
    """How two places become one, (5.15) and (5.16).

    Noise and variances are those of the author's later trials, which trust the scan more. With his first
    ones, 1, 5 and 5, the fused point lags behind what speeds up.

    Attributes:
        mean_shift_3d: the mean shift in the scan.
        noise: of the state, which moves as (5.17) has it.
        lidar_variance: of a place found in the scan, in m².
        image_variance: of a place found in the image.
        search: size of the area whose points tell how far away a place in the image is, in boxes.
    """

    mean_shift_3d: MeanShiftConfig = field(default_factory=MeanShiftConfig)  # Table 7.5
    noise: NoiseLevels = field(default_factory=lambda: NoiseLevels(process=3.0, first=1.0))
    lidar_variance: float = 1.0
    image_variance: float = 3.0
    search: float = 2.0  # author's code


@dataclass(frozen=True)
class FusionTrackerConfig:
    """Every value of the fusion tracker, beside those of the images: `color_model`, `image_mean_shift`.

    Attributes:
        point: shared by all trackers of a point.
        fusion: how LiDAR and image become one.
        motion: how the fused point moves.
    """

    point: CentroidTrackerConfig = field(default_factory=CentroidTrackerConfig)
    fusion: FusedLocalizerConfig = field(default_factory=FusedLocalizerConfig)
    motion: PointMotionConfig = field(default_factory=PointMotionConfig)


class FusedLocalizer(ObjectLocalizer):
    """Finds an object in scan and image, each on its own, and fuses both places."""

    def __init__(self, config: FusedLocalizerConfig) -> None:
        self._config = config
        self._point = ConstantAcceleration.at_rest(np.zeros(3), config.noise)
        self.colors = ColorLocalizer()

    def init(self, localizer_input: LocalizerInput) -> Float64 | None:
        """Learn the object in its first box."""
        self.colors = ColorLocalizer()
        seen = bounding_middle(localizer_input.obstacles.points_world, localizer_input.window)
        position = localizer_input.window.position_m if seen is None else seen
        self.reset(position)
        self._learn(localizer_input, localizer_input.window, position)
        return seen

    def locate(self, localizer_input: LocalizerInput) -> Float64 | None:
        """Fuse what is found within the gate; alone, each of both is enough."""
        config = self._config
        self._point = self._point.predicted(localizer_input.elapsed_s, config.noise)
        seen = (
            (self._in_scan(localizer_input), config.lidar_variance),
            (self._in_image(localizer_input), config.image_variance),
        )
        positions = [position for position, _ in seen if _is_in_gate(position, localizer_input)]
        variances = [
            variance for position, variance in seen if _is_in_gate(position, localizer_input)
        ]
        if not positions:
            return None
        self._point = self._point.corrected(np.array(positions), np.array(variances))
        self._learn(
            localizer_input,
            localizer_input.window.moved(self._point.position),
            self._point.position,
        )
        return self._point.position

    def reset(self, position_m: Float64) -> None:
        """Let the fused point rest."""
        self._point = ConstantAcceleration.at_rest(position_m, self._config.noise)

    def _in_scan(self, localizer_input: LocalizerInput) -> Float64 | None:
        shifted = mean_shift_3d(
            localizer_input.obstacles.points_world,
            localizer_input.window,
            self._config.mean_shift_3d,
        )
        return (
            None
            if shifted is None
            else bounding_middle(localizer_input.obstacles.points_world, shifted)
        )

    def _in_image(self, localizer_input: LocalizerInput) -> Float64 | None:
        center_px = self.colors.locate(
            localizer_input.tracker_input, localizer_input.window.position_m
        )
        if center_px is None or localizer_input.tracker_input.image_P_velo is None:
            return None
        near = localizer_input.window.scaled(self._config.search).contains(
            localizer_input.obstacles.points_world
        )
        position_velo = back_project(
            center_px,
            localizer_input.obstacles.points_velo[near],
            localizer_input.tracker_input.image_P_velo,
        )
        if position_velo is None:
            return None
        return np.asarray(
            (localizer_input.tracker_input.world_SE3_velo @ np.append(position_velo, 1.0))[:3]
        )

    def _learn(self, localizer_input: LocalizerInput, window: Window, position: Float64) -> None:
        inside = window.contains(localizer_input.obstacles.points_world)
        self.colors.learn(
            localizer_input.tracker_input, localizer_input.obstacles.points_velo[inside], position
        )


def _is_in_gate(position: Float64 | None, localizer_input: LocalizerInput) -> bool:
    return position is not None and bool(localizer_input.gate.contains(position[None])[0])


def bounding_middle(points_world: Float64, window: Window) -> Float64 | None:
    """Return (3,) the middle of the points over a window: their mean, but halfway up; None without points.

    Window panes return little, and the ground's removal takes the foot: the mean height depends on both.
    """
    inside = points_world[window.contains(points_world)]
    if len(inside) == 0:
        return None
    low_m, high_m = inside[:, 2].min(), inside[:, 2].max()
    return np.append(inside[:, :2].mean(axis=0), (low_m + high_m) / 2)


class FusionTracker(CentroidTracker):
    """H-Fus; implements `SingleObjectTracker`. Where there is no camera, the LiDAR alone finds the object."""

    def __init__(self, sensor: LidarModel, config: FusionTrackerConfig | None = None) -> None:
        config = config or FusionTrackerConfig()
        self._fused = FusedLocalizer(config.fusion)
        super().__init__(self._fused, sensor, config.point, config.motion)

    @property
    def colors(self) -> ColorLocalizer:
        """What it knows of the object's looks."""
        return self._fused.colors
