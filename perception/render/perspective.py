"""The scene in 3D from a virtual camera behind and above the vehicle."""

from functools import lru_cache

import cv2
import numpy as np

from perception.geometry.camera import project
from perception.geometry.se3 import from_euler
from perception.kernels.drawing import HIDDEN, paint_points
from perception.render import palette
from perception.render.canvas import (
    FIXED_POINT_BITS,
    fill_canvas,
    fixed_point,
)
from perception.render.ego_vehicle import vehicle_faces
from perception.render.overlay import GroundMesh, OverlayStyle, draw_overlay
from perception.types import Float64, PointState, Result, UInt8

_EYE_M = np.array([-15.0, 0.0, 9.0])
_TARGET_M = np.array([7.0, 0.0, -1.7])
_FIELD_OF_VIEW_RAD = np.radians(64)
_MAX_ASPECT = 0.62  # of the vertical field of view to the horizontal one
# Direction to the light that shades the vehicle.
_TO_LIGHT = np.array([-0.45, 0.25, 0.86])
# Colours of points by reflectance, brighter up to 0.6.
_LEVELS_PER_UNIT = 100
_POINTS = np.minimum(
    (0.45 + 0.9 * np.arange(0, 0.601, 1 / _LEVELS_PER_UNIT))[:, None] * palette.POINTS, 255
).astype(np.uint8)
# No image lies under the obstacles here, and gaps between voxels are left open.
_SOLID = OverlayStyle(cube_opacity=0.96, ground_opacity=0.42, mesh_opacity=0.25, gap_px=(1, 1))


@lru_cache(maxsize=8)
def _straight_camera(size_px: tuple[int, int], field_of_view_rad: float) -> Float64:
    """Return (3, 4) image_P_velo of the camera straight behind the vehicle; a video has few of them."""
    width, height = size_px
    # A high image is enlarged rather than filled with sky.
    low_rad = _MAX_ASPECT * field_of_view_rad
    focal_px = max(width / np.tan(field_of_view_rad / 2), height / np.tan(low_rad / 2)) / 2
    forward = (_TARGET_M - _EYE_M) / np.linalg.norm(_TARGET_M - _EYE_M)
    right = np.cross(forward, (0, 0, 1))
    right /= np.linalg.norm(right)
    cam_R_velo = np.stack([right, np.cross(forward, right), forward])
    image_K_cam = np.array([[focal_px, 0, width / 2], [0, focal_px, height / 2], [0, 0, 1]])
    return np.asarray(image_K_cam @ np.column_stack([cam_R_velo, -cam_R_velo @ _EYE_M]))


def chase_camera(
    size_px: tuple[int, int],
    turn_rad: float = 0.0,
    field_of_view_rad: float = _FIELD_OF_VIEW_RAD,
) -> Float64:
    """Return (3, 4) image_P_velo of a camera behind and above the vehicle, looking ahead and down.

    Args:
        size_px: (width, height) of the image.
        turn_rad: Angle of the viewing direction from ahead to the left in radians; the camera moves around the
            vehicle.
        field_of_view_rad: Horizontal field of view in radians.
    """
    turn = from_euler(0.0, 0.0, -turn_rad)
    return np.asarray(_straight_camera(size_px, field_of_view_rad) @ turn)


def draw_perspective(
    canvas: UInt8, image_P_velo: Float64, result: Result, surface: GroundMesh
) -> None:
    """Fill a canvas with points, ground, obstacles and the vehicle."""
    fill_canvas(canvas, palette.PANEL)
    _draw_points(canvas, image_P_velo, result)
    draw_overlay(canvas, image_P_velo, surface, result.obstacles, _SOLID)
    ground_height_m = float(result.ground.height_m(np.zeros((1, 2)))[0])
    draw_vehicle(canvas, image_P_velo, ground_height_m)


def _draw_points(image: UInt8, image_P_velo: Float64, result: Result) -> None:
    """Draw the points outside the local area, brighter with their reflectance."""
    points = result.frame.points_velo
    is_outside = result.obstacles.point_states == PointState.OUTSIDE
    levels = np.minimum(points[:, 3] * _LEVELS_PER_UNIT, len(_POINTS) - 1).astype(np.uint8)
    paint_points(image, image_P_velo, points, np.where(is_outside, levels, HIDDEN), _POINTS, 1)


def draw_vehicle(image: UInt8, image_P_velo: Float64, ground_height_m: float) -> None:
    """Draw the vehicle on the ground at a z, lit from behind and above."""
    image_P_ground = image_P_velo.copy()
    image_P_ground[:, 3] += ground_height_m * image_P_velo[:, 2]
    eye_m = np.asarray(-np.linalg.solve(image_P_ground[:, :3], image_P_ground[:, 3]), np.float64)
    faces = [face for face in vehicle_faces() if face.outward @ (eye_m - face.corners_m[0]) > 0]
    faces.sort(key=lambda one: (-np.linalg.norm(one.corners_m.mean(axis=0) - eye_m), one.is_glass))
    for face in faces:
        pixels, _ = project(image_P_ground, face.corners_m)
        corners = fixed_point(pixels)
        light = 0.55 + 0.45 * max(float(face.outward @ _TO_LIGHT), 0.0)
        tint = palette.GLASS if face.is_glass else palette.VEHICLE
        color = [int(channel * light) for channel in tint]
        cv2.fillPoly(image, [corners], color, cv2.LINE_AA, FIXED_POINT_BITS)
