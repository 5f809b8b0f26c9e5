"""Settings of the training of DepthCN's network (7.2.1)."""

from collections.abc import Mapping
from dataclasses import dataclass

from data.samples.config import TrainingDrives
from data.samples.crops.config import CropDataConfig
from perception.types import Method
from train.config import OptimizerConfig

_SGD = OptimizerConfig("sgd", 0.05, weight_decay=0.0005)


@dataclass(frozen=True)
class VerifierTrainingConfig:
    """Network of DepthCN, and how it is trained.

    Attributes:
        method: Network: default, or thesis for that of Fig. 6.5.
        optimizer: Optimizer and learning rate.
        box_weight: Weight of the loss of boxes beside that of classes.
        training_data: Names of the training drives, for the model file.
        revision: Revision of the program, for the model file.
    """

    method: Method = "default"
    optimizer: OptimizerConfig = _SGD
    box_weight: float = 1.0
    training_data: str = "unknown"
    revision: str = "unknown"


VERIFIER_CONFIGS: Mapping[Method, VerifierTrainingConfig] = {
    "default": VerifierTrainingConfig(),
    # 7.2.1; learning rate, its steps and weight decay are those of the author's code.
    "thesis": VerifierTrainingConfig(
        "thesis",
        OptimizerConfig("sgd", 0.001, weight_decay=0.004, schedule="step"),
        box_weight=0.0,
    ),
}


@dataclass(frozen=True)
class VerifierExperiment:
    """All settings of the training of DepthCN's network, which `config.yaml` records.

    Attributes:
        drives: Labelled drives.
        network: Network, and how it is trained.
        data: Split, batches, sampling and augmentation.
    """

    drives: TrainingDrives
    network: VerifierTrainingConfig
    data: CropDataConfig
