"""Settings of the fusion's network and of its training."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from perception.detection.config import FusionVariant
from perception.errors import UsageError
from train.config import OptimizerConfig

MODEL = "fusion"  # kind of model in checkpoints and model files

FitMethod = Literal["lm", "adamw"]
_ADAMW = OptimizerConfig("adamw", 0.01, weight_decay=0.1)


@dataclass(frozen=True)
class MlpConfig:
    """Network of the fusion.

    Attributes:
        variant: Features of a combination: default, with distances, overlaps and missing detectors; features or
            scores, as in the thesis.
        hidden: Neurons of each hidden layer.
    """

    variant: FusionVariant = "default"
    hidden: tuple[int, ...] = (30,)

    def __post_init__(self) -> None:
        """Validate that each layer has neurons."""
        if not self.hidden or min(self.hidden) < 1:
            found = ", ".join(map(str, self.hidden)) or "none"
            raise UsageError("hidden layers", expected="one or more neurons in each", found=found)


@dataclass(frozen=True)
class LevenbergMarquardtConfig:
    """Parameters of Levenberg-Marquardt; defaults are those of MATLAB's trainlm.

    Attributes:
        initial_damping: Damping μ of the first step.
        decrease: Factor of the damping after a step that lowers the error.
        increase: Factor of the damping after a step that does not.
        max_damping: Damping beyond which the search stops.
        min_gradient: Norm of the gradient below which the search stops.
        max_steps: Maximum number of steps.
        patience: Steps without a lower validation error after which the search stops.
    """

    initial_damping: float = 1e-3
    decrease: float = 0.1
    increase: float = 10.0
    max_damping: float = 1e10
    min_gradient: float = 1e-7
    max_steps: int = 1000
    patience: int = 6


@dataclass(frozen=True)
class FusionFitConfig:
    """Hidden layers of the fusion's network, and how they are fitted.

    Attributes:
        hidden: Neurons of each hidden layer.
        method: Levenberg-Marquardt over all rows at once, lm; or AdamW in batches, adamw.
        lm: Parameters of Levenberg-Marquardt.
        adamw: Parameters of AdamW.
        batch_size: Combinations per batch of AdamW.
    """

    hidden: tuple[int, ...] = (32, 16)
    method: FitMethod = "adamw"
    lm: LevenbergMarquardtConfig = field(default_factory=LevenbergMarquardtConfig)
    adamw: OptimizerConfig = _ADAMW
    batch_size: int = 512

    def training(self, variant: FusionVariant) -> "FusionTrainingConfig":
        """Return the training of a network of these layers."""
        return FusionTrainingConfig(
            MlpConfig(variant, self.hidden), self.method, self.lm, self.adamw, self.batch_size
        )


@dataclass(frozen=True)
class FusionTrainingConfig:
    """Network of the fusion, and how it is fitted.

    Attributes:
        network: Network and its features.
        method: Levenberg-Marquardt over all rows at once, lm; or AdamW in batches, adamw.
        lm: Parameters of Levenberg-Marquardt.
        adamw: Parameters of AdamW.
        batch_size: Combinations per batch of AdamW.
        seed: Seed of the initial weights and of the order of the rows.
        training_data: Names of the training drives, for the model file.
        detectors: Fingerprints of the detectors, for the model file.
        class_names: Classes of the detectors, for the model file.
        revision: Revision of the program, for the model file.
    """

    network: MlpConfig = field(default_factory=MlpConfig)
    method: FitMethod = "lm"
    lm: LevenbergMarquardtConfig = field(default_factory=LevenbergMarquardtConfig)
    adamw: OptimizerConfig = _ADAMW
    batch_size: int = 512
    seed: int = 0
    training_data: str = "unknown"
    detectors: str = "unknown"
    class_names: tuple[str, ...] = ("Car",)
    revision: str = "unknown"

    @property
    def hyper_parameters(self) -> dict[str, Any]:
        """Hyperparameters that a checkpoint stores."""
        return {
            "model": MODEL,
            "variant": self.network.variant,
            "hidden": list(self.network.hidden),
            "optimiser": self.method,
            "seed": self.seed,
            "training_data": self.training_data,
            "detectors": self.detectors,
            "classes": ",".join(self.class_names),
            "revision": self.revision,
        }


# The thesis: 41 neurons on scores, 23 on all features, by Levenberg-Marquardt (7.2.2).
FUSION_VARIANTS: Mapping[FusionVariant, FusionFitConfig] = {
    "default": FusionFitConfig((32, 16), "adamw"),
    "features": FusionFitConfig((23,), "lm"),
    "scores": FusionFitConfig((41,), "lm"),
}
