"""Settings of the fusion's network and of its training."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from data.detections.config import DetectorModelPaths, FusionDataConfig
from data.samples.config import TrainingDrives
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

    def __post_init__(self) -> None:
        """Validate the layers."""
        MlpConfig(hidden=self.hidden)


@dataclass(frozen=True)
class FusionTrainingConfig(FusionFitConfig):
    """Network of the fusion, how it is fitted, and what its model file states.

    Attributes:
        variant: Features of a combination.
        seed: Seed of the initial weights and of the order of the rows.
        training_data: Names of the training drives, for the model file.
        detectors: Fingerprints of the detectors, for the model file.
        class_names: Classes of the detectors, for the model file.
        revision: Revision of the program, for the model file.
    """

    variant: FusionVariant = "default"
    seed: int = 0
    training_data: str = "unknown"
    detectors: str = "unknown"
    class_names: tuple[str, ...] = ("Car",)
    revision: str = "unknown"

    @property
    def network(self) -> MlpConfig:
        """Network and its features."""
        return MlpConfig(self.variant, self.hidden)

    @property
    def hyper_parameters(self) -> dict[str, Any]:
        """Hyperparameters that a checkpoint stores."""
        return {
            "model": MODEL,
            "variant": self.variant,
            "hidden": list(self.hidden),
            "optimiser": self.method,
            "seed": self.seed,
            "training_data": self.training_data,
            "detectors": self.detectors,
            "classes": ",".join(self.class_names),
            "revision": self.revision,
        }


@dataclass(frozen=True)
class FusionExperiment:
    """All settings of the training of the fusion, which `config.yaml` records.

    Attributes:
        drives: Labelled drives that no detector was trained on.
        training: Network, and how it is fitted.
        models: Model files of the detectors.
        data: Split and cache.
        sweep: Numbers of neurons of one hidden layer to try; the best of all sizes is taken.
        sweep_two: Numbers of neurons of two hidden layers, of which all falling pairs are tried.
    """

    drives: TrainingDrives
    training: FusionTrainingConfig
    models: DetectorModelPaths
    data: FusionDataConfig
    sweep: tuple[int, ...] = ()
    sweep_two: tuple[int, ...] = ()


# The thesis: 41 neurons on scores, 23 on all features, by Levenberg-Marquardt (7.2.2).
FUSION_VARIANTS: Mapping[FusionVariant, FusionFitConfig] = {
    "default": FusionFitConfig((32, 16), "adamw"),
    "features": FusionFitConfig((23,), "lm"),
    "scores": FusionFitConfig((41,), "lm"),
}
