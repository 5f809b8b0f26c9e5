"""Tracks drawn through any projection: the camera's or a virtual one.

A track is a box with a filled front, its path, a velocity arrow as long as its path in one second, and a label.
Dashed edges: predicted, not observed in this scan.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from perception.geometry.camera import NEAREST_M, outlines_px, project
from perception.render import palette
from perception.render.palette import Color
from perception.render.strokes import draw_seam, draw_strokes, fill_polygons, project_strokes
from perception.render.track_figures import TrackFigures, TrackPart
from perception.render.track_labels import draw_track_labels
from perception.types import Bool, Float64, Int, UInt8

_FRONT_OPACITY = 0.5
# Brightness of each part: the path fades with its age.
_LIGHT = {
    TrackPart.OLD_PATH: 0.5,
    TrackPart.PATH: 0.75,
    TrackPart.NEW_PATH: 1.0,
    TrackPart.BOX: 1.0,
    TrackPart.ARROW: 1.0,
}
# Boxes with a smaller outline are drawn with thin lines.
_SMALL_PX = 40.0


@dataclass(frozen=True)
class TrackStyle:
    """Line width and text height.

    Attributes:
        line_px: Width of lines in pixels.
        text_px: Height of capitals in pixels.
    """

    line_px: int = 2
    text_px: int = 10

    @classmethod
    def of_height(cls, height_px: int) -> "TrackStyle":
        """Return a style that is legible in an image of a height."""
        return cls(max(round(height_px / 450), 1), max(round(height_px / 90), 7))


def draw_tracks(
    canvas: UInt8,
    image_P_velo: Float64,
    figures: TrackFigures,
    style: TrackStyle,
    unnamed: Int | None = None,
) -> None:
    """Draw tracks onto a canvas, each in the colour of its id.

    Args:
        canvas: (H, W, 3) canvas.
        image_P_velo: (3, 4) projection from the LiDAR frame to the canvas.
        figures: (T) tracks as lines and faces.
        style: Line width and text height.
        unnamed: Ids of tracks without a label.
    """
    if not len(figures.tracks):
        return
    colors = [palette.track_color(track) for track in figures.tracks.ids.tolist()]
    outlines = draw_track_figures(canvas, image_P_velo, figures, colors, style)
    if unnamed is not None:
        outlines[np.isin(figures.tracks.ids, unnamed)] = (0.0, 0.0, -1.0, -1.0)
    draw_track_labels(canvas, outlines, figures, style.text_px)


def draw_track_figures(
    canvas: UInt8,
    image_P_velo: Float64,
    figures: TrackFigures,
    colors: Sequence[Color],
    style: TrackStyle,
) -> Float64:
    """Draw tracks without labels, each in its colour.

    Returns:
        (T, 4) x1 y1 x2 y2 around each box; x1 > x2 where it is not visible.
    """
    count = len(figures.tracks)
    strokes = project_strokes(image_P_velo, canvas, figures.segments_m, figures.numbers)
    boxes = slice(TrackPart.BOX * count, TrackPart.ARROW * count)
    outlines = outlines_px(strokes.ends_px, strokes.owners, len(TrackPart) * count)[boxes]
    is_dashed = np.zeros(len(TrackPart) * count, bool)
    is_dashed[boxes] = ~figures.tracks.is_observed
    widths_px = np.full(len(TrackPart) * count, style.line_px)
    widths_px[boxes][_is_small(outlines)] = 1
    _fill_fronts(canvas, image_P_velo, figures, colors)
    strokes = strokes.dashed(is_dashed)
    # A dark outline keeps boxes and arrows visible on any background.
    draw_seam(canvas, strokes.since(TrackPart.BOX * count), palette.BACKGROUND, style.line_px + 2)
    draw_strokes(canvas, strokes, _colors_of_parts(colors), widths_px)
    return np.asarray(outlines)


def _colors_of_parts(colors: Sequence[Color]) -> list[Color]:
    """Return the colour of each line number."""
    return [
        (round(light * red), round(light * green), round(light * blue))
        for light in _LIGHT.values()
        for red, green, blue in colors
    ]


def _fill_fronts(
    canvas: UInt8, image_P_velo: Float64, figures: TrackFigures, colors: Sequence[Color]
) -> None:
    """Fill the front faces of the boxes that face the camera."""
    pixels, depth_m = project(image_P_velo, figures.faces_m.reshape(-1, 3))
    polygons = pixels.reshape(-1, 4, 2)
    shown = (depth_m.reshape(-1, 4) > NEAREST_M).all(axis=1)
    shown &= _is_near(polygons, canvas) & _is_clockwise(polygons)
    face_colors = [colors[face % len(colors)] for face in np.flatnonzero(shown).tolist()]
    fill_polygons(canvas, polygons[shown], face_colors, _FRONT_OPACITY)


def _is_near(polygons_px: Float64, canvas: UInt8) -> Bool:
    """Return the (F,) mask of the (F, C, 2) polygons within one canvas size of the canvas."""
    size = np.array([canvas.shape[1], canvas.shape[0]])
    return np.asarray(((polygons_px > -size) & (polygons_px < 2 * size)).all(axis=(1, 2)))


def _is_clockwise(polygons_px: Float64) -> Bool:
    """Return the (F,) mask of the (F, C, 2) polygons that are clockwise and have an area."""
    following = np.roll(polygons_px, -1, axis=1)
    cross = polygons_px[..., 0] * following[..., 1] - polygons_px[..., 1] * following[..., 0]
    return np.asarray(cross.sum(axis=1) > 1.0)


def _is_small(outlines: Float64) -> Bool:
    return np.asarray((outlines[:, 2:] - outlines[:, :2]).max(axis=1) < _SMALL_PX)
