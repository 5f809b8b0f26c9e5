"""The network that rescores combinations of boxes: one or two hidden layers of tanh (7.2.2)."""

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import torch
from torch import Tensor, nn

from perception.detection.config import FusionVariant
from perception.detection.fusion.features import FEATURES
from perception.detection.fusion.score_calibration import FusionCalibration
from perception.errors import ModelError, UsageError
from perception.types import MODALITIES, Float32
from train.checkpoints import read_checkpoint, weights_of

MODEL = "fusion"  # what the checkpoints say that they are of


@dataclass(frozen=True)
class MlpConfig:
    """Which network.

    Attributes:
        variant: what it is told of a combination.
        hidden: sizes of the hidden layers.
    """

    variant: FusionVariant = "default"
    hidden: tuple[int, ...] = (30,)

    def __post_init__(self) -> None:
        """Refuse layers that are none."""
        if not self.hidden or min(self.hidden) < 1:
            found = ", ".join(map(str, self.hidden)) or "none"
            raise UsageError("hidden layers", expected="one or more neurons in each", found=found)


class RescoringMlp(nn.Module):
    """From (T, F) features to (T, 3) expected IoU.

    features - to -1..1 over the training set - tanh layers - linear, in the default a sigmoid after it
    """

    lows: Tensor
    scales: Tensor

    def __init__(self, network_config: MlpConfig) -> None:
        super().__init__()
        count = len(FEATURES[network_config.variant])
        self.network_config = network_config
        self.register_buffer("lows", torch.zeros(count))
        self.register_buffer("scales", torch.ones(count))
        sizes = (count, *network_config.hidden)
        self.hidden = nn.ModuleList(nn.Linear(before, after) for before, after in pairwise(sizes))
        self.last = nn.Linear(sizes[-1], len(MODALITIES))
        for layer in (*self.hidden, self.last):
            nn.init.xavier_normal_(layer.weight)
            nn.init.zeros_(layer.bias)

    def fit_inputs(self, features: Float32) -> None:
        """Map the range of each of (T, F) features to -1..1; one that never changes, to -1."""
        lows, highs = features.min(axis=0), features.max(axis=0)
        spans = torch.from_numpy(highs - lows)
        self.lows.copy_(torch.from_numpy(lows))
        self.scales.copy_(torch.where(spans > 0, 2 / spans.clamp(min=1e-12), 0.0))

    def mapped(self, features: Tensor) -> Tensor:
        """Return (T, F) features as the first layer takes them."""
        return (features - self.lows) * self.scales - 1

    def forward(self, features: Tensor) -> Tensor:
        """Return (T, 3) expected IoU of the boxes of (T, F) combinations."""
        values = self.mapped(features)
        for layer in self.hidden:
            values = torch.tanh(layer(values))
        raw: Tensor = self.last(values)
        # What no training set holds shall still be between 0 and 1; fitnet's output is linear.
        return torch.sigmoid(raw) if self.network_config.variant == "default" else raw


def load_fusion(checkpoint: Path) -> tuple[RescoringMlp, dict[str, str]]:
    """Return the network of a checkpoint, and what its file shall say of it.

    Raises:
        ModelError: the checkpoint is damaged, or of another network.
    """
    content = read_checkpoint(checkpoint, MODEL)
    hyper_parameters = content["hyper_parameters"]
    network_config = MlpConfig(hyper_parameters["variant"], tuple(hyper_parameters["hidden"]))
    network = RescoringMlp(network_config)
    try:
        network.load_state_dict(weights_of(content, "network"))
    except RuntimeError as error:
        raise ModelError(
            checkpoint, expected=f"weights of {network_config}", found="those of another network"
        ) from error
    metadata = {
        "kind": MODEL,
        "modalities": ",".join(MODALITIES),
        "variant": network_config.variant,
        "features": ",".join(FEATURES[network_config.variant]),
        "hidden": ",".join(map(str, network_config.hidden)),
        "calibration": content.get("calibration", str(FusionCalibration())),
        "optimiser": str(hyper_parameters["optimiser"]),
        "training_data": str(hyper_parameters["training_data"]),
        "detectors": str(hyper_parameters["detectors"]),
        "revision": str(hyper_parameters["revision"]),
        "epochs": str(content["epoch"] + 1),
    }
    return network.eval(), metadata
