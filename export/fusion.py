"""The fusion's network on its way from a checkpoint to a file."""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import torch

from export.onnx import Exportable, to_onnx
from export.result import ChosenVariant, ExportConfig, ExportResult
from export.variants import compare_variants
from perception.atomic_file import write_atomically
from perception.detection.fusion.rescoring import CONTRACT
from perception.detection.onnx_model import OnnxModel
from perception.errors import UsageError
from train.fusion.network import load_fusion

TOLERANCES = {"scores": 1e-4}
_ROWS = (0, 1, 2, 60)


def export_fusion(config: ExportConfig) -> ExportResult:
    """Make the file of a checkpoint, and show it and the checkpoint the same features.

    Its scores are calibrated where the training has calibrated them on held-out detections.

    Raises:
        ModelError: the checkpoint is damaged, or of another network.
        UsageError: an input size or 8 bits are asked for.
    """
    if config.int8 or config.size is not None:
        raise UsageError(
            "fusion", expected="neither --int8 nor --size, as it takes no images", found="one"
        )
    network, metadata = load_fusion(config.checkpoint)
    rng = np.random.default_rng(0)
    lows, highs = (one.numpy() for one in network.input_range)
    spans = highs - lows
    # Within the range of the training features, and a little beyond.
    batches = [
        {"features": (lows + spans * rng.uniform(-0.1, 1.1, (n, len(lows)))).astype(np.float32)}
        for n in _ROWS
    ]
    example = {"features": torch.from_numpy(batches[2]["features"])}
    exportable = Exportable(network.eval(), example, tuple(TOLERANCES), metadata)
    model = to_onnx(exportable)
    with TemporaryDirectory() as folder:
        file = Path(folder, "fusion.onnx")
        write_atomically(file, model)
        opened = {"fp32": (len(model), OnnxModel(file, CONTRACT))}
        variants = compare_variants(exportable, opened, {"features": batches}, timed=batches[-1])
    return ExportResult(
        metadata=dict(metadata),
        models={"fp32": model},
        variants=variants,
        tolerances=TOLERANCES,
        choice=ChosenVariant("fp32", "no other form is of use to so small a network"),
        timed_input=f"{_ROWS[-1]} combinations",
    )
