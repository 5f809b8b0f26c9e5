"""What a layout is: a way in which drives lie on disk, and how it is recognised and opened."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from data.recorded_drive import RecordedDrive
from perception.sensor import HDL_64E, LidarModel, load_sensor


@dataclass(frozen=True)
class OpenConfig:
    """How a drive is read, in any layout; a layout ignores what it has no use for.

    Attributes:
        sensor: Name of a LiDAR model, or a file that describes one; else what the drive states.
        images: Whether frames carry images.
    """

    sensor: str | None = None
    images: bool = True

    def lidar_model(self, folder: Path, default: LidarModel = HDL_64E) -> LidarModel:
        """Return the model that was asked for, else that of the folder's sensor.json, else the default.

        Raises:
            UsageError: There is no such model, or a file does not describe one.
        """
        if self.sensor is not None:
            return load_sensor(self.sensor)
        own = folder / "sensor.json"
        return load_sensor(str(own)) if own.is_file() else default


@dataclass(frozen=True)
class Layout:
    """A way in which drives lie on disk.

    Attributes:
        name: Name, such as KITTI raw.
        description: What its folder or file looks like, in a few words with an article, for error messages.
        sequences: Names of the drives at a path; none of them where the path itself is the one drive; None where it is
            not of this layout. It looks at names, and reads no scan.
        open: Opens the drive at a path, of one of these names where there are any.
    """

    name: str
    description: str
    sequences: Callable[[Path], tuple[str, ...] | None]
    open: Callable[[Path, str | None, OpenConfig], RecordedDrive]
