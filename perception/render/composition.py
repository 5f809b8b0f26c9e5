"""One picture that explains one frame: camera, scene in 3D, bird's-eye view, legend, stage times."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from perception.errors import UsageError
from perception.geometry.grids import LocalArea
from perception.render import palette
from perception.render.birds_eye import draw_birds_eye, view_of_area
from perception.render.canvas import blank_canvas
from perception.render.follow_figures import FollowFigure
from perception.render.overlay import draw_overlay
from perception.render.panels import FittedImage, LegendEntry, draw_legend, place_panel
from perception.render.perspective import chase_camera, draw_perspective
from perception.render.stage_bar import draw_stage_bar
from perception.render.surface import Surface, sample_surface
from perception.render.text import Align, draw_text
from perception.render.track_figures import TrackFigures, track_figures
from perception.render.tracks import TrackStyle, draw_tracks
from perception.render.trails import Trails
from perception.types import Float64, Result, UInt8

# The parts of the picture, as shares of its width and height.
_LEFT_SHARE = 0.70
_FOOTER_SHARE = 0.075
_CAMERA_SHARE = 0.46
_BAR_SHARES = (0.27, 0.86)
_GUTTER_PX = 4
# The bird's-eye view shows a little more than the area that is searched.
_SURROUND_M = 1.0
_LEGEND: tuple[LegendEntry, ...] = (
    ("ground", (palette.GROUND,)),
    ("static", (palette.STATIC,)),
    ("moving", (palette.MOVING,)),
    ("tracks", palette.TRACKS),
)
_FOLLOWED: LegendEntry = ("followed", (palette.FOLLOWED,))


@dataclass(frozen=True)
class Composition:
    """How results become pictures of one fixed size.

    Attributes:
        size_px: (width, height), even as video needs it.
        area: the local area that the obstacle stages searched.
        turn_s: time of one turn of the LiDAR, the budget of a frame.
    """

    size_px: tuple[int, int] = (1600, 900)
    area: LocalArea = field(default_factory=LocalArea)
    turn_s: float = 0.1

    def __post_init__(self) -> None:
        """Refuse sizes that no video can have, or that hold no readable text."""
        width, height = self.size_px
        if width % 2 or height % 2 or width < 640 or height < 360:
            raise UsageError(
                "picture size",
                expected="an even width and height of at least 640x360 pixels",
                found=f"{width}x{height}",
            )

    def draw(
        self,
        result: Result,
        trails: Trails | None = None,
        followed: FollowFigure | None = None,
    ) -> UInt8:
        """Return the (height, width, 3) picture of one frame.

        Args:
            result: what the pipeline made of it.
            trails: where its tracks were before, or None where nobody remembers.
            followed: one object drawn over all others, or None.
        """
        width, height = self.size_px
        scene = self._scene(result, trails, followed)
        canvas = blank_canvas(self.size_px, palette.BACKGROUND)
        body_px, left_px = round(height * (1 - _FOOTER_SHARE)), round(width * _LEFT_SHARE)
        # Left: what the camera sees, and below it the same in 3D; without a camera, 3D alone.
        camera = _draw_camera(scene, (left_px, round(body_px * _CAMERA_SHARE)))
        behind_top_px = len(camera) + _GUTTER_PX if len(camera) else 0
        behind = _draw_from_behind(scene, (left_px, body_px - behind_top_px))
        place_panel(canvas, camera, (0, 0), "Camera")
        place_panel(canvas, behind, (0, behind_top_px), "3D, from behind the vehicle")
        # Right: the same from above.
        right_px = left_px + _GUTTER_PX
        above = self._draw_from_above(scene, (width - right_px, body_px))
        place_panel(canvas, above, (right_px, 0), "From above")
        # Below: what the colours mean, and where the time went.
        is_tracking = trails is not None or len(result.tracks) > 0
        legend = list(_LEGEND if is_tracking else _LEGEND[:-1])
        if followed is not None:
            legend.append(_FOLLOWED)
        self._draw_footer(canvas[body_px:], result, legend)
        return canvas

    def _scene(
        self, result: Result, trails: Trails | None, followed: FollowFigure | None
    ) -> "_Scene":
        here = result.tracks.boxes.bottom_m[:, None]
        paths_velo = list(here) if trails is None else trails.paths_velo(result)
        surface = sample_surface(result.ground, self.area)
        figures = track_figures(result.tracks, paths_velo)
        style = TrackStyle.of_height(self.size_px[1])
        return _Scene(result, surface, figures, style, followed)

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

    def _draw_footer(self, canvas: UInt8, result: Result, legend: Sequence[LegendEntry]) -> None:
        height, width = canvas.shape[:2]
        text_px = round(0.19 * height)
        legend_px = draw_legend(canvas, legend, text_px)
        start, stop = (round(share * width) for share in _BAR_SHARES)
        start = max(start, legend_px)
        draw_stage_bar(canvas[:, start:stop], result.timings_s, self.turn_s, round(0.85 * text_px))
        total_s = sum(result.timings_s.values())
        lines = [f"frame {result.frame.index}   {result.frame.stamp_s:.1f} s"]
        if total_s > 0:
            lines.insert(0, f"{total_s * 1e3:.0f} ms = {1 / total_s:.0f} frames/s")
        for line, words in enumerate(lines):
            at = (width - 1.2 * text_px, height * (0.42 + 0.4 * line))
            color = palette.FAINT_TEXT if line else palette.TEXT
            draw_text(canvas, words, at, color=color, height_px=text_px, align=Align.RIGHT)


@dataclass(frozen=True)
class _Scene:
    """All that the three views show.

    Attributes:
        result: of one frame.
        surface: its ground, sampled.
        figures: its tracks.
        style: how large tracks are drawn.
        followed: the object that is followed by itself, or None.
    """

    result: Result
    surface: Surface
    figures: TrackFigures
    style: TrackStyle
    followed: FollowFigure | None

    def draw_tracks(self, panel: UInt8, image_P_velo: Float64) -> None:
        """Draw the tracks over a view."""
        draw_tracks(panel, image_P_velo, self.figures, self.style)
        if self.followed is not None:
            bold = replace(self.style, line_px=self.style.line_px + 1)
            self.followed.draw(panel, image_P_velo, bold)


def _draw_camera(scene: _Scene, largest_px: tuple[int, int]) -> UInt8:
    """Return the overlay at the largest size that fits, centred on a strip; empty without a camera."""
    image, calibration = scene.result.frame.image, scene.result.frame.calibration
    if image is None or calibration is None:
        return np.zeros((0, largest_px[0], 3), np.uint8)
    image_P_velo = calibration.image_P_velo
    overlay = draw_overlay(image, image_P_velo, scene.surface, scene.result.obstacles)
    fitted = FittedImage.within(overlay, largest_px)
    # Lines and letters are drawn at the size at which they are seen.
    scene.draw_tracks(fitted.picture, fitted.resizing.project(image_P_velo))
    return fitted.on_strip(largest_px[0])


def _draw_from_behind(scene: _Scene, size_px: tuple[int, int]) -> UInt8:
    panel = draw_perspective(size_px, scene.result, scene.surface)
    scene.draw_tracks(panel, chase_camera(size_px))
    return panel
