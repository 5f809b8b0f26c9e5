"""A candidate cut out of its picture and changed: places by one affine map, values in the crop.

changed (x, y) = M (x, y)        where a point of the picture goes; about the window's centre
crop --window's map--> changed picture --inverse of M--> picture        one warp
"""

from dataclasses import dataclass

import cv2
import numpy as np

from data.crops.augmentation import CropTransform, Occluder
from perception.detection.depthcn.crops import MIN_EDGE_PX, warp, window_maps
from perception.detection.depthcn.windows import CROP_HEIGHT_PX, CROP_WIDTH_PX
from perception.maps.encoding import decode_depth, encode_depth
from perception.types import Float, Float64, UInt8

_DEPTH, _HEIGHT, _REFLECTANCE = range(3)  # rows of picture.CHANNELS
_EYE = 136  # the camera's height over the road, some 1.65 m, as the picture encodes it
_MIDDLE = (0.2, 0.8)  # of a window
_ALL_DEPTHS_M = decode_depth(np.arange(256, dtype=np.uint8))


@dataclass(frozen=True)
class CropSource:
    """One candidate of one picture.

    Attributes:
        window_px: (4,) x1 y1 x2 y2 that the network sees.
        depth_m: how far it is.
        box_px: (4,) of the vehicle's label, NaN where it is none.
    """

    window_px: Float
    depth_m: float
    box_px: Float


@dataclass(frozen=True)
class CropView:
    """What the network sees of a candidate at one look.

    Attributes:
        crop: (66, 112, C).
        normalized_box: (4,) x1 y1 x2 y2 of the label as shares of the window, NaN of what is no vehicle.
    """

    crop: UInt8
    normalized_box: Float64


def crop_view(image: UInt8, source: CropSource, transform: CropTransform) -> CropView:
    """Cut a candidate out of an (H, W, 3) picture and change it."""
    window = np.asarray(source.window_px, np.float64)
    changed_A_picture = affine_matrix(transform, window)
    changed_A_crop = window_maps(window[None])[0]
    crop = warp(image, np.linalg.inv(changed_A_picture) @ changed_A_crop)
    normalized_box = _shares(transform_box(source.box_px, changed_A_picture), window)
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
    """Return (3, 3) where the points of the picture go, about the centre of the window."""
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
    """Hide one side of what a crop shows behind something nearer, as far beyond its edge as before.

    Args:
        crop: (66, 112, 3).
        occlusion: what hides it.
        normalized_box: (4,) where the object is; NaN where that is not known, and the middle is taken.
        depth_m: of the object.
    """
    left, right = normalized_box[[0, 2]] if np.isfinite(normalized_box).all() else _MIDDLE
    edge, hidden = (left if occlusion.from_left else right), occlusion.share * (right - left)
    first, end = np.rint(np.array([edge - hidden, edge + hidden]) * CROP_WIDTH_PX).astype(int)
    occluded = crop.copy()
    part = occluded[:, max(first, 0) : max(end, 0)]
    pixel_m, occluder_m = _ALL_DEPTHS_M[part[..., _DEPTH]], occlusion.nearness * depth_m
    # Above the highest beam nothing is known of the cover either.
    is_hidden = (part[..., _HEIGHT] > 0) & (pixel_m > occluder_m)
    # Along a ray from the eye, height over the eye shrinks with depth.
    height = _EYE + (part[..., _HEIGHT].astype(np.float32) - _EYE) * (occluder_m / pixel_m)
    seen = np.empty((*is_hidden.shape, 3), np.uint8)
    seen[..., _DEPTH] = encode_depth(np.array([occluder_m], np.float32)).item()
    seen[..., _HEIGHT] = np.clip(np.rint(height), 1, 255)
    seen[..., _REFLECTANCE] = round(255 * occlusion.reflectance)
    part[is_hidden] = seen[is_hidden]
    return occluded


def scale_depth(crop: UInt8, factor: float) -> UInt8:
    """Return a (66, 112, 3) crop of the same things that many times as far away."""
    encoded = encode_depth((_ALL_DEPTHS_M * factor).astype(np.float32))
    scaled = crop.copy()
    # 0 is a near depth, but where nothing is known, which has no height either.
    scaled[..., _DEPTH] = encoded[crop[..., _DEPTH]] * (crop[..., _HEIGHT] > 0)
    return scaled


def scale_reflectance(crop: UInt8, factor: float) -> UInt8:
    """Return a (66, 112, 3) crop of the same things that return that many times as much."""
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
    """Return (4,) a box as shares of a window."""
    corner, size = window_px[:2], window_px[2:] - window_px[:2]
    shares = (box_px - np.tile(corner, 2)) / np.tile(np.maximum(size, MIN_EDGE_PX), 2)
    return np.asarray(shares)
