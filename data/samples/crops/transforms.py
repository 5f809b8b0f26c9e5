"""Crops of DepthCN's input image, augmented: geometry by one affine map, values within the crop (6.1.4).

transformed (x, y) = M (x, y)        where a point of the image goes, about the window's centre
crop --window's map--> transformed image --inverse of M--> image        one warp

One warp takes 0.02 ms; a crop and an affine map of torchvision take 0.6 ms, and resample twice.
"""

from dataclasses import dataclass

import cv2
import numpy as np

from data.samples.crops.config import CropAugmentationConfig
from perception.detection.depthcn.crops import (
    CROP_HEIGHT_PX,
    CROP_WIDTH_PX,
    MIN_EDGE_PX,
    warp,
    window_maps,
)
from perception.maps.encoding import decode_depth, encode_depth
from perception.types import Float, Float64, Method, UInt8

_DEPTH, _HEIGHT, _REFLECTANCE = range(3)  # channels of the input image
_CAMERA_HEIGHT = 136  # of the camera over the road, about 1.65 m, as the image encodes heights
_UNKNOWN_EXTENT = (0.2, 0.8)  # left and right edge of an object without a label, in the window
_ALL_DEPTHS_M = decode_depth(np.arange(256, dtype=np.uint8))


@dataclass(frozen=True)
class Occluder:
    """A nearer object that hides one side of the crop's object.

    Attributes:
        share: Fraction of the object's width that is hidden.
        from_left: Whether the left side is hidden.
        nearness: Depth of the occluder over the object's.
        reflectance: Reflectance of the occluder, 0..1.
    """

    share: float
    from_left: bool
    nearness: float
    reflectance: float


@dataclass(frozen=True)
class CropTransform:
    """One augmentation of a crop, drawn or set by hand.

    Attributes:
        scale: Factor of size, above 1 larger.
        depth: Factor of depth.
        is_flipped: Whether left and right are swapped.
        shift: Shift right and down, as fractions of the window.
        aspect: Factor of width over height.
        occlusion: Occluder of one side, or None.
        rotation_rad: Rotation, clockwise in the image.
        row_shifts_px: (66,) shift of each row of the crop to the right, or None.
        reflectance: Factor of reflectance.
    """

    scale: float = 1.0
    depth: float = 1.0
    is_flipped: bool = False
    shift: tuple[float, float] = (0.0, 0.0)
    aspect: float = 1.0
    occlusion: Occluder | None = None
    rotation_rad: float = 0.0
    row_shifts_px: Float64 | None = None
    reflectance: float = 1.0


@dataclass(frozen=True)
class CropSource:
    """A proposal or jittered label of an image, before it is cropped.

    Attributes:
        window_px: (4,) x1 y1 x2 y2 of the crop's window in the image.
        depth_m: Depth of the object.
        box_px: (4,) x1 y1 x2 y2 of the vehicle's label, NaN of others.
    """

    window_px: Float
    depth_m: float
    box_px: Float


@dataclass(frozen=True)
class CropView:
    """An augmented crop.

    Attributes:
        crop: (66, 112, C) pixels.
        normalized_box: (4,) x1 y1 x2 y2 of the label, 0..1 over the window, NaN of others.
    """

    crop: UInt8
    normalized_box: Float64


def draw_transform(magnitudes: CropAugmentationConfig, rng: np.random.Generator) -> CropTransform:
    """Draw a transform; as many numbers are drawn whatever is switched off."""
    # One call for all numbers: single ones would cost as much as the rest of the sample.
    scale, depth, x, y, aspect, turn, side, nearness, grey, share, flip, fade = rng.uniform(
        -1, 1, 12
    )
    rows = rng.uniform(-1, 1, CROP_HEIGHT_PX)
    occlusion = Occluder(
        share=magnitudes.occlusion * share,
        from_left=bool(side > 0),
        nearness=0.7 + 0.25 * nearness,
        reflectance=0.3 + 0.3 * grey,
    )
    return CropTransform(
        scale=(1 + magnitudes.scale) ** scale,
        depth=(1 + magnitudes.depth) ** depth,
        is_flipped=bool(abs(flip) < magnitudes.flip),
        shift=(magnitudes.jitter * x, magnitudes.jitter * y),
        aspect=(1 + magnitudes.aspect) ** aspect,
        occlusion=occlusion if occlusion.share > 0 else None,  # every second object is not occluded
        rotation_rad=magnitudes.rotation_rad * turn,
        row_shifts_px=magnitudes.row_shift_px * rows if magnitudes.row_shift_px else None,
        reflectance=1 - magnitudes.reflectance * abs(fade),
    )


def crop_view(
    image: UInt8, source: CropSource, transform: CropTransform, method: Method = "default"
) -> CropView:
    """Crop an (H, W, 3) image by the interpolation of a method, and augment the crop."""
    window = np.asarray(source.window_px, np.float64)
    transformed_A_image = affine_matrix(transform, window)
    transformed_A_crop = window_maps(window[None])[0]
    crop = warp(image, np.linalg.inv(transformed_A_image) @ transformed_A_crop, method)
    normalized_box = _shares(transform_box(source.box_px, transformed_A_image), window)
    if transform.occlusion is not None:
        crop = occlude_side(crop, transform.occlusion, normalized_box, source.depth_m)
    if transform.depth != 1.0:
        crop = scale_depth(crop, transform.depth)
    if transform.row_shifts_px is not None:
        crop = shift_rows(crop, transform.row_shifts_px)
    if transform.reflectance != 1.0:
        crop = scale_reflectance(crop, transform.reflectance)
    return CropView(crop, normalized_box)


