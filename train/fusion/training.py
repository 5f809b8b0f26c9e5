"""How the fusion's network is fitted: by Levenberg-Marquardt as in 7.2.2, or by AdamW.

Both leave the same: OUT/best.ckpt of the lowest error on what was kept back, and what TensorBoard shows.
"""

import io
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Literal

import torch
from lightning.pytorch import LightningDataModule, LightningModule
from torch import Tensor
from torch.optim import AdamW
from torch.optim.lr_scheduler import LambdaLR
from torch.utils.data import DataLoader, TensorDataset
from torch.utils.tensorboard import SummaryWriter

from data.whole_file import write_whole
from perception.geometry.threads import one_blas_thread
from perception.types import Float64
from train.fusion.levenberg_marquardt import Damping, Step, descend
from train.fusion.mlp import MODEL, MlpForm, RescoringMlp
from train.fusion.mlp_squares import MlpSquares
from train.fusion.targets import FusionRows
from train.schedules import warm_cosine
from train.trainer import BEST, TrainerPlan, fit, make_trainer

Optimiser = Literal["lm", "adamw"]
WATCHED = "validation/explained"


@dataclass(frozen=True)
class FusionPlan:
    """Which network is fitted, and how.

    Attributes:
        form: the network.
        optimiser: lm, Levenberg-Marquardt over all rows at once; adamw, in small steps.
        damping: of lm.
        checks: lm ends when the error on what was kept back has not fallen for so many steps.
        learning_rate: the highest of adamw.
        weight_decay: of adamw, of weights only.
        batch: combinations a step of adamw.
        seed: of the first weights.
        training_data: what it learns from, for the model file.
        revision: of the program, for the model file.
    """

    form: MlpForm = field(default_factory=MlpForm)
    optimiser: Optimiser = "lm"
    damping: Damping = field(default_factory=Damping)
    checks: int = 6
    learning_rate: float = 0.01
    weight_decay: float = 0.0001
    batch: int = 512
    seed: int = 0
    training_data: str = "unknown"
    revision: str = "unknown"

    @property
    def notes(self) -> dict[str, Any]:
        """What a checkpoint says of it."""
        form = {"variant": self.form.variant, "hidden": list(self.form.hidden)}
        kept = ("optimiser", "seed", "training_data", "revision")
        return {"model": MODEL, **form, **{name: asdict(self)[name] for name in kept}}

    def first_network(self, training: FusionRows) -> RescoringMlp:
        """Return a network of random weights that knows the ranges of its inputs."""
        torch.manual_seed(self.seed)
        network = RescoringMlp(self.form)
        network.fit_inputs(training.features)
        return network


@dataclass(frozen=True)
class FusionSets:
    """What is learned from, and what is kept back to judge by."""

    training: FusionRows
    validation: FusionRows


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


def fit_fusion(sets: FusionSets, plan: FusionPlan, out: Path, trainer: TrainerPlan) -> FittedFusion:
    """Fit a network in a folder; how long and on what is asked of adamw only."""
    if plan.optimiser == "lm":
        with SummaryWriter(str(out)) as writer:
            best = lowest(sets, plan, partial(_log_step, writer))
        network = MlpSquares(plan.first_network(sets.training), sets.training).network_of(
            best.parameters
        )
        _write_checkpoint(out / BEST, network, plan, best.step)
        return FittedFusion(out / BEST, best.step, best.training, best.validation)
    torch.manual_seed(plan.seed)
    module = FusionTraining(plan, plan.first_network(sets.training))
    fit(make_trainer(out, trainer, []), module, FusionBatches(sets, plan.batch))
    content = torch.load(out / BEST, map_location="cpu", weights_only=True)
    module.load_state_dict(content["state_dict"])
    errors = [MlpSquares(module.network, rows) for rows in (sets.training, sets.validation)]
    training, validation = (problem.mean_square(problem.start) for problem in errors)
    return FittedFusion(out / BEST, content["epoch"], training, validation)


@dataclass(frozen=True)
class Lowest:
    """Where the error on what was kept back was lowest."""

    step: int
    parameters: Float64
    training: float
    validation: float


