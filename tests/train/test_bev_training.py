"""The bird's-eye view's network, its loss, and a training of a few synthetic scans."""

import math

import numpy as np
import pytest
import torch
from torch.nn.functional import pixel_shuffle, pixel_unshuffle

from data.array_store import ArrayStore
from data.open_drive import open_drive
from data.samples.bev.dataset import BevConfig, BevDataset, collate
from data.samples.bev.labelled_scans import LabelledScans
from data.synthetic.collection import SynthConfig, write_drives
from perception.cli.main import main
from perception.detection.bev.bev_map import CHANNELS, BevGrid
from perception.detection.bev.boxes import BOX, decode_boxes
from perception.errors import ModelError, UsageError
from perception.sensor import VLP_16
from tests.faults import command, fault
from train.bev.loss import BevLabels, BevLossConfig, bev_loss, bev_targets
from train.bev.metrics import FoundCenters, measure
from train.bev.networks import load_bev
from train.bev.training import BevTraining
from train.checkpoints import read_checkpoint
from train.networks.bev_centers import BevCenters, CenterMaps, of_whole_numbers
from train.trainings import training_of

GRID = BevGrid(reach_m=12.8, cell_m=0.2)  # 64 places of 0.4 m a side
CAR = [3.4, -10.0, 0.1, 4.0, 2.0, 1.5, 0.5]


def labels_of(*boxes, classes=(0,), is_ignored=(False,), view_rad=(0.0, math.pi), middle_m=(0, 0)):
    return BevLabels(
        torch.tensor([boxes], dtype=torch.float32),
        torch.tensor([classes]),
        torch.tensor([is_ignored]),
        torch.tensor([view_rad]),
        torch.tensor([middle_m], dtype=torch.float32),
    )


def perfect(labels: BevLabels, classes: int) -> CenterMaps:
    """Return the predictions of a network that knows the labels."""
    targets = bev_targets(labels, 0.4, classes, (64, 64))
    logits = torch.where(targets.scores >= 1, 12.0, -12.0)
    stated = torch.full((1, 16, 64, 64), -3.0)
    image, row, column = targets.places
    stated[image, :10, row, column] = targets.boxes
    return CenterMaps(pixel_unshuffle(logits, 2), pixel_unshuffle(stated, 2))


def added(raw: CenterMaps, part: slice, value: float) -> CenterMaps:
    """Return predictions of which one part of the boxes is larger everywhere."""
    stated = pixel_shuffle(raw.boxes, 2)
    stated[:, part] += value
    return raw._replace(boxes=pixel_unshuffle(stated, 2))


def test_targets_of_a_label_are_decoded_to_its_box():
    raw = perfect(labels_of(CAR, [0] * 7, classes=(1, 0), is_ignored=(False, False)), 2)
    found = decode_boxes(*(part[0].numpy() for part in raw), GRID)
    assert found.classes.tolist() == [1]
    assert found.boxes.bottom_m[0] == pytest.approx(CAR[:3], abs=1e-4)
    assert found.boxes.size_m[0] == pytest.approx(CAR[3:6], abs=1e-4)
    assert found.boxes.yaw_rad[0] == pytest.approx(CAR[6], abs=1e-4)
    assert found.deviations[0] == pytest.approx(np.full(6, math.sqrt(2) * math.exp(-3)), rel=1e-4)


def test_the_loss_of_a_perfect_prediction_is_near_zero():
    labels = labels_of(CAR)
    good = bev_loss(perfect(labels, 1), labels, GRID, BevLossConfig(deviation_weight=0.0))
    assert good.total.item() < 1e-3
    wrong = added(perfect(labels, 1), BOX.size, 0.5)
    assert bev_loss(wrong, labels, GRID, BevLossConfig()).box.item() == pytest.approx(1.5, rel=0.01)
    missed = perfect(labels, 1)._replace(scores=torch.full((1, 4, 32, 32), -12.0))
    assert bev_loss(missed, labels, GRID, BevLossConfig()).score.item() == pytest.approx(
        12, rel=0.01
    )


def test_the_scale_of_the_error_is_the_likeliest():
    labels, losses = labels_of(CAR), []
    for log_scale in (-3.0, math.log(0.4), 1.0):
        raw = added(perfect(labels, 1), BOX.bottom, 0.4)
        raw = added(raw, slice(11, 12), log_scale + 3)
        losses.append(bev_loss(raw, labels, GRID, BevLossConfig()).deviation.item())
    assert losses[1] == min(losses)


@pytest.mark.parametrize(
    "change",
    [{"is_ignored": (True,)}, {"view_rad": (0.5, 0.4)}],
    ids=["an object that is ignored", "beside the labelled directions"],
)
def test_a_detection_there_has_no_loss(change):
    seen, labels = labels_of(CAR), labels_of(CAR, **change)
    raw = perfect(seen, 1)
    if "view_rad" in change:
        labels = labels._replace(boxes=torch.zeros(1, 1, 7))
    assert bev_loss(raw, labels, GRID, BevLossConfig()).score.item() < 0.02


def test_targets_of_a_crop_lie_about_its_middle():
    moved = labels_of(CAR, middle_m=(3.2, -8.0))
    crop = bev_targets(moved, 0.4, 1, (16, 16))
    whole = bev_targets(labels_of(CAR), 0.4, 1, (64, 64))
    # The middle of the crop is 8 places ahead of that of the map, and 20 to the right.
    assert torch.equal(crop.scores, whole.scores[:, :, 32:48, 4:20])
    assert torch.equal(crop.places, whole.places - torch.tensor([[0], [32], [4]]))
    assert torch.allclose(crop.boxes, whole.boxes, atol=1e-5)


