"""Training of the fusion's network: by Levenberg-Marquardt as in 7.2.2, or by AdamW.

Both write OUT/best.ckpt of the lowest validation error, OUT/last.ckpt to resume from, and TensorBoard events.
"""

from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch

from perception.detection.fusion.score_calibration import FusionCalibration
from perception.types import Float64
from train.best_epoch import Criterion
from train.checkpoint_writer import write_checkpoint
from train.checkpoints import read_checkpoint
from train.config import TrainingRun
from train.events import event_logger, log_hyperparameters, writing_events
from train.fusion.config import MODEL, FusionTrainingConfig
from train.fusion.fit_adamw import FusionBatches, FusionTraining
from train.fusion.fit_lm import LevenbergMarquardtState, fit_levenberg_marquardt
from train.fusion.mlp import initial_network
from train.fusion.mlp_least_squares import MlpLeastSquares
from train.fusion.previous import TrainingFolder, fit, require_same_training
from train.fusion.targets import FusionSets
from train.progress import step_bar

RANKING = (Criterion("validation/mse", is_lower_better=True),)
_LM_STATE = "fit_state"  # entry of a checkpoint from which Levenberg-Marquardt is resumed


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
    sets: FusionSets, config: FusionTrainingConfig, run: TrainingRun, folder: TrainingFolder
) -> FittedFusion:
    """Fit a network in a folder; epochs and devices matter to AdamW only.

    Args:
        sets: Combinations for training and validation.
        config: Network, and how it is fitted.
        run: Epochs and devices.
        folder: Folder of the training.

    Raises:
        ModelError: the checkpoint is damaged, or of another network or method.
    """
    torch.manual_seed(config.seed)
    module = FusionTraining(config, initial_network(config, sets.training.features))
    if config.method == "lm":
        return _fit_by_levenberg_marquardt(sets, module, folder)
    fit(module, FusionBatches(sets, config), RANKING, run, folder)
    content = read_checkpoint(folder.best, MODEL)
    module.load_state_dict(content["state_dict"])
    errors = [MlpLeastSquares(module.network, rows) for rows in (sets.training, sets.validation)]
    training, validation = (problem.mean_square(problem.start) for problem in errors)
    return FittedFusion(folder.best, content["epoch"], training, validation)


def write_calibrations(checkpoint: Path, calibrations: FusionCalibration) -> None:
    """Write calibration curves into a checkpoint, for its export."""
    content = read_checkpoint(checkpoint, MODEL)
    write_checkpoint(checkpoint, content | {"calibration": str(calibrations)})


def _fit_by_levenberg_marquardt(
    sets: FusionSets, module: FusionTraining, folder: TrainingFolder
) -> FittedFusion:
    config, problem = module.config, MlpLeastSquares(module.network, sets.training)
    state = None
    if folder.resume is not None:
        require_same_training(folder.resume, module, _LM_STATE)
        state = LevenbergMarquardtState.from_dict(read_checkpoint(folder.resume, MODEL)[_LM_STATE])
    folder.on_start()

    def content(parameters: Float64, step: int) -> dict[str, Any]:
        weights = problem.network_of(parameters).state_dict()
        state = {f"network.{name}": weight for name, weight in weights.items()}
        return {"state_dict": state, "hyper_parameters": config.hyper_parameters, "epoch": step}

    def keep(found: LevenbergMarquardtState, validation: float) -> None:
        last, best = found.last, found.best
        metrics = {
            "train/mse": last.mean_square,
            "validation/mse": validation,
            "train/gradient_norm": last.gradient,
            "train/damping": last.damping,
        }
        logger.log_metrics(metrics, last.number)
        if best.step == last.number:
            write_checkpoint(folder.best, content(best.parameters, best.step))
        write_checkpoint(
            folder.last, content(last.parameters, last.number) | {_LM_STATE: found.as_dict}
        )
        bar.update(last.number - bar.n)
        bar.set_postfix(train=f"{last.mean_square:.5f}", validation=f"{validation:.5f}")

    if state is not None:
        write_checkpoint(folder.best, content(state.best.parameters, state.best.step))
    logger = event_logger(folder.out)
    first = 0 if state is None else state.last.number
    with (
        writing_events(folder.out),
        closing(logger.experiment),
        step_bar(config.lm.max_steps, first) as bar,
    ):
        best = fit_levenberg_marquardt(sets, config, keep, state)
        log_hyperparameters(logger, config.hyper_parameters, {"validation/mse": best.validation})
    return FittedFusion(folder.best, best.step, best.training, best.validation)
