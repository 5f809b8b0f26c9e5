"""How the weights of a detector go down: by which steps, at which rate."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Literal

from torch import nn
from torch.optim import SGD, AdamW, Optimizer

from train.detector.losses import DetectionLossConfig
from train.schedules import burn_in_steps, warmup_cosine

Preset = Literal["default", "thesis"]


@dataclass(frozen=True)
class OptimizerConfig:
    """A way down.

    Attributes:
        optimizer: stochastic gradient descent, or Adam with decoupled decay.
        learning_rate: the highest.
        momentum: of SGD.
        weight_decay: of the weights of convolutions only.
        schedule: `cosine` a short rise and a long fall, `published` that of `yolo-voc.cfg`.
        ema_decay: share that the running mean of the weights keeps at every step; 0 takes the last ones.
        gradient_clip_norm: longer ones are cut to this length; 0 leaves them.
    """

    optimizer: Literal["sgd", "adamw"] = "adamw"
    learning_rate: float = 0.002
    momentum: float = 0.9
    weight_decay: float = 0.02
    schedule: Literal["cosine", "published"] = "cosine"
    ema_decay: float = 0.998
    gradient_clip_norm: float = 20.0

    def make_optimizer(self, network: nn.Module) -> Optimizer:
        """Return the steps of a network's weights."""
        weights = [weight for weight in network.parameters() if weight.requires_grad]
        groups = [
            {"params": [w for w in weights if w.ndim > 1], "weight_decay": self.weight_decay},
            {"params": [w for w in weights if w.ndim <= 1], "weight_decay": 0.0},
        ]
        if self.optimizer == "sgd":
            return SGD(groups, lr=self.learning_rate, momentum=self.momentum)
        return AdamW(groups, lr=self.learning_rate)

    def learning_rate_factor(self, steps: int) -> Callable[[int], float]:
        """Return the function from the number of a step to its share of the highest rate."""
        schedule = burn_in_steps if self.schedule == "published" else warmup_cosine
        return partial(schedule, steps=steps)


@dataclass(frozen=True)
class TrainingPreset:
    """All that a word stands for.

    Attributes:
        optimizer_config: the way down.
        loss: what it makes small.
        batch_size: pictures a step.
    """

    optimizer_config: OptimizerConfig = field(default_factory=OptimizerConfig)
    loss: DetectionLossConfig = field(default_factory=DetectionLossConfig)
    batch_size: int = 16


PRESETS: dict[Preset, TrainingPreset] = {
    "default": TrainingPreset(
        OptimizerConfig(), DetectionLossConfig(box="ciou", objectness="focal", box_weight=2.0)
    ),
    # 7.2.2: 80200 iterations with these figures; they are those of yolo-voc.cfg, and so its schedule.
    "thesis": TrainingPreset(
        OptimizerConfig("sgd", 0.001, 0.9, 0.0005, "published", ema_decay=0, gradient_clip_norm=0),
        DetectionLossConfig(),
        batch_size=64,
    ),
}
