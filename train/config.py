"""Settings that all trainings share: optimizer and learning rate, devices and duration."""

from dataclasses import dataclass
from typing import Literal

from perception.errors import UsageError

Accelerator = Literal["auto", "cpu", "gpu"]
DevicePrecision = Literal["32-true", "16-mixed", "bf16-mixed"]
Precision = Literal["auto"] | DevicePrecision


@dataclass(frozen=True)
class OptimizerConfig:
    """Optimizer and schedule of the learning rate.

    Attributes:
        optimizer: Stochastic gradient descent with momentum, or AdamW.
        learning_rate: Largest learning rate.
        momentum: Momentum of SGD.
        weight_decay: Weight decay of all weights but biases and those of normalization layers.
        schedule: Cosine with a warm-up; step, a tenth after every 8 epochs; or darknet, that of yolo-voc.cfg.
        ema_decay: Decay of the exponential moving average of the weights at every step; 0 for none.
        gradient_clip_norm: Norm to which longer gradients are clipped; 0 for none.
    """

    optimizer: Literal["sgd", "adamw"] = "adamw"
    learning_rate: float = 0.002
    momentum: float = 0.9
    weight_decay: float = 0.02
    schedule: Literal["cosine", "step", "darknet"] = "cosine"
    ema_decay: float = 0.0
    gradient_clip_norm: float = 0.0


@dataclass(frozen=True)
class TrainerConfig:
    """Devices, precision and early stopping of a training.

    Attributes:
        accelerator: Device; auto uses a GPU where there is one.
        devices: Number of GPUs, or of processes on a CPU.
        nodes: Number of machines with as many devices each, started as Lightning documents for a cluster.
        precision: Number format; auto is bf16-mixed where the device has instructions for it.
        patience: Epochs without a better one after which training stops; else it runs to the end.
    """

    accelerator: Accelerator = "auto"
    devices: int = 1
    nodes: int = 1
    precision: Precision = "32-true"
    patience: int | None = None

    def __post_init__(self) -> None:
        """Validate that all numbers are positive."""
        if min(self.devices, self.nodes) < 1:
            found = f"{self.devices} devices, {self.nodes} nodes"
            raise UsageError("training", expected="at least one of each", found=found)
        if self.patience is not None and self.patience < 1:
            raise UsageError("patience", expected="at least one epoch", found=f"{self.patience}")


@dataclass(frozen=True)
class TrainingRun(TrainerConfig):
    """One training.

    Attributes:
        epochs: Number of epochs in all, those before a resume included.
        seed: Seed of weights, order and augmentation.
        fast_dev_run: Run one batch of training and validation and write nothing, to test the setup.
    """

    epochs: int = 40
    seed: int = 0
    fast_dev_run: bool = False

    def __post_init__(self) -> None:
        """Validate the number of epochs."""
        super().__post_init__()
        if self.epochs < 1:
            raise UsageError("--epochs", expected="at least 1", found=f"{self.epochs}")
