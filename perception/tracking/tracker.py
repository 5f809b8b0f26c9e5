"""What every tracker of many objects offers."""

from typing import Protocol

from perception.geometry.footprints import Footprints
from perception.types import Float64, Tracks


class MultiObjectTracker(Protocol):
    """Follows all objects of a drive, scan after scan."""

    def update(
        self, stamp_s: float, world_SE3_velo: Float64, moving: Footprints, static: Footprints
    ) -> Tracks:
        """Take in what one scan shows and say where everything is that is tracked.

        Args:
            stamp_s: time of the scan; one not later than the last repeats the last answer's moment.
            world_SE3_velo: (4, 4) pose of the scan.
            moving: things that move, in the LiDAR frame of the scan; only these begin tracks.
            static: things that stand; they may keep a track alive whose object has stopped.
        """
        ...

    def clear(self) -> None:
        """End all tracks, as where poses before and after no longer fit; ids are not used again."""
        ...
