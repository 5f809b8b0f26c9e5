"""Where in the picture things are, and how large: the operations that all three views have in common.

A picture that is zoomed shows what a closer look would: everything is larger and as much nearer, so that depths
are divided by the zoom. Another focal length makes things larger and leaves them where they are.
"""

from dataclasses import dataclass, replace
from typing import ClassVar

import cv2
import numpy as np

from data.images.targets import LEARNED, DetectionTargets, clipped, has_area
from data.magnitudes import AugmentationConfig
from perception.geometry.box_overlap_px import area_px, intersection_over_area_px
from perception.types import Float64, Modality, UInt8

_MAX_PATCHES = 3
_PATCH_SHARES = (0.04, 0.3)  # of the picture's height; a patch is up to twice as wide as high
_GREY_SPREAD = 40.0
_AROUND = (60, 190)  # values around an image that has become smaller


@dataclass(frozen=True)
class GeometricConfig(AugmentationConfig):
    """How far things move.

    Attributes:
        flip: probability of left and right changing places.
        zoom: things are larger and nearer, or smaller and farther, by up to a factor of 1 + this.
        focal: things are larger or smaller by up to 1 + this, at the same distance.
        aspect: width over height changes by up to a factor of 1 + this.
        shift: the picture moves by up to this share of its size, beyond the freedom that the zoom gives.
        cover: probability of something nearer that hides parts of the picture.
    """

    MAX: ClassVar = {
        "flip": 1.0,
        "zoom": 3.0,
        "focal": 1.0,
        "aspect": 1.0,
        "shift": 0.5,
        "cover": 1.0,
    }

    flip: float = 0.5
    zoom: float = 0.4
    focal: float = 0.1
    aspect: float = 0.08
    shift: float = 0.04
    occlusion: float = 0.4


@dataclass(frozen=True)
class GeometricTransform:
    """What happens to the places of one picture at one look, drawn or set by hand.

    x' = scale * x + offset, in pixels from the upper left edge.

    Attributes:
        scale: along x, negative where left and right change places, and along y.
        offset_px: along x and y.
        zoom: by which depths are divided.
        occluders_px: (P, 4) x1 y1 x2 y2 of what hides the picture, in whole pixels.
    """

    scale: tuple[float, float] = (1.0, 1.0)
    offset_px: tuple[float, float] = (0.0, 0.0)
    zoom: float = 1.0
    occluders_px: Float64 | None = None


def draw_geometric_transform(
    magnitudes: GeometricConfig, size_px: tuple[int, int], rng: np.random.Generator
) -> GeometricTransform:
    """Draw what happens to a picture of (width, height); as many numbers whatever is switched off."""
    zoom, focal, aspect, *drawn = rng.uniform(-1, 1, 8)
    free, shift, flip = np.array(drawn[:2]), np.array(drawn[2:4]), drawn[4]
    zoom = (1 + magnitudes.zoom) ** zoom
    larger = zoom * (1 + magnitudes.focal) ** focal
    stretch = (1 + magnitudes.aspect) ** (aspect / 2)
    scale = np.array([larger * stretch, larger / stretch])
    # A larger picture is cut anywhere, a smaller one lies anywhere.
    offset = np.array(size_px) * ((1 - scale) * (1 + free) / 2 + magnitudes.shift * shift)
    if abs(flip) < magnitudes.flip:
        scale[0], offset[0] = -scale[0], size_px[0] - offset[0]
    occluders_px = _draw_occluders(size_px, rng) if rng.random() < magnitudes.occlusion else None
    return GeometricTransform(
        (float(scale[0]), float(scale[1])), (float(offset[0]), float(offset[1])), zoom, occluders_px
    )


def warp_image(
    image: UInt8,
    geometric_transform: GeometricTransform,
    modality: Modality,
    rng: np.random.Generator,
) -> UInt8:
    """Return an (h, w, C) picture with everything at its new place.

    Of maps the nearest pixel is taken, and around the picture nothing is known; around an image is some grey.
    Values stay as they are, so that a depth map's have to be divided by the zoom yet.
    """
    height, width = image.shape[:2]
    is_image = modality == "rgb"
    scale, offset = np.array(geometric_transform.scale), np.array(geometric_transform.offset_px)
    # OpenCV's places are of the centres of pixels.
    matrix = np.column_stack([np.diag(scale), offset + (scale - 1) / 2])
    warped = cv2.warpAffine(
        image,
        matrix,
        (width, height),
        flags=cv2.INTER_LINEAR if is_image else cv2.INTER_NEAREST,
        borderMode=cv2.BORDER_CONSTANT,
        borderValue=rng.uniform(*_AROUND, 3).tolist() if is_image else 0,
    )
    warped_image = np.asarray(warped, np.uint8).reshape(image.shape)
    if geometric_transform.occluders_px is not None:
        for x1, y1, x2, y2 in geometric_transform.occluders_px.astype(int).tolist():
            patch = warped_image[y1:y2, x1:x2]
            patch[:] = _occluder_values(patch, modality, rng)
    return warped_image


def transform_targets(
    labels: DetectionTargets, geometric_transform: GeometricTransform, size_px: tuple[int, int]
) -> DetectionTargets:
    """Return the labels of a placed picture of (width, height).

    What has left the picture is left out. What is hidden, or has left, by more than KITTI's hard level
    allows to be cut off, or has become too small, is ignored.
    """
    moved = labels.boxes_px * np.tile(geometric_transform.scale, 2) + np.tile(
        geometric_transform.offset_px, 2
    )
    if geometric_transform.scale[0] < 0:
        moved = moved[:, [2, 1, 0, 3]]
    within = clipped(moved, size_px)
    visible = area_px(within) / np.maximum(area_px(moved), 1e-9)
    if geometric_transform.occluders_px is not None:
        hidden = intersection_over_area_px(within, geometric_transform.occluders_px).sum(axis=1)
        visible *= 1 - np.minimum(hidden, 1)
    is_low = within[:, 3] - within[:, 1] < labels.min_height_px
    is_unseen = is_low | (visible < 1 - LEARNED.max_truncation)
    warped_image = replace(
        labels, boxes_px=within.astype(np.float32), is_ignored=labels.is_ignored | is_unseen
    )
    return warped_image[has_area(warped_image.boxes_px)]


def _draw_occluders(size_px: tuple[int, int], rng: np.random.Generator) -> Float64:
    count = int(rng.integers(1, _MAX_PATCHES + 1))
    height = size_px[1] * rng.uniform(*_PATCH_SHARES, count)
    sizes = np.column_stack([height * rng.uniform(0.3, 2.0, count), height])
    first = rng.uniform(0, 1, (count, 2)) * (np.array(size_px) - sizes)
    return np.round(np.concatenate([first, first + sizes], axis=1))


def _occluder_values(patch: UInt8, modality: Modality, rng: np.random.Generator) -> UInt8:
    """Return what hides an (h, w, C) part: colours, nothing known, or something nearer than all behind it."""
    if modality == "rgb":
        grey = rng.uniform(0, 255, 3) + _GREY_SPREAD * rng.standard_normal(patch.shape, np.float32)
        return np.asarray(np.clip(grey, 0, 255), np.uint8)
    known = patch[patch > 0]
    if rng.random() < 0.5 or not len(known):
        return np.zeros_like(patch)
    highest = float(known.min()) if modality == "dm" else 255.0
    return np.full_like(patch, int(rng.uniform(0, highest)))
