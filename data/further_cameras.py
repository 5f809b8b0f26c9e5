"""Cameras of a drive beside its main one."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

from data.drive_images import DriveImages
from data.per_frame import PerFrame
from perception.types import Calibration, CameraImage


@dataclass(frozen=True)
class DriveCamera:
    """A camera of a drive.

    Attributes:
        name: Name of the camera.
        calibration: Calibration of the camera in all frames.
        images: Image of each frame, or None where there are none or they are not loaded.
    """

    name: str
    calibration: Calibration
    images: DriveImages | None = None


@dataclass(frozen=True)
class FurtherCameras(PerFrame):
    """Cameras beside the main one, in the order in which they were asked for."""

    cameras: tuple[DriveCamera, ...] = ()

    def select(self, indices: Sequence[int]) -> Self:
        """Return the cameras with the images of some frames."""
        return type(self)(
            tuple(
                replace(one, images=one.images and one.images.select(indices))
                for one in self.cameras
            )
        )

    def at(self, index: int, *, with_images: bool = True) -> tuple[CameraImage, ...]:
        """Read what each camera has in a frame; a camera without an image is dark in it.

        Raises:
            ImageError: An image is damaged, or of another size.
        """
        found = []
        for one in self.cameras:
            images = one.images if with_images else None
            is_dark = images is None or images.is_missing(index)
            image = images.read(index) if images is not None and not is_dark else None
            found.append(CameraImage(one.name, one.calibration, image))
        return tuple(found)
