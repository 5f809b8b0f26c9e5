"""Region of an image that an object covers, and the ring around it: Ω and Ω† - Ω (5.3.3).

Pixel (column, row) has its centre at (column, row), as in KITTI's projection. A pixel belongs to a region if its
centre lies within the region's outline.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import cv2
import numpy as np

from perception.tracking.single_object.config import ColorModelConfig
from perception.types import Bool, Float, Float64, Int


@dataclass(frozen=True)
class ImageRegion:
    """Convex outline of an object in an image, and on demand the pixels within and around it.

    The outline is not cut off at the image's borders; only the pixels are. An object that leaves the image
    loses its pixels, and has them again when it returns.

    Attributes:
        hull_px: (V, 2) columns and rows of the corners of Ω.
        image_size_px: Width and height of the image.
        ring_scale: Length of the outline of Ω† relative to that of Ω.
    """

    hull_px: Float64
    image_size_px: tuple[int, int]
    ring_scale: float = ColorModelConfig.ring_scale

    @cached_property
    def corner_px(self) -> Int:
        """(2,) column and row of the upper left pixel of the window that holds Ω†."""
        low = np.ceil(self.outer_px.min(axis=0))
        return np.asarray(np.clip(low, 0, self.image_size_px).astype(int))

    @cached_property
    def is_inside(self) -> Bool:
        """(h, w) whether a pixel of the window lies within Ω."""
        return self._pixels_within(self.hull_px)

    @cached_property
    def is_ring(self) -> Bool:
        """(h, w) whether a pixel of the window lies within Ω† but not within Ω."""
        return self._pixels_within(self.outer_px) & ~self.is_inside

    @property
    def window(self) -> tuple[slice, slice]:
        """Rows and columns of the image that `is_inside` and `is_ring` cover."""
        (column, row), (height, width) = self.corner_px, self.is_inside.shape
        return slice(row, row + height), slice(column, column + width)

    @cached_property
    def outer_px(self) -> Float64:
        """(V, 2) corners of Ω†, the outline of the ring."""
        return self.center_px + self.ring_scale * (self.hull_px - self.center_px)

    @cached_property
    def center_px(self) -> Float64:
        """(2,) centroid of the area of Ω."""
        return _centroid(self.hull_px)

    @property
    def box_px(self) -> Float64:
        """(4,) x1 y1 x2 y2 around Ω, which may reach beyond the image."""
        return np.concatenate([self.hull_px.min(axis=0), self.hull_px.max(axis=0)])

    def shifted(self, by_px: Float64, image_size_px: tuple[int, int]) -> Self:
        """Return the region moved by columns and rows in the next image; without a pixel where it has left the image."""
        return type(self)(self.hull_px + by_px, image_size_px, self.ring_scale)

    def _pixels_within(self, outline_px: Float64) -> Bool:
        high = np.floor(self.outer_px.max(axis=0)) + 1
        end_px = np.clip(high, self.corner_px, self.image_size_px).astype(int)
        return _pixels_within(outline_px, self.corner_px, end_px)


def region_of(
    points_px: Float,
    image_size_px: tuple[int, int],
    ring_scale: float = ColorModelConfig.ring_scale,
) -> ImageRegion | None:
    """Outline an object by its projected points.

    Args:
        points_px: (N, 2) columns and rows; those not finite, as of points behind the camera, are left out.
        image_size_px: Width and height of the image.
        ring_scale: Length of the ring's outline relative to the object's.

    Returns:
        None where the points lie on one line, or where no pixel of the image lies within their hull.
    """
    finite = points_px[np.isfinite(points_px).all(axis=1)]
    if len(finite) < 3:
        return None
    # Hulls are found in single precision; the corners are those that came in.
    corners = cv2.convexHull(finite.astype(np.float32), returnPoints=False)
    hull_px = np.asarray(finite[np.asarray(corners).ravel()], np.float64)
    if len(hull_px) < 3:
        return None
    region = ImageRegion(hull_px, image_size_px, ring_scale)
    return region if region.is_inside.any() else None


def _centroid(hull_px: Float64) -> Float64:
    """Return the centroid of a polygon's area; the mean of its corners where it has none."""
    middle = hull_px.mean(axis=0)
    here = hull_px - middle
    ahead, areas = np.roll(here, -1, axis=0), _signed_areas(here)
    whole = areas.sum()
    return np.asarray(middle + areas @ (here + ahead) / (3 * whole) if whole else middle)


def _signed_areas(hull_px: Float64) -> Float64:
    """Return (V,) areas between origin and edge, positive where columns turn to rows along the outline."""
    here, ahead = hull_px, np.roll(hull_px, -1, axis=0)
    return np.asarray((here[:, 0] * ahead[:, 1] - here[:, 1] * ahead[:, 0]) / 2)


def _pixels_within(hull_px: Float64, low: Int, high: Int) -> Bool:
    """Return (h, w): which pixels from low to before high lie within a convex outline.

    Such an outline is where half-planes meet: it has each row of pixels from the innermost of the edges
    on its left to the innermost of those on its right.
    """
    rows, columns = np.arange(low[1], high[1])[:, None], np.arange(low[0], high[0], dtype=np.int32)
    area = _signed_areas(hull_px - hull_px[0]).sum()
    if area == 0:
        return np.zeros((len(rows), columns.size), bool)
    # From columns to rows is clockwise on the screen: what goes down then is on the right.
    run, rise = (np.roll(hull_px, -1, axis=0) - hull_px).T * np.sign(area)

    def crossings(edges: Bool) -> Float64:
        slope = run[edges] / rise[edges]
        return np.asarray(hull_px[edges, 0] + (rows - hull_px[edges, 1]) * slope)

    left = crossings(rise < 0).max(axis=1, keepdims=True)
    right = crossings(rise > 0).min(axis=1, keepdims=True)
    is_beside = (rows >= hull_px[:, 1].min()) & (rows <= hull_px[:, 1].max())
    # Whole numbers compare several times faster; the outline may lie far beyond the image.
    first = np.clip(np.ceil(left), low[0], high[0]).astype(np.int32)
    last = np.clip(np.floor(right), low[0] - 1, high[0]).astype(np.int32)
    return np.asarray((columns >= first) & (columns <= np.where(is_beside, last, -1)))