def lowest(
    sets: FusionSets, plan: FusionPlan, watch: Callable[[Step, float], None] | None = None
) -> Lowest:
    """Go down by Levenberg-Marquardt until what was kept back says that it is enough.

    Args:
        sets: combinations.
        plan: the network, and when to stop.
        watch: is told of each step and of its error on what was kept back.
    """
    network = plan.first_network(sets.training)
    problem, kept_back = MlpSquares(network, sets.training), MlpSquares(network, sets.validation)
    best: Lowest | None = None
    with one_blas_thread():
        for step in descend(problem, problem.start, plan.damping):
            error = kept_back.mean_square(step.parameters)
            if watch is not None:
                watch(step, error)
            if best is None or error < best.validation:
                best = Lowest(step.number, step.parameters, step.mean_square, error)
            elif step.number - best.step >= plan.checks:
                break
    assert best is not None  # the start is one
    return best


class FusionTraining(LightningModule):
    """One network and its descent by AdamW."""

    def __init__(self, plan: FusionPlan, network: RescoringMlp) -> None:
        """Take a network as it is."""
        super().__init__()
        self.save_hyperparameters(plan.notes)
        self.plan, self.network = plan, network

    def training_step(self, batch: list[Tensor], batch_idx: int) -> Tensor:
        """Return the error of a batch."""
        features, targets, weights = batch
        squares = weights * (self.network(features) - targets) ** 2
        error: Tensor = squares.sum() / weights.sum().clamp(min=1e-6)
        self.log("train/mse", error, on_step=False, on_epoch=True, batch_size=len(features))
        return error

    def validation_step(self, batch: list[Tensor], batch_idx: int) -> None:
        """Log the error of the whole set, and which share of the targets' variance is explained."""
        features, targets, weights = batch
        total = weights.sum()
        error = (weights * (self.network(features) - targets) ** 2).sum() / total
        mean = (weights * targets).sum() / total
        variance = (weights * (targets - mean) ** 2).sum() / total
        found = {"validation/mse": error, WATCHED: 1 - error / variance.clamp(min=1e-12)}
        self.log_dict(found, batch_size=len(features))

    def configure_optimizers(self) -> Any:  # noqa: ANN401 - one of many forms that Lightning takes
        """Return the descent and its rate, which changes with every step."""
        weights = [w for w in self.parameters() if w.ndim > 1]
        biases = [w for w in self.parameters() if w.ndim <= 1]
        groups = [
            {"params": weights, "weight_decay": self.plan.weight_decay},
            {"params": biases, "weight_decay": 0.0},
        ]
        descent = AdamW(groups, lr=self.plan.learning_rate)
        steps = int(self.trainer.estimated_stepping_batches)
        rate = LambdaLR(descent, partial(warm_cosine, steps=steps))
        return {"optimizer": descent, "lr_scheduler": {"scheduler": rate, "interval": "step"}}


class FusionBatches(LightningDataModule):
    """Combinations in batches; what was kept back is one."""

    def __init__(self, sets: FusionSets, batch: int) -> None:
        super().__init__()
        self._sets, self._batch = sets, batch

    def train_dataloader(self) -> DataLoader[Any]:
        """Return what is learned from, in a new order each time."""
        return DataLoader(_tensors(self._sets.training), self._batch, shuffle=True)

    def val_dataloader(self) -> DataLoader[Any]:
        """Return what was kept back."""
        return DataLoader(_tensors(self._sets.validation), len(self._sets.validation))


def _tensors(rows: FusionRows) -> TensorDataset:
    return TensorDataset(*(torch.from_numpy(column) for column in vars(rows).values()))


def _log_step(writer: SummaryWriter, step: Step, validation: float) -> None:
    figures = {
        "train/mse": step.mean_square,
        "validation/mse": validation,
        "train/gradient": step.gradient,
        "train/damping": step.damping,
    }
    for name, value in figures.items():
        writer.add_scalar(name, value, step.number)


def _write_checkpoint(path: Path, network: RescoringMlp, plan: FusionPlan, step: int) -> None:
    state = {f"network.{name}": weight for name, weight in network.state_dict().items()}
    content = io.BytesIO()
    torch.save({"state_dict": state, "hyper_parameters": plan.notes, "epoch": step}, content)
    write_whole(path, content.getvalue())
