"""Edges of an image: maps of how much brighter or darker it gets across upright and across level lines.

Where everything is rough, as in leaves, an edge tells little: each pixel is compared with the mean around it.
"""

from dataclasses import dataclass, field

import cv2
import numpy as np

from perception.calibration.grey_image import GreyImage
from perception.geometry.camera import project
from perception.types import Bool, Calibration, Float32, Float64, UInt8

# Images are made as small as those of this focal length: a pixel is 1.4 mrad wide.
FOCAL_PX = 720.0
NEAREST_M = 0.1
_NOISE_SIGMA_PX = 1.0
_AROUND_PX = 49
_MIN_SLOPE = 4.0  # grey levels a pixel times four, about the noise of a camera
# Grey level below which an image tells no edge, and width of what belongs to a place.
_MIN_LIT, _LIT_PX = 40, 9
_KEPT = 2
_MAX_RATIO = 3.0  # of the mean around, from which on an edge is as sure as it can be


@dataclass(frozen=True)
class EdgeMaps:
    """Edges of one image.

    Attributes:
        upright: (h, w) edges that stand upright, 0 to 255.
        level: (h, w) edges that lie level.
        brightest: (h, w) grey level of the brightest pixel around.
        map_P_cam: (3, 4) projection to the pixels of the maps.
    """

    upright: UInt8
    level: UInt8
    brightest: UInt8
    map_P_cam: Float64
    _smoothed: dict[float, Float32] = field(default_factory=dict, repr=False)

    def pixels(self, points_cam: Float64) -> Float64:
        """Return (K, 2) places of (K, 3) points in the maps, NaN behind the camera."""
        pixels, depths_m = project(self.map_P_cam, points_cam)
        return np.where((depths_m > NEAREST_M)[:, None], pixels, np.nan)

    def is_dark(self, pixels: Float64) -> Bool:
        """Return whether the map is dark at (K, 2) pixels and around; beyond its borders it is not."""
        height, width = self.brightest.shape
        inside = np.all((pixels >= -0.5) & (pixels < (width - 0.5, height - 0.5)), axis=1)
        u, v = np.rint(pixels[inside]).astype(np.int64).T
        dark = np.zeros(len(pixels), bool)
        dark[inside] = self.brightest[v, u] < _MIN_LIT
        return dark

    def smoothed(self, smoothing_px: float) -> Float32:
        """Return the (2, h, w) maps, upright and level, from 0 to 1, smoothed by a Gaussian; those of the last two are kept."""
        if smoothing_px not in self._smoothed:
            if len(self._smoothed) == _KEPT:
                del self._smoothed[next(iter(self._smoothed))]
            size_px = round(8 * smoothing_px + 1) | 1  # that of OpenCV's Gaussian over floats
            gaussian = cv2.getGaussianKernel(size_px, smoothing_px, cv2.CV_32F)
            maps = np.empty((2, *self.upright.shape), np.float32)
            for edges, one in zip((self.upright, self.level), maps, strict=True):
                # From bytes at once: a copy in floats takes a quarter of the time.
                cv2.sepFilter2D(edges, cv2.CV_32F, gaussian, gaussian / 255, dst=one)
            self._smoothed[smoothing_px] = maps
        return self._smoothed[smoothing_px]


def find_image_edges(
    image: UInt8, calibration: Calibration, max_focal_px: float = FOCAL_PX
) -> EdgeMaps:
    """Return the edges of an (H, W, 3) image.

    Args:
        image: RGB image.
        calibration: Calibration of the camera.
        max_focal_px: Focal length above which the image is made smaller.
    """
    shrunk = GreyImage.of(image, calibration, max_focal_px)
    grey = shrunk.grey
    brightest = cv2.dilate(cv2.blur(grey, (3, 3)), np.ones((_LIT_PX, _LIT_PX), np.uint8))
    smooth = cv2.GaussianBlur(grey.astype(np.float32), (0, 0), _NOISE_SIGMA_PX)
    return EdgeMaps(
        _relative(np.asarray(cv2.Sobel(smooth, cv2.CV_32F, 1, 0), np.float32)),
        _relative(np.asarray(cv2.Sobel(smooth, cv2.CV_32F, 0, 1), np.float32)),
        np.asarray(brightest, np.uint8),
        shrunk.image_P_cam,
    )


def _relative(slopes: Float32) -> UInt8:
    """Return slopes in relation to those around, 0 to 255; the slopes are lost."""
    # In place, as memory that is new to the process costs more than the arithmetic.
    sizes = np.abs(slopes, out=slopes)
    around = np.asarray(cv2.blur(sizes, (_AROUND_PX, _AROUND_PX)), np.float32)
    around += np.float32(_MIN_SLOPE)
    ratio = cv2.divide(sizes, around, scale=255 / _MAX_RATIO, dtype=cv2.CV_8U)  # at most 255
    return np.asarray(ratio, np.uint8)
