"""The fusion's network, which rescores combinations of boxes: hidden layers of tanh (7.2.2)."""

from itertools import pairwise
from pathlib import Path

import torch
from torch import Tensor, nn

from perception.detection.fusion.features import FEATURES
from perception.detection.fusion.score_calibration import FusionCalibration
from perception.types import MODALITIES, Float32
from train.checkpoints import Content, load_network
from train.fusion.config import MODEL, FusionTrainingConfig, MlpConfig


class RescoringMlp(nn.Module):
    """Network from (T, F) features to (T, 3) expected IoU.

    features - to -1..1 over the training set - tanh layers - linear, in the default a sigmoid after it
    """

    lows: Tensor
    scales: Tensor

    def __init__(self, config: MlpConfig) -> None:
        super().__init__()
        count = len(FEATURES[config.variant])
        self.config = config
        self.register_buffer("lows", torch.zeros(count))
        self.register_buffer("scales", torch.ones(count))
        sizes = (count, *config.hidden)
        self.hidden = nn.ModuleList(nn.Linear(before, after) for before, after in pairwise(sizes))
        self.last = nn.Linear(sizes[-1], len(MODALITIES))
        for layer in (*self.hidden, self.last):
            nn.init.xavier_normal_(layer.weight)
            nn.init.zeros_(layer.bias)

    def fit_inputs(self, features: Float32) -> None:
        """Scale the range of each of (T, F) features to -1..1; a constant one to -1."""
        lows, highs = features.min(axis=0), features.max(axis=0)
        spans = torch.from_numpy(highs - lows)
        self.lows.copy_(torch.from_numpy(lows))
        self.scales.copy_(torch.where(spans > 0, 2 / spans.clamp(min=1e-12), 0.0))

    def mapped(self, features: Tensor) -> Tensor:
        """Return (T, F) features scaled for the first layer."""
        return (features - self.lows) * self.scales - 1

    def forward(self, features: Tensor) -> Tensor:
        """Return (T, 3) expected IoU of the boxes of (T, F) combinations."""
        values = self.mapped(features)
        for layer in self.hidden:
            values = torch.tanh(layer(values))
        raw: Tensor = self.last(values)
        # Features outside the training set still give 0..1; the output of MATLAB's fitnet is linear.
        return torch.sigmoid(raw) if self.config.variant == "default" else raw


def initial_network(config: FusionTrainingConfig, features: Float32) -> RescoringMlp:
    """Return a network of random weights, with inputs scaled to the range of (T, F) features."""
    torch.manual_seed(config.seed)
    network = RescoringMlp(config.network)
    network.fit_inputs(features)
    return network


def load_fusion(checkpoint: Path) -> tuple[RescoringMlp, dict[str, str]]:
    """Return the network of a checkpoint, and the metadata of its model file.

    Raises:
        ModelError: the checkpoint is damaged, or of another network.
    """

    def make(content: Content) -> tuple[RescoringMlp, dict[str, str]]:
        found = content["hyper_parameters"]
        config = MlpConfig(found["variant"], tuple(found["hidden"]))
        metadata = {
            "kind": MODEL,
            "modalities": ",".join(MODALITIES),
            "variant": config.variant,
            "features": ",".join(FEATURES[config.variant]),
            "hidden": ",".join(map(str, config.hidden)),
            "calibration": content.get("calibration", str(FusionCalibration())),
        }
        stated = {name: found[name] for name in ("optimiser", "detectors", "classes")}
        return RescoringMlp(config), metadata | stated

    return load_network(checkpoint, MODEL, make)
