"""Geometric augmentation, which images and maps share: flip, zoom, focal length, aspect, shift, occlusion, crop.

A zoomed image is the view from a nearer place: objects are larger and as much nearer, so that depths are divided
by the zoom. Another focal length makes objects larger at the same distance.
"""

from dataclasses import dataclass, replace

import cv2
import numpy as np

from data.samples.images.config import GeometricConfig
from data.samples.images.targets import (
    TRAINING_DIFFICULTY,
    DetectionTargets,
    clip_boxes,
    has_area,
)
from perception.detection.detectors.input_size import SIZE_STEP_PX
from perception.geometry.box_overlap_px import area_px, intersection_over_area_px
from perception.types import Float64, Modality, UInt8

_MAX_OCCLUDERS = 3
_OCCLUDER_HEIGHTS = (0.04, 0.3)  # of the image's height; an occluder is up to twice as wide as high
_GREY_SPREAD = 40.0
_AROUND = (60, 190)  # values around an image that has become smaller
_CROPS_ON_OBJECTS = 0.7  # the others lie anywhere, and show what is no object


@dataclass(frozen=True)
class GeometricTransform:
    """One geometric augmentation of an image, drawn or set by hand.

    x' = scale * x + offset, in pixels from the upper left edge.

    Attributes:
        scale: Factors along x, negative for a flip, and along y.
        offset_px: Offsets along x and y in pixels.
        zoom: Divisor of the depths.
        occluders_px: (P, 4) x1 y1 x2 y2 of the occluders in whole pixels, or None.
    """

    scale: tuple[float, float] = (1.0, 1.0)
    offset_px: tuple[float, float] = (0.0, 0.0)
    zoom: float = 1.0
    occluders_px: Float64 | None = None

    def from_column(self, left_px: int) -> "GeometricTransform":
        """Return the transform to an image that begins at a column of this one's."""
        hidden_px = self.occluders_px
        if hidden_px is not None:
            hidden_px = np.maximum(hidden_px - [left_px, 0, left_px, 0], 0)
        return replace(
            self, offset_px=(self.offset_px[0] - left_px, self.offset_px[1]), occluders_px=hidden_px
        )


def draw_geometric_transform(
    magnitudes: GeometricConfig, size_px: tuple[int, int], rng: np.random.Generator
) -> GeometricTransform:
    """Draw a transform of a (width, height) image; as many numbers are drawn whatever is switched off."""
    zoom, focal, aspect, *drawn = rng.uniform(-1, 1, 8)
    free, shift, flip = np.array(drawn[:2]), np.array(drawn[2:4]), drawn[4]
    zoom = (1 + magnitudes.zoom) ** zoom
    larger = zoom * (1 + magnitudes.focal) ** focal
    stretch = (1 + magnitudes.aspect) ** (aspect / 2)
    scale = np.array([larger * stretch, larger / stretch])
    # A larger image is cropped anywhere, a smaller one lies anywhere.
    offset = np.array(size_px) * ((1 - scale) * (1 + free) / 2 + magnitudes.shift * shift)
    if abs(flip) < magnitudes.flip:
        scale[0], offset[0] = -scale[0], size_px[0] - offset[0]
    occluders_px = _draw_occluders(size_px, rng) if rng.random() < magnitudes.occlusion else None
    return GeometricTransform(
        (float(scale[0]), float(scale[1])), (float(offset[0]), float(offset[1])), zoom, occluders_px
    )


def crop_size_px(size_px: tuple[int, int], crop: float) -> tuple[int, int]:
    """Return the (width, height) of crops of a (width, height) image; the network takes multiples of 32."""
    steps = max(1, round((1 - crop) * size_px[0] / SIZE_STEP_PX))
    return (min(size_px[0], SIZE_STEP_PX * steps), size_px[1]) if crop else size_px


def draw_crop_column(
    labels: DetectionTargets, widths_px: tuple[int, int], rng: np.random.Generator
) -> int:
    """Draw the first column of a crop: most crops hold an object, at any place of theirs.

    Args:
        labels: Targets of the whole image.
        widths_px: Widths of the image and of the crop.
        rng: Random generator.
    """
    whole_px, crop_px = widths_px
    targets_px = labels.boxes_px[~labels.is_ignored]
    column = rng.uniform(0, whole_px - crop_px)
    if len(targets_px) and rng.random() < _CROPS_ON_OBJECTS:
        x1, _, x2, _ = targets_px[rng.integers(len(targets_px))].tolist()
        column = (x1 + x2) / 2 - rng.uniform(0.15, 0.85) * crop_px
    return int(np.clip(round(column), 0, whole_px - crop_px))