def test_the_network_takes_crops_and_batches_alike():
    network = BevCenters(("Car", "Bus"), CHANNELS).eval()
    maps = torch.randint(0, 256, (3, 16, 16, 16, CHANNELS), dtype=torch.uint8)
    with torch.no_grad():
        scores, boxes = network(maps)
        exported = of_whole_numbers(network)(maps)
        alone = network(maps[1:2])
    assert scores.shape == (3, 4 * 2, 16, 16)
    assert boxes.shape == (3, 4 * 16, 16, 16)
    # Whose first weights take numbers of 8 bits as they are.
    assert torch.allclose(exported[0], scores, rtol=1e-3, atol=1e-4)
    assert torch.allclose(exported[1], boxes, rtol=1e-3, atol=1e-4)
    assert torch.allclose(alone[1], boxes[1:2], rtol=1e-4, atol=1e-5)
    assert sum(weight.numel() for weight in network.parameters()) < 1e6


def test_the_modality_chooses_the_training():
    assert training_of("detector", ["x", "--modality", "bev"]) == "bev"
    assert training_of("detector", ["x", "--modality=bev", "--lr", "1"]) == "bev"
    assert training_of("detector", ["x", "--modality", "dm"]) == "detector"
    assert training_of("fusion", ["--modality", "bev"]) == "fusion"


def test_classes_of_no_table_are_refused():
    with fault(UsageError, expected="some of Car, Van, Truck, Bus", found="Ship"):
        BevTraining(classes=("Car", "Ship"))


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    synth_config = SynthConfig(layout="object", frames=2, sensor=VLP_16, seed=4, images=False, street="jam")  # fmt: skip
    [folder] = write_drives(tmp_path_factory.mktemp("drive"), synth_config)
    return folder


@pytest.fixture
def words(drive, tmp_path):
    flags = (
        f"--validation {drive} --data.cache {tmp_path}/cache --data.cache-workers 1 --batch-size 2 "
        "--model.reach-m 25.6 --model.cell-m 0.4 --model.classes Car,Truck "
        "--trainer.accelerator cpu --trainer.precision 32-true"
    )
    return f"train detector {drive} --modality bev {flags} --out {tmp_path}/out".split()


def test_a_training_is_resumed_evaluated_and_started_from(words, tmp_path, capsys):
    out = tmp_path / "out"
    assert main([*words, "--epochs", "1"]) == 0
    printed = capsys.readouterr().out
    assert "centres within 2 m on 2 validation scans" in printed
    assert main([*words, "--epochs", "2", "--resume", "last"]) == 0
    assert read_checkpoint(out / "last.ckpt", "bev")["epoch"] == 1
    network, metadata = load_bev(out / "best.ckpt")
    assert not network.training
    assert (metadata["modality"], metadata["classes"]) == ("bev", "Car,Truck")
    assert (metadata["reach_m"], metadata["cell_m"]) == ("25.6", "0.4")
    command(*f"train bev validate --resume {out}/best.ckpt".split())
    assert (out / "metrics_validate.json").is_file()
    with fault(ModelError, expected="a bev whose cell_m is 0.2"):
        command(*words, "--model.cell-m", "0.2", "--resume", f"{out}/last.ckpt")
    further = BevTraining(classes=("Bus", "Truck"), reach_m=25.6, cell_m=0.4, weights=out / "best.ckpt")  # fmt: skip
    learned, started = network.state_dict(), further.network.state_dict()
    assert torch.equal(started["score_head.1.weight"][4:], learned["score_head.1.weight"][4:])
    assert not torch.equal(started["score_head.1.weight"][:4], learned["score_head.1.weight"][:4])
    kept = [name for name in learned if not name.startswith("score_head.1")]
    assert all(torch.equal(started[name], learned[name]) for name in kept)
    with fault(ModelError, expected="a bev whose cell_m is 0.2"):
        BevTraining(weights=out / "best.ckpt")


def test_a_scan_is_overfitted(drive, tmp_path):
    torch.manual_seed(0)
    grid = BevGrid(reach_m=25.6, cell_m=0.4)
    scans = LabelledScans([open_drive(drive)], grid, ArrayStore(tmp_path))
    dataset = BevDataset(scans, np.array([0, 1]), BevConfig(grid, ("Car", "Truck")))
    batch = collate([dataset[0], dataset[1]])
    labels = BevLabels(*(batch[name] for name in BevLabels._fields))
    network = BevCenters(("Car", "Truck"), CHANNELS)
    optimizer = torch.optim.AdamW(network.parameters(), lr=0.01)
    for _ in range(60):
        loss = bev_loss(network(batch["maps"]), labels, grid, BevLossConfig())
        optimizer.zero_grad()
        loss.total.backward()
        optimizer.step()
    scores, boxes = (part.detach().numpy() for part in network(batch["maps"]))
    found = FoundCenters()
    found.update([decode_boxes(*one, grid) for one in zip(scores, boxes, strict=True)], batch["numbers"], 0)  # fmt: skip
    precision = measure([dataset.targets(row) for row in (0, 1)], found.compute(), ("Car", "Truck"))
    assert min(one.ap for one in precision.values()) > 0.9
