"""Training of the fusion's network by Levenberg-Marquardt and by AdamW."""

import pytest
import torch

from export.fusion import export_fusion
from export.result import ExportConfig
from perception.errors import ModelError, UsageError
from tests.faults import fault
from tests.train.events import hyperparameters_of
from tests.train.fusion.toy_rows import LM, WHOLE, KilledFusion, toy_rows, toy_words, train_toy
from train.checkpoints import read_checkpoint
from train.events import read_scalars
from train.fusion.datamodule import RowBatches, row_tensors
from train.fusion.gauss_newton import mean_square
from train.fusion.network import RescoringMlp, load_fusion

OPTIMIZERS = [LM, "LBFGS", "AdamW"]


def state_of(folder, name="last.ckpt"):
    return read_checkpoint(folder / name, "fusion")


def require_equal(ours, theirs):
    """Require the same weights, epoch and state of the optimizer, to the last digit."""
    for name, weight in theirs["state_dict"].items():
        torch.testing.assert_close(ours["state_dict"][name], weight, rtol=0, atol=0, msg=name)
    groups = [one["optimizer_states"][0]["param_groups"] for one in (ours, theirs)]
    assert groups[0] == groups[1]
    assert [ours[name] for name in ("epoch", "global_step")] == [
        theirs[name] for name in ("epoch", "global_step")
    ]


@pytest.mark.parametrize("optimizer", OPTIMIZERS)
def test_every_optimizer_writes_a_network_to_export(tmp_path, optimizer):
    train_toy(tmp_path, toy_words(optimizer))
    network, metadata = load_fusion(tmp_path / "best.ckpt")
    torch.manual_seed(0)
    first = RescoringMlp("scores", (4,))
    first.fit_inputs(toy_rows(80, 0).features)
    rows = row_tensors(toy_rows(40, 1))
    best = float(mean_square(network, rows))
    assert best < 0.5 * float(mean_square(first, rows))
    stated = {
        name: metadata[name] for name in ("hidden", "optimizer", "training_data", "detectors")
    }
    assert list(stated.values()) == ["4", optimizer, "toys", "toy"]
    names = ["train/mse", "validation/mse", "train/gradient_norm"]
    logged = read_scalars(tmp_path, names)
    assert [len(logged[name]) for name in names] == [8, 8, 8]
    assert min(logged["validation/mse"]) == pytest.approx(best, rel=1e-3)
    shown, found = hyperparameters_of(tmp_path)
    assert shown["variant"] == "scores"
    assert found["best/validation/mse"] == pytest.approx(best, rel=1e-3)
    exported = export_fusion(ExportConfig(tmp_path / "best.ckpt"))
    exported.require_parity("toy")
    assert exported.variants["fp32"].parity["features"].rows == 63


def test_levenberg_marquardt_lowers_the_error_at_every_step(tmp_path):
    train_toy(tmp_path, toy_words())
    logged = read_scalars(tmp_path, ["train/mse", "train/damping"])
    assert (logged["train/mse"][1:] < logged["train/mse"][:-1]).all()
    assert logged["train/damping"][-1] == pytest.approx(
        state_of(tmp_path)["optimizer_states"][0]["param_groups"][0]["damping"]
    )


@pytest.mark.parametrize("optimizer", OPTIMIZERS)
def test_a_killed_training_resumes_exactly(tmp_path, optimizer, monkeypatch):
    words = toy_words(optimizer, 5)
    train_toy(tmp_path / "whole", words)
    # Four batches an epoch by AdamW.
    monkeypatch.setattr(KilledFusion, "at", 3 if optimizer in WHOLE else 10, raising=False)
    out = tmp_path / "killed"
    with pytest.raises(KeyboardInterrupt):
        train_toy(out, words, module=KilledFusion)
    assert state_of(out)["epoch"] == (2 if optimizer in WHOLE else 1)
    train_toy(out, words, resume=out / "last.ckpt")
    for name in ("best.ckpt", "last.ckpt"):
        require_equal(state_of(out, name), state_of(tmp_path / "whole", name))


def test_it_stops_early_by_the_validation_error(tmp_path):
    words = toy_words(LM, 200, "--early_stopping.patience=2")
    train_toy(tmp_path, words)
    errors = read_scalars(tmp_path, ["validation/mse"])["validation/mse"]
    assert len(errors) < 200
    assert len(errors) - 1 - errors.argmin() in (0, 2)  # no way down, or two epochs in vain
    assert state_of(tmp_path, "best.ckpt")["epoch"] == errors.argmin()


def test_where_no_step_lowers_the_error_it_ends(tmp_path):
    words = toy_words(LM, 50, "--optimizer.max_damping=1e-4")
    train_toy(tmp_path, words)
    assert state_of(tmp_path)["epoch"] == 0


def test_single_precision_ends_near_double(tmp_path):
    errors = {}
    for precision in ("64-true", "32-true"):
        out = tmp_path / precision
        module = train_toy(out, toy_words(LM, 6, f"--trainer.precision={precision}"))
        errors[precision] = float(module.trainer.callback_metrics["validation/mse"])
    assert state_of(tmp_path / "64-true")["state_dict"]["network.layers.0.weight"].dtype == (
        torch.float64
    )
    assert errors["32-true"] == pytest.approx(errors["64-true"], rel=0.01)


def test_a_checkpoint_of_another_training_is_refused(tmp_path):
    train_toy(tmp_path, toy_words(LM, 1))
    last = tmp_path / "last.ckpt"
    for words, found in (
        (toy_words("AdamW"), "that of another optimizer"),
        (toy_words(LM, 2, "--model.max_partners=0"), "None"),
        (toy_words(LM, 2, "--model.hidden=[5]"), "[4]"),
    ):
        with fault(ModelError, last.name, found=found):
            train_toy(tmp_path / "out", words, resume=last)
    assert not (tmp_path / "out").exists()


def test_levenberg_marquardt_refuses_batches(tmp_path):
    with fault(UsageError, "--data.batch_size", "null", "20"):
        train_toy(tmp_path, toy_words(LM, 1, "--data.batch_size=20"))
    assert not (tmp_path / "config.yaml").exists()


@pytest.mark.parametrize("flag", ["gradient_clip_val=1.0", "accumulate_grad_batches=2"])
def test_levenberg_marquardt_refuses_what_is_of_batches(tmp_path, flag):
    with pytest.raises(UsageError) as raised:
        train_toy(tmp_path, toy_words(LM, 1, f"--trainer.{flag}"))
    assert "manual" in str(raised.value)


def test_other_checkpoints_are_refused(tmp_path):
    with fault(ModelError, expected="a checkpoint of fusion", found="no such file"):
        load_fusion(tmp_path / "none.ckpt")


def test_every_row_is_in_a_batch_of_one_process():
    first, second = (RowBatches(11, 4, seed=1, process=part, processes=2) for part in range(2))
    batches = [[*one, *other] for one, other in zip(first, second, strict=True)]
    assert [len(one) for one in batches] == [4, 4, 3]
    assert len(first) == 3
    assert sorted(row for one in batches for row in one) == list(range(11))
    order = [row for one in first for row in one]
    assert order == [row for one in first for row in one]
    first.set_epoch(1)
    assert order != [row for one in first for row in one]
