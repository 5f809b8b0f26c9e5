"""The views of one tracked object: camera image, close-up, 3D view and top view."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from perception.geometry.boxes import corners, edges
from perception.geometry.camera import outlines_px, project_segments
from perception.render import palette
from perception.render.birds_eye import BirdsEyeView, draw_rings, draw_scale, draw_vehicle
from perception.render.canvas import FIXED_POINT_BITS, blank_canvas, fixed_point
from perception.render.labels import draw_labels
from perception.render.object_figures import ObjectFigures, object_figures
from perception.render.objects import draw_objects
from perception.render.palette import Color, Style
from perception.render.panels import FittedImage, Resizing
from perception.render.perspective import chase_camera
from perception.render.perspective import draw_vehicle as draw_solid_vehicle
from perception.render.scan_points import ScanPoints
from perception.render.scene import SceneObjects
from perception.render.strokes import draw_seam, draw_strokes, project_strokes
from perception.render.trails import KM_H
from perception.tracking.single_object.tracker import TrackedObject, TrackStatus
from perception.types import Boxes3D, Calibration, Float64, Int, Result, UInt8

STATUS_COLORS: dict[TrackStatus, Color] = {
    TrackStatus.SEEN: palette.TRACKED_OBJECT,
    TrackStatus.PREDICTED: palette.TRACKS[3],
    TrackStatus.LOST: palette.STATIC,
}
_REGION_OPACITY = 0.30
_SURROUND_M = 9.0  # margin around object and vehicle in the top view
_MIN_SPAN_M = 36.0
_CLOSE_UP = 1.7  # height of the close-up in heights of the object
_MIN_CLOSE_UP_PX = 56.0
_FIELD_OF_VIEW_RAD = np.radians(82)


@dataclass(frozen=True)
class TrackedObjectScene:
    """One tracked object in one frame, in the LiDAR frame of the scan.

    Attributes:
        result: Pose and ground of the frame.
        tracked: Output of the one-object tracker.
        path_velo: (K, 3) path of the object, the oldest position first.
        ego_path_velo: (E, 3) path of the vehicle on the ground, the oldest position first.
        speeds_km_h: (F,) speeds in km/h of the frames up to this one, NaN without a box.
        states: (F,) tracking status of the same frames.
        seconds: Processing time of the tracker in seconds.
        truth: Labelled box, or None where unknown.
    """

    result: Result
    tracked: TrackedObject
    path_velo: Float64
    ego_path_velo: Float64
    speeds_km_h: Sequence[float]
    states: Sequence[TrackStatus]
    seconds: float
    truth: Boxes3D | None = None


class TrackedObjectViews:
    """The views of one scene."""

    def __init__(self, scene: TrackedObjectScene, style: Style) -> None:
        """Prepare what several views share.

        Args:
            scene: Tracked object in one frame.
            style: Line width and text height.
        """
        self._scene, self._style = scene, style
        objects = SceneObjects.of_tracked(scene.tracked)
        self._figures = object_figures(objects, [scene.path_velo] * len(objects))
        still = replace(objects, is_moving=np.zeros(len(objects), bool))
        self._still_figures = object_figures(still, [np.zeros((0, 3))] * len(objects))
        result, box = scene.result, scene.tracked.box_velo
        self._points = ScanPoints.of(result.frame.points_velo, result.ground, box)

    def camera(self, largest_px: tuple[int, int]) -> UInt8:
        """Return the camera image with the object's region and box; empty without a camera."""
        image, calibration = self._scene.result.frame.image, self._scene.result.frame.calibration
        if image is None or calibration is None:
            return np.zeros((0, largest_px[0], 3), np.uint8)
        fitted = FittedImage.within(image, largest_px)
        self._draw_on_image(fitted.canvas, fitted.resizing, calibration)
        return fitted.on_strip(largest_px[0])

    def close_up(self, size_px: tuple[int, int]) -> UInt8:
        """Return the part of the image around the object, enlarged; blank where it is not in view."""
        image, calibration = self._scene.result.frame.image, self._scene.result.frame.calibration
        if image is None or calibration is None:
            return np.zeros((0, size_px[0], 3), np.uint8)
        limits_px = (image.shape[1], image.shape[0])
        window_px = self._window_px(calibration.image_P_velo, size_px, limits_px)
        if window_px is None:
            return blank_canvas(size_px, palette.PANEL)
        resizing = Resizing.of_window(window_px, size_px)
        canvas = resizing.cut(image, size_px)
        self._draw_on_image(canvas, resizing, calibration)
        return canvas

    def _window_px(
        self, image_P_velo: Float64, size_px: tuple[int, int], limits_px: tuple[int, int]
    ) -> Float64 | None:
        """Return the (4,) window x1 y1 x2 y2 of the image around the object, or None where it is not in view."""
        outline_px, box = self._scene.tracked.box_px, self._scene.tracked.box_velo
        if box is not None:
            visible = project_segments(image_P_velo, edges(box)[0], limits_px)
            outline_px = outlines_px(visible.ends_px, np.zeros(len(visible), np.int64), 1)[0]
        if outline_px is None or not np.isfinite(outline_px).all():
            return None
        middle_px, span_px = (outline_px[:2] + outline_px[2:]) / 2, outline_px[2:] - outline_px[:2]
        aspect = size_px[0] / size_px[1]
        high_px = max(_CLOSE_UP * float(max(span_px[1], span_px[0] / aspect)), _MIN_CLOSE_UP_PX)
        # At most as large as the image, and within it.
        high_px = min(high_px, limits_px[1], limits_px[0] / aspect)
        half_px = np.array([high_px * aspect, high_px]) / 2
        middle_px = np.clip(middle_px, half_px, np.array(limits_px) - half_px)
        return np.concatenate([middle_px - half_px, middle_px + half_px])

    def _draw_on_image(self, canvas: UInt8, resizing: Resizing, calibration: Calibration) -> None:
        image_P_velo = resizing.project(calibration.image_P_velo)
        draw_tracked_in_image(canvas, self._scene.tracked, resizing, self._style.line_px)
        self._draw_truth(canvas, image_P_velo)
        self._draw_object(canvas, image_P_velo, self._still_figures)

    def from_behind(self, size_px: tuple[int, int]) -> UInt8:
        """Return the points in 3D from behind the vehicle, towards the object."""
        image_P_velo = chase_camera(size_px, self._bearing_rad(), _FIELD_OF_VIEW_RAD)
        canvas = blank_canvas(size_px, palette.PANEL)
        self._points.draw(canvas, image_P_velo)
        self._draw_paths(canvas, image_P_velo)
        ground_m = float(self._scene.result.ground.height_m(np.zeros((1, 2)))[0])
        draw_solid_vehicle(canvas, image_P_velo, ground_m)
        return canvas

    def from_above(self, size_px: tuple[int, int]) -> UInt8:
        """Return the points from above, at the largest scale that shows object and vehicle."""
        view = self._view_of_both(size_px)
        canvas = blank_canvas(size_px, palette.PANEL)
        self._points.draw(canvas, view.image_P_velo)
        draw_rings(canvas, view)
        taken_px = draw_scale(canvas, view, self._style.text_px - 1)
        draw_vehicle(canvas, view)
        self._draw_paths(canvas, view.image_P_velo, taken_px)
        return canvas

    def _draw_paths(
        self, canvas: UInt8, image_P_velo: Float64, taken_px: Sequence[Int] = ()
    ) -> None:
        draw_path(canvas, image_P_velo, self._scene.ego_path_velo, palette.EGO_PATH)
        self._draw_truth(canvas, image_P_velo)
        self._draw_object(canvas, image_P_velo, self._figures, taken_px)

    def _draw_object(
        self,
        canvas: UInt8,
        image_P_velo: Float64,
        figures: ObjectFigures,
        taken_px: Sequence[Int] = (),
    ) -> None:
        """Draw the object with its speed, and its status where it is not observed."""
        labels = draw_objects(canvas, image_P_velo, figures, self._style)
        text = label_text(self._scene.tracked)
        labels = [replace(label, name="", details=text) for label in labels]
        draw_labels(canvas, labels, self._style.text_px, taken_px)

    def _draw_truth(self, canvas: UInt8, image_P_velo: Float64) -> None:
        if self._scene.truth is not None:
            segments = edges(self._scene.truth)[0]
            owners = np.zeros(len(segments), np.int64)
            strokes = project_strokes(image_P_velo, canvas, segments, owners)
            draw_strokes(canvas, strokes, [palette.TRUTH], np.array([1]))

    def _bearing_rad(self) -> float:
        box = self._scene.tracked.box_velo
        return 0.0 if box is None else float(np.arctan2(box.bottom_m[0, 1], box.bottom_m[0, 0]))

    def _view_of_both(self, size_px: tuple[int, int]) -> BirdsEyeView:
        """Fit vehicle and object into the view, with a margin around them."""
        shown_m = np.zeros((1, 2))
        box = self._scene.tracked.box_velo
        if box is not None:
            shown_m = np.concatenate([shown_m, corners(box)[0, :, :2]])
        low_m, high_m = shown_m.min(axis=0) - _SURROUND_M, shown_m.max(axis=0) + _SURROUND_M
        span_m = np.maximum(high_m - low_m, _MIN_SPAN_M * np.array([1.0, size_px[0] / size_px[1]]))
        scale = float(min(size_px[1] / span_m[0], size_px[0] / span_m[1]))
        middle_m = (low_m + high_m) / 2
        vehicle_px = (
            size_px[0] / 2 + middle_m[1] * scale,
            size_px[1] / 2 + middle_m[0] * scale,
        )
        return BirdsEyeView(size_px, scale, vehicle_px)


