"""Every tracker of one object, by the name under which commands know it."""

from collections.abc import Callable

from perception.errors import UsageError
from perception.sensor import LidarModel
from perception.tracking.single_object.tracker import SingleObjectTracker

# Best first. A tracker is made anew for every object that is followed.
_MAKERS: dict[str, Callable[[LidarModel], SingleObjectTracker]] = {}

TRACKERS = tuple(_MAKERS)


def single_object_tracker(name: str, sensor: LidarModel) -> SingleObjectTracker:
    """Make a tracker of one object.

    Args:
        name: one of `TRACKERS`.
        sensor: the LiDAR whose scans it will be shown.

    Raises:
        UsageError: there is no tracker of this name.
    """
    maker = _MAKERS.get(name)
    if maker is None:
        raise UsageError(
            "tracker of one object", expected=f"one of {', '.join(_MAKERS)}", found=name
        )
    return maker(sensor)
