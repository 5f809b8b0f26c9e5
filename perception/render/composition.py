"""The image of one frame of a run: camera, scene in 3D, bird's-eye view, legend and stage times."""

from dataclasses import dataclass, field, replace

import numpy as np

from perception.detection.config import DetectionConfig
from perception.errors import UsageError
from perception.geometry.grids import LocalArea
from perception.render import palette
from perception.render.birds_eye import draw_birds_eye, view_of_area
from perception.render.canvas import blank_canvas
from perception.render.overlay import GroundMesh, draw_overlay, sample_surface
from perception.render.panels import FittedImage, LegendEntry, place_panel, title_height_px
from perception.render.perspective import chase_camera, draw_perspective
from perception.render.stage_bar import draw_footer
from perception.render.track_figures import TrackFigures, track_figures
from perception.render.tracked_object_figure import TrackedObjectFigure
from perception.render.tracks import TrackStyle, draw_tracks
from perception.render.trails import Trails
from perception.render.vehicles import VehicleFigures, map_panels
from perception.types import Float64, Result, UInt8

# Sizes of the panels, as shares of the image's width and height.
_LEFT_SHARE = 0.70
_FOOTER_SHARE = 0.075
_CAMERA_SHARE = 0.46
_MAP_SHARE = 0.3  # of the width of the 3D view
_GUTTER_PX = 4
# Margin of the bird's-eye view around the local area.
_SURROUND_M = 1.0
_LEGEND: tuple[LegendEntry, ...] = (
    ("ground", (palette.GROUND,)),
    ("static", (palette.STATIC,)),
    ("moving", (palette.MOVING,)),
    ("tracks", palette.TRACKS),
)
_DETECTED: tuple[LegendEntry, ...] = (
    ("in image", (palette.MODALITIES["rgb"],)),
    ("in depth", (palette.MODALITIES["dm"],)),
    ("in reflectance", (palette.MODALITIES["rm"],)),
)
_TRACKED_OBJECT: LegendEntry = ("followed", (palette.TRACKED_OBJECT,))


@dataclass(frozen=True)
class Composition:
    """Layout of the images of a run, all of one size.

    Attributes:
        size_px: (width, height) of an image; video needs even numbers.
        area: Local area of the obstacle stages.
        turn_s: Time of one LiDAR revolution in seconds, the time budget of a frame.
        display_score: Score from which a detection is drawn.
    """

    size_px: tuple[int, int] = (1600, 900)
    area: LocalArea = field(default_factory=LocalArea)
    turn_s: float = 0.1
    display_score: float = DetectionConfig.display_score

    def __post_init__(self) -> None:
        """Validate the size: even for video, and large enough for readable text."""
        width, height = self.size_px
        if width % 2 or height % 2 or width < 640 or height < 360:
            raise UsageError(
                "image size",
                expected="an even width and height of at least 640x360 pixels",
                found=f"{width}x{height}",
            )

    def draw(
        self,
        result: Result,
        trails: Trails | None = None,
        tracked: TrackedObjectFigure | None = None,
    ) -> UInt8:
        """Return the (height, width, 3) image of one frame.

        Args:
            result: Output of the pipeline.
            trails: Past positions of the tracks, or None.
            tracked: Object of the one-object tracker, drawn over all others, or None.
        """
        width, height = self.size_px
        scene = self._scene(result, trails, tracked)
        canvas = blank_canvas(self.size_px, palette.BACKGROUND)
        body_px, left_px = round(height * (1 - _FOOTER_SHARE)), round(width * _LEFT_SHARE)
        # Left: the camera's image, and below it the scene in 3D; without a camera, 3D alone.
        camera = _draw_camera(scene, (left_px, round(body_px * _CAMERA_SHARE)))
        behind_top_px = len(camera) + _GUTTER_PX if len(camera) else 0
        behind = _draw_from_behind(scene, (left_px, body_px - behind_top_px))
        place_panel(canvas, camera, (0, 0), "Camera")
        place_panel(canvas, behind, (0, behind_top_px), "3D, from behind the vehicle")
        self._place_maps(canvas, result, (left_px, behind_top_px))
        # Right: the scene from above.
        right_px = left_px + _GUTTER_PX
        above = self._draw_from_above(scene, (width - right_px, body_px))
        place_panel(canvas, above, (right_px, 0), "From above")
        # Below: legend and times of the stages.
        is_tracking = trails is not None or len(result.tracks) > 0
        legend = [list(_LEGEND if is_tracking else _LEGEND[:-1])]
        if tracked is not None:
            legend[0].append(_TRACKED_OBJECT)
        if scene.vehicles is not None:
            legend.append(list(_DETECTED))
        draw_footer(canvas[body_px:], result, legend, self.turn_s)
        return canvas

    def _scene(
        self, result: Result, trails: Trails | None, tracked: TrackedObjectFigure | None
    ) -> "_Scene":
        here = result.tracks.boxes.bottom_m[:, None]
        paths_velo = list(here) if trails is None else trails.paths_velo(result)
        surface = sample_surface(result.ground, self.area)
        figures = track_figures(result.tracks, paths_velo)
        style = TrackStyle.of_height(self.size_px[1])
        return _Scene(
            result, surface, figures, style, tracked, VehicleFigures.of(result, self.display_score)
        )

    def _place_maps(self, canvas: UInt8, result: Result, corner_px: tuple[int, int]) -> None:
        """Place the maps in the upper corners of the 3D view, which show the least."""
        right_px, top_px = corner_px
        # Below the title of that view.
        top_px += title_height_px(canvas)
        largest_px = (round(right_px * _MAP_SHARE), self.size_px[1])
        panels = map_panels(result, largest_px, self.display_score)
        for place, (title, panel) in enumerate(panels.items()):
            left_px = right_px - panel.shape[1] if place else 0
            place_panel(canvas, panel, (left_px, top_px), title)

    def _draw_from_above(self, scene: "_Scene", size_px: tuple[int, int]) -> UInt8:
        shown = LocalArea(
            self.area.ahead_m + _SURROUND_M,
            self.area.behind_m + _SURROUND_M,
            self.area.side_m + _SURROUND_M,
        )
        view = view_of_area(shown, size_px)
        panel = draw_birds_eye(view, scene.result, scene.surface)
        scene.draw_tracks(panel, view.image_P_velo)
        return panel


