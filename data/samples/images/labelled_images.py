"""Labelled frames as input images of one modality, with their targets."""

import logging
from collections.abc import Sequence

from data.array_store import Arrays, ArrayStore
from data.frames import file_number
from data.samples.cached_frames import CachedFrames
from data.samples.images.input_images import ImageConfig, image_settings, make_images
from data.samples.images.targets import DetectionTargets, detection_targets, labels_within_image
from perception.detection.detectors.network_input import ImagePlacement, PixelRectangle
from perception.types import Drive, Labels, UInt8

log = logging.getLogger(__name__)


class LabelledImages(CachedFrames):
    """Frames of some drives; the input images of each are cached."""

    def __init__(self, drives: Sequence[Drive], config: ImageConfig, store: ArrayStore) -> None:
        """Number the frames.

        Args:
            drives: Drives with labels, and with images or the camera's calibration as the modality needs.
            config: Input of the network.
            store: Cache of the images.
        """
        super().__init__(drives, store)
        self.config = config
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
            labels, left_out = labels_within_image(drive.labels(index), self.size_px(number))
            if left_out:
                log.warning(
                    "%s frame %d: left out %d labels without an area within the image",
                    drive.root,
                    file_number(drive, index),
                    left_out,
                )
            self._labels[number] = labels
        return self._labels[number]

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
