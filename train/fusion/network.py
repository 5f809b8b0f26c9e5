"""The fusion's networks, which rescore combinations of boxes: hidden layers of tanh (7.2.2), or naive Bayes."""

import math
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import ClassVar, cast

import numpy as np
import torch
from torch import Tensor, nn

from perception.detection.config import FusionVariant
from perception.detection.fusion.features import CLASSES, FEATURES
from perception.detection.fusion.score_calibration import FusionCalibration
from perception.errors import UsageError
from perception.types import MODALITIES, Float32
from train.checkpoints import Content, load_network
from train.fusion.config import MODEL

_MIN_SCORE = 1e-5  # of a probability whose logarithm is taken
_START_SLOPE = math.log(0.5)
# Weight of the squared distances of all weights from where they start. The error changes along some directions by next
# to no amount, and weights of rare classes would grow without an end; with it there is one minimum.
_DECAY = 1e-5


class RescoringMlp(nn.Module):
    """Network from (T, F) features to (T, 3) scores, of the thesis' variants.

    features - to -1..1 over the training set - tanh layers - linear

    Attributes:
        hidden: Neurons of each hidden layer.
        is_probability: Whether scores stay between 0 and 1.
    """

    is_probability: ClassVar[bool] = False
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
        self.hidden = tuple(hidden)
        count = len(FEATURES[variant])
        self.register_buffer("lows", torch.zeros(count))
        self.register_buffer("scales", torch.ones(count))
        sizes = (count, *hidden, len(MODALITIES))
        self.layers = nn.ModuleList(nn.Linear(before, after) for before, after in pairwise(sizes))
        for layer in self.linear_layers:
            nn.init.xavier_normal_(layer.weight)
            nn.init.zeros_(layer.bias)

    def penalty(self) -> Tensor:
        """Return what is added to the error for the size of the weights: 0."""
        return self.lows.new_zeros(())

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

    @property
    def input_range(self) -> tuple[Tensor, Tensor]:
        """(F,) smallest and largest value of each feature in the training set."""
        spans = torch.where(self.scales > 0, 2 / self.scales.clamp(min=1e-12), 0.0)
        return self.lows, self.lows + spans

    def mapped(self, features: Tensor) -> Tensor:
        """Return (T, F) features scaled for the first layer."""
        return (features - self.lows) * self.scales - 1

    def activations(self, features: Tensor) -> list[Tensor]:
        """Return the (T, V) input of each layer for (T, F) features, and the (T, 3) output."""
        *hidden, last = self.linear_layers
        values = [self.mapped(features)]
        for layer in hidden:
            values.append(torch.tanh(layer(values[-1])))
        return [*values, last(values[-1])]

    def forward(self, features: Tensor) -> Tensor:
        """Return (T, 3) scores of the boxes of (T, F) combinations."""
        return self.activations(features)[-1]


class NaiveBayes(nn.Module):
    """Network from (T, F) default features to (T, 3) scores, the same for all boxes of a combination.

    Detectors err independently, so that their evidence, in log-odds, adds up. A box is evidence that grows with its
    score s, and a modality that was searched without a box speaks against the object. Each of the sets of modalities
    that were searched has weights of its own: what a box is worth depends on what else could have found the object.

        score = sigmoid(p + sum of e)      p the prior
        e = a ln s - b ln (1 - s) + c + d     of a box: a, b, c of the modality, d of modality and class
        e = -m                                of a missing box, m of the modality

    Attributes:
        hidden: Neurons of each hidden layer: it has none.
        is_probability: Whether scores stay between 0 and 1.
    """

    bits: Tensor
    hidden: tuple[int, ...] = ()
    is_probability: ClassVar[bool] = True

    def __init__(self) -> None:
        """Make a network that takes the evidence of half of each log-odds."""
        super().__init__()
        modalities = len(MODALITIES)
        # A set's bits say which modalities it has.
        sets = 2**modalities
        self.register_buffer("bits", 2.0 ** torch.arange(modalities), persistent=False)
        # a, b and m as logarithms, so that they stay above 0.
        self.log_slopes = nn.Parameter(torch.full((sets, 2, modalities), _START_SLOPE))
        self.log_misses = nn.Parameter(torch.zeros(sets, modalities))
        self.offsets = nn.Parameter(torch.zeros(sets, modalities))
        self.class_offsets = nn.Parameter(torch.zeros(sets, len(CLASSES), modalities))
        self.prior = nn.Parameter(torch.zeros(sets, 1))

    def fit_inputs(self, features: Float32) -> None:
        """Scale nothing: scores are probabilities."""

    def penalty(self) -> Tensor:
        """Return what is added to the error for the distance of the weights from where they start."""
        others = (self.log_misses, self.offsets, self.class_offsets, self.prior)
        distances = [self.log_slopes - _START_SLOPE, *others]
        return _DECAY * torch.stack([one.square().sum() for one in distances]).sum()

    @property
    def input_range(self) -> tuple[Tensor, Tensor]:
        """(F,) smallest and largest value of each feature."""
        ones = torch.ones(len(FEATURES["default"]), dtype=self.offsets.dtype)
        return 0 * ones, ones

    def forward(self, features: Tensor) -> Tensor:
        """Return (T, 3) scores of the boxes of (T, F) combinations."""
        modalities = len(MODALITIES)
        scores, searched = features[:, :modalities], features[:, modalities : 2 * modalities]
        flags = features[:, 2 * modalities :]
        sets = ((searched > 1 / 2).to(self.bits.dtype) @ self.bits).long()
        within = scores.clamp(_MIN_SCORE, 1 - _MIN_SCORE)
        rising, falling = self.log_slopes[sets].exp().unbind(1)
        of_boxes = rising * within.log() - falling * (1 - within).log()
        of_classes = (flags[:, None] @ self.class_offsets[sets])[:, 0]
        of_boxes = of_boxes + self.offsets[sets] + of_classes
        evidence = torch.where(scores > 0, of_boxes, -searched * self.log_misses[sets].exp())
        total = self.prior[sets] + evidence.sum(dim=1, keepdim=True)
        return torch.sigmoid(total).expand(-1, modalities)


FusionNetwork = RescoringMlp | NaiveBayes


def fusion_network(variant: FusionVariant, hidden: Sequence[int]) -> FusionNetwork:
    """Return an untrained network of a variant; hidden layers are those of the thesis' variants."""
    return NaiveBayes() if variant == "default" else RescoringMlp(variant, hidden)


def load_fusion(checkpoint: Path) -> tuple[FusionNetwork, dict[str, str]]:
    """Return the network of a checkpoint, and the metadata of its model file.

    Raises:
        ModelError: the checkpoint is damaged, or of another network.
    """

    def make(content: Content) -> tuple[FusionNetwork, dict[str, str]]:
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
        network = fusion_network(variant, found["hidden"])
        return network, metadata | {name: str(found[name]) for name in stated}

    return load_network(checkpoint, MODEL, make)