def label_text(tracked: TrackedObject) -> str:
    """Return the speed of an object, and its status where it is not observed."""
    speed = f"{KM_H * float(np.hypot(*tracked.velocity_m_s)):.1f} km/h"
    return {
        TrackStatus.SEEN: speed,
        TrackStatus.PREDICTED: f"predicted {speed}",
        TrackStatus.LOST: "lost",
    }[tracked.status]


def draw_path(canvas: UInt8, image_P_velo: Float64, path_velo: Float64, color: Color) -> None:
    """Draw a (K, 3) path as a curve."""
    if len(path_velo) < 2:
        return
    segments = np.stack([path_velo[:-1], path_velo[1:]], axis=1)
    strokes = project_strokes(image_P_velo, canvas, segments, np.zeros(len(segments), np.int64))
    draw_seam(canvas, strokes, palette.BACKGROUND, 4)
    draw_strokes(canvas, strokes, [color], np.array([2]))


def draw_tracked_in_image(
    canvas: UInt8, tracked: TrackedObject, resizing: Resizing, line_px: int
) -> None:
    """Draw what a tracker knows of the image alone: region and ring, or the rectangle of an object without a box.

    Args:
        canvas: (H, W, 3) image.
        tracked: Output of the tracker.
        resizing: From the camera image to the canvas.
        line_px: Width of lines.
    """
    region = tracked.region
    if region is not None:
        draw_region(canvas, resizing.move(region.hull_px), resizing.move(region.outer_px))
    if tracked.box_velo is None and tracked.box_px is not None:
        first, last = np.rint(resizing.move(tracked.box_px.reshape(2, 2))).astype(int).tolist()
        color = STATUS_COLORS[tracked.status]
        cv2.rectangle(canvas, first, last, color, line_px, cv2.LINE_AA)


def draw_region(canvas: UInt8, hull_px: Float64, outer_px: Float64) -> None:
    """Tint the object's region blue and the ring around it red, as in Fig. 5.13.

    Args:
        canvas: (H, W, 3) image.
        hull_px: (V, 2) corners of the region in the image.
        outer_px: (V, 2) corners of the region with its ring.
    """
    inside, outside = fixed_point(hull_px), fixed_point(outer_px)
    painted = canvas.copy()
    # Filling two outlines together leaves out what lies within both.
    cv2.fillPoly(painted, [outside, inside], palette.RING, cv2.LINE_AA, FIXED_POINT_BITS)
    cv2.fillPoly(painted, [inside], palette.INSIDE, cv2.LINE_AA, FIXED_POINT_BITS)
    cv2.addWeighted(painted, _REGION_OPACITY, canvas, 1 - _REGION_OPACITY, 0, dst=canvas)
    for outline, color in ((outside, palette.RING), (inside, palette.INSIDE)):
        cv2.polylines(canvas, [outline], True, color, 1, cv2.LINE_AA, FIXED_POINT_BITS)
