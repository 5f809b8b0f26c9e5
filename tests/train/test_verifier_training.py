"""Training of verifiers: what is logged, overfitting of a batch, and resume after a kill."""

from functools import partial

import numpy as np
import pytest
import torch
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
from torch.nn.functional import binary_cross_entropy_with_logits

from perception.errors import ModelError, UsageError
from tests.train.interrupted import KilledAfter
from tests.train.toy_crops import ToyCrops, toy_batch
from train.box_overlap import paired_iou
from train.checkpoints import read_checkpoint
from train.config import TrainingRun
from train.networks.depthcn import MODEL, load_verifier
from train.optimization import step_decay, warmup_cosine
from train.trainer import checkpoint_to_resume, fit, make_trainer
from train.verifier.config import VERIFIER_CONFIGS
from train.verifier.images import ScoredCrops, VerifierImages, draw_scored
from train.verifier.metrics import VerifierMetrics
from train.verifier.run import MONITOR
from train.verifier.training import VerifierTraining, box_loss


def run_of(epochs, **other):
    return TrainingRun(epochs=epochs, accelerator="cpu", **other)


def module_of(method="default", seed=0):
    torch.manual_seed(seed)
    return VerifierTraining(VERIFIER_CONFIGS[method])


@pytest.mark.parametrize(("method", "channels"), [("default", 3), ("thesis", 1)])
def test_fast_dev_run_trains_and_writes_nothing(tmp_path, method, channels):
    trainer = make_trainer(tmp_path, run_of(1, fast_dev_run=True), MONITOR)
    fit(trainer, module_of(method), ToyCrops(8, channels))
    assert trainer.global_step == 1
    assert list(tmp_path.iterdir()) == []


def test_a_batch_is_overfitted():
    module, batch = module_of(), toy_batch(8, 3)
    module.network.full[-1].p = 0.0  # dropout
    module.log_dict = lambda *args, **config: None
    optimizer = torch.optim.SGD(module.parameters(), lr=0.02, momentum=0.9)
    rate = torch.optim.lr_scheduler.LambdaLR(optimizer, partial(warmup_cosine, steps=80))
    for _ in range(80):
        optimizer.zero_grad()
        module.training_step(batch, 0).backward()
        optimizer.step()
        rate.step()
    logits, shares = module.network.heads(batch["crops"])
    is_vehicle = batch["is_vehicle"]
    assert binary_cross_entropy_with_logits(logits, is_vehicle.float()) < 0.02
    assert paired_iou(shares[is_vehicle], batch["normalized_box"][is_vehicle]).mean() > 0.85


def weights_after(folder, epochs, killed_at=None):
    trainer = make_trainer(folder / "whole", run_of(epochs), MONITOR)
    fit(trainer, module_of(), ToyCrops())
    with pytest.raises(KeyboardInterrupt):
        fit(
            make_trainer(folder / "killed", run_of(epochs), MONITOR, [KilledAfter(killed_at)]),
            module_of(),
            ToyCrops(),
        )
    again = make_trainer(folder / "killed", run_of(epochs), MONITOR)
    fit(again, module_of(seed=9), ToyCrops(), folder / "killed" / "last.ckpt")
    return [read_checkpoint(folder / name / "last.ckpt", MODEL) for name in ("whole", "killed")]


def test_a_killed_training_resumes_exactly(tmp_path):
    whole, resumed = weights_after(tmp_path, epochs=3, killed_at=4 + 2)
    for name, weight in whole["state_dict"].items():
        torch.testing.assert_close(resumed["state_dict"][name], weight, rtol=0, atol=0, msg=name)
    for key in ("epoch", "global_step", "lr_schedulers"):
        assert resumed[key] == whole[key]


def test_the_best_epoch_and_the_last_are_kept(tmp_path):
    trainer = make_trainer(tmp_path, run_of(3), MONITOR)
    fit(trainer, module_of(), ToyCrops())
    assert {file.name for file in tmp_path.glob("*.ckpt")} == {"best.ckpt", "last.ckpt"}
    last = read_checkpoint(tmp_path / "last.ckpt", MODEL)
    assert (last["epoch"], last["global_step"]) == (2, 12)
    network, hyper_parameters = load_verifier(tmp_path / "best.ckpt")
    assert int(hyper_parameters["epochs"]) in (1, 2, 3)
    assert network.heads(toy_batch(2, 3)["crops"])[0].isfinite().all()


