"""Points of a scan through any projection: dim on the ground, bright above it, highlighted on one object."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from perception.geometry.boxes import points_inside
from perception.geometry.camera import project
from perception.render import palette
from perception.render.canvas import is_inside
from perception.types import Bool, Boxes3D, Float32, Float64, GroundModel, UInt8

_GROUND_M = 0.2  # height below which points are ground, d_min of Table 7.5
_TALL_M = 2.5  # height from which points are drawn at full brightness
_GROUND_SHADE = 0.55
_NEAR_M = 18.0  # nearer points are drawn as squares of two pixels
_BEHIND_CAMERA_M = 0.5


@dataclass(frozen=True)
class ScanPoints:
    """Points of a scan with their colours, the lowest first, so that higher ones are drawn on top.

    Attributes:
        points_velo: (N, 4) points in the LiDAR frame.
        colors: (N, 3) RGB colours.
        is_marked: (N,) mask of the points on the object.
    """

    points_velo: Float32
    colors: UInt8
    is_marked: Bool

    @classmethod
    def of(cls, points_velo: Float32, ground: GroundModel, marked: Boxes3D | None) -> Self:
        """Colour points by their height above the ground, and those in a box as the tracked object."""
        ordered = points_velo[np.argsort(points_velo[:, 2], kind="stable")]
        above_m: Float64 = np.asarray(ground.distance_m(ordered), np.float64)
        is_ground = above_m < _GROUND_M
        light = 0.75 + 0.5 * np.clip(above_m / _TALL_M, 0, 1) + 0.35 * ordered[:, 3]
        shades = np.where(
            is_ground[:, None],
            _GROUND_SHADE * np.array(palette.GROUND_POINTS),
            np.minimum(light, 1.6)[:, None] * np.array(palette.POINTS),
        )
        is_marked = np.zeros(len(ordered), bool)
        if marked is not None:
            is_marked = points_inside(marked, ordered, margin_m=0.1)[0] & ~is_ground
        shades[is_marked] = palette.TRACKED_OBJECT
        return cls(ordered, np.minimum(shades, 255).astype(np.uint8), is_marked)

    def draw(self, canvas: UInt8, image_P_velo: Float64) -> None:
        """Draw the points, the nearest on top."""
        pixels, depth_m = project(image_P_velo, self.points_velo)
        size_px = (canvas.shape[1] - 1, canvas.shape[0] - 1)
        shown = np.flatnonzero(is_inside(pixels, size_px) & (depth_m > _BEHIND_CAMERA_M))
        shown = shown[np.argsort(-depth_m[shown], kind="stable")]
        column, row = np.rint(pixels[shown]).astype(int).T
        canvas[row, column] = self.colors[shown]
        # In the top view every depth is 1: there only the object's points are large.
        is_flat = not image_P_velo[2, :3].any()
        is_large = self.is_marked[shown] | ((depth_m[shown] < _NEAR_M) & (not is_flat))
        for down, right in ((0, 1), (1, 0), (1, 1)):
            canvas[row[is_large] + down, column[is_large] + right] = self.colors[shown[is_large]]
