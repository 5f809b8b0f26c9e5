"""Training of verifiers: what is logged, overfitting of a batch, and resume after a kill."""

import resource
import signal

import numpy as np
import pytest
import torch
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
from torch.nn.functional import binary_cross_entropy_with_logits

from perception.errors import ModelError, WriteError
from tests.faults import fault
from tests.train.events import hyperparameters_of, require_costs
from tests.train.toy_crops import TOY_DEPTHCN, toy_batch
from tests.train.trainings import LOGGED, run
from train.box_overlap import paired_iou
from train.checkpoints import read_checkpoint
from train.networks.depthcn import MODEL, load_verifier
from train.optimization import WarmupCosine
from train.verifier.images import ScoredCrops, draw_scored
from train.verifier.metrics import VerifierMetrics
from train.verifier.training import VerifierTraining, box_loss, class_targets


def train(out, *words, epochs=1, resume=None):
    return run(TOY_DEPTHCN, out, *words, epochs=epochs, resume=resume)


def module_of(method="default", seed=0):
    torch.manual_seed(seed)
    return VerifierTraining(method=method)


THESIS = ("--model.method=thesis", "--data.channels=1")


@pytest.mark.parametrize("words", [(), THESIS])
def test_fast_dev_run_trains_and_writes_no_file(tmp_path, words):
    cli, result = train(tmp_path, "--trainer.fast_dev_run=true", "--data.count=8", *words)
    assert (cli.trainer.global_step, result) == (1, None)
    assert list(tmp_path.iterdir()) == []


def test_a_batch_is_overfitted():
    module, batch = module_of(), toy_batch(8, 3)
    module.network.full[-1].p = 0.0  # dropout
    module.log_dict = lambda *args, **config: None
    optimizer = torch.optim.SGD(module.parameters(), lr=0.02, momentum=0.9)
    rate = WarmupCosine(optimizer)
    rate.set_steps(80, 80)
    for _ in range(80):
        optimizer.zero_grad()
        module.training_step(batch, 0).backward()
        optimizer.step()
        rate.step()
    logits, shares = module.network.heads(batch["crops"])
    is_vehicle = batch["is_vehicle"]
    assert binary_cross_entropy_with_logits(logits, is_vehicle.float()) < 0.02
    assert paired_iou(shares[is_vehicle], batch["normalized_box"][is_vehicle]).mean() > 0.85


def test_loggers_and_callbacks_are_added_to_ours(tmp_path):
    words = [
        "--trainer.logger=lightning.pytorch.loggers.CSVLogger",
        f"--trainer.logger.save_dir={tmp_path / 'csv'}",
        "--trainer.callbacks+=lightning.pytorch.callbacks.ModelSummary",
        "--data.count=8",
    ]
    cli, _ = train(tmp_path, *words)
    assert [type(one).__name__ for one in cli.trainer.loggers] == ["TensorBoardLogger", "CSVLogger"]
    names = [type(one).__name__ for one in cli.trainer.callbacks]
    assert {"ModelSummary", "BestEpoch", "TrainingBar"} <= set(names)
    assert list(tmp_path.glob("events*"))
    silent, _ = train(tmp_path / "silent", "--data.count=8", "--trainer.logger=false")
    assert silent.trainer.loggers == []
    assert not list((tmp_path / "silent").glob("events*"))


def test_the_best_epoch_and_the_last_are_kept(tmp_path):
    train(tmp_path, epochs=3)
    assert {file.name for file in tmp_path.glob("*.ckpt")} == {"best.ckpt", "last.ckpt"}
    last = read_checkpoint(tmp_path / "last.ckpt", MODEL)
    assert (last["epoch"], last["global_step"]) == (2, 12)
    network, hyper_parameters = load_verifier(tmp_path / "best.ckpt")
    assert int(hyper_parameters["epochs"]) in (1, 2, 3)
    assert network.heads(toy_batch(2, 3)["crops"])[0].isfinite().all()


