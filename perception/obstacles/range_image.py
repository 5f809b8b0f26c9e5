"""Range image of one scan, and the visibility of places in it: free, hit or occluded.

Every return has two meanings: there is an object at its end, and free space before it. The thesis counts only the
first; the second separates moving objects from those that were occluded before.
"""

from dataclasses import dataclass
from enum import IntEnum
from typing import TypeVar, cast

import cv2
import numpy as np

from perception.sensor import LidarModel
from perception.types import Bool, Float32, Int, UInt8

Image = TypeVar("Image", Float32, Bool)
_NOTHING = np.float32(np.inf)  # a direction without a return: dark, glass, or sky
_SLOPE_STEPS = 4096
_FIRINGS_A_COLUMN = 2  # so that a lost return rarely empties a pixel
_LEVELS = 4


class Visibility(IntEnum):
    """Visibility of a place in a scan."""

    UNKNOWN = 0  # no beam is near, or the beams disagree
    FREE = 1  # every beam around passed and ended farther away
    HIT = 2  # a beam ended here
    OCCLUDED = 3  # a beam ended before it


@dataclass(frozen=True)
class PointVisibility:
    """Visibility of P places in a scan.

    Attributes:
        states: (P,) `Sight`.
        gaps_m: (P,) distance in metres from the return before it to an occluded place; 0 for other places.
    """

    states: UInt8
    gaps_m: Float32


