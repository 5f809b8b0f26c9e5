"""Other methods to fill a sparse map, to compare with."""

import cv2
import numpy as np
from cv2.typing import MatLike

from perception.maps.filling import FilledMaps
from perception.maps.projection import SparseMaps
from perception.types import Float32

_FAR_M = 100.0


def fill_by_morphology(sparse: SparseMaps) -> FilledMaps:
    """Fill the depth map by dilation of inverted depths, small kernels first, as IP-Basic describes.

    From the paper (Ku, Harakeh, Waslander; 2018): dilate with a diamond, close small holes, fill
    middle ones, extend columns upwards, fill large ones, blur. It knows depth alone, so that
    reflectances are dilated with kernels of the same sizes: the brightest wins there.
    """
    if not len(sparse):
        return FilledMaps.empty(sparse.size_px)
    inverted = _dilated(sparse.scattered(np.asarray(_FAR_M - sparse.depth_m, np.float32)))
    # Reflectances of 0 are measured: lifted, so that they differ from none.
    lifted = _dilated(sparse.scattered(sparse.reflectance + np.float32(1)))
    is_known = inverted > 0
    depth_m = np.where(is_known, _FAR_M - inverted, 0).astype(np.float32)
    return FilledMaps(depth_m, np.clip(lifted - 1, 0, 1)).with_measured(sparse)


def fill_nearest_by_chamfer(sparse: SparseMaps) -> FilledMaps:
    """Let OpenCV's distance transform name the nearest return, in its 5 x 5 approximation."""
    if not len(sparse):
        return FilledMaps.empty(sparse.size_px)
    _, labels = cv2.distanceTransformWithLabels(
        (~sparse.is_measured).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    number = np.zeros(len(sparse) + 1, np.int32)
    number[labels[sparse.pixels[:, 1], sparse.pixels[:, 0]]] = np.arange(len(sparse))
    nearest = number[labels]
    return FilledMaps(sparse.depth_m[nearest], sparse.reflectance[nearest])


def _dilated(values: Float32) -> Float32:
    from_center = np.abs(np.arange(-2, 3))
    diamond = (from_center + from_center[:, None] <= 2).astype(np.uint8)
    dense = cv2.dilate(values, diamond)
    dense = cv2.morphologyEx(dense, cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8))
    dense = _with_holes_dilated(dense, 7)
    top = np.argmax(dense > 0, axis=0)
    rows = np.arange(dense.shape[0])[:, None]
    dense = np.where(rows < top, dense[top, np.arange(dense.shape[1])], dense)
    dense = _with_holes_dilated(dense, 31)
    dense = cv2.medianBlur(np.ascontiguousarray(dense, np.float32), 5)
    return np.where(dense > 0, cv2.GaussianBlur(dense, (5, 5), 0), dense).astype(np.float32)


def _with_holes_dilated(dense: MatLike, edge_px: int) -> MatLike:
    return np.where(dense > 0, dense, cv2.dilate(dense, np.ones((edge_px, edge_px), np.uint8)))
