"""Weight decay and schedules of the learning rate that torch does not have.

`--optimizer` takes any optimizer of torch, `--lr_scheduler` any of its schedules or one of these.
"""

import math
from abc import ABC, abstractmethod
from typing import Any

from lightning.pytorch import LightningModule
from lightning.pytorch.cli import LRSchedulerCallable, OptimizerCallable
from torch import Tensor, nn
from torch.optim import Optimizer
from torch.optim.lr_scheduler import LRScheduler

_DARKNET_STEPS = 80_200  # `max_batches` of yolo-voc.cfg


class StepSchedule(LRScheduler, ABC):
    """Schedule over the steps of a training, which the trainer knows.

    Attributes:
        steps: Number of steps of the training.
        steps_per_epoch: Number of steps of an epoch.
    """

    steps = 1
    steps_per_epoch = 1

    @abstractmethod
    def factor(self, step: int) -> float:
        """Return the factor of the largest learning rate at a step, from 0."""

    def get_lr(self) -> list[float | Tensor]:
        """Return the learning rate of each group of weights."""
        factor = self.factor(self.last_epoch)  # torch's name for the number of calls
        return [factor * rate for rate in self.base_lrs]

    def set_steps(self, steps: int, steps_per_epoch: int) -> None:
        """Set the numbers of steps, before the first of them."""
        self.steps, self.steps_per_epoch = max(steps, 1), max(steps_per_epoch, 1)
        for group, rate in zip(self.optimizer.param_groups, self.get_lr(), strict=True):
            group["lr"] = rate

    def state_dict(self) -> dict[str, Any]:
        """Return the state without the numbers of steps, which may grow when a training is resumed."""
        lengths = ("steps", "steps_per_epoch")
        return {name: value for name, value in super().state_dict().items() if name not in lengths}


class WarmupCosine(StepSchedule):
    """Learning rate that rises over the first steps, then falls along half a cosine."""

    def __init__(
        self, optimizer: Optimizer, warmup: float = 0.1, last: float = 0.001, last_epoch: int = -1
    ) -> None:
        """Take the shape.

        Args:
            optimizer: Optimizer.
            warmup: Fraction of the steps in which the rate rises.
            last: Factor of the rate at the end.
            last_epoch: Number of steps done, less 1.
        """
        self.warmup, self.last = warmup, last
        super().__init__(optimizer, last_epoch)

    def factor(self, step: int) -> float:
        """Return the factor of the largest learning rate at a step."""
        done = min((step + 1) / self.steps, 1.0)
        if done < self.warmup:
            return done / self.warmup
        fallen = (1 - math.cos(math.pi * (done - self.warmup) / (1 - self.warmup))) / 2
        return 1 - (1 - self.last) * fallen


class StepDecay(StepSchedule):
    """Learning rate that falls by a factor after every few epochs; the defaults are the author's."""

    def __init__(
        self, optimizer: Optimizer, epochs: int = 8, gamma: float = 0.1, last_epoch: int = -1
    ) -> None:
        """Take the stages.

        Args:
            optimizer: Optimizer.
            epochs: Number of epochs of a stage.
            gamma: Factor of the rate from a stage to the next.
            last_epoch: Number of steps done, less 1.
        """
        self.epochs, self.gamma = epochs, gamma
        super().__init__(optimizer, last_epoch)

    def factor(self, step: int) -> float:
        """Return the factor of the largest learning rate at a step."""
        return float(self.gamma ** (step // (self.epochs * self.steps_per_epoch)))


class DarknetSteps(StepSchedule):
    """Learning rate of Darknet's burn-in and steps policy.

    `yolo-voc.cfg` has 80200 steps: the rate rises with the fourth power over 1000, and falls to a tenth after
    40000 and after 60000. Here these are scaled to the number of steps.
    """

    def factor(self, step: int) -> float:
        """Return the factor of the largest learning rate at a step."""
        done = (step + 1) * _DARKNET_STEPS / self.steps
        if done < 1000:
            return float((done / 1000) ** 4)
        return 0.1 ** ((done > 40_000) + (done > 60_000))


def configure_optimizers(
    module: LightningModule,
    network: nn.Module,
    optimizer: OptimizerCallable,
    lr_scheduler: LRSchedulerCallable | None,
) -> dict[str, Any]:
    """Return optimizer and schedule of a network's weights, for `LightningModule.configure_optimizers`."""
    made = optimizer(network.parameters())
    if "weight_decay" in made.defaults:  # else all weights are one group, which LBFGS needs
        made = optimizer(decay_groups(network))
    if lr_scheduler is None:
        return {"optimizer": made}
    schedule = lr_scheduler(made)
    if not isinstance(schedule, StepSchedule):
        return {"optimizer": made, "lr_scheduler": {"scheduler": schedule, "interval": "epoch"}}
    trainer = module.trainer
    trainer.fit_loop.setup_data()  # so that the number of batches is known
    steps_per_epoch = math.ceil(trainer.num_training_batches / trainer.accumulate_grad_batches)
    schedule.set_steps(int(trainer.estimated_stepping_batches), steps_per_epoch)
    return {"optimizer": made, "lr_scheduler": {"scheduler": schedule, "interval": "step"}}


def decay_groups(network: nn.Module) -> list[dict[str, Any]]:
    """Return a network's weights in two groups: vectors and biases do not decay."""
    weights = [weight for weight in network.parameters() if weight.requires_grad]
    return [
        {"params": [weight for weight in weights if weight.ndim > 1]},
        {"params": [weight for weight in weights if weight.ndim <= 1], "weight_decay": 0.0},
    ]
