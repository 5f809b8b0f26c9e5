"""Images and their targets as tensors: a torch `Dataset` that augments each whenever it is indexed."""

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np
import torch
from torch import Tensor
from torch.nn.utils.rnn import pad_sequence
from torch.utils.data import Dataset

from data.samples.epoch_samplers import SampleIndex
from data.samples.images.config import ImageAugmentationConfig
from data.samples.images.darknet import augment_as_darknet
from data.samples.images.geometric import (
    crop_size_px,
    draw_crop_column,
    draw_geometric_transform,
    transform_targets,
    warp_image,
)
from data.samples.images.input_images import ImageConfig
from data.samples.images.labelled_images import LabelledImages
from data.samples.images.map_transforms import transform_depth_map, transform_reflectance_map
from data.samples.images.photometric import transform_image
from data.samples.images.targets import DetectionTargets
from perception.detection.detectors.network_input import ImagePlacement
from perception.evaluation.detection.box_rows import TrueBoxes
from perception.types import Float64, Int, UInt8

Sample = Mapping[str, Tensor]


def augment(
    image: UInt8,
    labels: DetectionTargets,
    config: ImageConfig,
    magnitudes: ImageAugmentationConfig,
    rng: np.random.Generator,
) -> tuple[UInt8, DetectionTargets]:
    """Return an augmented image and its targets: (h, w, C), or narrower where images are cropped."""
    if magnitudes.method == "thesis":
        return augment_as_darknet(image, labels, magnitudes.darknet, rng)
    modality, is_filled = config.modality, config.filling != "sparse"
    size_px = image.shape[1], image.shape[0]
    geometric_transform = draw_geometric_transform(magnitudes.geometric, size_px, rng)
    seen_px = crop_size_px(size_px, magnitudes.geometric.crop)
    if seen_px != size_px:
        moved = transform_targets(labels, geometric_transform, size_px)
        left_px = draw_crop_column(moved, (size_px[0], seen_px[0]), rng)
        geometric_transform = geometric_transform.from_column(left_px)
    warped_image = warp_image(image, geometric_transform, modality, rng, seen_px)
    if modality == "rgb":
        warped_image = transform_image(warped_image, magnitudes.photometric, rng)
    elif modality == "dm":
        warped_image = transform_depth_map(
            warped_image, geometric_transform.zoom, magnitudes.maps, rng, is_filled=is_filled
        )
    else:
        warped_image = transform_reflectance_map(
            warped_image, magnitudes.maps, rng, is_filled=is_filled
        )
    return warped_image, transform_targets(labels, geometric_transform, seen_px)


class Samples(Dataset[Sample], ABC):
    """Images and targets of some frames, by row (unchanged) or by `SampleIndex` (augmented).

    A sample holds

        images      (C, h, w) uint8
        boxes_px    (L, 4)    float32, x1 y1 x2 y2 in pixels of the input
        classes     (L,)      int64, indices into the class names
        is_ignored  (L,)      bool, boxes in which a detection is neither right nor wrong
        numbers     ()        int64, row of the sample
    """

    def __init__(
        self, config: ImageConfig, augmentation: ImageAugmentationConfig | None, seed: int
    ) -> None:
        """Take the input of the network, the magnitudes of the augmentation and its seed."""
        self.config, self.augmentation, self.seed = config, augmentation, seed

    def __getitem__(self, index: SampleIndex | int) -> Sample:
        """Return one sample.

        Raises:
            PerceptionError: its frame has to be read again and cannot be.
        """
        row = index.row if isinstance(index, SampleIndex) else index
        image, labels = self.view(index)
        return {
            "images": torch.from_numpy(np.array(image.transpose(2, 0, 1), order="C")),
            "boxes_px": torch.from_numpy(labels.boxes_px),
            "classes": torch.from_numpy(labels.classes),
            "is_ignored": torch.from_numpy(labels.is_ignored),
            "numbers": torch.tensor(row),
        }

    def view(self, index: SampleIndex | int) -> tuple[UInt8, DetectionTargets]:
        """Return the (h, w, C) image and the targets of a sample.

        Raises:
            PerceptionError: as `[]`.
        """
        row = index.row if isinstance(index, SampleIndex) else index
        image, labels = self.unchanged(row)
        if self.augmentation is None or not isinstance(index, SampleIndex):
            return image, labels
        rng = np.random.default_rng([self.seed, *index.view])
        return augment(image, labels, self.config, self.augmentation, rng)

    @abstractmethod
    def __len__(self) -> int: ...

    @abstractmethod
    def unchanged(self, row: int) -> tuple[UInt8, DetectionTargets]:
        """Return the (h, w, C) image and the targets of a sample, as they are.

        Raises:
            PerceptionError: as `[]`.
        """

    @abstractmethod
    def target_types(self) -> Counter[str]:
        """Return the number of targets of each class, which excludes objects that are hard to see."""

    @abstractmethod
    def label_sizes_px(self) -> Float64:
        """Return (M, 2) widths and heights of targets in pixels of the input."""


class ImageDataset(Samples):
    """Samples of frames of labelled drives."""

    def __init__(
        self,
        frames: LabelledImages,
        numbers: Int,
        augmentation: ImageAugmentationConfig | None = None,
        seed: int = 0,
    ) -> None:
        """Read the labels of some frames.

        Args:
            frames: Frames with the images.
            numbers: (F,) numbers of the frames that are samples.
            augmentation: Magnitudes of the augmentation; None leaves samples unchanged.
            seed: Seed of the augmentation.

        Raises:
            PerceptionError: labels or images cannot be read.
        """
        super().__init__(frames.config, augmentation, seed)
        self.frames, self.numbers = frames, np.asarray(numbers, np.int64)
        self._labels = [frames.targets(number) for number in self.numbers.tolist()]

    def __len__(self) -> int:
        return len(self.numbers)

    def unchanged(self, row: int) -> tuple[UInt8, DetectionTargets]:
        """Return the (h, w, C) image and the targets of a sample, as they are."""
        return self.frames.image(int(self.numbers[row])), self._labels[row]

    def placement(self, row: int) -> ImagePlacement:
        """Return where an image lies in the input."""
        return self.frames.placement(int(self.numbers[row]))

    def truth(self) -> TrueBoxes:
        """Return all labels in pixels of the original images, against which detections are evaluated."""
        return TrueBoxes.of_frames([self.frames.labels(number) for number in self.numbers.tolist()])

    def target_types(self) -> Counter[str]:
        """Return the number of targets of each class, which excludes objects that are hard to see."""
        names = self.config.class_names
        classes = [labels.classes[~labels.is_ignored].tolist() for labels in self._labels]
        return Counter(names[number] for of_image in classes for number in of_image)

    def label_sizes_px(self) -> Float64:
        """Return (M, 2) widths and heights of the targets in pixels of the input."""
        boxes_px = [labels.boxes_px[~labels.is_ignored] for labels in self._labels]
        targets = np.concatenate([np.zeros((0, 4)), *boxes_px])
        return np.asarray(targets[:, 2:] - targets[:, :2], np.float64)


def collate(samples: Sequence[Sample]) -> Sample:
    """Return a batch; targets are padded with boxes of zero size."""
    stacked = {name: torch.stack([one[name] for one in samples]) for name in ("images", "numbers")}
    padded = {
        name: pad_sequence([one[name] for one in samples], batch_first=True)
        for name in ("boxes_px", "classes", "is_ignored")
    }
    return {**stacked, **padded}
