"""Crops as tensors: a torch `Dataset` that augments each crop whenever it is indexed."""

from collections.abc import Mapping

import numpy as np
import torch
from torch import Tensor
from torch.utils.data import Dataset

from data.samples.crops.config import CropAugmentationConfig
from data.samples.crops.labelled_frames import LabelledFrames
from data.samples.crops.sampling import CropSet
from data.samples.crops.transforms import CropSource, CropTransform, crop_view, draw_transform
from data.samples.epoch_samplers import SampleIndex
from perception.detection.depthcn.image import CHANNELS
from perception.errors import UsageError
from perception.types import UInt8

Sample = Mapping[str, Tensor]

_MAX_OPEN_IMAGES = 384  # a file handle each; systems allow a process 1024 or more


class CropDataset(Dataset[Sample]):
    """Samples of a crop set, by row (unchanged) or by `SampleIndex` (augmented).

    A sample holds

        crops           (C, 66, 112) uint8
        windows_px      (4,)         float32, x1 y1 x2 y2
        is_vehicle      ()           float32, 0 or 1: an object of the classes
        classes         ()           int64, number of its class, -1 of others
        normalized_box  (4,)         float32, the label's box, 0..1 over the window, NaN of others

    Images are opened by the process that needs them: the dataset may be sent to workers, forked or spawned.
    """

    def __init__(
        self,
        frames: LabelledFrames,
        crops: CropSet,
        augmentation: CropAugmentationConfig | None = None,
        seed: int = 0,
    ) -> None:
        """Take what samples are made of.

        Args:
            frames: Frames with the images.
            crops: Crops of these frames.
            augmentation: Magnitudes of the augmentation; None leaves samples unchanged.
            seed: Seed of the augmentation.

        Raises:
            UsageError: a channel is not one of the image's.
        """
        channels = frames.config.channels
        unknown = [name for name in channels if name not in CHANNELS]
        if unknown or not channels:
            raise UsageError("channels", expected=f"some of {CHANNELS}", found=str(channels))
        self.frames, self.crops = frames, crops
        self.augmentation, self.seed = augmentation, seed
        self._channels = [CHANNELS.index(name) for name in channels]
        self._images: dict[int, UInt8] = {}

    def __len__(self) -> int:
        return len(self.crops)

    def __getitem__(self, index: SampleIndex | int) -> Sample:
        """Return one sample.

        Raises:
            PerceptionError: its frame has to be read again and cannot be.
        """
        row, transform = self._transform_of(index)
        view = crop_view(self.image(row), self.source(row), transform, self.frames.config.method)
        crop = np.ascontiguousarray(view.crop[..., self._channels].transpose(2, 0, 1))
        return {
            "crops": torch.from_numpy(crop),
            "windows_px": torch.from_numpy(self.crops.windows_px[row]),
            "is_vehicle": torch.tensor(float(self.crops.is_vehicle[row])),
            "classes": torch.tensor(int(self.crops.classes[row])),
            "normalized_box": torch.from_numpy(view.normalized_box.astype(np.float32)),
        }

    def source(self, row: int) -> CropSource:
        """Return the place of a crop in its image."""
        crops = self.crops
        return CropSource(crops.windows_px[row], float(crops.depths_m[row]), crops.boxes_px[row])

    def image(self, row: int) -> UInt8:
        """Return the whole image of a crop."""
        number = int(self.crops.frames[row])
        if number not in self._images:
            if len(self._images) >= _MAX_OPEN_IMAGES:
                self._images.pop(next(iter(self._images)))
            self._images[number] = np.asarray(self.frames.image(number))
        return self._images[number]

    def _transform_of(self, index: SampleIndex | int) -> tuple[int, CropTransform]:
        if not isinstance(index, SampleIndex):
            return index, CropTransform()
        if self.augmentation is None:
            return index.row, CropTransform()
        return index.row, draw_transform(
            self.augmentation, np.random.default_rng([self.seed, *index.view])
        )

    def __getstate__(self) -> dict[str, object]:
        """Leave open images out of what is sent to another process."""
        return {**self.__dict__, "_images": {}}
