"""Batches of pictures: what they hold, in which order, by how many processes, and after a resume."""

import logging
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
import torch
from lightning.pytorch import LightningModule, Trainer
from torch.utils.data import DataLoader

from data.array_store import ArrayStore
from data.open_drive import open_drive, open_drives
from data.samples.config import TrainingDrives
from data.samples.epoch_samplers import DistributedBatchSampler, SampleIndex, ShuffledSampler
from data.samples.images.config import (
    GeometricConfig,
    ImageAugmentationConfig,
    ImageDataConfig,
    MapAugmentationConfig,
    PhotometricConfig,
)
from data.samples.images.datamodule import ImageDataModule
from data.samples.images.dataset import ImageDataset, augment, collate
from data.samples.images.input_images import ImageConfig
from data.samples.images.labelled_images import LabelledImages
from data.splits.draw import draw_split
from data.splits.files import write_split
from data.splits.parts import PARTS
from data.splits.training_frames import ENTRY, UNKNOWN, TrainingFrames
from perception.errors import LabelError, ScanError, UsageError
from perception.types import MODALITIES, Modality
from tests.car_frames import SIZE_PX
from tests.data.samples.images.conftest import SMALL
from tests.faults import fault

FIELDS = {"images", "boxes_px", "classes", "is_ignored", "numbers"}
MakeData = Callable[..., ImageDataModule]


@pytest.fixture
def make_data(make_frames: Callable[..., Path], tmp_path: Path) -> MakeData:
    def make(
        modality: Modality = "dm",
        training: tuple[Path, ...] | None = None,
        validation: tuple[Path, ...] = (),
        progress: Callable[[Iterable[int]], Iterable[int]] = iter,
        class_names: tuple[str, ...] = ("Car",),
        split: Path | None = None,
        **data: object,
    ) -> ImageDataModule:
        named = (make_frames(),) if training is None else training
        made = ImageDataModule(
            named,
            validation,
            split=split,
            image=ImageConfig(modality, class_names, SMALL),
            **{"batch_size": 2, "cache": tmp_path / "cache", **data},
        )
        made.progress = progress
        return made

    return make


def names_of(dataset: ImageDataset) -> tuple[str, ...]:
    return tuple(dataset.frames.name(number) for number in dataset.numbers.tolist())


@pytest.fixture
def dataset(make_images: Callable[..., LabelledImages]) -> ImageDataset:
    return ImageDataset(make_images(), np.arange(5), ImageAugmentationConfig(), seed=3)


def test_a_sample_without_augmentation_is_the_image_and_its_labels(dataset: ImageDataset):
    sample = dataset[1]
    assert set(sample) == FIELDS
    image = dataset.frames.image(1)
    np.testing.assert_array_equal(sample["images"].numpy(), image.transpose(2, 0, 1))
    expected = dataset.frames.labels(1).boxes_px * np.tile([313 / 620, 96 / 190], 2)
    np.testing.assert_allclose(sample["boxes_px"], expected, rtol=1e-5)
    assert (sample["classes"].tolist(), sample["is_ignored"].tolist()) == ([0, 0], [False, False])
    assert int(sample["numbers"]) == 1


@pytest.mark.parametrize("modality", MODALITIES)
def test_a_view_is_reproducible_and_differs_from_others(
    make_images: Callable[..., LabelledImages], modality: Modality
):
    dataset = ImageDataset(make_images(modality), np.arange(5), ImageAugmentationConfig(), seed=3)
    first, again, other = (dataset[SampleIndex(0, view)] for view in ((1, 5), (1, 5), (2, 5)))
    for name in FIELDS:
        assert torch.equal(first[name], again[name])
    assert not torch.equal(first["images"], other["images"])
    reseeded = ImageDataset(dataset.frames, np.arange(5), ImageAugmentationConfig(), seed=4)
    assert not torch.equal(first["images"], reseeded[SampleIndex(0, (1, 5))]["images"])


