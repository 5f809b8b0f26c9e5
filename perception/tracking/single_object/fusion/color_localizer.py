"""The half of the fusion tracker that looks at images: where the object's colours are (5.3.3)."""

import numpy as np

from perception.geometry import se3
from perception.geometry.camera import project
from perception.tracking.single_object.color_model import AdaptiveColorModel, color_ratios
from perception.tracking.single_object.fusion.image_mean_shift import (
    confidence_centroid,
    image_mean_shift,
)
from perception.tracking.single_object.fusion.image_region import ImageRegion, region_of
from perception.tracking.single_object.tracker import TrackerInput
from perception.types import Float, Float64


class ColorLocalizer:
    """Learns an object's outline and colours from one image and finds it in the next.

    Without an image, or where the object is not in it, it finds nothing and keeps what it learned.

    Attributes:
        colors: the colour model.
        regions: of the last climb, from where it began to where it ended.
        region: the object's outline when it was last learned.
    """

    def __init__(self) -> None:
        self.colors = AdaptiveColorModel()
        self.regions: tuple[ImageRegion, ...] = ()
        self.region: ImageRegion | None = None
        self._anchor_px = np.zeros(2)
        self._center_px: Float64 | None = None

    def locate(self, tracker_input: TrackerInput, expected_world: Float64) -> Float64 | None:
        """Return (2,) where the colours are densest, or None.

        The climb begins where the object is expected in this image, as the vehicle may have turned.

        Args:
            tracker_input: with the next image.
            expected_world: (3,) where the object is expected.
        """
        self.regions = ()
        anchor_px = _seen_at(tracker_input, expected_world)
        if tracker_input.image is None or self.region is None or anchor_px is None:
            return None
        height, width = tracker_input.image.shape[:2]
        by_px = anchor_px - self._anchor_px
        region = self.region.shifted(by_px, (width, height))
        start_px = None if self._center_px is None else self._center_px + by_px
        found = image_mean_shift(tracker_input.image, region, self.colors.ratios, start_px=start_px)
        self.regions = found.regions
        return found.center_px

    def learn(
        self, tracker_input: TrackerInput, points_velo: Float, position_world: Float64
    ) -> None:
        """Take in how the object looks, by (N, 3+) its points; nothing where they span no area.

        Args:
            tracker_input: with the image.
            points_velo: of the object.
            position_world: (3,) where it is.
        """
        anchor_px = _seen_at(tracker_input, position_world)
        if tracker_input.image is None or tracker_input.image_P_velo is None or anchor_px is None:
            return
        height, width = tracker_input.image.shape[:2]
        pixels, _ = project(tracker_input.image_P_velo, points_velo)
        region = region_of(pixels, (width, height))
        if region is None:
            return
        self.measured = color_ratios(tracker_input.image, region)
        self.colors.update(self.measured)
        self.regions = self.regions or (region,)
        self.region, self._anchor_px = region, anchor_px
        self._center_px = confidence_centroid(tracker_input.image, region, self.colors.ratios)


def _seen_at(tracker_input: TrackerInput, position_world: Float64) -> Float64 | None:
    """Return (2,) the pixel of a place, within the image or beyond; None behind the camera."""
    if tracker_input.image_P_velo is None:
        return None
    position_velo = se3.inverse(tracker_input.world_SE3_velo) @ np.append(position_world, 1.0)
    pixel = project(tracker_input.image_P_velo, position_velo[None])[0][0]
    return pixel if np.isfinite(pixel).all() else None
