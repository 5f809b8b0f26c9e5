"""The thesis' fusion tracker, H-Fus: LiDAR and camera each locate the object, a Kalman filter fuses both (5.3)."""

import numpy as np

from perception.geometry.camera import project
from perception.sensor import LidarModel
from perception.tracking.single_object.centroid_tracker import CentroidTracker
from perception.tracking.single_object.config import CentroidTrackerConfig, FusionTrackerConfig
from perception.tracking.single_object.fusion.color_localizer import ColorLocalizer
from perception.tracking.single_object.localizer import LocalizerInput, ObjectLocalizer, Window
from perception.tracking.single_object.point_motion import ConstantAcceleration
from perception.types import Float, Float64


def back_project(center_px: Float64, points_velo: Float, image_P_velo: Float64) -> Float64 | None:
    """Return (3,) the position in the LiDAR frame of a pixel.

    It is the bilinear mean of the nearest point in each of the four quadrants around the pixel: of the upper
    two and of the lower two at the pixel's column, then of both at its row. With fewer quadrants, their points
    have equal weights.

    Args:
        center_px: (2,) column and row.
        points_velo: (N, 3+) points of the object and near it.
        image_P_velo: (3, 4) projection from the LiDAR frame to pixels.

    Returns:
        None where no point is in front of the camera.
    """
    pixels, _ = project(image_P_velo, points_velo)
    in_front = np.isfinite(pixels).all(axis=1)
    away_px = pixels[in_front] - center_px
    corners = [_nearest_of(quadrant, away_px) for quadrant in _quadrants(away_px)]
    found = [corner for corner in corners if corner is not None]
    if not found:
        return None
    weights = _bilinear(away_px[found]) if len(found) == 4 else np.full(len(found), 1 / len(found))
    return np.asarray(weights @ points_velo[in_front][found, :3].astype(np.float64))


def _quadrants(away_px: Float64) -> list[np.ndarray]:
    """Return the points to the upper left, upper right, lower left and lower right; axes belong to both sides."""
    right, down = away_px.T
    return [
        np.flatnonzero((side * right >= 0) & (level * down >= 0))
        for level in (-1, 1)
        for side in (-1, 1)
    ]


def _nearest_of(rows: np.ndarray, away_px: Float64) -> int | None:
    if len(rows) == 0:
        return None
    return int(rows[np.argmin((away_px[rows] ** 2).sum(axis=1))])


def _bilinear(corners_px: Float64) -> Float64:
    """Return (4,) weights for which the mean of the corners is 0: upper left, upper right, lower two."""
    (upper, upper_row), (lower, lower_row) = _at_column(corners_px[:2]), _at_column(corners_px[2:])
    height = lower_row - upper_row
    share = -upper_row / height if height > 0 else 0.5
    return np.concatenate([upper * (1 - share), lower * share])


def _at_column(pair_px: Float64) -> tuple[Float64, float]:
    """Return (2,) weights of a left and a right point where the line between them has column 0; and its row."""
    (left, _), (right, _) = pair_px
    share = -left / (right - left) if right > left else 0.5
    weights = np.array([1 - share, share])
    return weights, float(weights @ pair_px[:, 1])


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
