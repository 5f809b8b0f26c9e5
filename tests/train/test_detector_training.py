"""Training of detectors: what is logged, overfitting of a batch, and resume after a kill."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest
import torch
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from perception.detection.detectors.postprocess import postprocess_detections
from perception.errors import ModelError, UsageError
from perception.render import palette
from perception.types import Detections
from tests.faults import fault
from tests.train.events import hyperparameters_of, require_costs
from tests.train.toy_crops import TOY_DEPTHCN
from tests.train.toy_images import SIZE, TINY, TOY_DETECTOR, ToyImages, tiny_network
from tests.train.trainings import LOGGED, cli_of, killed_after, run
from train.best_epoch import Criterion
from train.checkpoints import program_revision, read_checkpoint
from train.cli import fit
from train.detector import networks
from train.detector.anchors import fit_anchors
from train.detector.config import DistillationConfig, InitialWeights
from train.detector.images import draw_detections
from train.detector.networks import MODEL, DetectorNetworkConfig, load_detector
from train.detector.training import DetectorTraining
from train.networks.depthcn import load_verifier
from train.networks.yolox import YoloxNano
from train.trainer import fastest_precision, require_devices


@pytest.fixture(autouse=True, scope="module")
def tiny():
    """Offer a small network."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(networks.NETWORKS, "tiny", tiny_network)
        yield


def train(out, *words, epochs=1, resume=None):
    return run(TOY_DETECTOR, out, *TINY, *words, epochs=epochs, resume=resume)[1]


# One batch over and over at one size.
OVERFITTING = ("--model.scales=[1.0,1.0]", "--optimizer.lr=0.02", "--data.repeats=40")


@pytest.mark.parametrize(("modality", "channels"), [("dm", 1), ("rgb", 3)])
def test_fast_dev_run_trains_and_writes_no_file(tmp_path, modality, channels):
    words = (f"--model.modality={modality}", f"--data.channels={channels}")
    assert train(tmp_path, "--trainer.fast_dev_run=true", *words) is None
    assert list(tmp_path.iterdir()) == []


def test_a_batch_is_overfitted(tmp_path):
    # 44 labels: 41 points of recall
    trained = train(tmp_path, *OVERFITTING, "--data.count=11", LOGGED, epochs=3)
    metrics = {"easy": 100.0, "moderate": 100.0, "hard": 100.0}
    assert trained.precision == {"Car 0.7": metrics, "Car 0.5": metrics}
    assert trained.counts["validation_labels"] == 44
    losses = EventAccumulator(str(tmp_path)).Reload().Scalars("train/loss")
    assert losses[-1].value < 0.1 * losses[0].value < 1


def test_half_precision_trains_as_well(tmp_path):
    words = (*OVERFITTING, "--data.count=11", "--trainer.precision=bf16-mixed")
    assert train(tmp_path, *words).precision["Car 0.5"]["moderate"] > 90


def test_a_study_resumes_the_same_training_only(tmp_path):
    values = dict(word.removeprefix("--").split("=") for word in TINY)
    arguments = {**values, "trainer.max_epochs": 1, "trainer.accelerator": "cpu"}
    first = fit(TOY_DETECTOR, arguments, tmp_path)
    assert fit(TOY_DETECTOR, arguments, tmp_path).precision == first.precision  # it was at its end
    with fault(UsageError, str(tmp_path), "a training with the same settings", "config.yaml"):
        fit(TOY_DETECTOR, {**arguments, "optimizer.lr": 0.5}, tmp_path)


def test_steps_end_a_training_with_a_validation(tmp_path):
    train(tmp_path, "--trainer.max_steps=3", LOGGED, epochs=-1)
    assert read_checkpoint(tmp_path / "last.ckpt", MODEL)["global_step"] == 3
    events = EventAccumulator(str(tmp_path)).Reload()
    assert [event.step for event in events.Scalars("validation/moderate")] == [1, 2]


def test_gradients_of_several_batches_are_one_step(tmp_path):
    train(tmp_path, "--trainer.accumulate_grad_batches=2", epochs=2)
    assert read_checkpoint(tmp_path / "last.ckpt", MODEL)["global_step"] == 2


