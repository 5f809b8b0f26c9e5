"""Faults of the camera, and of its calibration."""

from dataclasses import replace

import cv2
import numpy as np

from data.corruptions import darken
from data.faults.moment import FaultMoment
from perception.geometry.se3 import from_motion_vector
from perception.types import Float32, Float64, Frame, UInt8

_GREY, _MUD = 200.0, np.array([70.0, 60.0, 45.0], np.float32)
_MUD_COVER = 0.75  # of the light, at the middle of a spot
_MUD_BLUR_SHARE = 0.01  # of the width of the image
_NOISE = 1.5  # grey levels
_PITCH, _YAW, _RIGHT = 0, 1, 3


def dark(moment: FaultMoment, stops: float) -> Frame:
    """Take away light by stops of half the light each, as a covered lens or a wrong exposure does."""
    return darken(moment.frame, stops, moment.passing)


def frozen(moment: FaultMoment, size: float) -> Frame:
    """Repeat the last image before the fault, to the last bit."""
    del size
    return replace(moment.frame, image=moment.start.image)


def washed_out(moment: FaultMoment, share: float) -> Frame:
    """Mix the image with grey light, as glare, haze on the lens or overexposure does.

    Args:
        moment: Frame of the fault.
        share: Share of the light that is no image, 0 to 1.
    """
    image = moment.frame.image
    if image is None:
        return moment.frame
    mixed = (1 - share) * image.astype(np.float32) + share * _GREY
    return replace(moment.frame, image=_with_noise(mixed, moment))


def dirty(moment: FaultMoment, share: float) -> Frame:
    """Cover a share of the image with a spot of mud out of focus: what is behind is dim and blurred."""
    image = moment.frame.image
    if image is None:
        return moment.frame
    height, width = image.shape[:2]
    rng = moment.lasting
    # An ellipse half as high as wide, anywhere in the image.
    radius_px = np.sqrt(2 * share * height * width / np.pi)
    radius_y = min(radius_px / 2, height / 2)
    center = rng.uniform(0.2, 0.8) * width, rng.uniform(0.35, 0.75) * height
    y, x = np.mgrid[:height, :width].astype(np.float32)
    distance = np.hypot((x - center[0]) / radius_px, (y - center[1]) / radius_y)
    cover = np.clip(2 * (1.25 - distance), 0, 1)[..., None].astype(np.float32)
    blurred = cv2.GaussianBlur(image, (0, 0), _MUD_BLUR_SHARE * width).astype(np.float32)
    behind = (1 - _MUD_COVER) * blurred + _MUD_COVER * _MUD
    return replace(
        moment.frame, image=_with_noise((1 - cover) * image + cover * behind, moment, cover)
    )


def blurred(moment: FaultMoment, sigma_px: float) -> Frame:
    """Blur the image, as a lens out of focus or a film of water does.

    Args:
        moment: Frame of the fault.
        sigma_px: Standard deviation of the blur, in pixels of an image 1242 pixels wide.
    """
    image = moment.frame.image
    if image is None or sigma_px <= 0:
        return moment.frame
    scaled = cv2.GaussianBlur(image, (0, 0), sigma_px * image.shape[1] / 1242)
    return replace(moment.frame, image=_with_noise(scaled.astype(np.float32), moment))


def missing(moment: FaultMoment, size: float) -> Frame:
    """Take the image away."""
    del size
    return replace(moment.frame, image=None)


def _with_noise(image: Float32, moment: FaultMoment, share: Float32 | float = 1.0) -> UInt8:
    """Return grey levels with the noise of the sensor, which no lens takes away."""
    noise = moment.passing.standard_normal(image.shape, np.float32) * np.float32(_NOISE)
    return np.asarray(np.clip(np.rint(image + share * noise), 0, 255), np.uint8)


def turned_aside(moment: FaultMoment, yaw_deg: float) -> Frame:
    """Turn the camera of the calibration to the side."""
    return _changed(moment.frame, np.radians(yaw_deg) * np.eye(6)[_YAW])


def tilted(moment: FaultMoment, pitch_deg: float) -> Frame:
    """Tilt the camera of the calibration up or down."""
    return _changed(moment.frame, np.radians(pitch_deg) * np.eye(6)[_PITCH])


def shifted(moment: FaultMoment, distance_m: float) -> Frame:
    """Move the camera of the calibration to the right."""
    return _changed(moment.frame, distance_m * np.eye(6)[_RIGHT])


def _changed(frame: Frame, offset: Float64) -> Frame:
    if frame.calibration is None:
        return frame
    cam_SE3_velo = from_motion_vector(offset) @ frame.calibration.cam_SE3_velo
    return replace(frame, calibration=replace(frame.calibration, cam_SE3_velo=cam_SE3_velo))
