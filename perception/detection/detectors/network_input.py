"""From an image to the network's input, in training and at run time, and boxes back to the image.

    image                          input
    +--------------------------+
    |                          |   +-----------------------+
    |-------- region ----------|   | content: the region   |
    |                          |   | in its own aspect     |
    |                          |   |-----------------------|
    +--------------------------+   | padding               |
                                   +-----------------------+

The thesis compares modalities by images of one JPEG quality (7.2.2). A network that was trained on compressed images
states their quality, and runs on images of the same quality.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import cv2
import numpy as np

from perception.detection.detectors.input_size import SIZE_STEP_PX, InputSize
from perception.types import Bool, Fit, Float, Float64, Modality, UInt8

# How a region gets the shape of the input: scaled and padded, or stretched.
# Where the padding of a letterbox is: right and below, or on all sides.
Alignment = Literal["top-left", "center"]
Resize = Literal["letterbox", "stretch", "tiles"]

# Padding of networks of this package: gray around images, unknown around maps.
_PAD_VALUES: Mapping[Modality, int] = {"rgb": 114, "dm": 0, "rm": 0}
_TILE_OVERLAP = 0.25  # of the width or height of a tile
_CUT_PX = 2.0  # boxes of an object that goes on beyond a tile end about here


class PixelRectangle(NamedTuple):
    """A rectangle of an image in whole pixels; right and bottom are the first column and row outside."""

    left: int
    top: int
    right: int
    bottom: int

    @classmethod
    def whole(cls, image: UInt8) -> "PixelRectangle":
        """Return the region of a whole (H, W, C) image."""
        return cls(0, 0, image.shape[1], image.shape[0])

    @property
    def height_px(self) -> int:
        """Number of rows."""
        return self.bottom - self.top

    @property
    def width_px(self) -> int:
        """Number of columns."""
        return self.right - self.left


@dataclass(frozen=True)
class ImagePlacement:
    """Where a region of an image lies in the input of a network.

    Attributes:
        region: Region of the image.
        content: Region of the input that shows it; the rest is padding.
        size: Size of the input.
        limits: Region of the image to which boxes are clipped.
    """

    region: PixelRectangle
    content: PixelRectangle
    size: InputSize
    limits: PixelRectangle

    def to_input(self, boxes_px: Float) -> Float64:
        """Return (M, 4) boxes of the image in pixels of the input."""
        return (boxes_px - _corners(self.region)) * self._scale + _corners(self.content)

    def to_image(self, boxes_px: Float) -> Float64:
        """Return (M, 4) boxes of the input in pixels of the image, clipped to its limits."""
        image_px = (boxes_px - _corners(self.content)) / self._scale + _corners(self.region)
        left, top, right, bottom = self.limits
        return np.clip(image_px, [left, top] * 2, [right, bottom] * 2)

    def from_row(self, row: int) -> "ImagePlacement":
        """Return the placement of the lower part of the region at the same scale, in as few rows of the input as show it.

        Boxes may extend above that part.

        Args:
            row: First row of the image that has to be shown.
        """
        rows_px = self.height_scale * max(self.region.bottom - row, 1)
        height_px = SIZE_STEP_PX * math.ceil(rows_px / SIZE_STEP_PX)
        if height_px >= self.size.height_px:
            return self
        top = max(self.region.top, self.region.bottom - int(height_px / self.height_scale))
        size = InputSize(height_px, self.size.width_px)
        return replace(place(self.region._replace(top=top), size), limits=self.limits)

    def is_cut(self, boxes_px: Float, whole: PixelRectangle) -> Bool:
        """Return which of (M, 4) boxes of the image end where the region does and a whole region goes on."""
        near_px = _CUT_PX / self._scale
        goes_on = np.array(self.region) != np.array(whole)
        ends = np.abs(boxes_px - np.array(self.region)) <= near_px
        return np.asarray((ends & goes_on).any(axis=1))

    @property
    def height_scale(self) -> float:
        """Rows of the input per row of the image."""
        return self.content.height_px / self.region.height_px

    @property
    def _scale(self) -> Float64:
        """Pixels of the input per pixel of the image: x, y, x, y."""
        region, content = self.region, self.content
        across = content.width_px / region.width_px, content.height_px / region.height_px
        return np.tile(across, 2)


def place(
    region: PixelRectangle,
    size: InputSize,
    fit: Fit = "letterbox",
    alignment: Alignment = "top-left",
) -> ImagePlacement:
    """Return the placement of a region of an image in an input.

    Args:
        region: Region of the image.
        size: Size of the input.
        fit: Keep the aspect and pad, or stretch to the size of the input.
        alignment: Place of the content where it is padded.
    """
    if fit == "stretch":
        content = PixelRectangle(0, 0, size.width_px, size.height_px)
        return ImagePlacement(region, content, size, region)
    scale = min(size.width_px / region.width_px, size.height_px / region.height_px)
    width = min(size.width_px, max(1, round(scale * region.width_px)))
    height = min(size.height_px, max(1, round(scale * region.height_px)))
    left, top = 0, 0
    if alignment == "center":
        left, top = (size.width_px - width) // 2, (size.height_px - height) // 2
    content = PixelRectangle(left, top, left + width, top + height)
    return ImagePlacement(region, content, size, region)


def place_tiles(region: PixelRectangle, size: InputSize) -> tuple[ImagePlacement, ...]:
    """Return placements of a region as a whole, and of tiles of it that have the aspect of the input and overlap."""
    height = min(region.height_px, round(region.width_px * size.height_px / size.width_px))
    width = min(region.width_px, round(region.height_px * size.width_px / size.height_px))
    tiles = [
        PixelRectangle(left, top, left + width, top + height)
        for top in _tile_starts(region.top, region.height_px, height)
        for left in _tile_starts(region.left, region.width_px, width)
    ]
    regions = tiles if tiles == [region] else [region, *tiles]
    return tuple(place(one, size) for one in regions)


def prepare_image(
    image: UInt8,
    modality: Modality,
    placement: ImagePlacement,
    jpeg_quality: int | None = None,
    pad_value: int | None = None,
) -> UInt8:
    """Return an (H, W, C) image as the (h, w, C) input of a network.

    Maps are resized by nearest neighbours: the mean of two depths is a position where nothing is.

    Args:
        image: Camera image or map.
        modality: Modality of the image.
        placement: Place of the image in the input.
        jpeg_quality: Quality of the JPEG compression, 1 to 100; None for none.
        pad_value: Value of the padding, 0 to 255; None for the modality's.
    """
    if jpeg_quality is not None:
        image = jpeg_compressed(image, jpeg_quality)
    left, top, right, bottom = placement.region
    region, content = image[top:bottom, left:right], placement.content
    size_px = content.width_px, content.height_px
    # Down to a half, linear interpolation reads every pixel, in a seventh of the time.
    skips = 2 * content.width_px < region.shape[1] or 2 * content.height_px < region.shape[0]
    smooth = cv2.INTER_AREA if skips else cv2.INTER_LINEAR
    how = smooth if modality == "rgb" else cv2.INTER_NEAREST
    value = _PAD_VALUES[modality] if pad_value is None else pad_value
    padded: UInt8 = np.empty((*placement.size, region.shape[2]), np.uint8)
    shown = padded[content.top : content.bottom, content.left : content.right]
    if shown.shape != padded.shape:
        padded[: content.top] = padded[content.bottom :] = value
        padded[:, : content.left] = padded[:, content.right :] = value
    if size_px == region.shape[1::-1]:
        shown[:] = region
    else:
        cv2.resize(region, size_px, dst=shown, interpolation=how)
    return padded


def jpeg_compressed(image: UInt8, quality: int) -> UInt8:
    """Return an (H, W, C) image after JPEG compression of a quality, 1 to 100."""
    # OpenCV takes BGR; the order matters, as JPEG keeps brightness better than colour.
    _, data = cv2.imencode(".jpg", image[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, quality])
    decoded = cv2.imdecode(data, cv2.IMREAD_UNCHANGED)
    return np.asarray(decoded, np.uint8).reshape(image.shape)[..., ::-1]


def _tile_starts(first: int, length: int, tile: int) -> list[int]:
    """Return where the fewest tiles begin that cover a length and overlap."""
    if tile >= length:
        return [first]
    count = int(np.ceil((length - _TILE_OVERLAP * tile) / ((1 - _TILE_OVERLAP) * tile)))
    return [first + round(start) for start in np.linspace(0, length - tile, count)]


def _corners(region: PixelRectangle) -> Float64:
    return np.tile(np.array(region[:2], np.float64), 2)
