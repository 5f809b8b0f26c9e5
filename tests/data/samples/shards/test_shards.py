"""Samples of shards are those of the drives; every reader has shards of its own."""

import tarfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch
from torch.utils.data import DataLoader

from data.array_store import ArrayStore
from data.open_drive import open_drives
from data.remote_folder import RemoteFolder
from data.samples.epoch_samplers import DistributedBatchSampler, SampleIndex
from data.samples.images.config import ImageAugmentationConfig
from data.samples.images.datamodule import ImageDataModule
from data.samples.images.dataset import ImageDataset, collate
from data.samples.images.input_images import ImageConfig
from data.samples.images.labelled_images import LabelledImages
from data.samples.shards.dataset import WINDOW, ShardedImages, ShardSampler, ShardSet
from data.samples.shards.index import NAME, ShardIndex
from data.samples.shards.writer import ShardSource, write_shards
from data.splits.training_frames import TrainingFrames
from perception.detection.detectors.input_size import InputSize
from perception.errors import DriveError, UsageError
from perception.types import MODALITIES, Modality
from tests.car_frames import write_car_frames
from tests.data.samples.images.conftest import write_images
from tests.faults import fault

FRAMES, SMALL = 5, InputSize(96, 320)


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = write_car_frames(tmp_path_factory.mktemp("drive"), FRAMES)
    write_images(root, FRAMES)
    return root


@pytest.fixture
def write(drive: Path, tmp_path: Path) -> Callable[..., str]:
    """Write the drive's frames as shards; return their folder."""

    def make(modality: Modality = "dm", url: str = "", **options: object) -> str:
        url = url or str(tmp_path / f"shards-{modality}")
        config = ImageConfig(modality, size=SMALL)
        source = ShardSource(open_drives([drive]), config, samples=options.pop("samples", 2))
        write_shards(source, RemoteFolder(url), workers=1, **options)
        return url

    return make


@pytest.mark.parametrize("modality", MODALITIES)
def test_samples_are_those_of_the_drive(write, drive, tmp_path, modality):
    config = ImageConfig(modality, size=SMALL)
    frames = LabelledImages(open_drives([drive]), config, ArrayStore(tmp_path / "cache"))
    of_drive = ImageDataset(frames, np.arange(FRAMES))
    streamed = ShardedImages(ShardSet([write(modality)], config), config)
    places = ShardSource(frames.drives, config).places()
    assert [index for _, index in places] != list(range(FRAMES))
    for row, (_, index) in enumerate(places):
        expected, found = of_drive[index], streamed[row]
        for name in ("images", "boxes_px", "classes", "is_ignored"):
            assert torch.equal(found[name], expected[name]), name
    assert streamed.target_types() == of_drive.target_types() == {"Car": 10}
    sizes_px = [np.sort(one.label_sizes_px(), axis=0) for one in (streamed, of_drive)]
    np.testing.assert_allclose(*sizes_px)
    assert streamed.shards.frames == TrainingFrames.of(frames.drives)


def test_augmented_views_depend_on_epoch_and_position_alone(write):
    config = ImageConfig("dm", size=SMALL)
    shards = ShardSet([write()], config)
    views = [
        ShardedImages(shards, config, ImageAugmentationConfig(), seed=3)[SampleIndex(1, view)]
        for view in ((1, 5), (1, 5), (2, 5))
    ]
    assert torch.equal(views[0]["images"], views[1]["images"])
    assert not torch.equal(views[0]["images"], views[2]["images"])


def test_the_same_frames_are_the_same_bytes(write, tmp_path):
    first, second = (write(url=str(tmp_path / name)) for name in ("a", "b"))
    files = sorted(path.name for path in Path(first).iterdir())
    assert files == [NAME, "shard-000000.tar", "shard-000001.tar", "shard-000002.tar"]
    for name in files:
        assert (Path(first) / name).read_bytes() == (Path(second) / name).read_bytes()
    with tarfile.open(Path(first) / "shard-000002.tar") as tar:
        assert tar.getnames() == [f"000002-000000.{kind}" for kind in ("dm.png", "rm.png", "json")]


def test_shards_are_read_from_an_object_store(write):
    url = write(url="memory://frames/dm")
    shards = ShardSet([url, url], ImageConfig("dm", size=SMALL))
    assert (len(shards), shards.sizes.tolist()) == (2 * FRAMES, [2, 2, 1, 2, 2, 1])
    assert shards.label_counts == {"Car": 20}
    assert shards[0].labels.boxes_px.tolist() == shards[FRAMES].labels.boxes_px.tolist()


def test_few_shards_are_in_memory(write):
    url = write(samples=1)
    shards = ShardSet([url] * 3, ImageConfig("dm", size=SMALL))
    for row in range(len(shards)):
        shards[row]
    assert list(shards._kept) == list(range(len(shards)))[-WINDOW - 1 :]


@pytest.mark.parametrize("workers", [0, 2])
def test_loaders_hand_out_each_sample_once(write, workers):
    config = ImageConfig("dm", size=SMALL)
    samples = ShardedImages(ShardSet([write()] * 2, config), config)
    sampler = ShardSampler(samples.shards.sizes, workers=max(workers, 1), batch_size=2)
    loader = DataLoader(
        samples, 2, sampler=sampler, num_workers=workers, collate_fn=collate,
        multiprocessing_context="fork" if workers else None,
    )  # fmt: skip
    rows = [row for batch in loader for row in batch["numbers"].tolist()]
    assert sorted(rows) == list(range(2 * FRAMES))


