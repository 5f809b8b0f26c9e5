"""Optimizers and schedules of the learning rate, as Lightning takes them."""

import math
from collections.abc import Callable
from functools import partial
from typing import Any

from lightning.pytorch import LightningModule
from torch import nn
from torch.optim import SGD, AdamW, Optimizer
from torch.optim.lr_scheduler import LambdaLR

from train.config import OptimizerConfig

_EPOCHS_PER_STAGE = 8  # of the step schedule; from the author's code


def configure_optimizers(
    module: LightningModule, network: nn.Module, config: OptimizerConfig
) -> dict[str, Any]:
    """Return optimizer and schedule of a network's weights, for `LightningModule.configure_optimizers`."""
    optimizer = make_optimizer(network, config)
    steps = int(module.trainer.estimated_stepping_batches)
    factor = learning_rate_factor(config, steps, module.trainer.max_epochs or 1)
    schedule = {"scheduler": LambdaLR(optimizer, factor), "interval": "step"}
    return {"optimizer": optimizer, "lr_scheduler": schedule}


def make_optimizer(network: nn.Module, config: OptimizerConfig) -> Optimizer:
    """Return the optimizer of a network's weights; vectors and biases do not decay."""
    weights = [weight for weight in network.parameters() if weight.requires_grad]
    groups = [
        {"params": [w for w in weights if w.ndim > 1], "weight_decay": config.weight_decay},
        {"params": [w for w in weights if w.ndim <= 1], "weight_decay": 0.0},
    ]
    if config.optimizer == "sgd":
        return SGD(groups, lr=config.learning_rate, momentum=config.momentum)
    return AdamW(groups, lr=config.learning_rate)


def learning_rate_factor(
    config: OptimizerConfig, steps: int, epochs: int = 1
) -> Callable[[int], float]:
    """Return the function from a step to the factor of the largest learning rate."""
    if config.schedule == "step":
        per_stage = _EPOCHS_PER_STAGE * max(steps // epochs, 1)
        return partial(step_decay, steps_per_stage=per_stage)
    schedule = burn_in_steps if config.schedule == "darknet" else warmup_cosine
    return partial(schedule, steps=steps)


def step_decay(step: int, steps_per_stage: int, factor: float = 0.1) -> float:
    """Return 1 in the first stage, and `factor` times less in each that follows."""
    return float(factor ** (step // max(steps_per_stage, 1)))


def warmup_cosine(step: int, steps: int, warm: float = 0.1, last: float = 0.001) -> float:
    """Return a factor that rises over the first steps, then falls along half a cosine.

    Args:
        step: Step of the training, from 0.
        steps: Number of steps of the training.
        warm: Fraction of the steps in which it rises.
        last: Factor at the end.
    """
    done = min((step + 1) / max(steps, 1), 1.0)
    if done < warm:
        return done / warm
    fallen = (1 - math.cos(math.pi * (done - warm) / (1 - warm))) / 2
    return 1 - (1 - last) * fallen


def burn_in_steps(step: int, steps: int) -> float:
    """Return the factor of Darknet's burn-in and steps policy.

    `yolo-voc.cfg` has 80200 steps: the rate rises with the fourth power over 1000, and falls after
    40000 and after 60000. Here these are scaled to the number of steps.
    """
    done = (step + 1) * 80_200 / max(steps, 1)
    if done < 1000:
        return float((done / 1000) ** 4)
    return 0.1 ** ((done > 40_000) + (done > 60_000))