@pytest.mark.parametrize("modality", MODALITIES)
def test_crops_are_narrower_views_with_their_targets(
    make_images: Callable[..., LabelledImages], modality: Modality
):
    cropped = ImageAugmentationConfig(geometric=GeometricConfig(crop=0.5))
    dataset = ImageDataset(make_images(modality), np.arange(5), cropped, seed=3)
    views = [dataset[SampleIndex(row, (1, row))] for row in range(5)]
    assert collate(views)["images"].shape[-2:] == (96, 160)
    boxes_px = torch.cat([view["boxes_px"] for view in views])
    assert len(boxes_px) > 0
    assert boxes_px[:, [0, 2]].min() >= 0
    assert boxes_px[:, [0, 2]].max() <= 160
    assert dataset[0]["images"].shape[-2:] == (96, 320)


@pytest.mark.parametrize("modality", MODALITIES)
def test_without_augmentation_samples_are_unchanged(
    make_images: Callable[..., LabelledImages], modality: Modality
):
    frames = make_images(modality)
    none = ImageAugmentationConfig(
        geometric=GeometricConfig.none(),
        maps=MapAugmentationConfig.none(),
        photometric=PhotometricConfig.none(),
    )
    rng = np.random.default_rng(0)
    image, labels = augment(frames.image(0), frames.targets(0), frames.config, none, rng)
    np.testing.assert_array_equal(image, frames.image(0))
    np.testing.assert_allclose(labels.boxes_px, frames.targets(0).boxes_px)
    plain = ImageDataset(frames, np.arange(5))
    assert torch.equal(plain[SampleIndex(0, (1, 5))]["images"], plain[0]["images"])


def test_lost_cache_entries_are_computed_again(dataset: ImageDataset):
    before = dataset[0]["images"]
    for path in list(dataset.frames.store.folder.rglob("*.npy")):
        path.unlink()
    assert torch.equal(ImageDataset(dataset.frames, np.arange(1))[0]["images"], before)


def test_truth_sizes_and_label_sizes_are_of_its_frames_in_order(
    make_images: Callable[..., LabelledImages],
):
    frames = make_images()
    dataset = ImageDataset(frames, np.array([3, 1]))
    truth = dataset.truth()
    assert truth.frames.tolist() == [0, 0, 1, 1]
    expected = [*frames.labels(3).boxes_px, *frames.labels(1).boxes_px]
    np.testing.assert_array_equal(truth.boxes_px, expected)
    assert dataset.placement(1).region == (0, 0, *SIZE_PX)
    assert dataset.placement(1).content == (0, 0, 313, 96)  # of 320 x 96
    sizes = np.array(expected)[:, 2:] - np.array(expected)[:, :2]
    np.testing.assert_allclose(dataset.label_sizes_px(), sizes * [313 / 620, 96 / 190], rtol=1e-5)


def test_labels_are_filled_up_with_boxes_of_no_size(dataset: ImageDataset):
    less = {**dataset[0], "boxes_px": torch.ones(1, 4), "classes": torch.ones(1, dtype=torch.int64)}
    less["is_ignored"] = torch.ones(1, dtype=torch.bool)
    batch = collate([dataset[1], less])
    assert batch["images"].shape == (2, 1, 96, 320)
    assert batch["boxes_px"][1].tolist() == [[1] * 4, [0] * 4]
    assert (batch["classes"][1].tolist(), batch["is_ignored"][1].tolist()) == (
        [1, 0],
        [True, False],
    )
    assert batch["numbers"].tolist() == [1, 0]


def test_a_batch_without_any_label_is_a_batch(
    make_frames: Callable[..., Path], make_images: Callable[..., LabelledImages]
):
    dataset = ImageDataset(make_images("dm", make_frames(cars=0)), np.arange(2))
    assert collate([dataset[0], dataset[1]])["boxes_px"].shape == (2, 0, 4)
    assert dataset.label_sizes_px().shape == (0, 2)


def test_an_epoch_holds_every_frame_once_and_depends_on_its_number_alone():
    first, resumed = ShuffledSampler(20, seed=1), ShuffledSampler(20, seed=1)
    epochs = []
    for epoch in range(3):
        first.set_epoch(epoch)
        epochs.append(list(first))
    assert all(sorted(ask.row for ask in epoch) == list(range(20)) for epoch in epochs)
    assert epochs[0] != epochs[1]
    assert len({ask.view for epoch in epochs for ask in epoch}) == 60
    resumed.set_epoch(2)
    assert list(resumed) == epochs[2]
    shares = [list(DistributedBatchSampler(resumed, 10, process, 2)) for process in range(2)]
    assert shares[0] + shares[1] == epochs[2]


