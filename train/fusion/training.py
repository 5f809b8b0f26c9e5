"""Training of the fusion's network: by Levenberg-Marquardt as in 7.2.2, or by any optimizer of torch."""

from functools import partial
from typing import Any, ClassVar

import torch
from lightning.pytorch import LightningModule
from lightning.pytorch.cli import LRSchedulerCallable, OptimizerCallable
from torch import Tensor
from torch.optim import LBFGS

from perception.detection.config import FusionVariant
from perception.errors import UsageError
from train.best_epoch import Criterion, Ranking
from train.checkpoints import program_revision
from train.fusion.config import MODEL, Hidden, SweepConfig
from train.fusion.gauss_newton import (
    mean_square,
    normal_equations,
    weighted_entropy,
    weighted_squares,
)
from train.fusion.levenberg_marquardt import LevenbergMarquardt, NormalEquations
from train.fusion.network import RescoringMlp, fusion_network
from train.optimization import configure_optimizers

_NO_SWEEP = SweepConfig()


class FusionTraining(LightningModule):
    """The fusion's network, its error and its optimizer.

    Attributes:
        ranking: Criteria of the best epoch.
        identity: Hyperparameters that a checkpoint must share to be resumed.
        metrics: Metrics of the last validation or test.
    """

    ranking: ClassVar[Ranking] = (Criterion("validation/mse", is_lower_better=True),)
    identity: ClassVar[tuple[str, ...]] = ("variant", "hidden", "max_partners")

    def __init__(  # noqa: PLR0913 - the flags of a group
        self,
        *,
        variant: FusionVariant = "default",
        hidden: Hidden = (23,),
        max_partners: int | None = None,
        sweep: SweepConfig = _NO_SWEEP,
        seed: int = 0,
        optimizer: OptimizerCallable = lambda weights: LBFGS(
            weights,
            max_iter=10,
            history_size=30,
            tolerance_grad=1e-6,
            line_search_fn="strong_wolfe",
        ),
        lr_scheduler: LRSchedulerCallable | None = None,
    ) -> None:
        """Make the network with random weights.

        Args:
            variant: Features of a combination: default, sums of the evidence of scores; features or scores, as in
                the thesis.
            hidden: Neurons of each hidden layer of the thesis' variants; the default has none.
            max_partners: Maximum number of boxes of each other modality that a box is combined with, 0 for all
                combinations; else that of the variant.
            sweep: Sizes of the network to try first; the best of them is taken in place of `hidden`.
            seed: Seed of the initial weights.
            optimizer: Optimizer of the weights; LBFGS and LevenbergMarquardt take all rows at once.
            lr_scheduler: Schedule of the learning rate, for optimizers that take batches.
        """
        super().__init__()
        torch.manual_seed(seed)
        self.network = fusion_network(variant, hidden)
        self.optimizer, self.lr_scheduler = optimizer, lr_scheduler
        made = optimizer(self.network.parameters())
        self.automatic_optimization = not isinstance(made, LevenbergMarquardt)
        self.save_hyperparameters(
            {
                "model": MODEL,
                "variant": variant,
                "hidden": list(self.network.hidden),
                "max_partners": max_partners,
                "seed": seed,
                "optimizer": {"class_path": type(made).__name__},
                "training_data": "unknown",
                "detectors": "unknown",
                "classes": "Car",
                "revision": program_revision(),
            }
        )
        self.variant, self.max_partners, self.sweep = variant, max_partners, sweep
        self.metrics: dict[str, float] = {}

    def setup(self, stage: str) -> None:
        """Scale the inputs to the training rows, and note what the detections are of.

        Raises:
            UsageError: Levenberg-Marquardt is asked for in batches, or for the default.
        """
        if stage != "fit":
            return
        data = self.trainer.datamodule  # type: ignore[attr-defined]
        batch_size = data.config.batch_size
        if not self.automatic_optimization and batch_size is not None:
            raise UsageError(
                "--data.batch_size",
                expected="null with LevenbergMarquardt, which takes all rows at once",
                found=str(batch_size),
            )
        if not (self.automatic_optimization or isinstance(self.network, RescoringMlp)):
            raise UsageError(
                "--optimizer",
                expected="LevenbergMarquardt with the variants features and scores",
                found=f"variant {self.variant}",
                advice="use --config thesis, or another optimizer",
            )
        self.network.fit_inputs(data.training.features)
        found = data.detections
        self.hparams.update(
            detectors=found.detectors, classes=",".join(found.class_names), **found.provenance
        )

    def configure_model(self) -> None:
        """Convert the network to the trainer's precision, before a checkpoint would be rounded to another."""
        self.trainer.precision_plugin.convert_module(self)

    def training_step(self, batch: list[Tensor], batch_idx: int) -> Tensor | None:
        """Return the error of a batch; by Levenberg-Marquardt, take a step."""
        if not self.automatic_optimization:
            self._take_step(batch)
            return None
        is_probability = self.network.is_probability
        loss = weighted_entropy if is_probability else weighted_squares
        total, weight = loss(self.network, batch)
        # The gradient is the mean of those of all processes, and the value is that of all, as LBFGS compares values.
        whole = self._sum(weight).clamp(min=1e-6)
        share = self.trainer.world_size * total / whole
        error: Tensor = share + (self._sum(total) / whole - share).detach()
        error = error + self.network.penalty()
        self._log("train/cross_entropy" if is_probability else "train/mse", error, len(batch[0]))
        return error

    def validation_step(self, batch: list[Tensor], batch_idx: int) -> None:
        """Log the error of the validation rows."""
        self._evaluate("validation", batch)

    def test_step(self, batch: list[Tensor], batch_idx: int) -> None:
        """Log the error of the test rows."""
        self._evaluate("test", batch)

    def configure_optimizers(self) -> Any:  # noqa: ANN401 - one of many forms that Lightning takes
        """Return optimizer and schedule; the damping of Levenberg-Marquardt is its schedule."""
        if not self.automatic_optimization:
            return self.optimizer(self.network.parameters())
        return configure_optimizers(self, self.network, self.optimizer, self.lr_scheduler)

    def _take_step(self, rows: list[Tensor]) -> None:
        network = self.network
        assert isinstance(network, RescoringMlp)  # as validated in setup

        def equations() -> NormalEquations:
            found = normal_equations(network, rows, self._sum)
            self._write_gradient(2 * found.gradient)  # for those who log it
            return found

        optimizer: Any = self.optimizers()
        error = optimizer.step(
            equations, mean_square=partial(mean_square, network, rows, self._sum)
        )
        self._log("train/mse", error, len(rows[0]))
        self._log("train/damping", optimizer.param_groups[0]["damping"], len(rows[0]))
        if optimizer.optimizer.has_converged:
            self.trainer.should_stop = True

    def _evaluate(self, part: str, rows: list[Tensor]) -> None:
        error = mean_square(self.network, rows)
        self.metrics = {"mse": float(error)}
        self._log(f"{part}/mse", error, len(rows[0]))

    def _log(self, name: str, value: Tensor | float, rows: int) -> None:
        self.log(name, value, on_step=False, on_epoch=True, batch_size=rows, sync_dist=True)

    def _sum(self, values: Tensor) -> Tensor:
        """Return the sum over all processes."""
        found = self.trainer.strategy.reduce(values.detach().clone(), reduce_op="sum")
        assert isinstance(found, Tensor)  # as it was given
        return found

    def _write_gradient(self, gradient: Tensor) -> None:
        weights = list(self.network.parameters())
        parts = torch.split(gradient, [weight.numel() for weight in weights])
        for weight, part in zip(weights, parts, strict=True):
            weight.grad = part.view_as(weight)
