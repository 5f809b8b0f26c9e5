"""The monitors of all cameras of a frame, and the frame without the images of those that failed."""

from dataclasses import replace

from perception.health.camera_monitors import CameraMonitors
from perception.types import CAMERA, Frame, Health, HealthFinding, HealthLevel


class AllCameraMonitors:
    """The monitors of each camera."""

    def __init__(self) -> None:
        self._cameras: dict[str, CameraMonitors] = {}

    def update(self, frame: Frame) -> Health:
        """Return the health of the cameras in a frame."""
        found: list[HealthFinding] = []
        for number, view in enumerate(frame.views):
            part = camera_part(view.camera, is_main=number == 0)
            found += self._cameras.setdefault(part, CameraMonitors(part)).update(view)
        return Health.of(found)


def without_failed_cameras(frame: Frame, health: Health) -> Frame:
    """Return the frame without the images of cameras with an ERROR."""
    if health.level < HealthLevel.ERROR:
        return frame
    further = tuple(
        replace(one, image=None)
        if health.level_of(camera_part(one.name, is_main=False)) is HealthLevel.ERROR
        else one
        for one in frame.further_cameras
    )
    image = None if health.level_of(CAMERA) is HealthLevel.ERROR else frame.image
    return replace(frame, image=image, further_cameras=further)


def camera_part(name: str, *, is_main: bool) -> str:
    """Return the name of a camera among the parts of a health."""
    return CAMERA if is_main else f"{CAMERA} {name}"
