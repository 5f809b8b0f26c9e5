"""Detected vehicles of a run as labels in the form of a labelling tool."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from data.box_labels.boxes import LabelledFrame
from data.box_labels.form_names import LabelFormName
from data.box_labels.forms import FORM_OF_NAME
from data.box_labels.written_frames import labelled_frame
from data.drive_images import ImageFiles
from data.labelled_objects import labels_of_boxes
from data.recorded_drive import RecordedDrive
from data.results.result_writer import ResultWriter
from perception.errors import UsageError
from perception.render.scene import SelectedObject
from perception.snapshot import Restorable
from perception.types import Int, Labels, Result, Vehicles


class LabelWriter(Restorable, ResultWriter):
    """Writes labels at the end of a run, also where that stops early."""

    memories = ("_frames",)

    def __init__(
        self, out: Path, form: LabelFormName, drive: RecordedDrive, min_score: float
    ) -> None:
        """Write nothing yet.

        Args:
            out: Folder of the labels.
            form: Name of their form.
            drive: Drive of the run.
            min_score: Score from which a vehicle is labelled.

        Raises:
            UsageError: The form is of images, which the drive does not have without distortion.
        """
        self._out, self._form, self._drive = out, FORM_OF_NAME[form], drive
        self._min_score = min_score
        self._frames: list[LabelledFrame] = []
        if self._form.is_of_image:
            images = drive.images
            if not isinstance(images, ImageFiles):
                expected = "a drive with images in files"
                raise UsageError(f"--label-form {form}", expected=expected, found="none")
            if images.lens is not None and not images.lens.is_pinhole:
                expected = "images without distortion, on which boxes are drawn"
                raise UsageError(f"--label-form {form}", expected=expected, found="a lens")

    def add(self, result: Result, selected: SelectedObject | None) -> None:
        """Add the vehicles of one frame that have a 3D box, and in the image those of the main camera."""
        index, vehicles = result.frame.index, result.vehicles
        if vehicles is None:
            return
        is_sure = vehicles.fused.detections.scores >= self._min_score
        around = _labels(vehicles, np.flatnonzero(is_sure & np.isfinite(vehicles.boxes.yaw_rad)))
        in_image = _labels(vehicles, np.flatnonzero(is_sure & (vehicles.cameras == 0)))
        self._frames.append(
            labelled_frame(self._drive, index, around, result.world_SE3_velo, in_image)
        )

    def close(self, *, is_complete: bool) -> None:
        """Write the labels of the frames that were added."""
        self._form.write(self._out, self._frames)


def _labels(vehicles: Vehicles, rows: Int) -> Labels:
    detections = vehicles.fused.detections
    types, ids = detections.types[rows].tolist(), vehicles.ids[rows]
    labels = labels_of_boxes(vehicles.boxes[rows], types, ids)
    return replace(labels, boxes_px=detections.boxes_px[rows].astype(np.float64))
