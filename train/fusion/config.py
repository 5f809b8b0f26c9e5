"""Which network of the fusion is fitted, and to what."""

from dataclasses import asdict, dataclass, field
from typing import Any, Literal

import torch

from train.fusion.levenberg_marquardt import LevenbergMarquardtConfig
from train.fusion.mlp import MODEL, MlpConfig, RescoringMlp
from train.fusion.targets import FusionRows

Optimiser = Literal["lm", "adamw"]


@dataclass(frozen=True)
class FusionTrainingConfig:
    """Which network is fitted, and how.

    Attributes:
        network_config: the network.
        optimiser: lm, Levenberg-Marquardt over all rows at once; adamw, in small steps.
        damping: of lm.
        checks: lm ends when the error on what was kept back has not fallen for so many steps.
        learning_rate: the highest of adamw.
        weight_decay: of adamw, of weights only.
        batch: combinations a step of adamw.
        seed: of the first weights and of the order of the rows.
        training_data: what it learns from, for the model file.
        detectors: that saw it, for the model file.
        revision: of the program, for the model file.
    """

    network_config: MlpConfig = field(default_factory=MlpConfig)
    optimiser: Optimiser = "lm"
    damping: LevenbergMarquardtConfig = field(default_factory=LevenbergMarquardtConfig)
    checks: int = 6
    learning_rate: float = 0.01
    weight_decay: float = 0.1
    batch: int = 512
    seed: int = 0
    training_data: str = "unknown"
    detectors: str = "unknown"
    revision: str = "unknown"

    @property
    def hyper_parameters(self) -> dict[str, Any]:
        """What a checkpoint says of it."""
        network_config = {
            "variant": self.network_config.variant,
            "hidden": list(self.network_config.hidden),
        }
        kept = ("optimiser", "seed", "training_data", "detectors", "revision")
        return {"model": MODEL, **network_config, **{name: asdict(self)[name] for name in kept}}

    def initial_network(self, training: FusionRows) -> RescoringMlp:
        """Return a network of random weights that knows the ranges of its inputs."""
        torch.manual_seed(self.seed)
        network = RescoringMlp(self.network_config)
        network.fit_inputs(training.features)
        return network


@dataclass(frozen=True)
class FusionSets:
    """What is learned from, and what is kept back to judge by."""

    training: FusionRows
    validation: FusionRows
