"""Pictures of drives on disk, in batches, for Lightning."""

import logging
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from lightning.pytorch import LightningDataModule
from torch.utils.data import DataLoader, Sampler

from data.epoch_sampler import SampleIndex, ShuffledSampler
from data.frames import OnBadFrame
from data.images.augmentation import ImageAugmentationConfig
from data.images.dataset import ImageDataset, Sample, collate
from data.images.input_images import ImageConfig
from data.images.labelled_images import LabelledImages
from data.images.splits import Split, random_split, split_from_lists
from data.loading import make_loader, process_sampler, validate_loader_config
from data.splitting import SplitBy
from data.training_drives import TrainingDrives, open_drives
from perception.errors import PerceptionError, UsageError
from perception.types import Int, Progress

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class ImageLoadingConfig:
    """Which pictures are learned from, and how they come to the network.

    Attributes:
        batch_size: pictures a batch.
        workers: processes that make samples; 0 makes them where the network is trained.
        validation_fraction: of the training frames or drives, where no validation drives are named.
        test_fraction: of the training frames or drives, kept for the end; the thesis' split is 0.2 and 0.2 (7.2.2).
        split_by: keep single frames back, or whole drives.
        training_fraction: of what is left to learn from; the first frames, and so the fewer places.
        frame_lists: files of frame numbers to learn from and to judge by, instead of the shares; of one drive.
        on_bad_frame: stop at a frame that cannot be read, or leave it out.
        seed: of the split, the order and the augmentation.
    """

    batch_size: int = 16
    workers: int = 0
    validation_fraction: float = 0.2
    test_fraction: float = 0.0
    split_by: SplitBy = "frames"
    training_fraction: float = 1.0
    frame_lists: tuple[Path, Path] | None = None
    on_bad_frame: OnBadFrame = "stop"
    seed: int = 0

    def __post_init__(self) -> None:
        """Refuse what no batch could be made of."""
        validate_loader_config(self)
        if not 0 < self.training_fraction <= 1:
            found = f"{self.training_fraction:g}"
            raise UsageError("training share", expected="above 0, at most 1", found=found)
        shares = self.validation_fraction, self.test_fraction
        if min(shares) < 0 or sum(shares) >= 1:
            raise UsageError(
                "validation and test share",
                expected="both from 0, together below 1",
                found=f"{shares[0]:g} and {shares[1]:g}",
            )


class ImageDataModule(LightningDataModule):
    """Batches of pictures of one modality: changed to learn from, as they are to judge by.

    A batch holds what `ImageDataset` says of a sample, with a first axis of samples; labels are filled up
    with boxes of zero size.

    Attributes:
        training: what is learned from; there, as all of them, after `setup`.
        validation: what is judged by.
        test: what is kept for the end; empty where no share is.
    """

    training: ImageDataset
    validation: ImageDataset
    test: ImageDataset

    def __init__(
        self,
        sources: TrainingDrives,
        config: ImageConfig,
        augmentation: ImageAugmentationConfig | None = None,
        loading: ImageLoadingConfig = ImageLoadingConfig(),
        progress: Progress = iter,
    ) -> None:
        """Keep what `setup` needs; nothing is read yet.

        Args:
            sources: drives.
            config: what becomes of their frames.
            augmentation: how pictures are changed to learn from; None leaves them as they are.
            loading: which are learned from, and how they come to the network.
            progress: goes through the numbers of the frames, and may show how far it is.
        """
        super().__init__()
        self.sources, self.config = sources, config
        self.augmentation, self.loading = augmentation, loading
        self._progress = progress

    def prepare_data(self) -> None:
        """Fill the cache; with several GPUs, in one process only.

        Raises:
            PerceptionError: a drive cannot be opened or read, or lacks labels, images or calibration.
        """
        for paths in self.sources.parts:
            frames = self._frames(paths)
            self._readable(frames, self._progress(range(len(frames))))

    def setup(self, stage: str | None = None) -> None:
        """Read all labels and keep some frames back.

        Raises:
            LabelError: nothing that is looked for is labelled, or a list of frames cannot be used.
            UsageError: the shares leave nothing of one part, or lists and shares or drives contradict.
            PerceptionError: a drive cannot be opened or read, or lacks labels, images or calibration.
        """
        frames = self._frames(self.sources.training)
        split = self._split(frames)
        kept_frames, kept = frames, split.validation
        if self.sources.validation:
            kept_frames = self._frames(self.sources.validation)
            kept = np.arange(len(kept_frames))
        learned = split.training[: math.ceil(self.loading.training_fraction * len(split.training))]
        self.training = self._dataset(frames, learned, self.augmentation)
        self.validation = self._dataset(kept_frames, kept, None)
        self.test = self._dataset(frames, split.test, None)
        self.training.require_targets("training pictures")
        self.validation.require_targets("validation pictures")

    def train_dataloader(self) -> DataLoader[Sample]:
        """Return batches in a new order, with new looks, at every epoch."""
        epoch_sampler = ShuffledSampler(len(self.training), self.loading.seed)
        return self._loader(self.training, process_sampler(self, epoch_sampler))

    def val_dataloader(self) -> DataLoader[Sample]:
        """Return batches of everything that is judged by, in order."""
        return self._loader(self.validation, None)

    def test_dataloader(self) -> DataLoader[Sample]:
        """Return batches of everything that was kept for the end, in order."""
        return self._loader(self.test, None)

    def _frames(self, paths: Sequence[Path]) -> LabelledImages:
        return LabelledImages(open_drives(paths), self.config, self.sources.store)

    def _split(self, frames: LabelledImages) -> Split:
        loading, has_drives = self.loading, bool(self.sources.validation)
        if loading.frame_lists is None:
            return random_split(
                frames.drive_numbers,
                validation_fraction=0.0 if has_drives else loading.validation_fraction,
                test_fraction=loading.test_fraction,
                by=loading.split_by,
                seed=loading.seed,
            )
        if has_drives or len(frames.drives) > 1 or loading.test_fraction > 0:
            raise UsageError(
                "lists of frames",
                expected="one drive, no validation drives and no test share beside them",
                found=f"{len(frames.drives)} drives, {len(self.sources.validation)} validation drives "
                f"and a test share of {loading.test_fraction:g}",
            )
        return split_from_lists(frames.file_numbers, loading.frame_lists)

    def _dataset(
        self, frames: LabelledImages, numbers: Int, augmentation: ImageAugmentationConfig | None
    ) -> ImageDataset:
        readable = self._readable(frames, numbers.tolist(), is_logged=True)
        return ImageDataset(frames, readable, augmentation, self.loading.seed)

    def _readable(
        self, frames: LabelledImages, numbers: Iterable[int], *, is_logged: bool = False
    ) -> Int:
        """Return the numbers of frames of which there is a picture; make it where it is not kept yet."""
        readable = []
        for number in numbers:
            try:
                frames.size_px(number)
            except PerceptionError as error:
                if self.loading.on_bad_frame == "stop":
                    raise
                if is_logged:
                    log.warning("skipped frame %d: %s", number, error)
                continue
            readable.append(number)
        return np.array(readable, np.int64)

    def _loader(
        self, dataset: ImageDataset, sampler: Sampler[SampleIndex] | None
    ) -> DataLoader[Sample]:
        return make_loader(self, dataset, sampler, self.loading, collate)
