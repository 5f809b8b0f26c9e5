"""Training of the fusion by both methods, and calibration of its scores."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from export.fusion import export_fusion, with_calibrations
from export.result import ExportConfig
from perception.detection.fusion.rescoring import Fusion
from perception.detection.fusion.score_calibration import BetaCalibration, FusionCalibration
from perception.errors import ModelError, UsageError
from perception.evaluation.detection.reliability import Correctness, measure_reliability
from tests.faults import fault
from tests.train.events import hyperparameters_of
from tests.train.fusion.test_mlp_least_squares import toy_rows
from train.config import TrainingRun
from train.folder import TrainingFolder
from train.fusion.calibration import fit_calibration
from train.fusion.config import FusionTrainingConfig, LevenbergMarquardtConfig
from train.fusion.fit_adamw import FusionTraining
from train.fusion.fit_lm import fit_levenberg_marquardt
from train.fusion.mlp import load_fusion
from train.fusion.mlp_least_squares import MlpLeastSquares
from train.fusion.sweep import hidden_sizes, sweep
from train.fusion.targets import FusionSets
from train.fusion.training import fit_fusion, write_calibrations

SETS = FusionSets(toy_rows(80, 0), toy_rows(40, 1))


def config_of(**changes) -> FusionTrainingConfig:
    return FusionTrainingConfig(
        (4,), **{"method": "lm"} | changes, variant="scores", training_data="toys"
    )


@pytest.mark.parametrize("method", ["lm", "adamw"])
def test_both_methods_write_a_network_to_export(tmp_path, method):
    config = config_of(method=method, lm=LevenbergMarquardtConfig(max_steps=8), batch_size=20)
    fitted = fit_fusion(SETS, config, TrainingRun(epochs=8), TrainingFolder(tmp_path))
    first = fit_levenberg_marquardt(SETS, config_of(lm=LevenbergMarquardtConfig(max_steps=0)))
    assert fitted.validation < 0.5 * first.validation
    _, metadata = load_fusion(fitted.checkpoint)
    assert metadata["hidden"] == "4"
    assert metadata["optimiser"] == method
    assert metadata["training_data"] == "toys"
    events = EventAccumulator(str(tmp_path)).Reload()
    assert {"train/mse", "validation/mse"} <= set(events.Tags()["scalars"])
    assert len(events.Scalars("validation/mse")) >= 2
    assert {"train/gradient_norm"} <= set(events.Tags()["scalars"])
    shown, best = hyperparameters_of(tmp_path)
    assert (shown["variant"], shown["optimiser"]) == ("scores", method)
    assert best["best/validation/mse"] == pytest.approx(fitted.validation, rel=1e-3)
    exported = export_fusion(ExportConfig(fitted.checkpoint))
    exported.require_parity("toy")
    assert exported.variants["fp32"].parity["features"].rows == 63


def killed(monkeypatch, config, at):
    """Let a fit end as by Ctrl-C at a step."""
    steps = iter(range(at))

    def one_less(self, *asked):
        if next(steps, None) is None:
            raise KeyboardInterrupt
        return original(self, *asked)

    owner, name = {
        "lm": (MlpLeastSquares, "normal_equations"),
        "adamw": (FusionTraining, "training_step"),
    }[config.method]
    original = getattr(owner, name)
    monkeypatch.setattr(owner, name, one_less)


@pytest.mark.parametrize("method", ["lm", "adamw"])
def test_a_killed_fit_resumes_exactly(tmp_path, monkeypatch, method):
    # Of lm steps, and of adamw batches of which there are four an epoch.
    config = config_of(method=method, lm=LevenbergMarquardtConfig(max_steps=9), batch_size=20)
    run = TrainingRun(epochs=3)
    whole = fit_fusion(SETS, config, run, TrainingFolder(tmp_path / "whole"))
    out = tmp_path / "killed"
    with monkeypatch.context() as patch:
        killed(patch, config, at=6)
        with pytest.raises(KeyboardInterrupt):
            fit_fusion(SETS, config, run, TrainingFolder(out))
    for name in ("best.ckpt", "last.ckpt"):
        load_fusion(out / name)
    resumed = fit_fusion(SETS, config, run, TrainingFolder(out, out / "last.ckpt"))
    assert replace(resumed, checkpoint=whole.checkpoint) == whole
    for name in ("best.ckpt", "last.ckpt"):
        expected, found = (load_fusion(tmp_path / of / name)[0] for of in ("whole", "killed"))
        for ours, theirs in zip(found.parameters(), expected.parameters(), strict=True):
            assert torch.equal(ours, theirs)


def test_a_checkpoint_of_another_fit_is_refused(tmp_path):
    config = config_of(lm=LevenbergMarquardtConfig(max_steps=1))
    fit_fusion(SETS, config, TrainingRun(), TrainingFolder(tmp_path))
    last, best = tmp_path / "last.ckpt", tmp_path / "best.ckpt"
    wider = FusionTrainingConfig((5,), "lm", variant="scores")
    for other, checkpoint, found in (
        (wider, last, "that of another network"),
        (config_of(method="adamw"), last, "one without the state of this optimizer"),
        (config, best, "one without the state of this optimizer"),
    ):
        with fault(ModelError, checkpoint.name, "the training of this fusion", found, "last.ckpt"):
            fit_fusion(SETS, other, TrainingRun(), TrainingFolder(tmp_path / "out", checkpoint))
    assert not (tmp_path / "out").exists()


def test_it_stops_early_by_the_validation_error():
    seen = []
    best = fit_levenberg_marquardt(
        SETS,
        config_of(lm=LevenbergMarquardtConfig(patience=2)),
        lambda state, error: seen.append(error),
    )
    assert best.validation == min(seen)
    assert len(seen) - 1 - int(np.argmin(seen)) in (0, 2)  # no way down, or two checks in vain


def test_the_same_seed_fits_the_same_parameters():
    first, second = (
        fit_levenberg_marquardt(SETS, config_of(lm=LevenbergMarquardtConfig(max_steps=5)))
        for _ in range(2)
    )
    np.testing.assert_array_equal(first.parameters, second.parameters)


def test_a_sweep_fits_every_size():
    sizes = hidden_sizes([2, 3], [2, 3, 4])
    assert sizes == [(2,), (3,), (3, 2), (4, 2), (4, 3)]
    swept = sweep(SETS, config_of(lm=LevenbergMarquardtConfig(max_steps=3)), sizes[1:3])
    assert [one.hidden for one in swept] == [(3,), (3, 2)]
    assert all(0 < one.validation < 0.1 for one in swept)


def test_a_calibration_finds_the_curve_that_made_the_scores():
    rng = np.random.default_rng(0)
    made = BetaCalibration(0.6, 1.8, -0.4)
    scores = rng.uniform(0, 1, 60_000)
    found = Correctness(scores, rng.uniform(size=60_000) < made.probabilities(scores))
    curve = fit_calibration(found)
    np.testing.assert_allclose([curve.a, curve.b, curve.c], [0.6, 1.8, -0.4], atol=0.06)
    before = measure_reliability(found).expected_calibration_error
    after = measure_reliability(Correctness(curve.probabilities(scores), found.is_correct))
    assert after.expected_calibration_error < 0.01 < before


def test_where_all_are_right_scores_stay():
    assert fit_calibration(Correctness(np.array([0.2, 0.9]), np.ones(2, bool))) == BetaCalibration()


def test_a_calibration_keeps_the_order_whatever_it_is_shown():
    scores = np.linspace(0.01, 0.99, 200)
    curve = fit_calibration(Correctness(scores, scores < 0.5))  # the surer, the wronger
    assert (np.diff(curve.probabilities(scores)) > 0).all()
    with pytest.raises(UsageError) as raised:
        BetaCalibration(-1.0, 1.0, 0.0)
    assert (raised.value.where, raised.value.found) == ("calibration", "-1.0,1.0,0.0")


def test_a_file_takes_a_calibration_and_so_does_a_checkpoint(tmp_path):
    config = config_of(lm=LevenbergMarquardtConfig(max_steps=1))
    checkpoint = fit_fusion(SETS, config, TrainingRun(), TrainingFolder(tmp_path)).checkpoint
    model = export_fusion(ExportConfig(checkpoint)).models["fp32"]
    file = tmp_path / "fusion.onnx"
    curves = FusionCalibration(
        BetaCalibration(2.0, 0.5, 0.25), {"dm": BetaCalibration(1.0, 0.0, -1.0)}
    )
    file.write_bytes(with_calibrations(model, curves))
    assert Fusion(file).calibrations == curves
    write_calibrations(checkpoint, curves)
    assert load_fusion(checkpoint)[1]["calibration"] == "2.0,0.5,0.25 dm=1.0,0.0,-1.0"


def test_other_checkpoints_are_refused(tmp_path):
    with fault(ModelError, expected="a checkpoint of fusion", found="no such file"):
        load_fusion(tmp_path / "none.ckpt")
