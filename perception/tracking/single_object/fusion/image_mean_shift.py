"""Find an object in an image by climbing to where its colours are densest (5.3.3)."""

from dataclasses import dataclass

import numpy as np

from perception.tracking.single_object.color_model import color_bins
from perception.tracking.single_object.fusion.image_region import ImageRegion
from perception.types import Float64, UInt8


@dataclass(frozen=True)
class MeanShiftResult:
    """The steps of one mean shift.

    Attributes:
        regions: S of them, from where it began to where it ended.
        center_px: (2,) centroid of the confidence where it ended, or None where no pixel within or around
            the region has a colour of the object, so that the image says nothing.
    """

    regions: tuple[ImageRegion, ...]
    center_px: Float64 | None


def image_mean_shift(
    image: UInt8,
    region: ImageRegion,
    ratios: Float64,
    iterations: int = 4,
    tolerance_px: float = 1.0,
    start_px: Float64 | None = None,
) -> MeanShiftResult:
    """Shift a region by what the centroid of the confidence moves, until it moves less than a pixel.

    Args:
        image: (H, W, 3) RGB.
        region: where the object is expected.
        ratios: (512,) its colour model.
        iterations: at most as many shifts (Table 7.5).
        tolerance_px: a smaller shift is the last (Table 7.5).
        start_px: (2,) where the centroid of the confidence lay in this region when it was outlined
            (`confidence_centroid`). The centre of the region where None, which is the same for an object
            whose colours are spread evenly, and wrong by as much as they are not.
    """
    height, width = image.shape[:2]
    at_px = region.center_px if start_px is None else start_px
    center_px, regions = None, [region]
    for _ in range(iterations):
        found_px = confidence_centroid(image, regions[-1], ratios)
        if found_px is None:
            break
        shift_px = found_px - at_px
        center_px = at_px = found_px
        regions.append(regions[-1].shifted(shift_px, (width, height)))
        if np.hypot(*shift_px) < tolerance_px:
            break
    return MeanShiftResult(tuple(regions), center_px)


def confidence(image: UInt8, region: ImageRegion, ratios: Float64) -> Float64:
    """Return (h, w) the ratio of each pixel's colour over the region's window; 0 outside region and ring.

    The ring takes part, as in the author's code: what has moved out of the region is seen there.
    """
    covered = region.is_inside | region.is_ring
    return np.asarray(ratios.take(color_bins(image[region.window])) * covered)


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
