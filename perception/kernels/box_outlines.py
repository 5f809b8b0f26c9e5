"""Outlines of upright boxes in an image."""

import numpy as np

from perception.kernels.compiled import NUMBER, WHOLE, array_of, compiled, written
from perception.types import Float64, Int

_BOXES, _EDGES = array_of(NUMBER, 2), array_of(WHOLE, 2)


@compiled((written(NUMBER), NUMBER, NUMBER, NUMBER))
def _include(outline: Float64, u: float, v: float, w: float) -> None:
    """Extend an outline x1 y1 x2 y2 to a homogeneous pixel."""
    outline[0], outline[1] = min(outline[0], u / w), min(outline[1], v / w)
    outline[2], outline[3] = max(outline[2], u / w), max(outline[3], v / w)


@compiled((_BOXES, array_of(NUMBER, 3), array_of(NUMBER, 2), array_of(NUMBER, 2), _EDGES, NUMBER))
def box_outlines(
    boxes: Float64, projections: Float64, limits: Float64, signs: Float64, edges: Int, near: float
) -> Float64:
    """Return (M, 4) x1 y1 x2 y2 around projected boxes; NaN of one that is not in the image.

    Args:
        boxes: (M, 7) x, y, z of the middle of the bottom, length, width, height, heading.
        projections: (M, 3, 4) projections to pixels, or (1, 3, 4) one for all.
        limits: (M, 4) or (1, 4) lowest column and row of the image, and the highest.
        signs: (8, 3) corners along heading, left and up, in length, width and height.
        edges: (12, 2) corners at the ends of each edge.
        near: Depth at which edges that lead behind the camera are cut.
    """
    outlines = np.full((len(boxes), 4), np.nan)
    corners = np.empty((len(signs), 3))
    for box in range(len(boxes)):
        x, y, z, length, width, height, heading = boxes[box]
        if np.isnan(x + y + z + length + width + height + heading):
            continue
        cos, sin = np.cos(heading), np.sin(heading)
        projection = projections[min(box, len(projections) - 1)]
        outline = np.array([np.inf, np.inf, -np.inf, -np.inf])
        for corner in range(len(signs)):
            along, left = signs[corner, 0] * length, signs[corner, 1] * width
            at_x, at_y = x + (cos * along - sin * left), y + (sin * along + cos * left)
            at_z = z + signs[corner, 2] * height
            for row in range(3):
                corners[corner, row] = (
                    projection[row, 0] * at_x
                    + projection[row, 1] * at_y
                    + projection[row, 2] * at_z
                    + projection[row, 3]
                )
            u, v, w = corners[corner]
            if w >= near:
                _include(outline, u, v, w)
        for edge in range(len(edges)):
            first, second = corners[edges[edge, 0]], corners[edges[edge, 1]]
            before, behind = first[2] - near, second[2] - near
            if (before < 0) != (behind < 0):
                share = before / (before - behind)
                u, v, w = first * (1 - share) + second * share
                _include(outline, u, v, w)
        limit = limits[min(box, len(limits) - 1)]
        for side in range(4):
            low, high = limit[side % 2], limit[2 + side % 2]
            outline[side] = min(max(outline[side], low), high)
        if outline[2] > outline[0] and outline[3] > outline[1]:
            outlines[box] = outline
    return outlines
