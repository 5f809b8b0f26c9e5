"""What a layout is: a way in which drives lie on disk, and how it is recognised and opened."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from data.recorded_drive import RecordedDrive
from perception.errors import UsageError
from perception.sensor import HDL_64E, LidarModel, load_sensor
from perception.types import Progress


@dataclass(frozen=True)
class OpenConfig:
    """How a drive is read, in any layout; a layout ignores what it has no use for.

    Attributes:
        sensor: Name of a LiDAR model, or a file that describes one, of packets the metadata; else what the drive states.
        images: Whether frames carry images.
        camera: Name of the camera, or topic of its images, several with commas, the main one first; else the first or
            the forward one.
        lidar: Name of the LiDAR, or topic of its scans, several with commas; else the first or all of them. Of packets its
            address and port.
        odometry: Topic of the poses; else the odometry with most messages, or positions and orientations.
        deskew: Whether the points of a sweep are moved to the time of the scan, where their times are known.
        reflectance_scale: Full scale of reflectance, such as 255; else found from some scans.
        columns: Names of the columns of scans in order, where their files do not name them; else what the drive states.
        start: Number of frames at the start of the drive that are left out.
        every: Step from frame to frame: 5 takes every fifth.
        progress: Progress bar over the frames of a drive that is read before its first frame.
    """

    sensor: str | None = None
    images: bool = True
    camera: str | None = None
    lidar: str | None = None
    odometry: str | None = None
    deskew: bool = False
    reflectance_scale: float | None = None
    columns: tuple[str, ...] = ()
    start: int = 0
    every: int = 1
    progress: Progress = field(default=iter, compare=False)

    def __post_init__(self) -> None:
        """Validate the full scale of reflectance, the columns, the start and the step."""
        if self.start < 0:
            raise UsageError("--start", expected="0 or more", found=str(self.start))
        if self.every < 1:
            raise UsageError("--every", expected="1 or more", found=str(self.every))
        if self.columns:
            from data.clouds.cloud import require_column_names

            require_column_names(self.columns, "--columns")
        scale = self.reflectance_scale
        if scale is not None and not 0 < scale < float("inf"):
            raise UsageError("--reflectance-scale", expected="a number above 0", found=f"{scale:g}")

    @property
    def cameras(self) -> tuple[str, ...]:
        """Names of the cameras that were asked for."""
        return () if self.camera is None else tuple(self.camera.split(","))

    def camera_among(self, names: Sequence[str]) -> str:
        """Return the camera that was asked for, else the first.

        Args:
            names: Names of the cameras of a drive.

        Raises:
            UsageError: There is no such camera.
        """
        if self.camera is not None and self.camera not in names:
            raise UsageError(
                f"--camera {self.camera}",
                expected=f"one of {', '.join(names)}" if names else "a drive with a camera",
                found=self.camera if names else "none",
            )
        return self.camera or names[0]

    def lidar_model(self, folder: Path) -> LidarModel:
        """Return the model that was asked for, else that of the folder's sensor.json, else an HDL-64E.

        Raises:
            UsageError: There is no such model, or a file does not describe one.
        """
        if self.sensor is not None:
            return load_sensor(self.sensor)
        own = folder / "sensor.json"
        return load_sensor(own) if own.is_file() else HDL_64E


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
