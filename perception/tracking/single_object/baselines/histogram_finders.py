"""Baselines in the image, mean shifts on colour histograms (7.1.2): MS-I and CBWH."""

import cv2
import numpy as np

from perception.tracking.single_object.color_model import color_bins
from perception.tracking.single_object.config import ColorModelConfig, HistogramTrackerConfig
from perception.types import Float32, Float64, Int, UInt8

_BINS_PER_CHANNEL, _BINS = ColorModelConfig.bins_per_channel, ColorModelConfig().bins
_CHANNELS, _RANGES = [0, 1, 2], [0.0, 256.0] * 3


class BackProjectionFinder:
    """MS-I: mean shift of a box on the back-projection of the object's histogram; an `ImageFinder`.

    Histogram, back-projection and mean shift are OpenCV's, which moves the box by whole pixels; the size stays
    that of the first image.
    """

    def __init__(self, config: HistogramTrackerConfig | None = None) -> None:
        self._config = config or HistogramTrackerConfig()

    def init(self, image: UInt8, box_px: Float64) -> None:
        """Learn the object's colours from its box."""
        self._window = _whole_window(box_px)
        rows, columns = _slices(self._window)
        patch = np.ascontiguousarray(image[rows, columns])
        histogram = cv2.calcHist([patch], _CHANNELS, None, [_BINS_PER_CHANNEL] * 3, _RANGES)
        self._histogram: Float32 = histogram * (255 / histogram.max())
        self._size_px = box_px[2:] - box_px[:2]

    def find(self, image: UInt8) -> Float64 | None:
        """Shift the last box; None where no pixel in it has a colour of the object."""
        similarity = cv2.calcBackProject([image], _CHANNELS, self._histogram, _RANGES, 1)
        rows, columns = _slices(self._window)
        if not similarity[rows, columns].any():
            return None
        criteria = (
            cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT,
            self._config.max_iterations,
            self._config.tolerance_px,
        )
        _, (column, row, width, height) = cv2.meanShift(similarity, self._window, criteria)
        self._window = column, row, width, height
        return _centered_box(_window_center(self._window), self._size_px)


class CorrectedHistogramFinder:
    """CBWH: mean shift on a background-weighted histogram (Ning et al. 2012); an `ImageFinder`.

    A colour's share of the object is scaled down by its frequency in the band around the object, in the first
    image only; in every image the correction would cancel out. The kernel is Epanechnikov's, so that the weight
    of a pixel of the ellipse within the box is the root of (corrected share / share in the present ellipse).

    Attributes:
        shares: (b³,) corrected share of each colour on the object.
    """

    def __init__(self, config: HistogramTrackerConfig | None = None) -> None:
        self._config = config or HistogramTrackerConfig()

    def init(self, image: UInt8, box_px: Float64) -> None:
        """Learn the object's colours and those around it, over three times the box's area."""
        self._half_px = (box_px[2:] - box_px[:2]) / 2
        self._center_px = (box_px[:2] + box_px[2:]) / 2
        here = _Ellipse(image, self._center_px, self._half_px)
        around = _band_colors(image, self._center_px, self._half_px)
        self.shares: Float64 = _corrected(here.shares(), around)

    def find(self, image: UInt8) -> Float64 | None:
        """Shift the last box; None where no pixel in it has a colour of the object."""
        center_px = self._center_px
        for _ in range(self._config.max_iterations):
            ellipse = _Ellipse(image, center_px, self._half_px)
            found_px = ellipse.weighted_mean(self.shares)
            if found_px is None:
                return None
            shift_px, center_px = np.hypot(*(found_px - center_px)), found_px
            if shift_px < self._config.tolerance_px:
                break
        self._center_px = center_px
        return _centered_box(center_px, 2 * self._half_px)


class _Ellipse:
    """Pixels within an upright ellipse, their colours, and their weights by Epanechnikov's kernel."""

    def __init__(self, image: UInt8, center_px: Float64, half_px: Float64) -> None:
        rows, columns = _window_around(image, center_px, half_px)
        across = (np.arange(columns.start, columns.stop) - center_px[0]) / half_px[0]
        down = (np.arange(rows.start, rows.stop) - center_px[1]) / half_px[1]
        kernel = 1 - down[:, None] ** 2 - across**2
        row_numbers, column_numbers = np.nonzero(kernel > 0)
        self._kernel = kernel[row_numbers, column_numbers]
        self._bins = color_bins(image[rows, columns])[row_numbers, column_numbers]
        self._places_px = np.column_stack(
            [column_numbers + columns.start, row_numbers + rows.start]
        )

    def shares(self) -> Float64:
        """Return (b³,) the share of each colour."""
        counts = np.bincount(self._bins, self._kernel, minlength=_BINS)
        return np.asarray(counts / max(counts.sum(), 1e-12))

    def weighted_mean(self, object_shares: Float64) -> Float64 | None:
        """Return the mean position of the pixels, weighted by the object's share of their colour, or None."""
        shares = self.shares()
        ratios = np.divide(object_shares, shares, out=np.zeros(_BINS), where=shares > 0)
        weights = np.sqrt(ratios)[self._bins]
        total = weights.sum()
        return np.asarray(weights @ self._places_px / total) if total > 0 else None


def _corrected(object_shares: Float64, background: Float64) -> Float64:
    """Scale colours down by their frequency around the object, relative to the rarest colour there."""
    least = background[background > 0].min(initial=np.inf)
    factors = np.minimum(least / np.maximum(background, least), 1) if np.isfinite(least) else 1.0
    corrected = object_shares * factors
    return np.asarray(corrected / max(corrected.sum(), 1e-12))


def _band_colors(image: UInt8, center_px: Float64, half_px: Float64) -> Float64:
    """Return (b³,) shares of the colours around a box; all 0 without pixels there."""
    outer = _window_around(image, center_px, np.sqrt(3) * half_px)
    inner = _window_around(image, center_px, half_px)
    counts = _counts(image[outer]) - _counts(image[inner])
    return np.asarray(counts / max(counts.sum(), 1))


def _counts(patch: UInt8) -> Int:
    return np.bincount(color_bins(patch).ravel(), minlength=_BINS)


def _window_around(image: UInt8, center_px: Float64, half_px: Float64) -> tuple[slice, slice]:
    """Return rows and columns of the pixels of a box, within the image."""
    size_px = np.array(image.shape[1::-1])
    low = np.clip(np.ceil(center_px - half_px), 0, size_px).astype(int)
    high = np.clip(np.floor(center_px + half_px) + 1, low, size_px).astype(int)
    return slice(low[1], high[1]), slice(low[0], high[0])


def _whole_window(box_px: Float64) -> tuple[int, int, int, int]:
    """Return column, row, width and height of the pixels of a box, at least one."""
    x1, y1 = np.floor(box_px[:2]).astype(int).tolist()
    x2, y2 = np.ceil(box_px[2:]).astype(int).tolist()
    return x1, y1, max(x2 - x1 + 1, 1), max(y2 - y1 + 1, 1)


def _slices(window: tuple[int, int, int, int]) -> tuple[slice, slice]:
    column, row, width, height = window
    return slice(row, row + height), slice(column, column + width)


def _window_center(window: tuple[int, int, int, int]) -> Float64:
    column, row, width, height = window
    return np.array([column + (width - 1) / 2, row + (height - 1) / 2])


def _centered_box(center_px: Float64, size_px: Float64) -> Float64:
    return np.concatenate([center_px - size_px / 2, center_px + size_px / 2])