def warp_image(
    image: UInt8,
    geometric_transform: GeometricTransform,
    modality: Modality,
    rng: np.random.Generator,
    size_px: tuple[int, int] | None = None,
) -> UInt8:
    """Return a transformed (h, w, C) image, of another (width, height) where one is given.

    Maps are resampled to the nearest pixel and unknown around it; images are grey around it. Values are not
    changed: the depths of a depth map have to be divided by the zoom afterwards.
    """
    width, height = size_px or (image.shape[1], image.shape[0])
    is_image = modality == "rgb"
    scale, offset = np.array(geometric_transform.scale), np.array(geometric_transform.offset_px)
    # OpenCV's coordinates are of pixel centres.
    matrix = np.column_stack([np.diag(scale), offset + (scale - 1) / 2])
    warped = cv2.warpAffine(
        image,
        matrix,
        (width, height),
        flags=cv2.INTER_LINEAR if is_image else cv2.INTER_NEAREST,
        borderMode=cv2.BORDER_CONSTANT,
        borderValue=rng.uniform(*_AROUND, 3).tolist() if is_image else 0,
    )
    warped_image = np.asarray(warped, np.uint8).reshape(height, width, -1)
    if geometric_transform.occluders_px is not None:
        for x1, y1, x2, y2 in geometric_transform.occluders_px.astype(int).tolist():
            patch = warped_image[y1:y2, x1:x2]
            patch[:] = _occluder_values(patch, modality, rng)
    return warped_image


def transform_targets(
    labels: DetectionTargets, geometric_transform: GeometricTransform, size_px: tuple[int, int]
) -> DetectionTargets:
    """Return the targets of a transformed (width, height) image.

    Boxes outside the image are left out. Boxes that are truncated or occluded by more than KITTI's hard level
    allows, or too small, are ignored.
    """
    moved = labels.boxes_px * np.tile(geometric_transform.scale, 2) + np.tile(
        geometric_transform.offset_px, 2
    )
    if geometric_transform.scale[0] < 0:
        moved = moved[:, [2, 1, 0, 3]]
    within = clip_boxes(moved, size_px)
    visible = area_px(within) / np.maximum(area_px(moved), 1e-9)
    if geometric_transform.occluders_px is not None:
        hidden = intersection_over_area_px(within, geometric_transform.occluders_px).sum(axis=1)
        visible *= 1 - np.minimum(hidden, 1)
    is_low = within[:, 3] - within[:, 1] < labels.min_height_px
    is_unseen = is_low | (visible < 1 - TRAINING_DIFFICULTY.max_truncation)
    warped_image = replace(
        labels, boxes_px=within.astype(np.float32), is_ignored=labels.is_ignored | is_unseen
    )
    return warped_image[has_area(warped_image.boxes_px)]


def _draw_occluders(size_px: tuple[int, int], rng: np.random.Generator) -> Float64:
    count = int(rng.integers(1, _MAX_OCCLUDERS + 1))
    height = size_px[1] * rng.uniform(*_OCCLUDER_HEIGHTS, count)
    sizes = np.column_stack([height * rng.uniform(0.3, 2.0, count), height])
    first = rng.uniform(0, 1, (count, 2)) * (np.array(size_px) - sizes)
    return np.round(np.concatenate([first, first + sizes], axis=1))


def _occluder_values(patch: UInt8, modality: Modality, rng: np.random.Generator) -> UInt8:
    """Return an occluder's (h, w, C) values: colours, unknown, or nearer than all that it hides."""
    if modality == "rgb":
        grey = rng.uniform(0, 255, 3) + _GREY_SPREAD * rng.standard_normal(patch.shape, np.float32)
        return np.asarray(np.clip(grey, 0, 255), np.uint8)
    known = patch[patch > 0]
    if rng.random() < 0.5 or not len(known):
        return np.zeros_like(patch)
    highest = float(known.min()) if modality == "dm" else 255.0
    return np.full_like(patch, int(rng.uniform(0, highest)))
