"""DepthCN's network on its way from a checkpoint to a file."""

from collections.abc import Iterable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from export.onnx import Exportable, to_onnx
from export.quantize import to_int8
from export.result import ChosenVariant, ExportConfig, ExportResult
from export.variants import compare_variants
from perception.atomic_file import write_atomically
from perception.detection.depthcn.crops import CROP_HEIGHT_PX, CROP_WIDTH_PX
from perception.detection.depthcn.detector import DepthCn
from perception.detection.depthcn.image import encode_channels
from perception.detection.depthcn.verifier import CONTRACT
from perception.detection.onnx_model import OnnxModel
from perception.errors import UsageError
from perception.maps.projection import camera_of
from perception.sensor import HDL_64E, LidarModel
from perception.types import Frame
from train.networks.depthcn import VehicleVerifier, load_verifier

Inputs = dict[str, NDArray[Any]]

# Of probabilities, and of pixels, as windows near the camera are some thousand pixels wide.
TOLERANCES = {"scores": 1e-4, "boxes_px": 0.02}
# No rows and one, which exporters often get wrong, and as many as frames have proposals.
_NOISE_ROWS = (0, 1, 2, 40)
_BLOCK_PX = 2  # divides both edges of a crop
_CALIBRATION_FRAMES = 8


class Probabilities(nn.Module):
    """A verifier that returns probabilities instead of logits."""

    def __init__(self, verifier: VehicleVerifier) -> None:
        super().__init__()
        self.verifier = verifier

    def forward(self, crops: Tensor, windows_px: Tensor) -> tuple[Tensor, Tensor]:
        """Return (M,) probabilities, (M, C) of C classes, and (M, 4) boxes in pixels."""
        logits, boxes_px = self.verifier(crops, windows_px)
        return torch.sigmoid(logits), boxes_px


def export_verifier(config: ExportConfig) -> ExportResult:
    """Make the model files of a checkpoint, and compare them on noise and on proposals of a drive.

    The scales of the 8-bit variant are calibrated on the proposals. It is for comparison alone.

    Raises:
        ModelError: the checkpoint is damaged, or of another network.
        UsageError: another size than the network's is asked for, or 8 bits without a proposal in any frame.
    """
    if config.size is not None:
        raise UsageError("size", expected="none, as crops have one size", found=str(config.size))
    exportable = exportable_verifier(config.checkpoint)
    sensor = config.drive.sensor if config.drive else HDL_64E
    models = {"fp32": to_onnx(exportable)}
    generator = np.random.default_rng(0)
    channels = exportable.inputs["crops"].shape[1]
    inputs = {"noise": [random_inputs(channels, rows, generator) for rows in _NOISE_ROWS]}
    with TemporaryDirectory() as folder:
        full = _write(models["fp32"], Path(folder, "fp32.onnx"))
        frames = config.read("candidates")
        if crop_batches := list(crop_inputs(DepthCn(full, sensor), frames, sensor)):
            inputs["candidates"] = crop_batches
        if config.int8:
            if not crop_batches:
                raise UsageError(
                    "int8", expected="candidates to find its scales with", found="none"
                )
            models["int8"] = to_int8(models["fp32"], crop_batches[:_CALIBRATION_FRAMES])
        opened = {
            name: (len(data), OnnxModel(_write(data, Path(folder, f"{name}.onnx")), CONTRACT))
            for name, data in models.items()
        }
    variants = compare_variants(exportable, opened, inputs, timed=inputs["noise"][-1])
    return ExportResult(
        metadata=dict(exportable.metadata),
        models=models,
        variants=variants,
        tolerances=TOLERANCES,
        choice=ChosenVariant(
            "fp32", "its scores are not worth giving up for the little time they take"
        ),
        timed_input=f"{_NOISE_ROWS[-1]} candidates",
    )


def exportable_verifier(checkpoint: Path) -> Exportable:
    """Return the network of a checkpoint with the metadata of its model file.

    Raises:
        ModelError: the checkpoint is damaged, or of another network.
    """
    verifier, metadata = load_verifier(checkpoint)
    channels = len(metadata["channels"].split(","))
    example = random_inputs(channels, 2, np.random.default_rng(0))
    return Exportable(
        Probabilities(verifier).eval(),
        {name: torch.from_numpy(array) for name, array in example.items()},
        outputs=("scores", "boxes_px"),
        metadata=metadata,
    )


def random_inputs(channels: int, rows: int, generator: np.random.Generator) -> Inputs:
    """Return crops of blocks of noise, and windows somewhere in an image of KITTI's size.

    Blocks, since noise of single pixels looks the same to a network everywhere.
    """
    blocks = (rows, channels, CROP_HEIGHT_PX // _BLOCK_PX, CROP_WIDTH_PX // _BLOCK_PX)
    brightness = generator.integers(0, 256, blocks, dtype=np.uint8)
    corners = generator.uniform((0, 100), (1100, 250), (rows, 2))
    sizes = generator.uniform((20, 15), (400, 240), (rows, 2))
    return {
        "crops": brightness.repeat(_BLOCK_PX, axis=2).repeat(_BLOCK_PX, axis=3),
        "windows_px": np.hstack([corners, corners + sizes]).astype(np.float32),
    }


def crop_inputs(detector: DepthCn, frames: Iterable[Frame], sensor: LidarModel) -> Iterator[Inputs]:
    """Yield the network's inputs of each frame that has proposals, by the maps that it was trained with."""
    for frame in frames:
        dense = detector.densify(frame)
        windows = detector.verify_frame(frame, dense).windows_px
        if len(windows):
            image_P_velo = camera_of(frame)[0].image_P_velo
            image = encode_channels(dense, image_P_velo, sensor.height_m)
            yield detector.verifier.inputs(image, windows)


def _write(data: bytes, file: Path) -> Path:
    write_atomically(file, data)
    return file
