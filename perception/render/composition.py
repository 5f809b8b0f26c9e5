"""The image of one frame of a run: camera, scene in 3D, bird's-eye view, and a strip of legend, maps and times."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from perception.detection.config import DetectionConfig
from perception.detection.vehicles.camera_views import views_of
from perception.errors import UsageError
from perception.geometry.grids import LocalArea
from perception.render import palette
from perception.render.birds_eye import draw_birds_eye, draw_scale, view_of_area
from perception.render.camera_grid import CameraGrid, camera_grid
from perception.render.canvas import blank_canvas, fill_canvas
from perception.render.detector_views import draw_detector_boxes, map_insets
from perception.render.labels import Label, draw_labels
from perception.render.object_figures import object_figures
from perception.render.objects import draw_objects
from perception.render.overlay import draw_overlay, sample_surface
from perception.render.palette import Style
from perception.render.panels import (
    FittedImage,
    LegendEntry,
    PanelArea,
    draw_title,
    left_column_px,
    title_area_px,
)
from perception.render.perspective import chase_camera, draw_perspective
from perception.render.scene import Scene
from perception.render.strip import draw_health, draw_strip, inset_height_px
from perception.render.tracked_object_views import draw_tracked_in_image
from perception.types import Calibration, Int, Result, UInt8

# Heights of the strip without and with maps, and largest height of the camera image, as shares.
_STRIP_SHARES = (0.095, 0.135)
_CAMERA_SHARE = 0.58
_MAP_SHARE = 0.22  # largest width of a map
_GUTTER_PX = 4
# Margin of the bird's-eye view around the local area.
_SURROUND_M = 1.0
_CAMERA, _BEHIND, _ABOVE = "Camera", "3D, from behind the vehicle", "From above"
_LEGEND: tuple[tuple[LegendEntry, ...], ...] = (
    (
        LegendEntry("ground", (palette.GROUND,)),
        LegendEntry("static", (palette.STATIC,)),
        LegendEntry("moving", (palette.MOVING,)),
    ),
    (LegendEntry("objects, by id", palette.TRACKS),),
)
_CLASSES: tuple[tuple[LegendEntry, ...], ...] = tuple(
    tuple(LegendEntry(name, (palette.CLASSES[name],)) for name in names)
    for names in (tuple(palette.CLASSES)[:5], tuple(palette.CLASSES)[5:])  # vehicles, others
)
_SELECTED = LegendEntry("selected", (palette.TRACKED_OBJECT,))
_REGION = (LegendEntry("its region", (palette.INSIDE,)), LegendEntry("ring", (palette.RING,)))
_OCCUPANCY = (
    LegendEntry("free", (palette.FREE,)),
    LegendEntry("occupied", (palette.OCCUPIED,)),
)
_VIEW_NAMES = {"rgb": "image", "dm": "depth", "rm": "reflectance"}


@dataclass(frozen=True)
class Composition:
    """Layout of the images of a run, all of one size.

    Attributes:
        size_px: (width, height) of an image; video needs even numbers.
        area: Local area of the obstacle stages.
        reach_m: Distance in metres that the view from above shows all round; 0 for the local area alone.
        period_s: Time from one scan to the next in seconds, the time budget of a frame.
        display_score: Score from which a detection is drawn.
        detector_views: Whether the boxes of each modality's detector are drawn on the camera image.
    """

    size_px: tuple[int, int] = (1600, 900)
    area: LocalArea = field(default_factory=LocalArea)
    reach_m: float = 0.0
    period_s: float = 0.1
    display_score: float = DetectionConfig.display_score
    detector_views: bool = False

    def __post_init__(self) -> None:
        """Validate the size: even for video, and large enough for readable text."""
        width, height = self.size_px
        if width % 2 or height % 2 or width < 640 or height < 360:
            raise UsageError(
                "image size",
                expected="an even width and height of at least 640x360 pixels",
                found=f"{width}x{height}",
            )

    def draw(self, scene: Scene, canvas: UInt8 | None = None) -> UInt8:
        """Return the image of one frame.

        Args:
            scene: Content of the image.
            canvas: (height, width, 3) canvas, all of which is drawn on and returned; None for a new one.
        """
        width, height = self.size_px
        canvas = np.empty((height, width, 3), np.uint8) if canvas is None else canvas
        panels, body_px = self._panels(scene.result), self._body_px(scene.result)
        views = _Views(self, scene)
        fill_canvas(canvas, palette.BACKGROUND)
        for name, panel in panels.items():
            views.draw(name, panel.of(canvas))
        # Below: legend, maps and times of the stages.
        text_px = self.style.text_px - 1
        largest_px = (round(_MAP_SHARE * width), inset_height_px(height - body_px, text_px))
        insets = map_insets(scene, largest_px, self.display_score)
        draw_strip(canvas[body_px:], scene, self._legend(scene), insets, self.period_s, text_px)
        draw_health(canvas, scene.result.health, self.style.text_px)
        return canvas

    def main_panels(self, result: Result) -> dict[str, PanelArea]:
        """Return by name where two views of a result are drawn: the camera, else the scene in 3D, and from above."""
        panels = self._panels(result)
        first = _CAMERA if _CAMERA in panels else _BEHIND
        return {name: panels[name] for name in (first, _ABOVE)}

    def draw_main_panels(self, scene: Scene) -> dict[str, UInt8]:
        """Return the images of these two views alone, by name."""
        views, images = _Views(self, scene), {}
        for name, panel in self.main_panels(scene.result).items():
            images[name] = blank_canvas(panel.size_px, palette.BACKGROUND)
            views.draw(name, images[name])
        return images

    def _panels(self, result: Result) -> dict[str, PanelArea]:
        """Return where each view is drawn, by its name."""
        width, body_px = self.size_px[0], self._body_px(result)
        grid = self.camera_grid(result)
        aspect = None if grid is None else grid.total_aspect
        left_px, camera_px = left_column_px((width, body_px), aspect, _CAMERA_SHARE)
        # Left: the cameras' images, and below them the scene in 3D; without a camera, 3D alone. Right: from above.
        panels, behind_px = {}, 0
        if grid is not None:
            panels[_CAMERA] = PanelArea(0, 0, left_px, camera_px)
            behind_px = camera_px + _GUTTER_PX
        panels[_BEHIND] = PanelArea(0, behind_px, left_px, body_px)
        panels[_ABOVE] = PanelArea(left_px + _GUTTER_PX, 0, width, body_px)
        return panels

    def camera_grid(self, result: Result) -> CameraGrid | None:
        """Return the cells of the cameras' images; None without any."""
        return camera_grid(result, (self.size_px[0], self._body_px(result)), _CAMERA_SHARE)

    def _body_px(self, result: Result) -> int:
        """Return the height above the strip."""
        height = self.size_px[1]
        return height - round(_STRIP_SHARES[bool(result.map_images)] * height)

    @property
    def style(self) -> Style:
        """Line width and text height."""
        return Style.of_height(self.size_px[1])

    def _legend(self, scene: Scene) -> list[tuple[LegendEntry, ...]]:
        """Return the rows of the legend."""
        legend = list(_LEGEND)
        if scene.tracked is not None:
            legend[-1] = (*legend[-1], _SELECTED)
            if scene.tracked.region is not None:
                legend.append(_REGION)
        if scene.result.occupancy is not None:
            legend.append(_OCCUPANCY)
        if scene.result.vehicles is not None:
            legend += _CLASSES
        if self.detector_views and scene.result.modality_detections:
            entries = (
                LegendEntry(_VIEW_NAMES[modality], (palette.TEXT,), palette.LINE_PATTERNS[modality])
                for modality in scene.result.modality_detections
            )
            legend.append(tuple(entries))
        return legend