@pytest.mark.parametrize("method", ["fork", "spawn"])
def test_workers_load_the_same_samples(dataset: ImageDataset, method: str):
    indices = [SampleIndex(row, (0, row)) for row in range(5)]

    def batches(**options: object) -> list[dict[str, torch.Tensor]]:
        return list(DataLoader(dataset, 2, sampler=indices, collate_fn=collate, **options))

    alone = batches()
    together = batches(num_workers=1, multiprocessing_context=method)
    for one, other in zip(alone, together, strict=True):
        assert all(torch.equal(one[name], other[name]) for name in FIELDS)


@pytest.fixture
def busy_opencv() -> Iterator[None]:
    """Let OpenCV begin threads, which a forked worker does not have."""
    before = cv2.getNumThreads()
    cv2.setNumThreads(2)
    cv2.GaussianBlur(np.zeros((1500, 1500, 3), np.uint8), (0, 0), 3)
    yield
    cv2.setNumThreads(before)


@pytest.mark.parametrize(
    ("device", "workers", "expected"),
    [("cpu", None, 0), ("cuda", None, 3), ("cuda", 0, 0), ("cpu", 2, 2)],
)
def test_a_gpu_has_a_loading_process_for_each_of_its_cores(
    make_data: MakeData, monkeypatch: pytest.MonkeyPatch, device: str, workers: int, expected: int
):
    monkeypatch.setattr("data.samples.datamodule.usable_cores", lambda: 6)
    data = make_data(workers=workers)
    data.trainer = SimpleNamespace(
        strategy=SimpleNamespace(root_device=torch.device(device)), num_devices=2
    )
    assert data.workers == expected


@pytest.mark.usefixtures("busy_opencv")
def test_workers_fill_one_cache_at_once(make_data: MakeData):
    data = make_data(workers=2)
    data.setup()
    folder = data.config.cache
    for path in list(folder.rglob("*.npy")):
        path.unlink()
    images = torch.cat([batch["images"] for batch in data.train_dataloader()])
    assert images.shape == (4, 1, 96, 320)
    assert (images > 0).any()
    assert len([path for path in folder.iterdir() if any(path.iterdir())]) == 4


def test_a_drive_on_disk_becomes_batches(make_data: MakeData):
    seen: list[int] = []

    def progress(numbers: Iterable[int]) -> Iterable[int]:
        for number in numbers:
            seen.append(number)
            yield number

    data = make_data(progress=progress, shares=(60, 20, 20))
    data.prepare_data()
    assert seen == [0, 1, 2, 3, 4]
    assert len(list(data.config.cache.iterdir())) == 5
    data.setup()
    parts = [names_of(part) for part in (data.training, data.validation, data.test)]
    assert [len(part) for part in parts] == [3, 1, 1]
    assert sorted(sum(parts, ())) == [f"{number:06d}" for number in range(5)]
    batches = list(data.train_dataloader())
    assert [set(batch) for batch in batches] == [FIELDS] * 2
    assert batches[0]["images"].dtype == torch.uint8
    assert sorted(torch.cat([batch["numbers"] for batch in batches]).tolist()) == [0, 1, 2]
    (kept,) = data.val_dataloader()
    plain = data.validation.frames.image(int(data.validation.numbers[0]))
    np.testing.assert_array_equal(kept["images"][0, 0].numpy(), plain[..., 0])
    assert len(list(data.test_dataloader())) == 1


def test_validation_drives_are_taken_whole(make_data: MakeData, make_frames: Callable[..., Path]):
    data = make_data(validation=(make_frames("other", 2),))
    data.setup()
    assert data.training.numbers.tolist() == [0, 1, 2, 3, 4]
    assert data.validation.numbers.tolist() == [0, 1]
    assert data.test is None


def test_a_share_takes_the_first_frames(make_data: MakeData, make_frames: Callable[..., Path]):
    data = make_data(validation=(make_frames("other", 2),), training_fraction=0.5)
    data.setup()
    assert data.training.numbers.tolist() == [0, 1, 2]
    assert data.validation.numbers.tolist() == [0, 1]


