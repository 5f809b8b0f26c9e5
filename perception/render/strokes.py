"""Lines of a scene through any projection: anti-aliased, clipped at the view, dashed."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import cv2
import numpy as np

from perception.geometry.camera import project_segments
from perception.render.canvas import FIXED_POINT_BITS, fixed_point
from perception.render.palette import Color, LinePattern
from perception.types import Float64, Int, UInt8

# Lines are continued beyond the canvas, so that their ends are not visible.
_MARGIN_PX = 8.0


@dataclass(frozen=True)
class Strokes:
    """K lines on a canvas.

    Attributes:
        owners: (K,) number of the object that each line belongs to.
        ends_px: (K, 2, 2) columns and rows of both ends of each line.
    """

    owners: Int
    ends_px: Float64

    def since(self, owner: int) -> Self:
        """Return the lines of an owner and of all after it."""
        kept = self.owners >= owner
        return type(self)(self.owners[kept], self.ends_px[kept])

    def joined(self, others: Self) -> Self:
        """Return these lines, then the others."""
        return type(self)(
            np.concatenate([self.owners, others.owners]),
            np.concatenate([self.ends_px, others.ends_px]),
        )

    def dashed(self, pattern: LinePattern) -> Self:
        """Return the lines cut into dashes."""
        period_px, drawn = pattern
        along = np.diff(self.ends_px, axis=1)
        periods = np.hypot(*along[:, 0].T) / period_px
        counts = np.ceil(periods).astype(np.int64)
        line = np.repeat(np.arange(len(counts)), counts)
        number = np.arange(len(line)) - (np.cumsum(counts) - counts)[line]
        # (D, dashes of a pattern, 2) starts and stops as shares of the line.
        shares = (number[:, None, None] + np.array(drawn)) / periods[line, None, None]
        shares = np.minimum(shares, 1.0).reshape(-1, 2, 1)
        line = np.repeat(line, len(drawn))
        return type(self)(self.owners[line], self.ends_px[line, :1] + shares * along[line])


def project_strokes(
    image_P_velo: Float64, canvas: UInt8, segments_velo: Float64, owners: Int
) -> Strokes:
    """Project (S, 2, 3) segments of (S,) owners onto a canvas."""
    size_px = (canvas.shape[1], canvas.shape[0])
    visible = project_segments(image_P_velo, segments_velo, size_px, margin_px=_MARGIN_PX)
    return Strokes(owners[visible.rows], visible.ends_px)


def rectangle_strokes(boxes_px: Float64, owners: Int) -> Strokes:
    """Return the sides of (M, 4) rectangles x1 y1 x2 y2 of (M,) owners."""
    corners = boxes_px[:, [[0, 1], [2, 1], [2, 3], [0, 3]]]
    sides = np.stack([corners, np.roll(corners, -1, axis=1)], axis=2)
    return Strokes(np.repeat(owners, 4).astype(np.int64), sides.reshape(-1, 2, 2))


def draw_strokes(canvas: UInt8, strokes: Strokes, colors: Sequence[Color], widths_px: Int) -> None:
    """Draw all lines anti-aliased, owner by owner, in the colours and widths of their owners."""
    # Thin lines side by side cost half as much as one thick line with its round ends.
    widths = np.asarray(widths_px[strokes.owners], np.int64)
    line = np.repeat(np.arange(len(widths)), widths)
    first = np.cumsum(widths) - widths
    number = np.arange(len(line)) - first[line]
    along = strokes.ends_px[:, 1] - strokes.ends_px[:, 0]
    length_px = np.maximum(np.hypot(along[:, 0], along[:, 1]), 1e-6)
    across = (along[:, ::-1] * (-1, 1) / length_px[:, None])[line]
    offsets = (number - (widths[line] - 1) / 2)[:, None] * across
    lines = fixed_point(strokes.ends_px[line] + offsets[:, None])
    owners = strokes.owners[line]
    order = np.argsort(owners, kind="stable")
    present, starts = np.unique(owners[order], return_index=True)
    for owner, part in zip(present.tolist(), np.split(lines[order], starts[1:]), strict=False):
        cv2.polylines(canvas, list(part), False, colors[owner], 1, cv2.LINE_AA, FIXED_POINT_BITS)


def draw_seam(canvas: UInt8, strokes: Strokes, color: Color, width_px: int) -> None:
    """Draw all lines without anti-aliasing, as a background of others."""
    if len(strokes.owners):
        lines = fixed_point(strokes.ends_px)
        cv2.polylines(canvas, list(lines), False, color, width_px, cv2.LINE_8, FIXED_POINT_BITS)


def fill_polygons(
    canvas: UInt8, corners_px: Float64, colors: Sequence[Color], opacity: float
) -> None:
    """Fill (F, C, 2) convex polygons, each in its colour, with an opacity from 0 to 1."""
    if not len(corners_px):
        return
    # Only the part of the canvas that the polygons touch is blended.
    height, width = canvas.shape[:2]
    low = np.clip(np.floor(corners_px.min(axis=(0, 1))) - 1, 0, (width, height)).astype(int)
    high = np.clip(np.ceil(corners_px.max(axis=(0, 1))) + 2, 0, (width, height)).astype(int)
    touched = canvas[low[1] : high[1], low[0] : high[0]]
    if not touched.size:
        return
    painted = touched.copy()
    for polygon, color in zip(fixed_point(corners_px - low), colors, strict=True):
        cv2.fillConvexPoly(painted, polygon, color, cv2.LINE_AA, FIXED_POINT_BITS)
    cv2.addWeighted(painted, opacity, touched, 1 - opacity, 0, dst=touched)
