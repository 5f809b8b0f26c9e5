"""The networks that classify proposals and regress their boxes: that of the thesis, and the default.

Both take M crops of 66 x 112 pixels with values 0..255 as `perception.detection.depthcn.image` makes them,
and the windows (M, 4) that they were cut from; both return M logits of a vehicle, or (M, C) of several classes, and M boxes in pixels.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor, nn
from torchvision.ops import Conv2dNormActivation  # type: ignore[import-untyped]

from perception.detection.depthcn.crops import CROP_HEIGHT_PX, CROP_WIDTH_PX, WindowKind
from perception.detection.depthcn.image import CHANNELS
from perception.detection.depthcn.verifier import CONTRACT, KIND
from perception.errors import UsageError
from perception.types import Method
from train.checkpoints import Content, load_network

MODEL = KIND  # kind of model in checkpoints and model files


class VehicleVerifier(nn.Module, ABC):
    """Base of both networks."""

    @abstractmethod
    def heads(self, crops: Tensor) -> tuple[Tensor, Tensor]:
        """Return (M,) logits, (M, C) of C classes, and (M, 4) boxes x1 y1 x2 y2 as shares of the window."""

    def forward(self, crops: Tensor, windows_px: Tensor) -> tuple[Tensor, Tensor]:
        """Return (M,) logits, (M, C) of C classes, and (M, 4) boxes in pixels of the image.

        Args:
            crops: (M, C, 66, 112) crops, uint8 or float, 0..255.
            windows_px: (M, 4) x1 y1 x2 y2 of the crops in the image.
        """
        logits, shares = self.heads(crops)
        origin_px = windows_px[:, :2]
        size_px = windows_px[:, 2:] - origin_px
        return logits, origin_px.repeat(1, 2) + shares * size_px.repeat(1, 2)


class ThesisVerifier(VehicleVerifier):
    """Fig. 6.5: two convolutions with pooling, two full layers; the window is the box.

    depth 1 x 66 x 112 - conv 32 - pool 32 x 32 x 55 - conv 64 - pool 64 x 15 x 27 - 64 - 2
    """

    mean_image: Tensor

    def __init__(self, dropout: float = 0.5) -> None:
        """Build it with the first weights of the author's code.

        Args:
            dropout: Fraction of the units that are dropped before the last layer in training; half of them in the
                thesis (7.2.1), none in the author's code.
        """
        super().__init__()
        # Subtracted first: the mean image of the training set.
        self.register_buffer("mean_image", torch.zeros(1, CROP_HEIGHT_PX, CROP_WIDTH_PX))
        self.features = nn.Sequential(
            nn.Conv2d(1, 32, 5, padding=2),
            nn.ReLU(),
            nn.MaxPool2d(3, 2),
            nn.Conv2d(32, 64, 5, padding=2),
            nn.ReLU(),
            nn.MaxPool2d(3, 2),
        )
        self.classifier = nn.Sequential(
            nn.Flatten(),
            nn.Linear(64 * 15 * 27, 64),
            nn.ReLU(),
            nn.Dropout(dropout),
            nn.Linear(64, 2),
        )
        self._set_first_weights()

    def _set_first_weights(self) -> None:
        """Draw weights as the author's code does: N(0, 0.0001²) in the first layer, 0.01² after it."""
        layers = [layer for layer in self.modules() if isinstance(layer, nn.Conv2d | nn.Linear)]
        for number, layer in enumerate(layers):
            nn.init.normal_(layer.weight, std=0.01 if number else 0.0001)
            if layer.bias is not None:
                nn.init.zeros_(layer.bias)

    def heads(self, crops: Tensor) -> tuple[Tensor, Tensor]:
        """Return the logits, and the whole window as the box."""
        classes = self.classifier(self.features(crops.float() - self.mean_image))
        whole = torch.tensor((0.0, 0.0, 1.0, 1.0), device=crops.device)
        # The softmax of two outputs is the sigmoid of their difference.
        return classes[:, 1] - classes[:, 0], whole.expand(crops.shape[0], 4)

    def forward(self, crops: Tensor, windows_px: Tensor) -> tuple[Tensor, Tensor]:
        """Return (M,) logits and the windows themselves."""
        return self.heads(crops)[0], windows_px