@dataclass(frozen=True)
class RangeImagePixels:
    """Where P points fall in a range image.

    Attributes:
        rows: (P,) nearest beam, the highest is 0.
        columns: (P,) direction around the vertical.
        ranges_m: (P,) distance from the sensor.
        is_in_view: (P,) whether a beam of the sensor points in that direction.
    """

    rows: Int
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
        self.columns = max(sensor.columns // _FIRINGS_A_COLUMN, 1)
        self.column_step_rad = 2 * np.pi / self.columns
        step_rad = sensor.elevation_step_rad
        rising = np.linspace(
            sensor.elevations_rad[-1] - step_rad, sensor.elevations_rad[0] + step_rad, _SLOPE_STEPS
        )
        self._lowest_slope = np.float32(np.tan(rising[0]))
        self._highest_slope = np.float32(np.tan(rising[-1]))
        slopes = np.linspace(self._lowest_slope, self._highest_slope, _SLOPE_STEPS)
        nearest = np.interp(-np.arctan(slopes), -sensor.elevations_rad, np.arange(self.rows))
        self._row_of_slope = np.rint(nearest).astype(np.int32)
        self.blocks = [
            (max(1, int(np.ceil(2**level * self.column_step_rad / step_rad))), 2**level)
            for level in range(_LEVELS)
        ]
        self._level_0_from_m = np.float32(tolerance_m / self.column_step_rad)

    def pixels(self, points_velo: Float32) -> RangeImagePixels:
        """Find the pixels of (P, 3+) points in the sensor's frame."""
        x, y, z = np.ascontiguousarray(points_velo[:, :3].T)
        polar = cv2.cartToPolar(x, y) if len(x) else (x, y)  # OpenCV returns nothing for nothing
        across, azimuth_rad = (part.ravel() for part in polar)
        slope = z / np.maximum(across, np.float32(1e-3))
        scale = np.float32((_SLOPE_STEPS - 1) / (self._highest_slope - self._lowest_slope))
        step = (slope - self._lowest_slope) * scale
        return RangeImagePixels(
            rows=self._row_of_slope[np.clip(step, 0, _SLOPE_STEPS - 1).astype(np.int32)],
            columns=np.minimum(
                (azimuth_rad * np.float32(1 / self.column_step_rad)).astype(np.int32),
                self.columns - 1,
            ),
            ranges_m=np.sqrt(across * across + z * z),
            is_in_view=(step >= 0) & (step <= _SLOPE_STEPS - 1),
        )

    def levels(self, ranges_m: Float32) -> Int:
        """Return (P,) the block level that spans the tolerance at each range."""
        finer = self._level_0_from_m / np.maximum(ranges_m, np.float32(1e-3))
        return np.searchsorted(2.0 ** np.arange(_LEVELS - 1), finer).astype(np.int32)


class RangeImage:
    """The nearest return in each pixel of one scan."""

    def __init__(self, points_velo: Float32, projection: SphericalProjection) -> None:
        """Make the image of a scan; points outside the sensor's elevations are left out."""
        pixels = projection.pixels(points_velo)
        cells = (pixels.rows * projection.columns + pixels.columns)[pixels.is_in_view]
        flat = np.full(projection.rows * projection.columns, _NOTHING, np.float32)
        np.minimum.at(flat, cells, pixels.ranges_m[pixels.is_in_view])
        ranges = flat.reshape(projection.rows, projection.columns)
        self._projection = projection
        self._nearest = _block_minima(ranges, projection.blocks)
        self._framed = _framed(ranges)
        self._is_moving = np.zeros(self._framed.shape, bool)

    def mark_moving(self, points_velo: Float32) -> None:
        """Remember that these (P, 3+) returns of the scan are of something that moved."""
        pixels = self._projection.pixels(points_velo)
        is_moving = np.zeros((self._projection.rows, self._projection.columns), bool)
        is_moving[pixels.rows, pixels.columns] = True
        self._is_moving = _framed(is_moving)

    def visibility(self, points_velo: Float32, margin_m: float) -> PointVisibility:
        """Return whether (P, 3+) places in this scan's frame are free, hit or occluded.

        Args:
            points_velo: (P, 3+) positions in the frame of the scan.
            margin_m: Distance in metres by which a beam must go farther to have passed, and within which it must end
                to have hit.
        """
        at = self._projection.pixels(points_velo)
        margin = np.float32(margin_m)
        pixel = self._framed_pixels(at)
        beam = self._framed.ravel().take(pixel)
        states = np.where(beam < at.ranges_m - margin, np.uint8(Visibility.OCCLUDED), np.uint8(0))
        states[self._is_passed(at, margin)] = Visibility.FREE
        states[self._ends_near(pixel, at.ranges_m, margin)] = Visibility.HIT
        states[~at.is_in_view] = Visibility.UNKNOWN
        gaps_m = np.where(states == Visibility.OCCLUDED, at.ranges_m - beam, np.float32(0))
        return PointVisibility(states, gaps_m)

    def is_free(self, points_velo: Float32, margin_m: float) -> Bool:
        """Return which (P, 3+) places are free, as `visibility` has it."""
        at = self._projection.pixels(points_velo)
        return self._is_passed(at, np.float32(margin_m)) & at.is_in_view

    def _is_passed(self, at: RangeImagePixels, margin_m: np.float32) -> Bool:
        """Return where every beam of the block around ended farther away."""
        pixel = at.rows * self._projection.columns + at.columns
        level = self._projection.levels(at.ranges_m)
        around = self._nearest.ravel().take(level * self._nearest.shape[1] + pixel)
        return np.asarray((around > at.ranges_m + margin_m) & (around < _NOTHING))

    def returns(self, points_velo: Float32, margin_m: float) -> tuple[Bool, Bool]:
        """Return at which (P, 3+) places a beam ended, and beyond which one did, among the beams next to them.

        Unlike `visibility`, single beams count: those that pass between leaves or the wires of a fence. Returns of
        what moved do not.
        """
        at = self._projection.pixels(points_velo)
        pixel, beams, is_moving = (
            self._framed_pixels(at),
            self._framed.ravel(),
            self._is_moving.ravel(),
        )
        margin, ended, passed = np.float32(margin_m), *np.zeros((2, len(pixel)), bool)
        for step in self._neighbours:
            beyond_m = beams.take(pixel + step) - at.ranges_m
            ended |= (np.abs(beyond_m) < margin) & ~is_moving.take(pixel + step)
            passed |= (beyond_m >= margin) & (beyond_m < _NOTHING)
        return ended & at.is_in_view, passed & at.is_in_view

    def _framed_pixels(self, at: RangeImagePixels) -> Int:
        """Return the pixels of the padded image."""
        return np.asarray((at.rows + 1) * self._framed.shape[1] + at.columns + 1)

    @property
    def _neighbours(self) -> tuple[int, ...]:
        """Offsets of the 3 x 3 pixels around one."""
        width = self._framed.shape[1]
        return tuple(row + column for row in (-width, 0, width) for column in (-1, 0, 1))

    def _ends_near(self, pixel: Int, ranges_m: Float32, margin_m: np.float32) -> Bool:
        """Return where a return in the 3 x 3 pixels around lies within the margin."""
        beams, is_hit = self._framed.ravel(), np.zeros(len(pixel), bool)
        for step in self._neighbours:
            is_hit |= np.abs(beams.take(pixel + step) - ranges_m) < margin_m
        return is_hit


def _framed(image: Image) -> Image:
    """Pad an image by one pixel on every side, so that neighbours are at a fixed offset."""
    return cast(Image, np.pad(np.pad(image, ((0, 0), (1, 1)), "wrap"), ((1, 1), (0, 0)), "edge"))


def _block_minima(ranges: Float32, blocks: list[tuple[int, int]]) -> Float32:
    """Return (levels, pixels) the nearest return in the block around each pixel, round the full turn."""
    wrap = max(columns for _, columns in blocks)
    turned = np.concatenate([ranges[:, -wrap:], ranges, ranges[:, :wrap]], axis=1)
    minima = [
        cv2.erode(
            turned,
            np.ones((2 * rows + 1, 2 * columns + 1), np.uint8),
            borderType=cv2.BORDER_CONSTANT,
            borderValue=float(_NOTHING),
        )[:, wrap:-wrap].ravel()
        for rows, columns in blocks
    ]
    return np.stack(minima)
