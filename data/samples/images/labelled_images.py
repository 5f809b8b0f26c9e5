"""Labelled frames as input images of one modality, with their targets."""

import logging
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from data.array_store import Arrays, ArrayStore
from data.frames import file_number, frame_name
from data.label_proposals.proposed_labels import ProposedLabels
from data.labels_in_view import labels_of_camera
from data.recorded_drive import RecordedDrive
from data.samples.cached_frames import CachedFrames
from data.samples.images.input_images import ImageConfig, image_settings, make_images
from data.samples.images.targets import DetectionTargets, detection_targets, labels_within_image
from perception.detection.detectors.network_input import ImagePlacement, PixelRectangle
from perception.errors import CalibrationError
from perception.types import Drive, Labels, UInt8

log = logging.getLogger(__name__)


class LabelledImages(CachedFrames):
    """Frames of some drives; the input images of each are cached."""

    def __init__(
        self,
        drives: Sequence[Drive],
        config: ImageConfig,
        store: ArrayStore,
        proposals: Mapping[str, ProposedLabels] | None = None,
    ) -> None:
        """Number the frames.

        Args:
            drives: Drives with labels, and with images or the camera's calibration as the modality needs.
            config: Input of the network.
            store: Cache of the images.
            proposals: Proposed labels by the name of a drive, in place of its own.
        """
        super().__init__(drives, store)
        self.config, self.proposals = config, dict(proposals or {})
        self._settings = image_settings(config)
        self._sizes_px: dict[int, tuple[int, int]] = {}
        self._regions: dict[int, PixelRectangle] = {}
        self._labels: dict[int, Labels] = {}

    def image(self, number: int) -> UInt8:
        """Return the (h, w, C) input image of a frame, by memory map where it is large.

        Raises:
            PerceptionError: a file of the frame cannot be read, or it lacks what the modality needs.
        """
        return self._images(number)[self.config.modality]

    def size_px(self, number: int) -> tuple[int, int]:
        """Return the (width, height) of the image of a frame.

        Raises:
            PerceptionError: as `image`.
        """
        if number not in self._sizes_px:
            width, height = self._images(number)["size_px"].tolist()
            self._sizes_px[number] = width, height
        return self._sizes_px[number]

    def placement(self, number: int) -> ImagePlacement:
        """Return where the image of a frame lies in the input.

        Raises:
            PerceptionError: as `image`.
        """
        if number not in self._regions:
            self._regions[number] = PixelRectangle(*self._images(number)["region"].tolist())
        return self.config.placement(self._regions[number])

    def labels(self, number: int) -> Labels:
        """Return the labels of a frame, in pixels of the original image.

        Boxes without an area within the image are left out, with a warning.

        Raises:
            PerceptionError: the labels or the image cannot be read, or there are no labels.
        """
        if number not in self._labels:
            drive, index = self.place(number)
            labels, left_out = labels_within_image(self._labels_of(number), self.size_px(number))
            if left_out:
                log.warning(
                    "%s frame %d: left out %d labels without an area within the image",
                    drive.root,
                    file_number(drive, index),
                    left_out,
                )
            self._labels[number] = labels
        return self._labels[number]

    def label_types(self) -> Counter[str]:
        """Return the number of labels of each type; of proposals, all around."""
        counts = Counter[str]()
        for number in range(len(self)):
            drive, index = self.place(number)
            proposed = self.proposals.get(drive.name)
            around = proposed.at(frame_name(drive, index)) if proposed else drive.labels(index)
            counts.update([] if around is None else around.types.astype(str).tolist())
        return counts

    def targets(self, number: int) -> DetectionTargets:
        """Return the targets in the input image of a frame, in pixels of the input.

        Raises:
            PerceptionError: as `labels`.
        """
        names = self.config.class_names
        return detection_targets(self.labels(number), names, self.placement(number))

    def keys(self, number: int) -> list[str]:
        """Return the key of the images of a frame."""
        return [self._key(number, self._what, self._settings)]

    def make(self, number: int) -> None:
        """Make the images of a frame where they are not cached.

        Raises:
            PerceptionError: as `image`.
        """
        self._images(number)

    @property
    def _what(self) -> str:
        return "camera image" if self.config.modality == "rgb" else "maps"

    def _images(self, number: int) -> Arrays:
        return self.cached(
            number, self._what, self._settings, lambda frame: make_images(frame, self.config)
        )

    def _labels_of(self, number: int) -> Labels:
        """Return the labels of a frame; of proposals those in view, DontCare where they are of no class of the network."""
        drive, index = self.place(number)
        if (proposed := self.proposals.get(drive.name)) is None:
            return drive.labels(index)
        assert isinstance(drive, RecordedDrive)  # which has proposals
        if drive.calibration is None:
            expected = "the calibration of the camera, which shows where proposals are"
            raise CalibrationError(drive.root, expected=expected, found="none")
        sized = replace(drive.calibration, image_size_px=self.size_px(number))
        around = proposed.at(drive.frame_names[index])
        found = labels_of_camera(around, replace(drive, calibration=sized), index)
        is_class = np.isin(found.types, self.config.class_names)
        regions_px = np.concatenate([found.dont_care_px, found.boxes_px[~is_class]])
        return replace(found[is_class], dont_care_px=regions_px)
