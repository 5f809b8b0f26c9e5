"""Interface of drives, the same for every layout on disk, and their labels and truth."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Protocol

import numpy as np
from numpy.typing import NDArray

from perception.types.frame import Calibration, Frame
from perception.types.lidar import LidarModel
from perception.types.objects import Boxes3D
from perception.types.table import SHARED, ArrayTable, Bool, Float64, Int


@dataclass(frozen=True)
class Labels(ArrayTable):
    """M labelled objects of one frame, converted from the conventions of KITTI.

    Attributes:
        boxes_velo: (M) 3D boxes in the LiDAR frame.
        boxes_px: (M, 4) x1 y1 x2 y2.
        types: (M,) class names as labelled: Car, Van, Truck, Pedestrian, Cyclist ...
        track_ids: (M,) -1 where the layout has none.
        truncation: (M,) 0..1, or KITTI's tracking levels 0..2 where it is a tracking label.
        occlusion: (M,) 0 visible, 1 partly, 2 largely occluded, 3 unknown.
        dont_care_px: (D, 4) image regions in which nothing was labelled.
    """

    boxes_velo: Boxes3D
    boxes_px: Annotated[Float64, 4]
    types: NDArray[np.str_]
    track_ids: Int
    truncation: Float64
    occlusion: Int
    dont_care_px: Annotated[Float64, SHARED]


class Drive(Protocol):
    """Frames in order of time, read from disk one at a time."""

    @property
    def name(self) -> str:
        """Name of the drive."""
        ...

    @property
    def root(self) -> Path:
        """Folder of the drive."""
        ...

    @property
    def sensor(self) -> LidarModel:
        """LiDAR model of the scans."""
        ...

    @property
    def calibration(self) -> Calibration | None:
        """Calibration of all frames, or None without a camera and where each frame has its own."""
        ...

    @property
    def is_sequence(self) -> bool:
        """Whether frames follow each other in time; object frames do not, and have no poses."""
        ...

    @property
    def has_images(self) -> bool:
        """Whether frames carry images."""
        ...

    @property
    def has_poses(self) -> bool:
        """Whether frames carry INS poses."""
        ...

    @property
    def has_labels(self) -> bool:
        """Whether there are labelled boxes."""
        ...

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences on files that are not joined to the scans by their names."""
        ...

    def __len__(self) -> int:
        """Return the number of frames."""
        ...

    def __getitem__(self, index: int) -> Frame:
        """Read one frame; the image only where the drive was opened with images."""
        ...

    def __iter__(self) -> Iterator[Frame]:
        """Read the frames in order."""
        ...

    def labels(self, index: int) -> Labels:
        """Read the labels of one frame; raise DriveError where there are none."""
        ...

    def point_truth(self, index: int) -> "PointTruth | None":
        """Read the truth of every point, or None where it is not known: exact in synthetic drives, else labelled."""
        ...


@dataclass(frozen=True)
class PointTruth:
    """Truth of the N points of a scan: exact where it is synthetic, else by labels of points or of boxes.

    Attributes:
        classes: (N,) SemanticKITTI class numbers, moving classes (252-259) mapped to their still ones.
        instances: (N,) object number, the track id of the label plus one; 0 without an object.
        is_moving: (N,) whether the point's object moves at this moment.
    """

    classes: Int
    instances: Int
    is_moving: Bool
