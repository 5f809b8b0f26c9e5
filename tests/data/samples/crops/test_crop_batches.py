"""Candidates as tensors: what a sample and a batch hold, balance, workers, and the split."""

import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from lightning.pytorch import LightningModule, Trainer
from torch.utils.data import DataLoader

from data.samples.crops.config import (
    OPERATIONS,
    CropAugmentationConfig,
    CropDataConfig,
    CropSamplingConfig,
)
from data.samples.crops.datamodule import CropDataModule
from data.samples.crops.dataset import CropDataset
from data.samples.crops.labelled_frames import LabelledFrames
from data.samples.crops.previews import augmentation_previews, preview_rows
from data.samples.crops.sampling import collect_crops
from data.samples.epoch_samplers import BalancedSampler, SampleIndex
from perception.detection.depthcn.crops import crop_windows
from perception.errors import LabelError, UsageError

FIELDS = {"crops", "windows_px", "is_vehicle", "classes", "normalized_box"}


@pytest.fixture
def dataset(street: LabelledFrames) -> CropDataset:
    return CropDataset(
        street, collect_crops(street, CropSamplingConfig()), CropAugmentationConfig(), seed=3
    )


@pytest.fixture
def make_data(make_street: Callable[..., Path], tmp_path: Path) -> Callable[..., CropDataModule]:
    def make(**drives: tuple[Path, ...]) -> CropDataModule:
        named = {"drives": (make_street(frames=5),)} | drives
        return CropDataModule(**named, batch_size=4, cache=tmp_path / "cache")

    return make


def test_a_sample_without_augmentation_is_the_crop_of_the_detector(dataset: CropDataset):
    row = int(np.flatnonzero(dataset.crops.is_vehicle)[0])
    sample = dataset[row]
    assert set(sample) == FIELDS
    expected = crop_windows(dataset.image(row), dataset.crops.windows_px[[row]])[0]
    assert np.abs(sample["crops"].numpy().astype(int) - expected).max() <= 2
    assert float(sample["is_vehicle"]) == 1.0
    x1, y1, x2, y2 = dataset.crops.windows_px[row]
    box = sample["normalized_box"].numpy() * np.tile([x2 - x1, y2 - y1], 2) + [x1, y1, x1, y1]
    np.testing.assert_allclose(box, dataset.crops.boxes_px[row], atol=1e-3)


def test_a_negative_has_no_box(dataset: CropDataset):
    sample = dataset[int(np.flatnonzero(~dataset.crops.is_vehicle)[0])]
    assert float(sample["is_vehicle"]) == 0.0
    assert sample["normalized_box"].isnan().all()


def test_a_view_is_reproducible_and_differs_from_others(dataset: CropDataset):
    first, again, other = (
        dataset[SampleIndex(0, view)]["crops"] for view in ((1, 5), (1, 5), (2, 5))
    )
    assert bool((first == again).all())
    assert bool((first != other).any())


def test_channels_are_chosen_by_name(street: LabelledFrames, dataset: CropDataset):
    street.config = replace(street.config, channels=("reflectance", "depth"))
    chosen = CropDataset(street, dataset.crops)
    crops = chosen[0]["crops"]
    np.testing.assert_array_equal(crops, dataset[0]["crops"][[2, 0]])
    street.config = replace(street.config, channels=("colour",))
    with pytest.raises(UsageError) as raised:
        CropDataset(street, dataset.crops)
    assert (raised.value.where, raised.value.found) == ("channels", "('colour',)")


def test_half_of_every_batch_are_vehicles_and_all_are_used():
    is_vehicle = np.arange(40) % 10 == 0
    sampler = BalancedSampler(is_vehicle, seed=1)
    rows = [index.row for index in sampler]
    assert len(rows) == len(sampler) == 40
    assert is_vehicle[rows].reshape(-1, 8).sum(axis=1).tolist() == [4] * 5
    vehicles, counts = np.unique([row for row in rows if is_vehicle[row]], return_counts=True)
    assert (vehicles.tolist(), counts.tolist()) == ([0, 10, 20, 30], [5] * 4)
    assert len(set(rows)) == 4 + 20  # others are not seen twice


def test_an_epoch_depends_on_its_number_alone():
    is_vehicle = np.arange(30) % 3 == 0
    first, resumed = BalancedSampler(is_vehicle, 4), BalancedSampler(is_vehicle, 4)
    epochs = []
    for epoch in range(3):
        first.set_epoch(epoch)
        epochs.append(list(first))
    resumed.set_epoch(2)
    assert list(resumed) == epochs[2]
    assert epochs[0] != epochs[1]
    assert len({index.view for epoch in epochs for index in epoch}) == 90


class Watcher(LightningModule):
    """Learns next to nothing, and notes what it sees."""

    def __init__(self) -> None:
        super().__init__()
        self.weight = torch.nn.Parameter(torch.zeros(1))
        self.seen: list[tuple[int, float]] = []

    def training_step(self, batch, batch_idx):
        self.seen.append((self.current_epoch, float(batch["crops"].float().mean())))
        return (self.weight - 1).square().sum()

    def configure_optimizers(self):
        return torch.optim.SGD(self.parameters(), 0.1)