def test_a_split_file_chooses_the_frames(make_data: MakeData, make_frames, tmp_path: Path):
    drives = open_drives([make_frames("split", 10)])
    file = tmp_path / "split.json"
    split = write_split(file, draw_split(drives, (60, 20, 20), by="frames", seed=5))
    data = make_data(training=(), split=file)
    data.prepare_data()
    data.setup()
    datasets = data.training, data.validation, data.test
    for part, dataset in zip(PARTS, datasets, strict=True):
        assert names_of(dataset) == split.drives[0].frames[part]
    (batch,) = data.test_dataloader()
    assert len(batch["images"]) == 2


def test_without_a_test_part_there_is_no_test(make_data: MakeData):
    data = make_data()
    data.setup()
    with fault(UsageError, "test", "a split with frames of part test", advice="--split"):
        data.test_dataloader()


def test_a_network_notes_the_frames_that_it_learns_from(make_data: MakeData, tmp_path: Path):
    data, watcher = make_data(training_fraction=0.5), Watcher()
    trainer = Trainer(
        accelerator="cpu", max_epochs=1, limit_val_batches=0, logger=False,
        enable_checkpointing=False, enable_progress_bar=False, enable_model_summary=False,
    )  # fmt: skip
    trainer.fit(watcher, data)
    trainer.save_checkpoint(tmp_path / "last.ckpt")
    stated = torch.load(tmp_path / "last.ckpt", weights_only=True)["hyper_parameters"]
    learned = TrainingFrames.from_metadata(stated, "last.ckpt")
    assert learned == TrainingFrames.of(data.training.frames.drives)
    assert len(learned.hashes) == 2  # half of the four training frames
    assert stated["part"] == "train"
    assert len(stated["split"]) == 16


@pytest.mark.parametrize(
    ("earlier", "joined"),
    [
        (UNKNOWN, UNKNOWN),
        ("AAECAwQFBgc=", None),
    ],  # of weights that learned from frames not known, or from one
)
def test_frames_of_the_initial_weights_are_noted_too(make_data: MakeData, earlier, joined):
    data, watcher = make_data(), Watcher()
    watcher.hparams.update({ENTRY: earlier})
    data.trainer = SimpleNamespace(lightning_module=watcher, is_global_zero=True)
    data.setup("fit")
    if joined is None:
        own = TrainingFrames.of(data.training.frames.drives)
        joined = own.joined(TrainingFrames(frozenset([bytes(range(8))]))).text
    assert watcher.hparams[ENTRY] == joined


def test_a_bad_frame_stops_or_is_left_out(
    make_data: MakeData, make_frames: Callable[..., Path], caplog
):
    root = make_frames("broken")
    (root / "training/velodyne/000002.bin").write_bytes(b"short")
    with fault(ScanError, "000002.bin"):
        make_data(training=(root,)).prepare_data()
    data = make_data(training=(root,), on_bad_frame="skip", shares=(60, 40))
    with caplog.at_level(logging.WARNING):
        data.prepare_data()
        assert caplog.messages == []
        data.setup()
    assert [record.args[0] for record in caplog.records if "skipped" in record.msg] == ["000002"]
    names = [*names_of(data.training), *names_of(data.validation)]
    assert sorted(names) == ["000000", "000001", "000003", "000004"]


def test_processes_fill_the_cache_with_the_same_bytes(
    make_data: MakeData, make_frames: Callable[..., Path], tmp_path: Path, caplog
):
    root = make_frames("broken")
    (root / "training/velodyne/000002.bin").write_bytes(b"short")

    def filled(workers: int) -> dict[str, bytes]:
        folder = tmp_path / str(workers)
        data = make_data(training=(root,), on_bad_frame="skip", cache=folder, cache_workers=workers)
        data.prepare_data()
        assert caplog.messages == []
        parts = data._parts()
        frames = data._frames([*parts.train, *parts.val])
        assert [frames.name(number) for number in frames.missing()] == ["000002"]
        return {
            str(path.relative_to(folder)): path.read_bytes()
            for path in folder.rglob("*")
            if path.is_file()
        }

    alone = filled(1)
    assert filled(2) == alone
    assert len({Path(name).parts[0] for name in alone}) == 4


