"""Localization of an object in the image, by a mean shift to where its colours are densest (5.3.3)."""

from dataclasses import dataclass

import numpy as np

from perception.geometry import se3
from perception.geometry.camera import project
from perception.tracking.single_object.color_model import (
    AdaptiveColorModel,
    bins_per_channel_of,
    color_bins,
    color_ratios,
)
from perception.tracking.single_object.config import ColorModelConfig, ImageMeanShiftConfig
from perception.tracking.single_object.image_region import ImageRegion, region_of
from perception.tracking.single_object.tracker import TrackerInput
from perception.types import Float, Float64, UInt8


class ColorLocalizer:
    """Learns an object's outline and colours from one image and locates it in the next.

    Without an image, or where the image does not show the object, it locates nothing and keeps what it learned.

    Attributes:
        colors: Colour model.
        measured: (b³,) colour ratios of the last image that was learned from.
        regions: Regions of the last mean shift, from the first to the converged one.
    """

    def __init__(self, colors: ColorModelConfig, mean_shift: ImageMeanShiftConfig) -> None:
        """Create a localizer that has learned nothing.

        Args:
            colors: Bins, ring and filters of the colour model.
            mean_shift: Iterations and tolerance.
        """
        self._color_config, self._mean_shift_config = colors, mean_shift
        self.colors = AdaptiveColorModel(colors)
        self.measured: Float64 = np.zeros(colors.bins)
        self.regions: tuple[ImageRegion, ...] = ()
        self._region: ImageRegion | None = None
        self._anchor_px = np.zeros(2)
        self._center_px: Float64 | None = None

    def locate(self, tracker_input: TrackerInput, expected_world: Float64) -> Float64 | None:
        """Return (2,) the pixel where the colours are densest, or None.

        The mean shift starts where the object is predicted in this image, as the vehicle may have turned.

        Args:
            tracker_input: Next image.
            expected_world: (3,) predicted position of the object.
        """
        self.regions = ()
        anchor_px = _pixel_of(tracker_input, expected_world)
        if tracker_input.image is None or self._region is None or anchor_px is None:
            return None
        height, width = tracker_input.image.shape[:2]
        by_px = anchor_px - self._anchor_px
        region = self._region.shifted(by_px, (width, height))
        start_px = None if self._center_px is None else self._center_px + by_px
        found = image_mean_shift(
            tracker_input.image, region, self.colors.ratios, self._mean_shift_config, start_px
        )
        self.regions = found.regions
        return found.center_px

    def learn(
        self, tracker_input: TrackerInput, points_velo: Float, position_world: Float64
    ) -> ImageRegion | None:
        """Learn the object's outline and colours; return its region of the image.

        Args:
            tracker_input: Image.
            points_velo: (N, 3+) points of the object.
            position_world: (3,) position of the object.

        Returns:
            None, with nothing learned, where the points span no area in the image.
        """
        anchor_px = _pixel_of(tracker_input, position_world)
        if tracker_input.image is None or tracker_input.image_P_velo is None or anchor_px is None:
            return None
        height, width = tracker_input.image.shape[:2]
        pixels, _ = project(tracker_input.image_P_velo, points_velo)
        region = region_of(pixels, (width, height), self._color_config.ring_scale)
        if region is None:
            return None
        self.measured = color_ratios(
            tracker_input.image, region, self._color_config.bins_per_channel
        )
        self.colors.update(self.measured)
        self.regions = self.regions or (region,)
        self._region, self._anchor_px = region, anchor_px
        self._center_px = confidence_centroid(tracker_input.image, region, self.colors.ratios)
        return region


def _pixel_of(tracker_input: TrackerInput, position_world: Float64) -> Float64 | None:
    """Return (2,) the pixel of a position, within the image or beyond; None behind the camera."""
    if tracker_input.image_P_velo is None:
        return None
    position_velo = se3.inverse(tracker_input.world_SE3_velo) @ np.append(position_world, 1.0)
    pixel = project(tracker_input.image_P_velo, position_velo[None])[0][0]
    return pixel if np.isfinite(pixel).all() else None


@dataclass(frozen=True)
class MeanShiftResult:
    """Steps of one mean shift in the image.

    Attributes:
        regions: S regions, from the first to the converged one.
        center_px: (2,) centroid of the confidence in the converged region, or None where no pixel within or
            around the region has a colour of the object.
    """

    regions: tuple[ImageRegion, ...]
    center_px: Float64 | None


def image_mean_shift(
    image: UInt8,
    region: ImageRegion,
    ratios: Float64,
    config: ImageMeanShiftConfig,
    start_px: Float64 | None = None,
) -> MeanShiftResult:
    """Shift a region by the displacement of the confidence's centroid, until it has converged.

    Args:
        image: (H, W, 3) RGB image.
        region: Region where the object is predicted.
        ratios: (b³,) colour model.
        config: Iterations and tolerance.
        start_px: (2,) centroid of the confidence in this region when it was learned (`confidence_centroid`);
            None for the centre of the region, which is the same for an object of evenly spread colours only.
    """
    height, width = image.shape[:2]
    at_px = region.center_px if start_px is None else start_px
    center_px, regions = None, [region]
    for _ in range(config.max_iterations):
        found_px = confidence_centroid(image, regions[-1], ratios)
        if found_px is None:
            break
        shift_px = found_px - at_px
        center_px = at_px = found_px
        regions.append(regions[-1].shifted(shift_px, (width, height)))
        if np.hypot(*shift_px) < config.tolerance_px:
            break
    return MeanShiftResult(tuple(regions), center_px)


def confidence(image: UInt8, region: ImageRegion, ratios: Float64) -> Float64:
    """Return (h, w) the ratio of each pixel's colour over the region's window; 0 outside region and ring.

    The ring takes part, as in the author's code: an object that has moved out of the region is observed there.
    """
    covered = region.is_inside | region.is_ring
    bins = color_bins(image[region.window], bins_per_channel_of(ratios))
    return np.asarray(ratios.take(bins) * covered)


def confidence_centroid(image: UInt8, region: ImageRegion, ratios: Float64) -> Float64 | None:
    """Return (2,) column and row of the weighted mean of pixels, or None where all weights are 0.

    This is (5.14) divided by the sum of the weights; the thesis prints their number.
    """
    weights = confidence(image, region, ratios)
    of_columns, of_rows = weights.sum(axis=0), weights.sum(axis=1)
    total = of_columns.sum()
    if not total > 0:
        return None
    offset = np.array([of_columns @ np.arange(len(of_columns)), of_rows @ np.arange(len(of_rows))])
    return np.asarray(region.corner_px + offset / total)
