"""Sensor corruptions of a frame: darkness, point dropout, and an erroneous calibration.

A generator of the same seed draws the same at every level: a stronger corruption includes the weaker one.
"""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from perception.errors import CalibrationError, UsageError
from perception.evaluation.detection.config import CorruptionLevels
from perception.evaluation.detection.robustness_measure import Corruption
from perception.types import MAP_MODALITIES, Calibration, Float32, Float64, Frame, UInt8

_GAMMA = 2.2  # from light to grey levels, about that of sRGB
# Of a pixel 3 µm wide, as in automotive cameras: electrons of white, and the read noise.
_WHITE_ELECTRONS, _READING_ELECTRONS = 10_000.0, 5.0


def darken(frame: Frame, stops: float, rng: np.random.Generator) -> Frame:
    """Darken an image by stops of half the light each, with the shot noise of the remaining electrons.

    Light arrives electron by electron, so that their number varies by its root (EMVA 1288, 2.2).

    Raises:
        UsageError: the number of stops is negative.
    """
    if stops < 0:
        raise UsageError("darkness", expected="0 stops or more", found=f"{stops:g}")
    if frame.image is None or stops == 0:
        return frame
    light = _light_of(frame.image) * np.float32(2.0**-stops)
    noise = rng.standard_normal(light.shape, np.float32)
    electrons = light * np.float32(_WHITE_ELECTRONS)
    electrons += noise * np.sqrt(electrons + np.float32(_READING_ELECTRONS**2))
    return replace(frame, image=_image_of(electrons / np.float32(_WHITE_ELECTRONS)))


def drop_points(frame: Frame, share: float, rng: np.random.Generator) -> Frame:
    """Drop a random fraction of the LiDAR points; at least one stays.

    Raises:
        UsageError: the fraction is not from 0 to below 1.
    """
    if not 0 <= share < 1:
        raise UsageError("point dropout", expected="from 0 to below 1", found=f"{share:g}")
    luck = rng.random(len(frame.points_velo))
    is_kept = luck >= share
    is_kept[luck.argmax()] = True
    return replace(frame, points_velo=frame.points_velo[is_kept])


def rotate_calibration(frame: Frame, angle_deg: float, rng: np.random.Generator) -> Frame:
    """Rotate the LiDAR in the calibration by an angle about a random axis through the camera.

    Raises:
        CalibrationError: the frame has no camera.
    """
    axis = _direction(rng, 3)
    turned_SE3_cam = np.eye(4)
    turned_SE3_cam[:3, :3] = Rotation.from_rotvec(np.deg2rad(angle_deg) * axis).as_matrix()
    known = _calibration_of(frame)
    turned = replace(known, cam_SE3_velo=turned_SE3_cam @ known.cam_SE3_velo)
    return replace(frame, calibration=turned)


def shift_calibration(frame: Frame, shift_px: float, rng: np.random.Generator) -> Frame:
    """Shift the calibration so that the scan moves in the image by some pixels, in a random direction.

    Raises:
        CalibrationError: the frame has no camera.
    """
    shifted_P_image = np.eye(3)
    shifted_P_image[:2, 2] = shift_px * _direction(rng, 2)
    known = _calibration_of(frame)
    shifted = replace(known, image_P_cam=shifted_P_image @ known.image_P_cam)
    return replace(frame, calibration=shifted)


def _calibration_of(frame: Frame) -> Calibration:
    if frame.calibration is None:
        raise CalibrationError(frame.source, expected="a camera's calibration", found="none")
    return frame.calibration


def _direction(rng: np.random.Generator, dimensions: int) -> Float64:
    """Return a vector of length one, every direction as likely."""
    vector = rng.standard_normal(dimensions)
    return np.asarray(vector / np.linalg.norm(vector))


def _light_of(image: UInt8) -> Float32:
    """Return the light, 0 to 1, of grey levels."""
    light: Float32 = ((np.arange(256) / 255) ** _GAMMA).astype(np.float32)
    return light[image]


def _image_of(light: Float32) -> UInt8:
    """Return the grey levels of light; beyond 1 it is white."""
    return np.asarray(np.rint(255 * np.clip(light, 0, 1) ** np.float32(1 / _GAMMA)), np.uint8)


def sensor_corruptions(
    levels: CorruptionLevels, *, has_camera: bool, has_images: bool
) -> list[Corruption]:
    """Return the corruptions that have levels; those of the calibration only with a camera, darkness only with images.

    Raises:
        UsageError: there is none.
    """
    darkness = levels.darkness if has_images else ()
    rotation, shift = (levels.rotation, levels.shift) if has_camera else ((), ())
    known = (
        Corruption("darkness of the camera [stops]", darken, ("rgb",), darkness),
        Corruption(
            "LiDAR point dropout [share]", drop_points, MAP_MODALITIES, levels.point_dropout
        ),
        Corruption("calibration rotated [degrees]", rotate_calibration, MAP_MODALITIES, rotation),
        Corruption("calibration shifted [pixels]", shift_calibration, MAP_MODALITIES, shift),
    )
    used = [one for one in known if one.levels]
    if not used:
        raise UsageError("--levels", expected="levels of one corruption or more", found="none")
    return used