def test_a_set_that_lacks_the_class_is_refused(
    make_data: MakeData, make_frames: Callable[..., Path]
):
    data = make_data(training=(make_frames("vans", kind="Van"),))
    with fault(LabelError, "vans", "at least one Car", "8 Van", "choose drives"):
        data.prepare_data()
    with fault(LabelError, "of the training images", "at least one Car", "no object"):
        data.setup()


def test_each_class_needs_labels_and_near_names_are_offered(
    make_data: MakeData, make_frames: Callable[..., Path]
):
    drives = (make_frames("cars"), make_frames("people", kind="Pedestrian"))
    names = ("Car", "Pedestrain", "Tram")
    data = make_data(training=drives, validation=drives, class_names=names)
    with fault(
        LabelError,
        f"{drives[0]}, {drives[1]}",
        "at least one Pedestrain and one Tram",
        "10 Car, 10 Pedestrian",
        "write Pedestrian",
    ):
        data.prepare_data()
    assert not list(data.config.cache.rglob("*.np*"))  # before any image is made


def test_a_class_without_validation_labels_is_noted(
    make_data: MakeData, make_frames: Callable[..., Path], caplog
):
    people = make_frames("people", kind="Pedestrian")
    data = make_data(
        training=(make_frames("cars"), people),
        validation=(people,),
        class_names=("Car", "Pedestrian"),
    )
    with caplog.at_level(logging.WARNING):
        data.prepare_data()
        data.setup()
    (record,) = caplog.records
    assert record.args == (
        "labels that are visible enough of the validation images",
        40,
        "0 Car, 10 Pedestrian",
    )


def test_drives_for_validation_are_named_once(tmp_path: Path):
    with fault(UsageError, "drives", "at least one", "none"):
        TrainingDrives()
    with fault(UsageError, "--split", "no validation drives", "other"):
        TrainingDrives(validation=(Path("other"),), split=tmp_path / "split.json")


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        ({"batch_size": 0}, "a batch size from 1 and workers from 0"),
        ({"workers": -1}, "a batch size from 1 and workers from 0"),
        ({"training_fraction": 0.0}, "above 0, at most 1"),
    ],
)
def test_loading_that_cannot_be_is_refused(data: dict[str, float], expected: str):
    with pytest.raises(UsageError) as raised:
        ImageDataConfig(**data)
    assert raised.value.expected == expected


class Watcher(LightningModule):
    """Learns next to nothing, and notes what it sees."""

    def __init__(self) -> None:
        super().__init__()
        self.weight = torch.nn.Parameter(torch.zeros(1))
        self.seen: list[tuple[int, float, list[int]]] = []

    def training_step(self, batch, batch_idx):
        epoch_sampler = batch["images"].float().mean()
        self.seen.append((self.current_epoch, float(epoch_sampler), batch["numbers"].tolist()))
        return (self.weight - 1).square().sum()

    def configure_optimizers(self):
        return torch.optim.SGD(self.parameters(), 0.1)


def test_resumed_training_loads_the_same_samples(make_data: MakeData, tmp_path: Path):
    data = make_data()

    def trained(epochs: int, resumed: Path | None = None) -> list[tuple[int, float, list[int]]]:
        watcher = Watcher()
        trainer = Trainer(
            accelerator="cpu", max_epochs=epochs, limit_val_batches=0, logger=False, enable_checkpointing=False,
            enable_progress_bar=False, enable_model_summary=False, reload_dataloaders_every_n_epochs=0,
        )  # fmt: skip
        trainer.fit(watcher, data, ckpt_path=resumed)
        trainer.save_checkpoint(tmp_path / f"{epochs}.ckpt")
        return watcher.seen

    first, whole = trained(1), trained(3)
    assert {epoch for epoch, *_ in whole} == {0, 1, 2}
    assert len({epoch_sampler for _, epoch_sampler, _ in whole}) == len(whole) == 6
    assert first + trained(3, tmp_path / "1.ckpt") == whole


def test_sequences_give_images_as_object_frames_do(kitti_root: Path, store: ArrayStore):
    drive = open_drive(kitti_root / "tracking", sequence="0000")
    dataset = ImageDataset(LabelledImages([drive], ImageConfig("rgb"), store), np.arange(3))
    assert dataset[0]["images"].shape == (3, 192, 640)
    assert set(dataset.truth().types) >= {"Van", "Cyclist"}
