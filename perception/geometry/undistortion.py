"""Lens distortion: images of a distorted camera are turned once into those of a pinhole."""

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from perception.errors import CalibrationError
from perception.types import Float64, UInt8

# Polynomial lenses are told apart by the number of coefficients alone, as OpenCV does; fisheye lenses are named.
_POLYNOMIAL_COUNTS, _FISHEYE_COUNT = (0, 4, 5, 8, 12), 4
_POLYNOMIAL = ("plumb_bob", "rational_polynomial", "thin_prism", "radtan", "pinhole", "none", "")
_FISHEYE = ("equidistant", "fisheye", "kannala_brandt")
LENS_MODELS = (*_POLYNOMIAL[:-1], *_FISHEYE)


@dataclass(frozen=True)
class Lens:
    """A camera whose images are distorted by its lens.

    Attributes:
        camera_matrix: (3, 3) focal lengths and principal point in pixels.
        coefficients: (K,) coefficients of the distortion in OpenCV's order; none, or all 0, for a pinhole.
        size_px: (width, height) of the images.
        model: Name of the model: plumb_bob (k1 k2 p1 p2 k3), rational_polynomial (eight), thin_prism (twelve), or
            equidistant (fisheye, four); also by other usual names.
        rectification: (3, 3) rotation from the camera to the rectified camera, or None for none.
        target_matrix: (3, 3) camera matrix of the undistorted images, or None for one that shows no border.
        source: Calibration, for error messages.
    """

    camera_matrix: Float64
    coefficients: Float64
    size_px: tuple[int, int]
    model: str = "plumb_bob"
    rectification: Float64 | None = None
    target_matrix: Float64 | None = None
    source: str = "calibration"

    def __post_init__(self) -> None:
        """Validate the camera matrix, the model and the number of its coefficients."""
        if self.model.lower() not in (*_POLYNOMIAL, *_FISHEYE):
            raise CalibrationError(
                self.source,
                expected=f"a distortion model of {', '.join(LENS_MODELS)}",
                found=repr(self.model),
            )
        count = len(self.coefficients)
        allowed = (_FISHEYE_COUNT,) if self.is_fisheye else _POLYNOMIAL_COUNTS
        if len(np.trim_zeros(self.coefficients, "b")) > max(allowed):
            raise CalibrationError(
                self.source,
                expected=f"{', '.join(map(str, allowed))} coefficients of {self.model}",
                found=str(count),
            )
        matrix, size = self.camera_matrix, self.size_px
        finite = np.isfinite(matrix).all() and np.isfinite(self.coefficients).all()
        if not (finite and matrix[0, 0] > 0 and matrix[1, 1] > 0 and min(size) > 0):
            raise CalibrationError(
                self.source,
                expected="positive focal lengths and an image size, all finite",
                found=f"{matrix[0, 0]:g}, {matrix[1, 1]:g} and {size[0]}x{size[1]} pixels",
            )

    @property
    def is_fisheye(self) -> bool:
        """Whether angles from the axis, not their tangents, are distorted."""
        return self.model.lower() in _FISHEYE

    @property
    def is_pinhole(self) -> bool:
        """Whether images are used as they are."""
        is_turned = self.rectification is not None and not np.allclose(
            self.rectification, np.eye(3)
        )
        return not is_turned and not np.any(self.coefficients) and not self.is_fisheye

    @cached_property
    def pinhole_matrix(self) -> Float64:
        """(3, 3) camera matrix of the undistorted images."""
        if self.is_pinhole:
            return self.camera_matrix
        if self.target_matrix is not None:
            return self.target_matrix
        if self.is_fisheye:
            return np.asarray(
                cv2.fisheye.estimateNewCameraMatrixForUndistortRectify(
                    self.camera_matrix, self._used, self.size_px, self._turn, balance=0.0
                )
            )
        matrix, _ = cv2.getOptimalNewCameraMatrix(
            self.camera_matrix, self._used, self.size_px, alpha=0.0
        )
        return np.asarray(matrix)

    def undistort(self, image: UInt8) -> UInt8:
        """Return an (H, W, 3) image as the pinhole camera would show it.

        Raises:
            CalibrationError: The image has another size.
        """
        if (image.shape[1], image.shape[0]) != self.size_px:
            raise CalibrationError(
                self.source,
                expected=f"the calibration of {image.shape[1]}x{image.shape[0]} images",
                found=f"that of {self.size_px[0]}x{self.size_px[1]} images",
            )
        if self.is_pinhole:
            return image
        columns, rows = self._maps
        return np.asarray(cv2.remap(image, columns, rows, cv2.INTER_LINEAR))

    def undistort_boxes(self, boxes_px: Float64) -> Float64:
        """Return (M, 4) the rectangles around (M, 4) distorted ones, x1 y1 x2 y2, as the pinhole camera shows them."""
        if self.is_pinhole or not len(boxes_px):
            return boxes_px
        x, y = boxes_px[:, [0, 2]], boxes_px[:, [1, 3]]
        steps = np.linspace(0, 1, 5)
        columns = x[:, :1] + steps * (x[:, 1:] - x[:, :1])
        rows = y[:, :1] + steps * (y[:, 1:] - y[:, :1])
        points = np.stack(np.broadcast_arrays(columns[:, :, None], rows[:, None, :]), axis=-1)
        make = cv2.fisheye if self.is_fisheye else cv2
        found = make.undistortPoints(
            np.ascontiguousarray(points.reshape(-1, 1, 2)),
            self.camera_matrix,
            self._used,
            R=self._turn,
            P=self.pinhole_matrix,
        ).reshape(len(boxes_px), -1, 2)
        return np.concatenate([found.min(axis=1), found.max(axis=1)], axis=1)

    @cached_property
    def _maps(self) -> tuple[np.ndarray, np.ndarray]:
        """Pixels of the distorted image that are shown at each pixel, as OpenCV's fixed-point maps."""
        make = cv2.fisheye if self.is_fisheye else cv2
        columns, rows = make.initUndistortRectifyMap(
            self.camera_matrix,
            self._used,
            self._turn,
            self.pinhole_matrix,
            self.size_px,
            cv2.CV_16SC2,
        )
        return columns, rows

    @property
    def _turn(self) -> Float64:
        return np.eye(3) if self.rectification is None else self.rectification

    @property
    def _used(self) -> Float64:
        """Coefficients in a number that OpenCV takes; zeros at the end are left out or filled in."""
        coefficients = np.trim_zeros(np.asarray(self.coefficients, np.float64), "b")
        counts = (_FISHEYE_COUNT,) if self.is_fisheye else _POLYNOMIAL_COUNTS[1:]
        count = next(count for count in counts if count >= len(coefficients))
        return np.pad(coefficients, (0, count - len(coefficients)))