def test_a_killed_training_resumes_exactly(tmp_path):
    whole = train(tmp_path / "whole", epochs=4)
    killed = tmp_path / "killed"
    with pytest.raises(KeyboardInterrupt):
        train(killed, *killed_after(2 * 2 + 1), epochs=4)
    load_detector(killed / "last.ckpt")
    resumed = train(killed, epochs=4, resume=killed / "last.ckpt")
    first, second = (
        read_checkpoint(path / "last.ckpt", MODEL) for path in (tmp_path / "whole", killed)
    )
    for part in ("state_dict", "current_model_state"):
        assert set(first[part]) == set(second[part])
        for name, weight in first[part].items():
            torch.testing.assert_close(second[part][name], weight, rtol=0, atol=0, msg=name)
    for key in ("epoch", "global_step", "lr_schedulers", "precision"):
        assert first[key] == second[key]
    assert (resumed.epoch, resumed.precision) == (whole.epoch, whole.precision)


def test_the_anchors_are_fitted_to_the_labels(tmp_path):
    train(tmp_path)
    data = ToyImages()
    detector, metadata = load_detector(tmp_path / "last.ckpt")
    sizes_px = data.training.label_sizes_px()
    expected = fit_anchors(sizes_px, 5, np.random.default_rng(0)).anchors_px
    np.testing.assert_allclose(detector.head.anchors_px.numpy(), expected, rtol=1e-6)
    assert metadata["anchors"].split(",")[0] == f"{expected[0, 0]:.1f}x{expected[0, 1]:.1f}"


def test_a_checkpoint_says_what_it_is(tmp_path):
    trained = train(tmp_path, "--model.anchors=default")
    detector, metadata = load_detector(trained.checkpoint)
    assert not detector.training
    assert metadata == {
        "kind": "detector",
        "network": "tiny",
        "modality": "dm",
        "classes": "Car",
        "input_height": "64",
        "input_width": "96",
        "filling": "default",
        "fit": "letterbox",
        "anchors": "19.1x13.4,37.6x22.6,66.8x36.0,102.2x63.1,165.4x90.7",
        "training_data": "toys",
        "revision": program_revision(),
        "epochs": "1",
    }
    config = DetectorNetworkConfig("dm", ("Car",), SIZE, network="tiny")
    assert DetectorNetworkConfig.from_metadata(metadata) == config


def test_the_loaded_network_sees_what_was_measured(tmp_path):
    data = ToyImages(4, repeats=60)
    train(tmp_path, "--model.scales=[1.0,1.0]", "--data.count=4", "--data.repeats=60")
    detector, _ = load_detector(tmp_path / "best.ckpt")
    with torch.inference_mode():
        boxes_px, scores = detector.decode(detector(data.training[0]["images"][None]))
    found = postprocess_detections(boxes_px[0].numpy(), scores[0].numpy(), ("Car",), SIZE)[:4]
    found = found[np.lexsort((found.boxes_px[:, 0], found.boxes_px[:, 1] > 30))]
    np.testing.assert_allclose(found.boxes_px, data.training.boxes_px[0], atol=3)


def test_training_starts_from_a_checkpoint(tmp_path):
    train(tmp_path / "first", epochs=3)
    start = f"--model.weights.checkpoint={tmp_path / 'first' / 'best.ckpt'}"
    train(tmp_path / "second", start, "--optimizer.lr=1e-12", "--data.count=5")  # other labels
    before, _ = load_detector(tmp_path / "first" / "best.ckpt")
    after, _ = load_detector(tmp_path / "second" / "last.ckpt")
    for (name, weight), found in zip(before.named_parameters(), after.parameters(), strict=True):
        torch.testing.assert_close(found, weight, rtol=1e-4, atol=1e-6, msg=name)
    torch.testing.assert_close(after.head.anchors_px, before.head.anchors_px)


def test_training_stops_early(tmp_path, monkeypatch):
    monkeypatch.setattr(DetectorTraining, "ranking", (Criterion("validation/moderate"),))
    monkeypatch.setattr(
        "train.detector.training.mean_precision", lambda validation_metrics: {"moderate": 1.0}
    )
    train(tmp_path, "--early_stopping.patience=2", epochs=9)
    assert read_checkpoint(tmp_path / "last.ckpt", MODEL)["epoch"] == 2