def test_resumed_training_loads_the_same_samples(
    make_data: Callable[..., CropDataModule], tmp_path: Path
):
    def trained(epochs: int, resumed: Path | None = None) -> list[tuple[int, float]]:
        watcher, data = Watcher(), make_data()
        trainer = Trainer(
            accelerator="cpu", max_epochs=epochs, limit_val_batches=0, logger=False, enable_checkpointing=False,
            enable_progress_bar=False, enable_model_summary=False,
        )  # fmt: skip
        trainer.fit(watcher, data, ckpt_path=resumed)
        trainer.save_checkpoint(tmp_path / f"{epochs}.ckpt")
        return watcher.seen

    first, whole = trained(1), trained(3)
    assert {epoch for epoch, _ in whole} == {0, 1, 2}
    assert len(set(whole)) == len(whole)
    assert first + trained(3, tmp_path / "1.ckpt") == whole


@pytest.mark.parametrize("method", ["fork", "spawn"])
def test_workers_load_the_same_samples(dataset: CropDataset, method: str):
    indices = [SampleIndex(row, (0, row)) for row in range(len(dataset))]
    assert len(dataset.image(0))  # an open picture stays behind

    def crops(**options: object) -> np.ndarray:
        loader = DataLoader(dataset, batch_size=4, sampler=indices, **options)
        return np.concatenate([batch["crops"].numpy() for batch in loader])

    alone = crops()
    np.testing.assert_array_equal(crops(num_workers=1, multiprocessing_context=method), alone)


def test_lost_cache_entries_are_computed_again(dataset: CropDataset):
    before = dataset[0]["crops"]
    for entry in dataset.frames.store.folder.iterdir():
        for path in entry.iterdir():
            path.unlink()
        entry.rmdir()
    other = CropDataset(dataset.frames, dataset.crops)
    np.testing.assert_array_equal(other[0]["crops"], before)


def test_batches_of_drives_on_disk(make_data: Callable[..., CropDataModule]):
    data = make_data()
    data.prepare_data()
    data.setup()
    batch = next(iter(data.train_dataloader()))
    assert set(batch) == FIELDS
    assert batch["crops"].shape == (4, 3, 66, 112)
    assert float(batch["is_vehicle"].mean()) == 0.5
    assert not data.validation.crops.is_jittered.any()
    parts = data.training.frames, data.validation.frames
    names = [[frames.name(number) for number in range(len(frames))] for frames in parts]
    assert [len(of_part) for of_part in names] == [4, 1]  # 80 and 20 % of five frames
    assert len({*names[0], *names[1]}) == 5
    kept = sum(len(batch["is_vehicle"]) for batch in data.val_dataloader())
    assert kept == len(data.validation)


def test_validation_drives_are_taken_whole(
    make_street: Callable[..., Path], make_data: Callable[..., CropDataModule]
):
    data = make_data(validation=(make_street("other", frames=2),))
    data.setup()
    assert set(data.training.crops.frames) == {0, 1, 2, 3, 4}
    assert set(data.validation.crops.frames) == {0, 1}


def test_the_mean_crop_is_the_mean_of_samples_without_augmentation(
    make_data: Callable[..., CropDataModule],
):
    data = make_data()
    data.setup()
    rows = [index.row for index in BalancedSampler(data.training.crops.is_vehicle, 0, 20)]
    crops = [data.training[row]["crops"].numpy() for row in rows]
    np.testing.assert_allclose(data.mean_crop(20), np.mean(crops, axis=0), rtol=1e-5)


def test_a_validation_set_without_cars_is_refused(
    make_street: Callable[..., Path], make_data: Callable[..., CropDataModule]
):
    data = make_data(validation=(make_street("other", things=("Van",)),))
    with pytest.raises(LabelError) as raised:
        data.setup()
    assert raised.value.expected == "at least one Car"


@pytest.mark.parametrize("loading", [{"batch_size": 1}, {"workers": -1}])
def test_loading_that_cannot_be_is_refused(loading: dict[str, int]):
    with pytest.raises(UsageError) as raised:
        CropDataConfig(**loading)
    assert raised.value.expected == "a batch size from 2 and workers from 0"


def test_grids_show_every_operation(dataset: CropDataset):
    rows = preview_rows(dataset, 4)
    draws = 6
    grids = augmentation_previews(dataset, CropAugmentationConfig(), rows)
    assert list(grids) == ["none", *OPERATIONS, "all"]
    columns = 2 + min(2, int((~dataset.crops.is_vehicle).sum()))
    for name, grid in grids.items():
        assert grid.shape == ((1 + draws) * 134, columns * 226, 3)
        lines = grid.reshape(1 + draws, 134, -1, 3)
        assert bool((lines[0] != lines[1:]).any()) == (name != "none")
    assert dataset.crops.is_vehicle[rows].tolist() == [True, True, False, False]


def test_arrays_and_geometry_need_no_torch():
    code = (
        "import sys, data.array_store, data.samples.crops.sampling\n"
        "import data.samples.crops.transforms\n"
        "print([m for m in ('torch', 'lightning') if m in sys.modules])"
    )
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ran.stdout.strip() == "[]"