def affine_matrix(transform: CropTransform, window_px: Float64) -> Float64:
    """Return the (3, 3) map of the points of the image, about the centre of the window."""
    center, size = (window_px[:2] + window_px[2:]) / 2, window_px[2:] - window_px[:2]
    stretch = np.sqrt(transform.aspect)
    return (
        translation(*(center + transform.shift * size))
        @ rotation(transform.rotation_rad)
        @ scaling(transform.scale * stretch, transform.scale / stretch)
        @ scaling(-1.0 if transform.is_flipped else 1.0, 1.0)
        @ translation(*-center)
    )


def translation(x: float, y: float) -> Float64:
    """Return the (3, 3) map that moves points right and down."""
    return np.array([[1.0, 0, x], [0, 1, y], [0, 0, 1]])


def scaling(x: float, y: float) -> Float64:
    """Return the (3, 3) map that stretches about the origin; -1 mirrors."""
    return np.array([[x, 0.0, 0], [0, y, 0], [0, 0, 1]])


def rotation(angle_rad: float) -> Float64:
    """Return the (3, 3) map that turns about the origin, clockwise as y points down."""
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    return np.array([[cos, -sin, 0.0], [sin, cos, 0], [0, 0, 1]])


def transform_box(box_px: Float, map_px: Float64) -> Float64:
    """Return (4,) the upright box around the corners of a box where a (3, 3) map takes them."""
    corners = np.asarray(box_px, np.float64)[[[0, 2, 2, 0], [1, 1, 3, 3]]]
    moved = map_px[:2, :2] @ corners + map_px[:2, 2:]
    return np.concatenate([moved.min(axis=1), moved.max(axis=1)])


def occlude_side(
    crop: UInt8, occlusion: Occluder, normalized_box: Float64, depth_m: float
) -> UInt8:
    """Hide one side of an object behind a nearer one, as far beyond its edge as before it.

    Args:
        crop: (66, 112, 3) crop.
        occlusion: Occluder.
        normalized_box: (4,) extent of the object; NaN where it is unknown, and the middle is taken.
        depth_m: Depth of the object.
    """
    left, right = normalized_box[[0, 2]] if np.isfinite(normalized_box).all() else _UNKNOWN_EXTENT
    edge, hidden = (left if occlusion.from_left else right), occlusion.share * (right - left)
    first, end = np.rint(np.array([edge - hidden, edge + hidden]) * CROP_WIDTH_PX).astype(int)
    occluded = crop.copy()
    part = occluded[:, max(first, 0) : max(end, 0)]
    pixel_m, occluder_m = _ALL_DEPTHS_M[part[..., _DEPTH]], occlusion.nearness * depth_m
    # Above the highest beam the occluder is not measured either.
    is_hidden = (part[..., _HEIGHT] > 0) & (pixel_m > occluder_m)
    # Along a ray from the camera, height over the camera shrinks with depth.
    height = _CAMERA_HEIGHT + (part[..., _HEIGHT].astype(np.float32) - _CAMERA_HEIGHT) * (
        occluder_m / pixel_m
    )
    nearer = np.empty((*is_hidden.shape, 3), np.uint8)
    nearer[..., _DEPTH] = encode_depth(np.array([occluder_m], np.float32)).item()
    nearer[..., _HEIGHT] = np.clip(np.rint(height), 1, 255)
    nearer[..., _REFLECTANCE] = round(255 * occlusion.reflectance)
    part[is_hidden] = nearer[is_hidden]
    return occluded


def scale_depth(crop: UInt8, factor: float) -> UInt8:
    """Return a (66, 112, 3) crop with depths multiplied by a factor."""
    encoded = encode_depth((_ALL_DEPTHS_M * factor).astype(np.float32))
    scaled = crop.copy()
    # 0 is a near depth, and also the unknown, which has no height either.
    scaled[..., _DEPTH] = encoded[crop[..., _DEPTH]] * (crop[..., _HEIGHT] > 0)
    return scaled


def scale_reflectance(crop: UInt8, factor: float) -> UInt8:
    """Return a (66, 112, 3) crop with reflectances multiplied by a factor."""
    scaled = crop.copy()
    scaled[..., _REFLECTANCE] = cv2.convertScaleAbs(crop[..., _REFLECTANCE], alpha=factor)
    return scaled


def shift_rows(crop: UInt8, shifts_px: Float64) -> UInt8:
    """Move each row of a (66, 112, C) crop to the right by its own rounded number of pixels."""
    columns = np.arange(CROP_WIDTH_PX) - np.rint(shifts_px)[:, None]
    rows = np.broadcast_to(np.arange(CROP_HEIGHT_PX)[:, None], columns.shape)
    shifted = cv2.remap(
        crop,
        columns.astype(np.float32),
        rows.astype(np.float32),
        cv2.INTER_NEAREST,
        borderMode=cv2.BORDER_REPLICATE,
    )
    return np.asarray(shifted, np.uint8)


def _shares(box_px: Float64, window_px: Float64) -> Float64:
    """Return (4,) a box normalized to a window."""
    corner, size = window_px[:2], window_px[2:] - window_px[:2]
    shares = (box_px - np.tile(corner, 2)) / np.tile(np.maximum(size, MIN_EDGE_PX), 2)
    return np.asarray(shares)