def test_at_equal_precision_the_overlap_of_a_half_decides(tmp_path, monkeypatch):
    values = iter([(0.0, 10.0), (0.0, 30.0), (0.0, 20.0)])

    def precision(_):
        moderate, moderate_50 = next(values)
        return {"moderate": moderate, "moderate_50": moderate_50}

    monkeypatch.setattr("train.detector.training.mean_precision", precision)
    assert train(tmp_path, epochs=3).epoch == 2


def test_tensorboard_has_metrics_and_images(tmp_path):
    train(tmp_path, LOGGED, epochs=2)
    events = EventAccumulator(str(tmp_path)).Reload()
    tags = set(events.Tags()["scalars"])
    terms = ("loss", "box_loss", "objects_loss", "no_objects_loss", "classes_loss", "prior_loss")
    metrics = [f"{level}{mark}" for level in ("easy", "moderate", "hard") for mark in ("", "_50")]
    assert {f"{stage}/{name}" for stage in ("train", "validation") for name in terms} <= tags
    assert {f"validation/{name}" for name in metrics} <= tags
    assert any(name.startswith("lr-") for name in tags)
    assert len(events.Scalars("validation/moderate")) == 2
    assert {"validation/images", "validation/curves"} <= set(events.Tags()["images"])
    require_costs(tmp_path, epochs=2)
    shown, best = hyperparameters_of(tmp_path)
    assert (shown["network"], shown["loss/box"], shown["ema/decay"]) == (
        "tiny",
        "ciou",
        0.8,
    )
    precisions = [event.value for event in events.Scalars("validation/moderate")]
    assert best["best/validation/moderate"] == max(precisions)
    assert set(best) == {f"best/{one.metric}" for one in DetectorTraining.ranking}
    image = events.Images("validation/images")[0]
    assert (image.width, image.height) == (13 * 96, 13 * 5 * 64)


def test_boxes_are_drawn_at_their_place():
    samples = ToyImages().validation
    batch = {name: value[None] for name, value in samples[0].items()}
    seen = Detections(np.array([[10.0, 20, 30, 40]]), np.array([0.5]), np.array(["Car"]))
    image = draw_detections(batch, 0, seen)
    assert image.shape == (13 * 64, 13 * 96, 3)
    white, green = (_is_near(image, color) for color in ((255, 255, 255), palette.MOVING))
    assert white[13 * 40, 13 * 12 : 13 * 28].all()
    left, _, right, bottom = (13 * samples.boxes_px[0, 3]).astype(int)
    assert green[bottom, left + 2 : right - 2].all()
    unsure = Detections(seen.boxes_px, np.array([0.2]), seen.types)
    assert not _is_near(draw_detections(batch, 0, unsure), (255, 255, 255)).any()


def _is_near(image, color):
    return (np.abs(image.astype(int) - color) < 50).all(axis=2)


@pytest.mark.parametrize(
    ("capabilities", "precision"),
    [({"avx512_bf16": True}, "bf16-mixed"), ({"avx512_f": True}, "32-true")],
)
def test_fastest_precision_of_the_cpu(monkeypatch, capabilities, precision):
    monkeypatch.setattr(torch.cpu, "get_capabilities", lambda: capabilities, raising=False)
    assert fastest_precision("cpu") == precision


@pytest.fixture(scope="module")
def checkpoint(tiny, tmp_path_factory):
    out = tmp_path_factory.mktemp("made")
    train(out)
    return out / "last.ckpt"


@pytest.mark.parametrize(
    ("changed", "expected", "found"),
    [
        ("--model.modality=rm", "a detector whose modality is rm", "dm"),
        ('--model.classes=["Van"]', "a detector whose classes is Van", "Car"),
        ("--model.network=compact", "a detector whose network is compact", "tiny"),
    ],
)
@pytest.mark.parametrize("how", ["resume", "start"])
def test_a_checkpoint_of_another_detector_is_refused(
    tmp_path, checkpoint, changed, expected, found, how
):
    resume = checkpoint if how == "resume" else None
    words = [changed] if resume else [changed, f"--model.weights.checkpoint={checkpoint}"]
    with fault(ModelError, checkpoint.name, expected, found):
        train(tmp_path / "out", *words, resume=resume)
    assert not (tmp_path / "out").exists()