SIZES = np.array([50] * 39 + [17])


def rows_of(epoch: int = 0, **readers: int) -> list[int]:
    sampler = ShardSampler(SIZES, seed=1, **readers)
    sampler.set_epoch(epoch)
    rows = [ask.row for ask in sampler]
    assert len(rows) == len(sampler)
    return rows


def test_an_epoch_has_each_sample_once_in_an_order_of_its_own():
    first, second = rows_of(0), rows_of(1)
    assert sorted(first) == sorted(second) == list(range(SIZES.sum()))
    assert first != second
    assert rows_of(1) == second


@pytest.mark.parametrize(("processes", "workers"), [(2, 1), (1, 3), (2, 4)])
def test_readers_have_shards_of_their_own(processes, workers):
    batch = 8
    rows = np.array(rows_of(processes=processes, workers=workers, batch_size=batch))
    assert len(set(rows.tolist())) == len(rows) > SIZES.sum() - processes * workers
    shard_of = np.repeat(np.arange(len(SIZES)), SIZES)
    shares = [
        np.array(list(DistributedBatchSampler(rows.tolist(), batch, process, processes)))
        for process in range(processes)
    ]
    assert sorted(np.concatenate(shares)) == sorted(rows)
    for of_process in shares:
        batches = [of_process[i : i + batch] for i in range(0, len(of_process), batch)]
        whole = len(of_process) // workers // batch * workers
        for worker in range(workers):
            mine = shard_of[np.concatenate(batches[:whole][worker::workers])]
            # Its share of the shards, and those at both ends that it has in common with others.
            assert len(set(mine.tolist())) <= len(SIZES) / (processes * workers) + 2
            for start in range(0, len(mine), batch):
                recent = set(mine[max(0, start - WINDOW * 50) : start + batch].tolist())
                assert len(recent) <= 2 * (WINDOW + 1) + 1


def test_samples_of_a_window_are_mixed():
    rows = np.array(rows_of())
    shard_of = np.repeat(np.arange(len(SIZES)), SIZES)
    assert [len(set(shard_of[rows[first : first + 50]])) >= WINDOW - 1 for first in (0, 400)]
    assert np.abs(np.diff(rows)).mean() > 100


def test_a_damaged_shard_is_named(write):
    url = write()
    path = Path(url) / "shard-000001.tar"
    path.write_bytes(path.read_bytes()[:-100])
    shards = ShardSet([url], ImageConfig("dm", size=SMALL))
    with fault(DriveError, "shard-000001.tar", found="of another hash", advice="copy"):
        shards[2]
    path.unlink()
    with fault(DriveError, "shard-000001.tar", expected="can be read"):
        shards[3]


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"format": "trifuse shards 1", "shards": 3}'])
def test_a_damaged_index_is_named(tmp_path, text):
    (tmp_path / NAME).write_text(text)
    with fault(UsageError, NAME, expected="an index of shards", advice="trifuse shards"):
        ShardIndex.read(RemoteFolder(str(tmp_path)))


def test_what_shards_are_not_made_for_is_refused(write, tmp_path):
    url = write()
    with fault(UsageError, url, "kind rgb", "kind maps", "train with that of the shards"):
        ShardSet([url], ImageConfig("rgb", size=SMALL))
    with fault(UsageError, url, "192x640", "96x320"):
        ShardSet([url], ImageConfig("dm"))
    with fault(UsageError, url, found=NAME, advice="--overwrite"):
        write()
    assert write(overwrite=True) == url
    with fault(UsageError, "nowhere://x", found="nowhere"):
        RemoteFolder("nowhere://x")
    with fault(DriveError, f"{tmp_path}/gone/{NAME}", found="FileNotFoundError"):
        ShardSet([str(tmp_path / "gone")], ImageConfig("dm"))


def test_an_interrupted_folder_has_no_index(write, tmp_path, monkeypatch):
    def stop(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(ShardIndex, "write", stop)
    with pytest.raises(KeyboardInterrupt):
        write()
    assert NAME not in [path.name for path in (tmp_path / "shards-dm").iterdir()]


def test_shards_train_and_drives_validate(write, drive, tmp_path):
    image = ImageConfig("dm", size=SMALL)
    data = ImageDataModule(
        (), [drive], shards=[write()], image=image, cache=tmp_path / "cache", batch_size=2
    )
    data.prepare_data()
    data.setup()
    batches = list(data.train_dataloader())
    assert [len(batch["images"]) for batch in batches] == [2, 2, 1]
    assert sorted(row for batch in batches for row in batch["numbers"].tolist()) == [0, 1, 2, 3, 4]
    assert len(list(data.val_dataloader())) == 3
    with fault(UsageError, "--shards", found="none", advice="--validation"):
        ImageDataModule(shards=["somewhere"])


def test_a_forked_process_opens_its_own_connection(write, monkeypatch):
    folder = RemoteFolder(write())
    index, connection = folder.read(NAME), folder._files
    assert folder._files is connection
    monkeypatch.setattr("data.remote_folder.os.getpid", lambda: -1)
    assert folder._files is not connection
    assert folder.read(NAME) == index


@pytest.mark.parametrize(("processes", "drawn"), [(1, 6), (2, 6), (4, 4)])
def test_more_workers_than_samples_leave_none_out(processes, drawn):
    sampler = ShardSampler(np.array([6]), processes=processes, workers=8, batch_size=2)
    rows = [one.row for one in sampler]
    assert len(rows) == len(set(rows)) == len(sampler) == drawn