class DefaultVerifier(VehicleVerifier):
    """The default: light, with batch norm; also regresses the vehicle's box."""

    # (filters, stride) of the 3 x 3 convolutions, and the units of the full layer. Where filters are many,
    # convolutions split into places and channels: a third of the time.
    _WHOLE = ((16, 2), (32, 2))
    _SEPARABLE = ((48, 1), (64, 2), (96, 1), (128, 2))
    _UNITS = 64
    # Initial box: the middle of the window's lower half.
    _FIRST_BOX = (0.3, 0.45, 0.7, 0.85)

    def __init__(self, dropout: float = 0.2, class_count: int = 1) -> None:
        """Build it with random weights.

        Args:
            dropout: Fraction of the units that are dropped before the last layer in training.
            class_count: Number of classes.
        """
        super().__init__()
        self.around = RelativeDepthEncoding()
        blocks, before = [], len(CHANNELS)
        for filters, stride in self._WHOLE:
            blocks.append(Conv2dNormActivation(before, filters, stride=stride))
            before = filters
        for filters, stride in self._SEPARABLE:
            blocks += [
                Conv2dNormActivation(before, before, stride=stride, groups=before),
                Conv2dNormActivation(before, filters, 1),
            ]
            before = filters
        self.features = nn.Sequential(*blocks, nn.Flatten())
        self.full = nn.Sequential(
            nn.Linear(before * 5 * 7 + 1, self._UNITS, bias=False),
            nn.BatchNorm1d(self._UNITS),
            nn.ReLU(),
            nn.Dropout(dropout),
        )
        self.vehicle = nn.Linear(self._UNITS, class_count)
        self.box = nn.Linear(self._UNITS, 4)
        nn.init.normal_(self.box.weight, std=0.01)
        with torch.no_grad():
            self.box.bias.copy_(torch.tensor(self._FIRST_BOX))

    def heads(self, crops: Tensor) -> tuple[Tensor, Tensor]:
        """Return logits, and (M, 4) shares of the window, which may lie outside 0..1."""
        channels, distance = self.around(crops)
        features = self.full(torch.cat((self.features(channels), distance), dim=1))
        logits = self.vehicle(features)
        return logits if logits.shape[1] > 1 else logits[:, 0], self.box(features)


class RelativeDepthEncoding(nn.Module):
    """Normalization of 8-bit crops: every channel from -1 to 1, depth relative to the object's.

    depth         how far behind the middle of the window, 8 m to both sides; unknown pixels come out nearest
    height        as it is, unknown pixels -1
    reflectance   as it is

    Encoded depths are linear in inverse depth (6.2), so that one factor and one offset a channel and
    crop suffice.
    """

    _RANGE_M = 8.0
    _MIDDLE = (..., slice(30, 54), slice(48, 64))

    def forward(self, crops: Tensor) -> tuple[Tensor, Tensor]:
        """Return (M, 3, H, W) normalized channels of (M, 3, H, W) crops of 0..255, and (M, 1) distances."""
        # Cut before it is converted, since that is a pass over all pixels.
        middle = crops[self._MIDDLE].float()
        depth, height = middle[:, 0], middle[:, 1]
        known = (height > 0).float()  # heights are 1..255
        mean = (depth * known).sum((1, 2)) / known.sum((1, 2)).clamp(min=1)
        distance_m = 400 / (80 - 75 / 255 * mean)
        # The derivative of (6.2)'s inverse: metres that one step of the encoding stands for.
        step_m = distance_m**2 * (75 / 400 / 255)
        factor = step_m / self._RANGE_M
        even = torch.full_like(factor, 2 / 255)
        factors = torch.stack((factor, even, even), dim=1)[..., None, None]
        offsets = torch.stack((-factor * mean, even * 0 - 1, even * 0 - 1), dim=1)[..., None, None]
        return (crops.float() * factors + offsets).clamp(-1, 1), distance_m[:, None] / 80


@dataclass(frozen=True)
class VerifierInputConfig:
    """Input of a network.

    Attributes:
        channels: Channels of the input image, names of `CHANNELS`.
        window: Part of the image around a proposal that is cropped.
    """

    channels: tuple[str, ...]
    window: WindowKind


VERIFIER_INPUTS: dict[Method, VerifierInputConfig] = {
    "default": VerifierInputConfig(CHANNELS, "metric"),
    "thesis": VerifierInputConfig(CHANNELS[:1], "box"),
}


def make_verifier(
    method: Method, dropout: float | None = None, class_count: int = 1
) -> VehicleVerifier:
    """Return an untrained network.

    Args:
        method: Method of the network.
        class_count: Number of classes that it tells apart; one of the thesis.
        dropout: Fraction of the units that are dropped before the last layer in training; else the network's own.

    Raises:
        UsageError: it is no such fraction, or there are no classes, or several of the thesis' network.
    """
    if dropout is not None and not 0 <= dropout < 1:
        raise UsageError("dropout", expected="a fraction from 0 to below 1", found=f"{dropout:g}")
    if class_count < 1 or (method == "thesis" and class_count > 1):
        expected = "Car alone" if method == "thesis" else "one or several"
        raise UsageError(f"classes of {method}", expected=expected, found=f"{class_count} classes")
    given = {} if dropout is None else {"dropout": dropout}
    if method == "thesis":
        return ThesisVerifier(**given)
    return DefaultVerifier(**given, class_count=class_count)


def object_logits(logits: Tensor) -> Tensor:
    """Return (M,) logits of an object of any class: the largest of (M, C)."""
    return logits if logits.ndim == 1 else logits.amax(1)


def load_verifier(checkpoint: Path) -> tuple[VehicleVerifier, dict[str, str]]:
    """Return a trained network in evaluation mode, and the metadata of its model file.

    Raises:
        ModelError: where the checkpoint is damaged, or of another network.
    """

    def make(content: Content) -> tuple[VehicleVerifier, dict[str, str]]:
        method: Method = content["hyper_parameters"]["method"]
        classes = content["hyper_parameters"]["classes"]
        inputs = VERIFIER_INPUTS[method]
        channels = ",".join(inputs.channels)
        metadata = {"method": method, "window": inputs.window, "channels": channels}
        metadata["classes"] = ",".join(classes)
        network = make_verifier(method, class_count=len(classes))
        return network, dict(CONTRACT.metadata) | metadata

    return load_network(checkpoint, MODEL, make)
