"""Frames of labelled drives as a detector of one modality is shown them: a small picture, and its labels."""

import logging
from collections.abc import Sequence

import numpy as np

from data.array_store import Arrays, ArrayStore
from data.frames import file_number
from data.images.input_images import ImageConfig, image_key, make_images
from data.images.targets import DetectionTargets, detection_targets, labels_within_image
from perception.types import Drive, Int, Labels, UInt8

log = logging.getLogger(__name__)


class LabelledImages:
    """The frames of some drives, numbered through; the picture of each is kept in a store."""

    def __init__(self, drives: Sequence[Drive], config: ImageConfig, store: ArrayStore) -> None:
        """Number the frames.

        Args:
            drives: with labels, and with images or a camera's calibration as the modality needs.
            config: what pictures are made of the frames.
            store: where pictures are kept.
        """
        self.drives, self.config, self.store = tuple(drives), config, store
        self._places = [(drive, index) for drive in drives for index in range(len(drive))]
        self.drive_numbers: Int = np.repeat(np.arange(len(drives)), [len(d) for d in drives])
        self._keys: dict[int, str] = {}  # worth keeping: a picture is asked for often
        self._sizes_px: dict[int, tuple[int, int]] = {}
        self._labels: dict[int, Labels] = {}

    def __len__(self) -> int:
        return len(self._places)

    @property
    def file_numbers(self) -> Int:
        """(F,) by which the files of the frames are named."""
        return np.array([file_number(drive, index) for drive, index in self._places], np.int64)

    def image(self, number: int) -> UInt8:
        """Return the (h, w, C) picture of a frame, by memory map where it is large.

        Raises:
            PerceptionError: a file of the frame cannot be read, or it lacks what the modality needs.
        """
        return self._arrays(number)[self.config.modality]

    def size_px(self, number: int) -> tuple[int, int]:
        """Return the (width, height) of the picture of a frame before it was stretched; make it if need be.

        Raises:
            PerceptionError: as `picture`.
        """
        if number not in self._sizes_px:
            width, height = self._arrays(number)["size_px"].tolist()
            self._sizes_px[number] = width, height
        return self._sizes_px[number]

    def labels(self, number: int) -> Labels:
        """Return the labels of a frame, in pixels of the original picture.

        Boxes that cover nothing of the picture are left out, with a warning that says where.

        Raises:
            PerceptionError: the labels or the picture cannot be read, or there are none.
        """
        if number not in self._labels:
            drive, index = self._places[number]
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
        """Return what is to be found in the picture of a frame, in pixels of the input.

        Raises:
            PerceptionError: as `labels`.
        """
        config = self.config
        labels = self.labels(number)
        return detection_targets(labels, config.class_names, self.size_px(number), config.size)

    def _arrays(self, number: int) -> Arrays:
        drive, index = self._places[number]
        if number not in self._keys:
            self._keys[number] = image_key(drive, index, self.config)
        return self.store.get(self._keys[number], lambda: make_images(drive[index], self.config))
