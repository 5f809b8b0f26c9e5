"""Range image of one scan, and the visibility of places in it: free, hit or occluded.

Every return has two meanings: there is an object at its end, and free space before it. The thesis counts only the
first; the second separates moving objects from those that were occluded before.
"""

from dataclasses import dataclass
from enum import IntEnum
from typing import Any, TypeVar, cast

import numpy as np

from perception.kernels.range_images import (
    ProjectionNumbers,
    are_free,
    nearest_returns,
    pixels_of,
    visibility_of,
)
from perception.sensor import LidarModel
from perception.types import Bool, Float32, Int, UInt8

Image = TypeVar("Image", Float32, Bool)
_SLOPE_STEPS = 4096
_FIRINGS_A_COLUMN = 2  # so that a lost return rarely empties a pixel
_LEVELS = 4


class Visibility(IntEnum):
    """Visibility of a place in a scan."""

    UNKNOWN = 0  # no beam is near, or the beams disagree
    FREE = 1  # every beam around passed, and above and below one of them ended farther away
    HIT = 2  # a beam ended here
    OCCLUDED = 3  # a beam ended before it
    UNCOVERED = 4  # occluded by what has left since


@dataclass(frozen=True)
class PointVisibility:
    """Visibility of P places in a scan.

    Attributes:
        states: (P,) `Visibility`.
        gaps_m: (P,) distance in metres from the return before it to an occluded place; 0 for other places.
    """

    states: UInt8
    gaps_m: Float32


@dataclass(frozen=True)
class RangeImagePixels:
    """Where P points fall in a range image.

    Attributes:
        rows: (P,) nearest beam, the highest is 0.
        next_rows: (P,) beam on the other side of the point; the nearest itself beyond the first and the last.
        columns: (P,) direction around the vertical.
        ranges_m: (P,) distance from the sensor.
        is_in_view: (P,) whether a beam of the sensor points in that direction.
    """

    rows: Int
    next_rows: Int
    columns: Int
    ranges_m: Float32
    is_in_view: Bool


class SphericalProjection:
    """The pixels of a sensor: one row a beam, one column for every two firings.

    Near the sensor a small shift of a point spans many pixels. So places are compared with blocks of
    pixels: level l spans 2^l columns to either side, and as many rows as make the same angle, but
    always the beam above and the beam below, so that no object fits between them.
    """

    def __init__(self, sensor: LidarModel, tolerance_m: float) -> None:
        """Lay out the pixels.

        Args:
            sensor: LiDAR model with its beams and its azimuth step.
            tolerance_m: Largest error of a position across the beam in metres, from pose and beam.
        """
        self.rows = sensor.beams
        self.elevations_rad = sensor.elevations_rad.astype(np.float32)
        self.columns = max(sensor.columns // _FIRINGS_A_COLUMN, 1)
        self.column_step_rad = 2 * np.pi / self.columns
        step_rad = sensor.elevation_step_rad
        rising = np.linspace(
            sensor.elevations_rad[-1] - step_rad, sensor.elevations_rad[0] + step_rad, _SLOPE_STEPS
        )
        slopes = np.linspace(np.tan(rising[0]), np.tan(rising[-1]), _SLOPE_STEPS)
        between = np.interp(-np.arctan(slopes), -sensor.elevations_rad, np.arange(self.rows))
        nearest = np.rint(between)
        following = nearest + np.sign(between - nearest)
        # The projection as compiled functions take it.
        self.numbers: tuple[Int, ProjectionNumbers] = (
            np.stack([nearest, following]).astype(np.int32),
            (slopes[0], 1 / (slopes[1] - slopes[0]), 1 / self.column_step_rad, self.columns),
        )
        columns_aside = 2 ** np.arange(_LEVELS)
        rows_aside = np.maximum(np.ceil(columns_aside * self.column_step_rad / step_rad), 1)
        self.blocks: Int = np.stack([rows_aside.astype(np.int64), columns_aside], axis=1)
        self.level_0_from_m = tolerance_m / self.column_step_rad

    def pixels(self, points_velo: Float32) -> RangeImagePixels:
        """Find the pixels of (P, 3+) points in the sensor's frame."""
        return RangeImagePixels(*pixels_of(_contiguous(points_velo), *self.numbers))


class RangeImage:
    """The nearest return in each pixel of one scan."""

    def __init__(self, points_velo: Float32, projection: SphericalProjection) -> None:
        """Make the image of a scan; points outside the sensor's elevations are left out."""
        ranges = nearest_returns(_contiguous(points_velo), *projection.numbers, projection.rows)
        self._projection = projection
        self._framed = _framed(ranges)

    def visibility(self, points_velo: Float32, margin_m: float) -> PointVisibility:
        """Return whether (P, 3+) places in this scan's frame are free, hit or occluded.

        Args:
            points_velo: (P, 3+) positions in the frame of the scan.
            margin_m: Distance in metres by which a beam must go farther to have passed, and within which it must end
                to have hit.
        """
        return PointVisibility(*visibility_of(*self._query(points_velo, margin_m)))

    def are_free(self, points_velo: Float32, margin_m: float) -> Bool:
        """Return which (P, 3+) places `visibility` calls free, in half of its time."""
        return are_free(*self._query(points_velo, margin_m))

    def _query(self, points_velo: Float32, margin_m: float) -> tuple[Any, ...]:
        """Return the arguments of a compiled function that compares places with blocks of pixels."""
        projection = self._projection
        return (
            _contiguous(points_velo),
            *projection.numbers,
            projection.blocks,
            self._framed,
            projection.elevations_rad,
            projection.level_0_from_m,
            margin_m,
        )


def _contiguous(points: Float32) -> Float32:
    return np.ascontiguousarray(points, np.float32)


def _framed(image: Image) -> Image:
    """Pad an image by one pixel on every side, so that neighbours are at a fixed offset."""
    framed = np.empty((image.shape[0] + 2, image.shape[1] + 2), image.dtype)
    # A sixth of the time of np.pad.
    framed[1:-1, 1:-1] = image
    framed[1:-1, 0], framed[1:-1, -1] = image[:, -1], image[:, 0]
    framed[0], framed[-1] = framed[1], framed[-2]
    return cast(Image, framed)