class _Views:
    """The three views of one scene."""

    def __init__(self, layout: Composition, scene: Scene) -> None:
        self._layout, self._scene, self._style = layout, scene, layout.style
        self._surface = sample_surface(scene.result.ground, layout.area)
        self._figures = object_figures(scene.objects, scene.paths_velo)

    def draw(self, name: str, panel: UInt8) -> None:
        """Draw the view of a name."""
        if name == _CAMERA:
            self.draw_cameras(panel)
        elif name == _BEHIND:
            self.draw_from_behind(panel)
        else:
            self.draw_from_above(panel)

    def draw_cameras(self, panel: UInt8) -> None:
        """Draw the image of each camera in a cell of its own; the cell of one without an image stays empty."""
        grid, views = self._layout.camera_grid(self._scene.result), views_of(self._scene.result)
        assert grid is not None  # else there is no panel of this name
        cells = grid.cells((panel.shape[1], panel.shape[0]))
        for number, (view, cell) in enumerate(zip(views, cells, strict=True)):
            frame, cell_of = view.frame, cell.of(panel)
            title = self._title(frame.camera)
            if frame.image is None or frame.calibration is None:
                fill_canvas(cell_of, palette.PANEL)
                draw_title(cell_of, f"{title}: no image", self._style.text_px)
                continue
            fitted = FittedImage.onto(cell_of, frame.image)
            self._draw_in_camera(fitted, frame.calibration, view, number)
            draw_title(cell_of, title, self._style.text_px)

    def _draw_in_camera(
        self, fitted: FittedImage, calibration: Calibration, view: Result, number: int
    ) -> None:
        """Draw ground, obstacles and objects over the image of a camera.

        Args:
            fitted: Image of the camera.
            calibration: Calibration of the camera.
            view: Result as the camera shows it.
            number: Number of the camera in `Frame.views`.
        """
        # Everything is drawn after resizing, so that lines and text keep their size.
        image_P_velo, canvas = fitted.resizing.project(calibration.image_P_velo), fitted.canvas
        draw_overlay(canvas, image_P_velo, self._surface, view.obstacles)
        if self._scene.tracked is not None and number == 0:
            line_px = self._style.line_px
            draw_tracked_in_image(canvas, self._scene.tracked, fitted.resizing, line_px)
        figures = replace(self._figures, objects=self._figures.objects.in_camera(number))
        labels = draw_objects(canvas, image_P_velo, figures, self._style, fitted.resizing)
        if self._layout.detector_views:
            for modality in view.modality_detections:
                draw_detector_boxes(
                    canvas,
                    replace(self._scene, result=view),
                    modality,
                    fitted.resizing,
                    display_score=self._layout.display_score,
                    pattern=palette.LINE_PATTERNS[modality],
                )
        self._draw_labels(canvas, labels, self._title(view.frame.camera))

    def _title(self, camera: str) -> str:
        """Return the title of a camera's image: its name where there are several."""
        return camera if self._scene.result.frame.further_cameras else _CAMERA

    def draw_from_behind(self, panel: UInt8) -> None:
        """Draw the scene in 3D from behind the vehicle."""
        image_P_velo = chase_camera((panel.shape[1], panel.shape[0]))
        draw_perspective(panel, image_P_velo, self._scene.result, self._surface)
        labels = draw_objects(panel, image_P_velo, self._figures, self._style)
        self._draw_labels(panel, labels, _BEHIND)
        draw_title(panel, _BEHIND, self._style.text_px)

    def draw_from_above(self, panel: UInt8) -> None:
        """Draw the scene from above, with its scale."""
        area, size_px = self._layout.area, (panel.shape[1], panel.shape[0])
        reaches_m = (area.ahead_m, area.behind_m, area.side_m)
        shown_m = (max(each_m + _SURROUND_M, self._layout.reach_m) for each_m in reaches_m)
        view = view_of_area(LocalArea(*shown_m), size_px)
        result = self._scene.result
        draw_birds_eye(panel, view, result, self._surface)
        taken_px = draw_scale(panel, view, self._style.text_px - 1)
        labels = draw_objects(panel, view.image_P_velo, self._figures, self._style)
        self._draw_labels(panel, labels, _ABOVE, taken_px)
        draw_title(panel, _ABOVE, self._style.text_px)

    def _draw_labels(
        self, canvas: UInt8, labels: Sequence[Label], title: str, taken_px: Sequence[Int] = ()
    ) -> None:
        """Draw labels over everything but the title and other text."""
        text_px = self._style.text_px
        draw_labels(canvas, labels, text_px, [title_area_px(title, text_px), *taken_px])
