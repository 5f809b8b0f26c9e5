"""The fusion's network on its way from a checkpoint to a file."""

from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import onnx
import torch
from torch import Tensor, nn

from export.forms import Form, compare_forms
from export.onnx import OPSET, Exportable, to_onnx
from perception.detection.fusion.calibration import Calibration
from perception.detection.fusion.rescoring import CONTRACT
from perception.detection.session import OnnxModel
from train.fusion.mlp import RescoringMlp, load_fusion

TOLERANCES = {"scores": 1e-4}
_ROWS = (0, 1, 2, 60)


@dataclass(frozen=True)
class ExportedFusion:
    """A network as a file, and how it compares with it.

    Attributes:
        facts: what the file says of itself.
        model: its content.
        forms: torch and the file, side by side.
        opset: of ONNX that it is written in.
    """

    facts: dict[str, str]
    model: bytes
    forms: dict[str, Form]
    opset: int = OPSET

    def require_parity(self, where: str) -> None:
        """Refuse a file that does not say what the checkpoint says.

        Raises:
            ModelError: a score is too far from it.
        """
        for parity in self.forms["fp32"].parity.values():
            parity.require(TOLERANCES, where)


class NamedScores(nn.Module):
    """A network with a list of outputs, as files have it."""

    def __init__(self, network: RescoringMlp) -> None:
        super().__init__()
        self.network = network

    def forward(self, features: Tensor) -> tuple[Tensor]:
        """Return (T, 3) scores."""
        return (self.network(features),)


def export_fusion(checkpoint: Path) -> ExportedFusion:
    """Make the file of a checkpoint, and show it and the checkpoint the same features.

    Raises:
        ModelError: the checkpoint is damaged, or of another network.
    """
    network, facts = load_fusion(checkpoint)
    rng = np.random.default_rng(0)
    lows, scales = network.lows.numpy(), network.scales.numpy()
    spans = np.where(scales > 0, 2 / np.where(scales > 0, scales, 1), 0)
    # Within the range of what it learned from, and a little beyond.
    batches = [
        {"features": (lows + spans * rng.uniform(-0.1, 1.1, (n, len(lows)))).astype(np.float32)}
        for n in _ROWS
    ]
    example = {"features": torch.from_numpy(batches[2]["features"])}
    exportable = Exportable(NamedScores(network).eval(), example, ("scores",), facts)
    model = to_onnx(exportable)
    with TemporaryDirectory() as folder:
        file = Path(folder, "fusion.onnx")
        file.write_bytes(model)
        opened = {"fp32": (len(model), OnnxModel(file, CONTRACT))}
        forms = compare_forms(exportable, opened, {"features": batches}, timed=batches[-1])
    return ExportedFusion(dict(facts), model, forms)


def with_calibration(model: bytes, calibration: Calibration) -> bytes:
    """Return the same file with another curve from its scores to probabilities."""
    loaded = onnx.load_from_string(model)
    facts = {entry.key: entry.value for entry in loaded.metadata_props}
    onnx.helper.set_model_props(loaded, facts | {"calibration": str(calibration)})
    return bytes(loaded.SerializeToString())
