"""Training of the fusion's network: by Levenberg-Marquardt as in 7.2.2, or by AdamW.

Both write OUT/best.ckpt of the lowest validation error, OUT/last.ckpt to resume from, and TensorBoard events.
"""

import io
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from torch.utils.tensorboard import SummaryWriter

from perception.atomic_file import write_atomically
from perception.detection.fusion.score_calibration import FusionCalibration
from perception.errors import ModelError
from perception.types import Float64
from train.checkpoint_writer import require_same_network
from train.checkpoints import read_checkpoint
from train.config import TrainingRun
from train.fusion.config import MODEL, FusionTrainingConfig
from train.fusion.fit_adamw import MONITOR, FusionBatches, FusionTraining
from train.fusion.fit_lm import LevenbergMarquardtState, fit_levenberg_marquardt
from train.fusion.mlp import initial_network
from train.fusion.mlp_least_squares import MlpLeastSquares
from train.fusion.targets import FusionSets
from train.progress import step_bar
from train.trainer import BEST, LAST, fit, make_trainer


@dataclass(frozen=True)
class FittedFusion:
    """Result of a fit.

    Attributes:
        checkpoint: Checkpoint of the lowest validation error.
        epoch: Its epoch or step, from 0.
        training: Mean square error of the training rows there.
        validation: Mean square error of the validation rows there.
    """

    checkpoint: Path
    epoch: int
    training: float
    validation: float


def fit_fusion(
    sets: FusionSets,
    config: FusionTrainingConfig,
    out: Path,
    run: TrainingRun,
    resume: Path | None = None,
) -> FittedFusion:
    """Fit a network in a folder; epochs and devices matter to AdamW only.

    Args:
        sets: Combinations for training and validation.
        config: Network, and how it is fitted.
        out: Folder of the checkpoints.
        run: Epochs and devices.
        resume: Checkpoint of the same fit to resume from.

    Raises:
        ModelError: the checkpoint is damaged, or of another network or method.
    """
    torch.manual_seed(config.seed)
    module = FusionTraining(config, initial_network(config, sets.training.features))
    if resume is not None:
        _require_same_fit(resume, module)
    if config.method == "lm":
        return _fit_by_levenberg_marquardt(sets, config, out, resume)
    fit(make_trainer(out, run, MONITOR), module, FusionBatches(sets, config), resume)
    content = read_checkpoint(out / BEST, MODEL)
    module.load_state_dict(content["state_dict"])
    errors = [MlpLeastSquares(module.network, rows) for rows in (sets.training, sets.validation)]
    training, validation = (problem.mean_square(problem.start) for problem in errors)
    return FittedFusion(out / BEST, content["epoch"], training, validation)


def write_calibrations(checkpoint: Path, calibrations: FusionCalibration) -> None:
    """Write calibration curves into a checkpoint, for its export."""
    _write(checkpoint, read_checkpoint(checkpoint, MODEL) | {"calibration": str(calibrations)})


def _fit_by_levenberg_marquardt(
    sets: FusionSets, config: FusionTrainingConfig, out: Path, resume: Path | None
) -> FittedFusion:
    problem = MlpLeastSquares(initial_network(config, sets.training.features), sets.training)

    def content(parameters: Float64, step: int) -> dict[str, Any]:
        weights = problem.network_of(parameters).state_dict()
        state = {f"network.{name}": weight for name, weight in weights.items()}
        return {"state_dict": state, "hyper_parameters": config.hyper_parameters, "epoch": step}

    def keep(fit_state: LevenbergMarquardtState, validation: float) -> None:
        last, best = fit_state.last, fit_state.best
        metrics = {
            "train/mse": last.mean_square,
            "validation/mse": validation,
            "train/gradient": last.gradient,
            "train/damping": last.damping,
        }
        for name, value in metrics.items():
            writer.add_scalar(name, value, last.number)
        if best.step == last.number:
            _write(out / BEST, content(best.parameters, best.step))
        _write(out / LAST, content(last.parameters, last.number) | {"fit_state": fit_state.as_dict})
        bar.update(last.number - bar.n)
        bar.set_postfix(train=f"{last.mean_square:.5f}", validation=f"{validation:.5f}")

    resumed_state = None
    if resume is not None:
        resumed_state = LevenbergMarquardtState.from_dict(
            read_checkpoint(resume, MODEL)["fit_state"]
        )
        _write(out / BEST, content(resumed_state.best.parameters, resumed_state.best.step))
    first = 0 if resumed_state is None else resumed_state.last.number
    with SummaryWriter(str(out)) as writer, step_bar(config.lm.max_steps, first) as bar:
        best = fit_levenberg_marquardt(sets, config, keep, resumed_state)
    return FittedFusion(out / BEST, best.step, best.training, best.validation)


def _require_same_fit(checkpoint: Path, module: FusionTraining) -> None:
    """Validate that a checkpoint is of this network and holds the state of this method."""
    require_same_network(checkpoint, module)
    content = read_checkpoint(checkpoint, MODEL)
    states = {"lm": "fit_state", "adamw": "optimizer_states"}
    if states[module.config.method] not in content:
        raise ModelError(
            checkpoint,
            expected=f"a checkpoint to resume from by {module.config.method}",
            found=f"one by {content['hyper_parameters']['optimiser']} without its state",
            advice="resume from last.ckpt with the flags of its training",
        )


def _write(path: Path, content: dict[str, Any]) -> None:
    data = io.BytesIO()
    torch.save(content, data)
    write_atomically(path, data.getvalue())
