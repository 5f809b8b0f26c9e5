"""A detector of one modality on its way from a checkpoint to a file, in the form that serves best."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple, get_args

import numpy as np
import torch
from torch import Tensor, nn

from export.onnx import Exportable, to_onnx
from export.quantize import QuantizationConfig, Scales, to_int8
from export.result import ChosenVariant, ExportConfig, ExportResult
from export.variants import Arrays, ModelVariant, Network, compare_variants, torch_runner
from perception.atomic_file import write_atomically
from perception.detection.detectors.input_size import SIZE_STEP_PX, InputSize
from perception.detection.detectors.modalities import modality_image
from perception.detection.detectors.modality_detector import ModalityDetector
from perception.errors import UsageError
from perception.evaluation.detection.box_rows import DetectedBoxes, TrueBoxes
from perception.types import Detections, Labels, UInt8
from train.detector.metrics import measure, precision_table
from train.detector.networks import load_detector
from train.networks.yolo_detector import YoloDetector

# Of probabilities, and of pixels, as boxes may be as large as the image.
TOLERANCES = {"scores": 1e-4, "boxes_px": 0.05}
# What flows from convolution to convolution must not leave the integers on its way. The first convolution
# has too few channels for their kernels: as it is, it is faster, and no 0.3 points of precision are lost on
# it. So is the last: 8 bits would quantize the centres of boxes to a coarse fraction of a cell.
QUANTIZATION = QuantizationConfig(
    layers=("Conv", "Relu", "LeakyRelu", "Add", "Resize", "MaxPool", "Concat"), ends="Conv"
)
FP32, INT8 = "fp32", "int8"
_MAX_LOST = 1.0  # points of average precision in percent, moderate, that 8 bits may cost
_NOISE_ROWS = (1, 2, 3)
_BLOCK_PX = 8  # divides every size; noise of single pixels looks the same to a network everywhere
_CALIBRATION_FRAMES = 32
_COMPARED_FRAMES = 8
Precision = dict[str, dict[str, float]]


class DecodedDetector(nn.Module):
    """A detector that returns boxes and scores instead of raw predictions."""

    def __init__(self, detector: YoloDetector) -> None:
        super().__init__()
        self.detector = detector

    def forward(self, images: Tensor) -> tuple[Tensor, Tensor]:
        """Return (rows, K, 4) boxes in pixels of the input and (rows, K, classes) scores."""
        decoded = self.detector.decode(self.detector(images))
        return decoded.boxes_px, decoded.scores


def export_detector(config: ExportConfig) -> ExportResult:
    """Make the model files of a checkpoint, compare all variants on the same images, and choose one.

    Raises:
        ModelError: the checkpoint is damaged, or of another network.
        UsageError: 8 bits without a drive.
        PerceptionError: a frame of the drive lacks what the modality needs.
    """
    if config.int8 and config.drive is None:
        raise UsageError("int8", expected="a drive to find its scales with", found="none")
    exportable = exportable_detector(config.checkpoint, config.size)
    shape = tuple(exportable.inputs["images"].shape[1:])
    models = {FP32: to_onnx(exportable)}
    generator = np.random.default_rng(0)
    inputs: dict[str, list[Arrays]] = {
        "noise": [{"images": random_images(rows, shape, generator)} for rows in _NOISE_ROWS]
    }
    with TemporaryDirectory() as folder:
        opened = {FP32: _open(models[FP32], Path(folder, "fp32.onnx"))}
        if images := list(_inputs(config, opened[FP32])):
            inputs["images"] = images[:_COMPARED_FRAMES]
        for scales in _scales_to_try(config):
            name = f"{INT8} {scales}"
            models[name] = to_int8(models[FP32], images, replace(QUANTIZATION, scales=scales))
            opened[name] = _open(models[name], Path(folder, f"{scales}.onnx"))
    variants = compare_variants(
        exportable,
        {name: (len(models[name]), detector.model) for name, detector in opened.items()},
        inputs,
        timed=inputs["noise"][0],
    )
    networks = {name: detector.model for name, detector in opened.items()}
    precision = measure_variants(
        config, {"torch": torch_runner(exportable)} | networks, opened[FP32]
    )
    variants = {
        name: replace(variant, precision=precision.get(name, {}))
        for name, variant in variants.items()
    }
    int8_name = best_int8(variants)
    return ExportResult(
        metadata=dict(exportable.metadata),
        models={name: data for name, data in models.items() if name in (FP32, int8_name)},
        variants=variants,
        tolerances=TOLERANCES,
        choice=choose(variants, int8_name),
        timed_input="one image on one thread",
    )


def exportable_detector(checkpoint: Path, size: InputSize | None = None) -> Exportable:
    """Return the network of a checkpoint with the metadata of its model file.

    Args:
        checkpoint: Checkpoint of a training.
        size: Size of the input of the model file; None for that of the training. A network finds objects of
            the sizes in pixels that it was trained on, so anchors stay as they are.

    Raises:
        ModelError: the checkpoint is damaged, or of another network.
    """
    return exportable_network(*load_detector(checkpoint), size)


def exportable_network(
    detector: YoloDetector, metadata: Mapping[str, str], size: InputSize | None = None
) -> Exportable:
    """Return a network with the metadata of its model file; size as of `exportable_detector`."""
    size = size or InputSize(int(metadata["input_height"]), int(metadata["input_width"]))
    sides = {"input_height": str(size.height_px), "input_width": str(size.width_px)}
    example = random_images(2, (detector.channels, *size), np.random.default_rng(0))
    return Exportable(
        DecodedDetector(detector).eval(),
        {"images": torch.from_numpy(example)},
        outputs=("boxes_px", "scores"),
        metadata={**metadata, **sides},
        side_step=SIZE_STEP_PX,
    )


def random_images(rows: int, shape: tuple[int, ...], generator: np.random.Generator) -> UInt8:
    """Return (rows, C, h, w) images of blocks of noise for a shape (C, h, w)."""
    channels, height, width = shape
    blocks = (rows, channels, height // _BLOCK_PX, width // _BLOCK_PX)
    brightness = generator.integers(0, 256, blocks, dtype=np.uint8)
    return brightness.repeat(_BLOCK_PX, axis=2).repeat(_BLOCK_PX, axis=3)


def best_int8(variants: Mapping[str, ModelVariant]) -> str | None:
    """Name the 8-bit form that sees best, the first of several; None where there is none."""
    names = [name for name in variants if name.startswith(INT8)]
    return max(names, key=lambda name: moderate(variants[name]), default=None)


def choose(variants: Mapping[str, ModelVariant], int8_name: str | None) -> ChosenVariant:
    """Choose 8 bits where they are faster than full precision and see as well."""
    if int8_name is None:
        return ChosenVariant(FP32, "no other form was asked for")
    full, other = variants[FP32], variants[int8_name]
    times = f"{other.fastest_ms:.1f} ms beside {full.fastest_ms:.1f} ms"
    if other.fastest_ms >= full.fastest_ms:
        return ChosenVariant(FP32, f"{int8_name} is no faster: {times}")
    if not full.precision:
        return ChosenVariant(FP32, f"no labels tell what {int8_name} loses: {times}")
    lost = moderate(full) - moderate(other)
    reason = f"{int8_name} loses {lost:.2f} points of average precision: {times}"
    return ChosenVariant(FP32 if lost > _MAX_LOST else int8_name, reason)


def moderate(variant: ModelVariant) -> float:
    """Return the average precision in percent over all classes, moderate where there are levels; 0 where it was not measured."""
    of_classes = list(variant.precision.values())
    if of_classes and "moderate" not in of_classes[0]:
        return float(np.mean([one["ap"] for one in of_classes]))
    # Of each class at the overlap that KITTI asks for; then again, at a half.
    strict = of_classes[: len(of_classes) // 2]
    return float(np.mean([levels["moderate"] for levels in strict])) if strict else 0.0


def _scales_to_try(config: ExportConfig) -> tuple[Scales, ...]:
    """Return all ways of finding scales where labels tell which is best."""
    if not config.int8 or config.drive is None:
        return ()
    every: tuple[Scales, ...] = get_args(Scales)
    return every if config.drive.has_labels else every[:1]


def _inputs(config: ExportConfig, detector: ModalityDetector) -> Iterator[Arrays]:
    """Yield what the network is shown of some frames of the drive."""
    for frame in config.read("calibration", _CALIBRATION_FRAMES):
        image = modality_image(frame, detector.modality, detector.filling)
        yield {"images": detector.preprocess(image)}


def _open(data: bytes, file: Path) -> ModalityDetector:
    """Open a file on one thread, as it runs beside other detectors."""
    write_atomically(file, data)
    return ModalityDetector(file, threads=1)


def measure_variants(
    config: ExportConfig, networks: Mapping[str, Network], detector: ModalityDetector
) -> dict[str, Precision]:
    """Return average precision in percent by form, class and overlap, and difficulty.

    Args:
        config: Export with its drive; without one, or without labels, nothing is measured.
        networks: Variants by name.
        detector: One of them, whose input and classes all share.
    """
    drive = config.drive
    if drive is None or not drive.has_labels:
        return {}
    images = (
        (modality_image(frame, detector.modality, detector.filling), drive.labels(frame.index))
        for frame in config.read("precision")
    )
    truths, found, frames = detect_images(networks, images, detector)
    return {
        name: precision_table(measure(truths, boxes, frames, detector.class_names))
        for name, boxes in found.items()
    }


class FoundBoxes(NamedTuple):
    """Boxes in some images.

    Attributes:
        truths: Labelled boxes.
        found: Boxes of each network by its name.
        frames: Number of images.
    """

    truths: TrueBoxes
    found: Mapping[str, DetectedBoxes]
    frames: int


def detect_images(
    networks: Mapping[str, Network],
    images: Iterable[tuple[UInt8, Labels]],
    detector: ModalityDetector,
) -> FoundBoxes:
    """Return what networks find in images.

    Args:
        networks: Networks of the same input by name.
        images: (H, W, C) images with their labels.
        detector: What makes the input of an image and detections of the outputs.
    """
    labels: list[Labels] = []
    found: dict[str, list[Detections]] = {name: [] for name in networks}
    for image, of_image in images:
        labels.append(of_image)
        inputs = {"images": detector.preprocess(image)}
        for name, network in networks.items():
            found[name].append(detector.postprocess(image, network(inputs)))
    boxes = {name: DetectedBoxes.of_frames(of_network) for name, of_network in found.items()}
    return FoundBoxes(TrueBoxes.of_frames(labels), boxes, len(labels))
