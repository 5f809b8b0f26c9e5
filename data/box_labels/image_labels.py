"""Labels of the images of a drive, as tools write them, without 3D boxes."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from data.box_labels.axes_check import numbers_of_boxes
from data.box_labels.box_labels import BoxLabels
from data.drive_images import ImageFiles
from data.kitti.labels import DONT_CARE
from perception.errors import LabelError
from perception.geometry.undistortion import Lens
from perception.types import Boxes3D, Labels


@dataclass(frozen=True)
class ImageLabels(BoxLabels):
    """Labels of the images of one camera.

    Attributes:
        images: Image of each frame of the drive.
        lens: Lens through which the labelled images were taken; boxes are returned without its distortion.
    """

    images: ImageFiles
    lens: Lens

    def in_image(self, name: str) -> Labels | None:
        """Return the labels of a frame, whose 3D boxes are NaN; None of one that is not labelled.

        Raises:
            LabelError: The labels cannot be read, or are of no image of the drive.
        """
        if not self._boxes:
            names = [path.stem for path in self.images.paths if path is not None]
            expected = f"labels of images such as {names[0]}" if names else "images of the drive"
            raise LabelError(self.path, expected=expected, found="none of the drive's")
        boxes = self.boxes(name)
        if boxes is None:
            return None
        x, y, _, width, height, _, _ = numbers_of_boxes(boxes).T
        shares = np.column_stack([x - width / 2, y - height / 2, x + width / 2, y + height / 2])
        edges_px = self.lens.undistort_boxes(shares * np.tile(self.lens.size_px, 2))
        is_object = np.array([box.kind != DONT_CARE for box in boxes], bool)
        objects = [box for box, kept in zip(boxes, is_object, strict=True) if kept]
        count = len(objects)
        nowhere = np.full((count, 3), np.nan)
        return Labels(
            boxes_velo=Boxes3D(nowhere, nowhere, nowhere[:, 0]),
            boxes_px=edges_px[is_object],
            types=np.array(self.types(objects), np.str_),
            track_ids=self.track_ids(objects),
            truncation=np.zeros(count),
            occlusion=np.zeros(count, np.int64),
            dont_care_px=edges_px[~is_object],
        )

    @cached_property
    def _frames(self) -> Mapping[str, str]:
        """Name of each frame by the name of its image."""
        paths = zip(self.images.paths, self.drive.scans.names, strict=True)
        return {path.stem: name for path, name in paths if path is not None}

    def _frame(self, name: str, where: str) -> str | None:
        # Images between the scans may be labelled, too.
        return self._frames.get(name)