@pytest.fixture
def full_disk():
    """Return a function that lets files hold at most some bytes, as on a disk that is full."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    yield lambda size: resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    resource.setrlimit(resource.RLIMIT_FSIZE, before)
    signal.signal(signal.SIGXFSZ, handler)


def test_a_full_disk_leaves_the_last_checkpoint(tmp_path, full_disk):
    train(tmp_path, LOGGED)
    before = {path.name: path.read_bytes() for path in tmp_path.glob("*.ckpt")}
    full_disk(100_000)
    with fault(WriteError, str(tmp_path), found="File too large", advice="make room"):
        train(tmp_path, LOGGED, epochs=2, resume=tmp_path / "last.ckpt")
    assert {path.name: path.read_bytes() for path in tmp_path.glob("*.ckpt")} == before
    load_verifier(tmp_path / "last.ckpt")


def test_events_that_cannot_be_written_are_one_sentence(tmp_path, full_disk, capfd):
    full_disk(6_000)  # more than config.yaml
    with fault(WriteError, str(tmp_path), found="File too large", advice="make room"):
        train(tmp_path, LOGGED)
    assert "Traceback" not in capfd.readouterr().err


def test_a_disk_that_is_full_from_the_start_holds_no_part_of_a_file(tmp_path, full_disk):
    full_disk(100_000)
    with fault(WriteError, str(tmp_path), found="File too large", advice="make room"):
        train(tmp_path, LOGGED)
    assert [path.name for path in tmp_path.iterdir() if "ckpt" in path.name] == []


def test_a_checkpoint_of_another_network_is_refused(tmp_path):
    train(tmp_path)
    last = tmp_path / "last.ckpt"
    with fault(ModelError, last.name, "a depthcn whose method is thesis", "default"):
        train(tmp_path / "thesis", *THESIS, epochs=2, resume=last)
    assert not (tmp_path / "thesis").exists()


def test_tensorboard_has_metrics_and_images(tmp_path, monkeypatch):
    grids = {"flip": np.full((20, 30, 3), 128, np.uint8), "jitter": np.zeros((20, 30, 3), np.uint8)}
    monkeypatch.setattr("train.verifier.training.augmentation_images", lambda data: grids)
    train(tmp_path, LOGGED, epochs=2)
    events = EventAccumulator(str(tmp_path)).Reload()
    metrics = (
        "accuracy",
        "balanced_accuracy",
        "precision",
        "recall",
        "box_iou",
        "box_iou_over_0.7",
    )
    losses = ("loss", "class_loss", "box_loss")
    promised = {f"{stage}/{n}" for stage in ("train", "validation") for n in (*metrics, *losses)}
    assert promised <= set(events.Tags()["scalars"])
    assert any(name.startswith("lr-") for name in events.Tags()["scalars"])
    assert len(events.Scalars("validation/accuracy")) == 2
    shown = set(events.Tags()["images"])
    assert {"augmentation/flip", "augmentation/jitter", "validation/boxes"} <= shown
    assert len(events.Images("augmentation/flip")) == 1
    require_costs(tmp_path, epochs=2)
    shown, best = hyperparameters_of(tmp_path)
    assert (shown["method"], shown["optimizer/init_args/lr"]) == ("default", 0.05)
    accuracies = [event.value for event in events.Scalars("validation/balanced_accuracy")]
    assert best["best/validation/balanced_accuracy"] == max(accuracies)
    assert best["best/validation/loss"] > 0


def test_the_terminal_stays_tidy(tmp_path, capfd):
    train(tmp_path, epochs=2)
    printed = capfd.readouterr()
    assert printed.out == ""
    lines = [line.split("\r")[-1] for line in printed.err.splitlines()]
    said = [line for line in lines if line.strip() and not line.startswith("train:")]
    assert [line.split()[:2] for line in said] == [["epoch", "1/2"], ["epoch", "2/2"]]
    assert "train loss" in said[0]
    assert "validation loss" in said[0]
    assert "train loss" in said[1] and "accuracy" in said[1].split("validation")[0]


def test_a_training_by_steps_counts_steps(tmp_path, capfd):
    train(tmp_path, "--trainer.max_steps=5", epochs=-1)
    printed = capfd.readouterr().err.replace("\r", "\n")
    assert "epoch 1, step 4/5 " in printed
    assert "epoch 2, step 5/5 " in printed
    assert "5/5 [" in printed


def test_the_thesis_network_subtracts_the_mean_crop(tmp_path):
    cli, _ = train(tmp_path, *THESIS, "--data.count=8")
    data = cli.datamodule
    torch.testing.assert_close(cli.model.network.mean_image, data.mean_crop())
    network, _ = load_verifier(tmp_path / "last.ckpt")
    torch.testing.assert_close(network.mean_image, data.mean_crop())


def test_iou_of_boxes_by_hand():
    boxes = torch.tensor([[0.0, 0.0, 1.0, 1.0], [0.0, 0.0, 2.0, 2.0]])
    targets = torch.tensor([[2.0, 0.0, 3.0, 1.0], [1.0, 1.0, 3.0, 3.0]])
    torch.testing.assert_close(paired_iou(boxes, targets), torch.tensor([0, 1 / 7]))


def test_errors_of_edges_by_hand():
    boxes = torch.tensor([[0.2, 0.3, 0.6, 0.7]])
    targets = torch.tensor([[0.25, 0.3, 0.6, 0.9]])
    # 0.05² / (2 * 0.1), and 0.2 - 0.1 / 2.
    assert box_loss(boxes, targets).item() == pytest.approx(0.0125 + 0.15)


def test_the_loss_of_right_boxes_and_of_no_boxes_is_zero():
    boxes = torch.tensor([[0.1, 0.2, 0.5, 0.6]])
    assert box_loss(boxes, boxes).item() == pytest.approx(0, abs=1e-6)
    assert box_loss(boxes[:0], boxes[:0]).item() == 0


def test_figures_by_hand():
    metrics = VerifierMetrics()
    box = [0.0, 0.0, 1.0, 1.0]
    nothing = [float("nan")] * 4
    metrics.update(
        torch.tensor([2.0, -1.0, 3.0, -2.0, -5.0]),
        torch.tensor([box, [0.0, 0.0, 0.5, 1.0], box, box, box]),
        torch.tensor([True, True, False, False, False]),
        torch.tensor([box, box, nothing, nothing, nothing]),
    )
    found = {name: value.item() for name, value in metrics.compute().items()}
    assert found == pytest.approx(
        {
            "accuracy": 3 / 5,
            "balanced_accuracy": (1 / 2 + 2 / 3) / 2,
            "precision": 1 / 2,
            "recall": 1 / 2,
            "box_iou": 0.75,
            "box_iou_over_0.7": 0.5,
        }
    )


def test_metrics_of_no_crops_are_zero():
    metrics = VerifierMetrics()
    none = torch.zeros(0)
    metrics.update(none, torch.zeros(0, 4), none.bool(), torch.zeros(0, 4))
    assert all(value == 0 for value in metrics.compute().values())


def test_the_drawn_box_lies_where_it_is_said():
    batch = toy_batch(2, 3)
    scored = ScoredCrops(
        crops=batch["crops"],
        logits=torch.tensor([3.0, -3.0]),
        shares=torch.tensor([[0.25, 0.5, 0.75, 0.9]] * 2),
        is_vehicle=batch["is_vehicle"],
        normalized_box=torch.full((2, 4), float("nan")),
    )
    image = draw_scored(scored)
    assert image.shape == (134, 452, 3)
    white = (image == 255).all(axis=2)
    assert white[66, 56:168].all()  # the upper edge of the vehicle's box
    assert not white[20:, 226:].any()  # the other candidate has none


def test_each_class_is_learned_by_its_own_logit():
    module, batch = VerifierTraining(classes=("Car", "Pedestrian", "Cyclist")), toy_batch(8, 3)
    assert module.crop.classes == ("Car", "Pedestrian", "Cyclist")
    batch["classes"] = torch.tensor([0, -1, 1, -1, 2, -1, 0, -1])
    logits, _ = module.network.heads(batch["crops"])
    targets = class_targets(logits, batch)
    assert targets.tolist()[:5] == [[1, 0, 0], [0, 0, 0], [0, 1, 0], [0, 0, 0], [0, 0, 1]]
    logged = {}
    module.log_dict = lambda values, **config: logged.update(values)
    module.training_step(batch, 0)
    expected = binary_cross_entropy_with_logits(logits, targets).item()
    assert logged["train/class_loss"].item() == pytest.approx(expected, rel=0.2)
