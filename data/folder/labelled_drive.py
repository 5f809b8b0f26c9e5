"""A folder of scans that a labelling tool has labelled: everything around, points, or images."""

from dataclasses import dataclass
from pathlib import Path

from data.box_labels.box_labels import BoxLabels
from data.box_labels.image_labels import ImageLabels
from data.derived.instance_boxes import InstanceLabels
from data.derived.motion_labels import PosedLabels
from data.folder.config import FILE_NAME
from data.folder.drive import FolderDrive
from data.labels_in_view import labels_of_camera
from perception.types import Labels


@dataclass(frozen=True, kw_only=True)
class LabelledFolderDrive(FolderDrive):
    """Frames of one folder with boxes all around, for which no camera is needed.

    Attributes:
        box_labels: Labels of the whole folder.
    """

    box_labels: BoxLabels

    @property
    def has_labels(self) -> bool:
        """Whether there are labelled boxes: yes."""
        return True

    def labels(self, index: int) -> Labels:
        """Return the labels of the objects in the view of the camera, of the virtual one without a camera."""
        return labels_of_camera(self.labels_around(index), self, index)

    def labels_around(self, index: int) -> Labels | None:
        """Return the labels of all objects around; None of a frame that is not labelled."""
        return self.box_labels.at(self.frame_names[index], self.velo_SE3_file(index))

    def other_labels(self) -> list[PosedLabels]:
        """Return none: all labels are of scans."""
        return []

    def _texts(self, index: int) -> tuple[Path | None, ...]:
        # drive.yaml has names of classes.
        return self.box_labels.file(self.frame_names[index]), self.root / FILE_NAME


@dataclass(frozen=True, kw_only=True)
class LabelledPointsDrive(InstanceLabels, FolderDrive):
    """Frames of one folder whose points are labelled with instances."""


@dataclass(frozen=True, kw_only=True)
class LabelledImagesDrive(FolderDrive):
    """Frames of one folder with boxes in the images of its camera alone.

    Attributes:
        image_labels: Labels of the images of the whole folder.
    """

    image_labels: ImageLabels

    @property
    def has_labels(self) -> bool:
        """Whether there are labelled boxes: yes."""
        return True

    def labels(self, index: int) -> Labels:
        """Return the labels of an image; of one that is not labelled, all of it is DontCare."""
        found = self.image_labels.in_image(self.frame_names[index])
        return labels_of_camera(None, self, index) if found is None else found

    def _texts(self, index: int) -> tuple[Path | None, ...]:
        return self.image_labels.file(self.frame_names[index]), self.root / FILE_NAME
