"""A frame of a run drawn by plain calls of OpenCV, one a point, a voxel and a line, and encoded by its writer."""

from pathlib import Path

import cv2
import numpy as np

from perception.geometry.boxes import corners
from perception.geometry.camera import NEAREST_M, project
from perception.render import palette
from perception.render.birds_eye import view_of_area
from perception.render.composition import Composition
from perception.render.overlay import GroundMesh, sample_surface
from perception.render.perspective import chase_camera
from perception.render.scene import Scene
from perception.types import Float, Float64, PointState, UInt8

_CAMERA_SHARE = 0.58
_STATE_COLORS = {
    PointState.OUTSIDE: palette.POINTS,
    PointState.GROUND: palette.GROUND_POINTS,
    PointState.STATIC: palette.STATIC,
    PointState.MOVING: palette.MOVING,
}


class OpenCvVideo:
    """OpenCV's video writer."""

    def __init__(self, path: Path, rate_hz: float, size_px: tuple[int, int]) -> None:
        """Open a file.

        Args:
            path: Path of the file.
            rate_hz: Images per second.
            size_px: (width, height) of the images.
        """
        code = cv2.VideoWriter.fourcc(*"mp4v")
        self._writer = cv2.VideoWriter(str(path), code, rate_hz, size_px)

    def add(self, image: UInt8) -> None:
        """Encode the next (H, W, 3) RGB image."""
        self._writer.write(cv2.cvtColor(image, cv2.COLOR_RGB2BGR))

    def close(self) -> None:
        """Complete the file."""
        self._writer.release()


def draw_by_opencv(scene: Scene, composition: Composition) -> UInt8:
    """Return an image with the three views of a frame: camera, from behind, from above."""
    width, height = composition.size_px
    canvas = np.full((height, width, 3), palette.BACKGROUND, np.uint8)
    result, left = scene.result, round(0.66 * width)
    surface = sample_surface(result.ground, composition.area)
    frame, top = result.frame, 0
    if frame.image is not None and frame.calibration is not None:
        top = min(
            round(_CAMERA_SHARE * height), round(left * frame.image.shape[0] / frame.image.shape[1])
        )
        camera = canvas[:top, :left]
        cv2.resize(frame.image, (left, top), dst=camera, interpolation=cv2.INTER_AREA)
        scale = np.diag([left / frame.image.shape[1], top / frame.image.shape[0], 1.0])
        _draw_view(camera, scale @ frame.calibration.image_P_velo, scene, surface, points=False)
    behind = canvas[top:, :left]
    _draw_view(behind, chase_camera((left, height - top)), scene, surface, points=True)
    above = canvas[:, left:]
    view = view_of_area(composition.area, (width - left, height))
    _draw_view(above, view.image_P_velo, scene, surface, points=True)
    return canvas


def _draw_view(
    canvas: UInt8, image_P_velo: Float64, scene: Scene, surface: GroundMesh, *, points: bool
) -> None:
    """Draw ground, points, voxels and boxes into one view."""
    _draw_ground(canvas, image_P_velo, surface)
    result = scene.result
    if points:
        states = result.obstacles.point_states
        for state, color in _STATE_COLORS.items():
            _draw_dots(canvas, image_P_velo, result.frame.points_velo[states == state], color)
    else:
        obstacles = result.obstacles
        _draw_dots(canvas, image_P_velo, obstacles.static.centers_m, palette.STATIC, radius_px=3)
        _draw_dots(canvas, image_P_velo, obstacles.moving.centers_m, palette.MOVING, radius_px=3)
    _draw_boxes(canvas, image_P_velo, scene)


def _draw_ground(canvas: UInt8, image_P_velo: Float64, surface: GroundMesh) -> None:
    nodes = surface.nodes_m
    pixels, depth_m = project(image_P_velo, nodes.reshape(-1, 3))
    grid, depth_m = pixels.reshape(*nodes.shape[:2], 2), depth_m.reshape(nodes.shape[:2])
    layer = canvas.copy()
    for i in range(len(grid) - 1):
        for j in range(grid.shape[1] - 1):
            cell = grid[[i, i, i + 1, i + 1], [j, j + 1, j + 1, j]]
            if (depth_m[i : i + 2, j : j + 2] > NEAREST_M).all() and (np.abs(cell) < 1e4).all():
                corners_px = np.rint(cell).astype(np.int32)
                cv2.fillConvexPoly(layer, corners_px, palette.GROUND)
                cv2.polylines(layer, [corners_px], True, palette.GROUND_MESH, 1)
    cv2.addWeighted(layer, 0.4, canvas, 0.6, 0, dst=canvas)


def _draw_dots(
    canvas: UInt8, image_P_velo: Float64, points_m: Float, color: palette.Color, radius_px: int = 0
) -> None:
    """Draw each point as a disc."""
    pixels, depth_m = project(image_P_velo, points_m)
    height, width = canvas.shape[:2]
    inside = (depth_m > NEAREST_M) & (pixels >= 0).all(axis=1) & (pixels < (width, height)).all(1)
    for at in np.rint(pixels[inside]).astype(int).tolist():
        cv2.circle(canvas, at, radius_px, color, -1)


def _draw_boxes(canvas: UInt8, image_P_velo: Float64, scene: Scene) -> None:
    """Draw the edges of the 3D boxes, and their ids."""
    objects = scene.objects
    for row in np.flatnonzero(objects.has_box).tolist():
        pixels, depth_m = project(image_P_velo, corners(objects.boxes[row : row + 1])[0])
        if not ((depth_m > NEAREST_M).all() and (np.abs(pixels) < 1e4).all()):
            continue
        at = np.rint(pixels).astype(int).tolist()
        for low in range(4):
            for a, b in ((low, (low + 1) % 4), (low + 4, (low + 1) % 4 + 4), (low, low + 4)):
                cv2.line(canvas, at[a], at[b], palette.TRACKS[0], 2, cv2.LINE_AA)
        text = f"#{objects.ids[row]}"
        cv2.putText(
            canvas, text, at[4], cv2.FONT_HERSHEY_SIMPLEX, 0.4, palette.TEXT, 1, cv2.LINE_AA
        )
