"""How the fusion's network is fitted: by Levenberg-Marquardt as in 7.2.2, or by AdamW.

Both leave the same: OUT/best.ckpt of the lowest error on what was kept back, OUT/last.ckpt to go on from, and
what TensorBoard shows.
"""

import io
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from torch.utils.tensorboard import SummaryWriter

from data.atomic_file import write_atomically
from perception.detection.fusion.score_calibration import FusionCalibration
from perception.errors import ModelError
from perception.types import Float64
from train.checkpoint_writer import require_same_network
from train.checkpoints import read_checkpoint
from train.fusion.config import FusionSets, FusionTrainingConfig
from train.fusion.fit_adamw import FusionBatches, FusionTraining
from train.fusion.fit_lm import LevenbergMarquardtState, fit_levenberg_marquardt
from train.fusion.mlp import MODEL
from train.fusion.mlp_least_squares import MlpLeastSquares
from train.progress import step_bar
from train.trainer import BEST, LAST, TrainerConfig, fit, make_trainer


@dataclass(frozen=True)
class FittedFusion:
    """What a fit leaves.

    Attributes:
        checkpoint: of the lowest error on what was kept back.
        epoch: when that was, from 0.
        training: mean square error there.
        validation: the same on what was kept back.
    """

    checkpoint: Path
    epoch: int
    training: float
    validation: float


def fit_fusion(
    sets: FusionSets,
    config: FusionTrainingConfig,
    out: Path,
    trainer: TrainerConfig,
    resume: Path | None = None,
) -> FittedFusion:
    """Fit a network in a folder; how long and on what is asked of adamw only.

    Args:
        sets: combinations.
        config: the network, and how it is fitted.
        out: the folder.
        trainer: how long and on what.
        resume: a checkpoint of the same fit to go on from.

    Raises:
        ModelError: the checkpoint is damaged, or of another network or way to fit.
    """
    torch.manual_seed(config.seed)
    module = FusionTraining(config, config.initial_network(sets.training))
    if resume is not None:
        _require_same_fit(resume, module)
    if config.optimiser == "lm":
        return _fit_by_levenberg_marquardt(sets, config, out, resume)
    fit(make_trainer(out, trainer, []), module, FusionBatches(sets, config), resume)
    content = read_checkpoint(out / BEST, MODEL)
    module.load_state_dict(content["state_dict"])
    errors = [MlpLeastSquares(module.network, rows) for rows in (sets.training, sets.validation)]
    training, validation = (problem.mean_square(problem.start) for problem in errors)
    return FittedFusion(out / BEST, content["epoch"], training, validation)


def write_calibrations(checkpoint: Path, calibrations: FusionCalibration) -> None:
    """Write into a checkpoint how scores become probabilities, for those who export it."""
    _write(checkpoint, read_checkpoint(checkpoint, MODEL) | {"calibration": str(calibrations)})


def _fit_by_levenberg_marquardt(
    sets: FusionSets, config: FusionTrainingConfig, out: Path, resume: Path | None
) -> FittedFusion:
    problem = MlpLeastSquares(config.initial_network(sets.training), sets.training)

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
        _write(out / LAST, content(last.parameters, last.number) | {"descent": fit_state.state})
        bar.update(last.number - bar.n)
        bar.set_postfix(train=f"{last.mean_square:.5f}", validation=f"{validation:.5f}")

    resumed_state = None
    if resume is not None:
        resumed_state = LevenbergMarquardtState.from_dict(read_checkpoint(resume, MODEL)["descent"])
        _write(out / BEST, content(resumed_state.best.parameters, resumed_state.best.step))
    first = 0 if resumed_state is None else resumed_state.last.number
    with SummaryWriter(str(out)) as writer, step_bar(config.damping.max_steps, first) as bar:
        best = fit_levenberg_marquardt(sets, config, keep, resumed_state)
    return FittedFusion(out / BEST, best.step, best.training, best.validation)


def _require_same_fit(checkpoint: Path, module: FusionTraining) -> None:
    """Refuse to go on from a checkpoint of another network, or from one that holds no state of this fit."""
    require_same_network(checkpoint, module)
    content = read_checkpoint(checkpoint, MODEL)
    states = {"lm": "descent", "adamw": "optimizer_states"}
    if states[module.config.optimiser] not in content:
        raise ModelError(
            checkpoint,
            expected=f"a checkpoint to go on from by {module.config.optimiser}",
            found=f"one by {content['hyper_parameters']['optimiser']} without its state",
            advice="go on from last.ckpt with the options that it was made with",
        )


def _write(path: Path, content: dict[str, Any]) -> None:
    data = io.BytesIO()
    torch.save(content, data)
    write_atomically(path, data.getvalue())
