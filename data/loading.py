"""How samples come to a network: in batches, made by some processes."""

from collections.abc import Callable, Sequence
from typing import Any, Protocol

import cv2
from lightning.pytorch import LightningDataModule
from torch.utils.data import DataLoader, Dataset, Sampler

from data.distributed_sampler import ContiguousDistributedSampler
from data.epoch_sampler import EpochSampler, SampleIndex
from perception.errors import UsageError


class LoaderConfig(Protocol):
    """How samples are put together; both numbers as whoever trains chose them."""

    @property
    def batch_size(self) -> int:
        """Samples a batch."""
        ...

    @property
    def workers(self) -> int:
        """Processes that make samples; 0 makes them where the network is trained."""
        ...


def validate_loader_config(loading: LoaderConfig, least: int = 1) -> None:
    """Refuse what no batch of so many samples could be made by.

    Raises:
        UsageError: the batch is smaller, or there are fewer workers than none.
    """
    if loading.batch_size < least or loading.workers < 0:
        raise UsageError(
            "loading",
            expected=f"a batch size from {least} and workers from 0",
            found=f"{loading.batch_size} and {loading.workers}",
        )


def make_loader(
    module: LightningDataModule,
    dataset: Dataset[Any],
    sampler: Sampler[SampleIndex] | None,
    loading: LoaderConfig,
    collate: Callable[[Sequence[Any]], Any] | None = None,
) -> DataLoader[Any]:
    """Return batches of a data set, whose workers leave the cores to each other.

    Args:
        module: whose trainer says whether batches go to an accelerator.
        dataset: of samples.
        sampler: in which order; None takes all as they come.
        loading: how many samples a batch, and by how many workers.
        collate: makes a batch of samples; else equal shapes are stacked.
    """
    if loading.workers > 0:
        # Workers share the cores already. Told here, before they are forked: one that gave up threads itself,
        # which its parent alone has, would wait for them for ever.
        cv2.setNumThreads(1)
    trainer = module.trainer
    return DataLoader(
        dataset,
        batch_size=loading.batch_size,
        sampler=sampler,
        num_workers=loading.workers,
        persistent_workers=loading.workers > 0,
        pin_memory=trainer is not None and trainer.strategy.root_device.type != "cpu",
        collate_fn=collate,
    )


def process_sampler(
    module: LightningDataModule, epoch_sampler: EpochSampler
) -> Sampler[SampleIndex]:
    """Return what this process learns from, of all; everything while nothing is trained."""
    trainer = module.trainer
    if trainer is None:
        return epoch_sampler
    # Workers begin before Lightning says which epoch a resumed training goes on with.
    epoch_sampler.set_epoch(trainer.current_epoch)
    return ContiguousDistributedSampler(epoch_sampler, trainer.global_rank, trainer.world_size)
