"""Candidates of drives on disk, in batches, for Lightning."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import torch
from lightning.pytorch import LightningDataModule
from torch import Tensor
from torch.utils.data import DataLoader

from data.crops.augmentation import CropAugmentationConfig
from data.crops.balanced_sampler import BalancedSampler
from data.crops.dataset import CropDataset, Sample
from data.crops.labelled_frames import FrameConfig, LabelledFrames
from data.crops.sampling import CropSamplingConfig, CropSet, collect_crops
from data.loading import make_loader, process_sampler, validate_loader_config
from data.splitting import SplitBy, split_rng, validation_frames
from data.training_drives import TrainingDrives, open_drives
from perception.detection.depthcn.image import CHANNELS
from perception.types import Bool, Progress


@dataclass(frozen=True)
class CropConfig:
    """What the drives' frames are turned into.

    Attributes:
        frames: how they are looked at.
        sampling: what becomes a candidate.
    """

    frames: FrameConfig = field(default_factory=FrameConfig)
    sampling: CropSamplingConfig = field(default_factory=CropSamplingConfig)


@dataclass(frozen=True)
class CropLoadingConfig:
    """How samples come to the network.

    Attributes:
        channels: of the picture, in the order of the network's input.
        batch_size: samples a batch, half of them vehicles (7.2.1).
        workers: processes that make samples; 0 makes them where the network is trained.
        samples_per_epoch: else as many as there are candidates.
        validation_fraction: of the training frames or drives, where no validation drives are named (7.2.1).
        split_by: keep single frames back, or whole drives.
        seed: of the split, the order and the augmentation.
    """

    channels: tuple[str, ...] = CHANNELS
    batch_size: int = 128
    workers: int = 0
    samples_per_epoch: int | None = None
    validation_fraction: float = 0.2
    split_by: SplitBy = "frames"
    seed: int = 0

    def __post_init__(self) -> None:
        """Refuse what no batch could be made of."""
        validate_loader_config(self, least=2)


class CropDataModule(LightningDataModule):
    """Batches of candidates: changed and balanced to learn from, as they are to judge by.

    A batch holds what `CropDataset` says of a sample, with a first axis of samples.
    """

    training: CropDataset
    validation: CropDataset

    def __init__(
        self,
        sources: TrainingDrives,
        config: CropConfig = CropConfig(),
        augmentation: CropAugmentationConfig | None = None,
        loading: CropLoadingConfig = CropLoadingConfig(),
        progress: Progress = iter,
    ) -> None:
        """Keep what `setup` needs; nothing is read yet.

        Args:
            sources: drives.
            config: what becomes of them.
            augmentation: how samples are changed; None leaves them as they are.
            loading: how they come to the network.
            progress: goes through the numbers of the frames, and may show how far it is.
        """
        super().__init__()
        self.sources, self.config = sources, config
        self.augmentation, self.loading = augmentation, loading
        self._progress = progress

    def prepare_data(self) -> None:
        """Fill the cache; with several GPUs, in one process only.

        Raises:
            PerceptionError: a drive cannot be opened or read, or has no labels or no camera.
        """
        for paths in self.sources.parts:
            collect_crops(self._frames(paths), self.config.sampling, self._progress)

    def setup(self, stage: str | None = None) -> None:
        """Gather the candidates and keep some back.

        Raises:
            LabelError: a part would hold one class only.
            UsageError: the validation share leaves nothing of one part.
            PerceptionError: a drive cannot be opened or read, or has no labels or no camera.
        """
        frames = self._frames(self.sources.training)
        found = collect_crops(frames, self.config.sampling)
        kept_frames, kept = frames, found
        if self.sources.validation:
            kept_frames = self._frames(self.sources.validation)
            kept = collect_crops(kept_frames, self.config.sampling)
        else:
            is_kept = self._is_kept(frames)[found.frames]
            found, kept = found[~is_kept], found[is_kept]
        # What is judged is what will be met: proposals, not labels that were shaken.
        kept = kept[~kept.is_jittered]
        found.require_both_classes("training candidates")
        kept.require_both_classes("validation candidates")
        self.training = self._dataset(frames, found, self.augmentation)
        self.validation = self._dataset(kept_frames, kept, None)

    def train_dataloader(self) -> DataLoader[Sample]:
        """Return batches of which half are vehicles."""
        is_vehicle = self.training.crops.is_vehicle
        loading = self.loading
        epoch_sampler = BalancedSampler(is_vehicle, loading.seed, loading.samples_per_epoch)
        return make_loader(self, self.training, process_sampler(self, epoch_sampler), loading)

    def val_dataloader(self) -> DataLoader[Sample]:
        """Return batches of everything that was kept back, in order."""
        return make_loader(self, self.validation, None, self.loading)

    def mean_crop(self, samples: int = 1024) -> Tensor:
        """Return (C, 66, 112) the mean of some training samples as they are, half of them vehicles."""
        plain = self._dataset(self.training.frames, self.training.crops, None)
        sampler = BalancedSampler(plain.crops.is_vehicle, self.loading.seed, samples)
        total = sum(plain[index]["crops"].to(torch.int64) for index in sampler)
        return torch.as_tensor(total, dtype=torch.float32) / len(sampler)

    def _frames(self, paths: Sequence[Path]) -> LabelledFrames:
        return LabelledFrames(open_drives(paths), self.config.frames, self.sources.store)

    def _is_kept(self, frames: LabelledFrames) -> Bool:
        """Tell which frames are kept back, where no drives are named to judge by."""
        loading = self.loading
        rng = split_rng(loading.seed)
        return validation_frames(
            frames.drive_numbers, loading.validation_fraction, loading.split_by, rng
        )

    def _dataset(
        self, frames: LabelledFrames, found: CropSet, augmentation: CropAugmentationConfig | None
    ) -> CropDataset:
        channels, seed = self.loading.channels, self.loading.seed
        return CropDataset(frames, found, augmentation, channels, seed)