@dataclass(frozen=True)
class _Scene:
    """Content of the three views.

    Attributes:
        result: Output of the pipeline.
        surface: Ground in the LiDAR frame.
        figures: Tracks as lines and faces.
        style: Line width and text height of tracks.
        tracked: Object of the one-object tracker, or None.
        vehicles: Detected vehicles, or None where no detector ran.
    """

    result: Result
    surface: GroundMesh
    figures: TrackFigures
    style: TrackStyle
    tracked: TrackedObjectFigure | None
    vehicles: VehicleFigures | None

    def draw_tracks(self, panel: UInt8, image_P_velo: Float64) -> None:
        """Draw tracks and vehicles over a view."""
        draw_tracks(panel, image_P_velo, self.figures, self.style)
        if self.vehicles is not None:
            self.vehicles.draw_in_space(panel, image_P_velo, self.style)
        self._draw_tracked(panel, image_P_velo)

    def draw_on_image(self, fitted: FittedImage, image_P_velo: Float64) -> None:
        """Draw tracks and vehicles over the camera's image; vehicles are labelled at their 2D boxes."""
        canvas, projection = fitted.canvas, fitted.resizing.project(image_P_velo)
        if self.vehicles is None:
            self.draw_tracks(canvas, projection)
            return
        draw_tracks(canvas, projection, self.figures, self.style, self.vehicles.ids)
        self.vehicles.draw_in_space(canvas, projection, self.style)
        self.vehicles.draw_on_image(canvas, fitted.resizing, self.style)
        self._draw_tracked(canvas, projection)

    def _draw_tracked(self, panel: UInt8, image_P_velo: Float64) -> None:
        if self.tracked is not None:
            bold = replace(self.style, line_px=self.style.line_px + 1)
            self.tracked.draw(panel, image_P_velo, bold)


def _draw_camera(scene: _Scene, largest_px: tuple[int, int]) -> UInt8:
    """Return the overlay at the largest size that fits, centred; empty without a camera."""
    image, calibration = scene.result.frame.image, scene.result.frame.calibration
    if image is None or calibration is None:
        return np.zeros((0, largest_px[0], 3), np.uint8)
    image_P_velo = calibration.image_P_velo
    overlay = draw_overlay(image, image_P_velo, scene.surface, scene.result.obstacles)
    fitted = FittedImage.within(overlay, largest_px)
    # Lines and text are drawn after resizing, so that they keep their size.
    scene.draw_on_image(fitted, image_P_velo)
    return fitted.on_strip(largest_px[0])


def _draw_from_behind(scene: _Scene, size_px: tuple[int, int]) -> UInt8:
    panel = draw_perspective(size_px, scene.result, scene.surface)
    scene.draw_tracks(panel, chase_camera(size_px))
    return panel
