"""What drives with a file for each scan have in common."""

from abc import ABC
from dataclasses import dataclass
from pathlib import Path

from data.kitti.sensor_files import FrameFiles, read_point_truth
from data.recorded_drive import RecordedDrive
from perception.types import PointTruth


@dataclass(frozen=True, kw_only=True)
class FileDrive(RecordedDrive, ABC):
    """Frames that have a scan, in the order of the names of the scans.

    Attributes:
        scans: Scans, one per frame.
        point_labels: SemanticKITTI's labels of the points, one file per scan, or None.
    """

    scans: FrameFiles
    point_labels: FrameFiles | None = None

    @property
    def frame_names(self) -> tuple[str, ...]:
        """Name of each frame in results: its number in six digits, or the name of its file."""
        return self.scans.names

    @property
    def frame_numbers(self) -> tuple[int, ...]:
        """Number of each frame in KITTI's rows: that in the name of its file, or its place."""
        return self.scans.numbers

    @property
    def has_point_truth(self) -> bool:
        """Whether the class of every point is known."""
        return self.point_labels is not None

    def source(self, index: int) -> str:
        """Return the file of a scan."""
        return str(self.scans.paths[index])

    def point_truth(self, index: int) -> PointTruth | None:
        """Read the truth of every point of one frame."""
        if self.point_labels is None:
            return None
        return read_point_truth(self.point_labels.paths[index], self._count_points(index))

    def _count_points(self, index: int) -> int:
        return len(self.points_velo(index))

    def frame_files(self, index: int) -> tuple[Path, ...]:
        """Return the scan, the texts and the image of one frame."""
        image = None if self.images is None else self.images.file(index)
        files = self.scans.paths[index], *self._texts(index), image
        return tuple(path for path in files if path is not None)

    def _texts(self, index: int) -> tuple[Path | None, ...]:
        """Return the label and calibration files of one frame."""
        return ()
