"""The fusion's network, which rescores combinations of boxes: hidden layers of tanh (7.2.2)."""

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import cast

import numpy as np
import torch
from torch import Tensor, nn

from perception.detection.config import FusionVariant
from perception.detection.fusion.features import FEATURES
from perception.detection.fusion.score_calibration import FusionCalibration
from perception.errors import UsageError
from perception.types import MODALITIES, Float32
from train.checkpoints import Content, load_network
from train.fusion.config import MODEL


class RescoringMlp(nn.Module):
    """Network from (T, F) features to (T, 3) scores.

    features - to -1..1 over the training set - tanh layers - linear, in the default a sigmoid after it

    Attributes:
        variant: Features of a combination.
        is_bounded: Whether a sigmoid follows the last layer.
    """

    lows: Tensor
    scales: Tensor

    def __init__(self, variant: FusionVariant, hidden: Sequence[int]) -> None:
        """Make a network of random weights.

        Args:
            variant: Features of a combination.
            hidden: Neurons of each hidden layer.

        Raises:
            UsageError: a layer has no neurons.
        """
        super().__init__()
        if not hidden or min(hidden) < 1:
            found = ", ".join(map(str, hidden)) or "none"
            raise UsageError("hidden layers", expected="one or more neurons in each", found=found)
        self.variant = variant
        # Features outside the training set still give 0..1; the output of MATLAB's fitnet is linear.
        self.is_bounded = variant == "default"
        count = len(FEATURES[variant])
        self.register_buffer("lows", torch.zeros(count))
        self.register_buffer("scales", torch.ones(count))
        sizes = (count, *hidden, len(MODALITIES))
        self.layers = nn.ModuleList(nn.Linear(before, after) for before, after in pairwise(sizes))
        for layer in self.linear_layers:
            nn.init.xavier_normal_(layer.weight)
            nn.init.zeros_(layer.bias)

    @property
    def linear_layers(self) -> list[nn.Linear]:
        """Layers in their order."""
        return cast("list[nn.Linear]", list(self.layers))

    def fit_inputs(self, features: Float32) -> None:
        """Scale the range of each of (T, F) features to -1..1; a constant one is always -1.

        So do MATLAB's mapminmax and removeconstantrows; in scikit-learn a constant feature would keep its scale, and
        another value of it later would meet a random weight.
        """
        from sklearn.preprocessing import MinMaxScaler

        scaler = MinMaxScaler((-1, 1)).fit(features)
        scales = np.where(scaler.data_range_ > 0, scaler.scale_, 0)
        self.lows.copy_(torch.from_numpy(scaler.data_min_))
        self.scales.copy_(torch.from_numpy(scales))

    def mapped(self, features: Tensor) -> Tensor:
        """Return (T, F) features scaled for the first layer."""
        return (features - self.lows) * self.scales - 1

    def activations(self, features: Tensor) -> list[Tensor]:
        """Return the (T, V) input of each layer for (T, F) features, and the (T, 3) output."""
        *hidden, last = self.linear_layers
        values = [self.mapped(features)]
        for layer in hidden:
            values.append(torch.tanh(layer(values[-1])))
        raw = last(values[-1])
        return [*values, torch.sigmoid(raw) if self.is_bounded else raw]

    def forward(self, features: Tensor) -> Tensor:
        """Return (T, 3) scores of the boxes of (T, F) combinations."""
        return self.activations(features)[-1]


def load_fusion(checkpoint: Path) -> tuple[RescoringMlp, dict[str, str]]:
    """Return the network of a checkpoint, and the metadata of its model file.

    Raises:
        ModelError: the checkpoint is damaged, or of another network.
    """

    def make(content: Content) -> tuple[RescoringMlp, dict[str, str]]:
        found = content["hyper_parameters"]
        variant = found["variant"]
        metadata = {
            "kind": MODEL,
            "modalities": ",".join(MODALITIES),
            "features": ",".join(FEATURES[variant]),
            "hidden": ",".join(map(str, found["hidden"])),
        }
        metadata["calibration"] = content.get("calibration", str(FusionCalibration()))
        metadata["optimizer"] = found["optimizer"]["class_path"].rpartition(".")[2]
        stated = ("variant", "max_partners", "detectors", "classes")
        network = RescoringMlp(variant, found["hidden"])
        return network, metadata | {name: str(found[name]) for name in stated}

    return load_network(checkpoint, MODEL, make)