def test_a_full_disk_leaves_the_last_checkpoint(tmp_path, monkeypatch):
    fit(make_trainer(tmp_path, run_of(1), MONITOR), module_of(), ToyCrops())
    before = (tmp_path / "last.ckpt").read_bytes()

    def full(path, content):
        path.with_name(f".{path.name}.part").write_bytes(content[: len(content) // 2])
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("train.checkpoint_writer.write_atomically", full)
    with pytest.raises(ModelError, match="No space left on device"):
        fit(
            make_trainer(tmp_path, run_of(2), MONITOR),
            module_of(),
            ToyCrops(),
            tmp_path / "last.ckpt",
        )
    assert (tmp_path / "last.ckpt").read_bytes() == before
    load_verifier(tmp_path / "last.ckpt")


def test_a_checkpoint_of_another_network_is_refused(tmp_path):
    fit(make_trainer(tmp_path, run_of(1), MONITOR), module_of(), ToyCrops())
    trainer = make_trainer(tmp_path / "thesis", run_of(2), MONITOR)
    with pytest.raises(ModelError, match=r"weights of this depthcn, found those of .* \(default\)"):
        fit(trainer, module_of("thesis"), ToyCrops(channels=1), tmp_path / "last.ckpt")


def test_a_training_is_not_written_over(tmp_path):
    assert checkpoint_to_resume(tmp_path, None) is None
    (tmp_path / "last.ckpt").touch()
    with pytest.raises(UsageError, match="resume it with --resume last"):
        checkpoint_to_resume(tmp_path, None)
    assert checkpoint_to_resume(tmp_path, "last") == tmp_path / "last.ckpt"


def test_tensorboard_has_metrics_and_images(tmp_path):
    grids = {"flip": np.full((20, 30, 3), 128, np.uint8), "jitter": np.zeros((20, 30, 3), np.uint8)}
    trainer = make_trainer(tmp_path, run_of(2), MONITOR, [VerifierImages(lambda: grids)])
    fit(trainer, module_of(), ToyCrops())
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


def test_the_terminal_stays_tidy(tmp_path, capfd):
    fit(make_trainer(tmp_path, run_of(2), MONITOR), module_of(), ToyCrops())
    printed = capfd.readouterr()
    assert printed.out == ""
    lines = [line.split("\r")[-1] for line in printed.err.splitlines()]
    said = [line for line in lines if line.strip() and not line.startswith("train:")]
    assert [line.split()[:2] for line in said] == [["epoch", "1/2"], ["epoch", "2/2"]]
    assert "train loss" in said[0]
    assert "validation loss" in said[0]
    assert "train loss" in said[1] and "accuracy" in said[1].split("validation")[0]


def test_the_rate_of_the_thesis_falls_to_a_tenth_every_eight_epochs():
    rates = [step_decay(step, steps_per_stage=8 * 10) for step in (0, 79, 80, 160, 399)]
    np.testing.assert_allclose(rates, [1, 1, 0.1, 0.01, 0.0001])


def test_the_default_rate_rises_and_falls():
    rates = [warmup_cosine(step, 100) for step in range(100)]
    assert np.argmax(rates) == 9
    assert rates[9] == pytest.approx(1, abs=1e-3)
    assert rates[54] == pytest.approx((1 + 0.001) / 2, abs=1e-3)
    assert rates[99] == pytest.approx(0.001)


def test_the_thesis_network_subtracts_the_mean_crop(tmp_path):
    data = ToyCrops(8, 1)
    module = module_of("thesis")
    fit(make_trainer(tmp_path, run_of(1), MONITOR), module, data)
    torch.testing.assert_close(module.network.mean_image, data.mean_crop())
    network, _ = load_verifier(tmp_path / "last.ckpt")
    torch.testing.assert_close(network.mean_image, data.mean_crop())


def test_only_matrices_decay():
    trainer = make_trainer_for_rates()
    module = module_of("thesis")
    module.trainer = trainer
    decays = {
        group["weight_decay"]: {weight.ndim > 1 for weight in group["params"]}
        for group in module.configure_optimizers()["optimizer"].param_groups
    }
    assert decays == {0.004: {True}, 0.0: {False}}


def make_trainer_for_rates():
    class _Steps:
        estimated_stepping_batches, max_epochs = 10, 2

    return _Steps()


def test_iou_of_boxes_by_hand():
    boxes = torch.tensor([[0.0, 0.0, 1.0, 1.0], [0.0, 0.0, 2.0, 2.0]])
    targets = torch.tensor([[2.0, 0.0, 3.0, 1.0], [1.0, 1.0, 3.0, 3.0]])
    torch.testing.assert_close(paired_iou(boxes, targets), torch.tensor([0, 1 / 7]))


def test_errors_of_edges_by_hand():
    boxes = torch.tensor([[0.2, 0.3, 0.6, 0.7]])
    targets = torch.tensor([[0.25, 0.3, 0.6, 0.9]])
    # 0.05² / (2 * 0.1), and 0.2 - 0.1 / 2.
    assert box_loss(boxes, targets).item() == pytest.approx(0.0125 + 0.15)


def test_right_boxes_cost_nothing_and_none_neither():
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


def test_figures_of_nothing_are_zero():
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