def test_a_checkpoint_of_another_model_is_refused(tmp_path, checkpoint):
    run(TOY_DEPTHCN, tmp_path, "--data.count=8")
    of_verifier = tmp_path / "last.ckpt"
    for refuses in (
        lambda: load_detector(of_verifier),
        lambda: train(tmp_path / "out", resume=of_verifier),
        lambda: train(tmp_path / "out", f"--model.weights.checkpoint={of_verifier}"),
    ):
        with fault(ModelError, "last.ckpt", "a checkpoint of detector", "one of depthcn"):
            refuses()
    with fault(ModelError, "last.ckpt", "a checkpoint of depthcn", "one of detector"):
        load_verifier(checkpoint)


def test_a_checkpoint_of_another_optimizer_is_refused(checkpoint):
    before = sorted(checkpoint.parent.iterdir())
    with fault(ModelError, "last.ckpt", "the training of this detector", "of another optimizer"):
        train(checkpoint.parent, "--optimizer=SGD", epochs=2, resume=checkpoint)
    assert sorted(checkpoint.parent.iterdir()) == before


def test_a_checkpoint_with_other_weights_is_refused(tmp_path, checkpoint, monkeypatch):
    wider = partial(networks.CompactDetector, widths=(8, 16, 32, 24, 24), residuals=(0, 0, 0))
    monkeypatch.setitem(
        networks.NETWORKS, "tiny", lambda names, channels: wider(names, channels=channels)
    )
    with fault(ModelError, "last.ckpt", "weights of this detector", "weights of other sizes"):
        load_detector(checkpoint)


def test_random_weights_are_not_kept():
    with fault(UsageError, "--model.distillation.weight", "--model.weights.public", "random ones"):
        DetectorTraining(modality="rgb", distillation=DistillationConfig(weight=1.0))


def test_public_weights_are_of_one_network(tmp_path):
    weights = InitialWeights(public=tmp_path / "yolox_nano.onnx")
    with fault(UsageError, "--model.weights.public", "network yolox-nano", "compact of modality"):
        DetectorTraining(modality="rgb", weights=weights)


def test_a_training_keeps_what_its_start_knows(tmp_path):
    words = ["--model.network=yolox-nano", "--model.modality=rgb", "--data.channels=3"]
    run(TOY_DETECTOR, tmp_path / "start", *TINY, *words, epochs=1)
    kept = [
        f"--model.weights.checkpoint={tmp_path / 'start' / 'best.ckpt'}",
        "--model.distillation.weight=2",
    ]
    run(TOY_DETECTOR, tmp_path / "kept", *TINY, *words, *kept, LOGGED, epochs=1)
    events = EventAccumulator(str(tmp_path / "kept")).Reload()
    assert events.Scalars("train/distillation_loss")[-1].value > 0
    detector, metadata = load_detector(tmp_path / "kept" / "best.ckpt")
    assert type(detector) is YoloxNano
    assert "anchors" not in metadata


def test_only_one_kind_of_initial_weights():
    with fault(UsageError, "initial weights", "at most one kind", "checkpoint, darknet"):
        InitialWeights(checkpoint=Path("a"), darknet=Path("b"))


def test_unknown_modalities_are_refused():
    with fault(UsageError, "modality", "one of", "lidar"):
        DetectorNetworkConfig("lidar")


@pytest.mark.parametrize(
    ("accelerator", "gpus", "expected"),
    [("cpu", 8, "2 cores"), ("auto", 0, "2 cores"), ("auto", 1, "1 GPUs")],
)
def test_more_devices_than_there_are_start_no_training(monkeypatch, accelerator, gpus, expected):
    monkeypatch.setattr("train.trainer.usable_cores", lambda: 2)
    monkeypatch.setattr(torch.cuda, "is_available", lambda: gpus > 0)
    monkeypatch.setattr(torch.cuda, "device_count", lambda: gpus)
    with fault(UsageError, "--trainer.devices", expected, "3"):
        require_devices(accelerator, 3)


def test_several_machines(tmp_path, monkeypatch):
    monkeypatch.setattr("train.trainer.usable_cores", lambda: 2)
    words = ("--trainer.num_nodes=3", "--trainer.devices=2", "--trainer.strategy=ddp")
    cli = cli_of(TOY_DETECTOR, tmp_path, *TINY, *words)
    monkeypatch.setattr("lightning.pytorch.Trainer.fit", lambda *given, **named: None)
    with pytest.raises(ModelError):  # nothing was trained
        cli.run()
    assert (cli.trainer.num_nodes, cli.trainer.world_size) == (3, 6)
