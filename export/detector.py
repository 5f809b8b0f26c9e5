"""A detector of one modality on its way from a checkpoint to a file, in the form that serves best."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import torch
from torch import Tensor, nn

from export.detector_precision import measure_forms
from export.exported import Choice, Exported, ExportOrder
from export.forms import Form, compare_forms
from export.onnx import Exportable, to_onnx
from export.parity import Arrays, in_torch
from export.quantize import Quantisation, to_int8
from perception.detection.input_size import InputSize
from perception.detection.modalities import picture_of
from perception.detection.modality_detector import ModalityDetector
from perception.errors import UsageError
from perception.types import UInt8
from train.detector.networks import load_detector
from train.networks.grid_detector import GridDetector

# Of probabilities, and of pixels, as boxes may be as large as the picture.
TOLERANCES = {"scores": 1e-4, "boxes_px": 0.05}
# What flows from convolution to convolution must not leave the integers on its way. The last convolution
# stays as it is: of what it says, 8 bits would be the centres of boxes to no more than the fraction of a cell.
DETECTOR_QUANTISATION = Quantisation(
    layers=("Conv", "Relu", "LeakyRelu", "Add", "Resize", "MaxPool", "Concat"), last="Conv"
)
_MOST_LOST = 1.0  # percent of average precision, moderate, that 8 bits may cost
_NOISE_ROWS = (1, 2, 3)
_BLOCK_PX = 8  # divides every size; noise of single pixels is the same wherever a network looks
_CALIBRATION_FRAMES = 32
_COMPARED_FRAMES = 8


class DecodedDetector(nn.Module):
    """A detector that says boxes and scores in place of raw predictions."""

    def __init__(self, detector: GridDetector) -> None:
        super().__init__()
        self.detector = detector

    def forward(self, pictures: Tensor) -> tuple[Tensor, Tensor]:
        """Return (rows, K, 4) boxes in pixels of the input and (rows, K, classes) scores."""
        decoded = self.detector.decode(self.detector(pictures))
        return decoded.boxes_px, decoded.scores


def export_detector(order: ExportOrder) -> Exported:
    """Make the files of a checkpoint, show all forms the same pictures, and choose one.

    Raises:
        ModelError: the checkpoint is damaged, or of another network.
        UsageError: 8 bits without a drive.
        PerceptionError: a frame of the drive lacks what the modality needs.
    """
    if order.int8 and order.drive is None:
        raise UsageError("int8", expected="a drive to find its scales with", found="none")
    exportable = exportable_detector(order.checkpoint, order.size)
    shape = tuple(exportable.inputs["pictures"].shape[1:])
    models = {"fp32": to_onnx(exportable)}
    generator = np.random.default_rng(0)
    inputs: dict[str, list[Arrays]] = {
        "noise": [{"pictures": random_pictures(rows, shape, generator)} for rows in _NOISE_ROWS]
    }
    with TemporaryDirectory() as folder:
        opened = {"fp32": _open(models["fp32"], Path(folder, "fp32.onnx"))}
        if pictures := list(_inputs(order, opened["fp32"])):
            inputs["pictures"] = pictures[:_COMPARED_FRAMES]
        if order.int8:
            models["int8"] = to_int8(models["fp32"], pictures, DETECTOR_QUANTISATION)
            opened["int8"] = _open(models["int8"], Path(folder, "int8.onnx"))
    forms = compare_forms(
        exportable,
        {name: (len(models[name]), detector.model) for name, detector in opened.items()},
        inputs,
        timed=inputs["noise"][0],
    )
    networks = {"torch": in_torch(exportable)} | {
        name: detector.model for name, detector in opened.items()
    }
    precision = measure_forms(order, networks, opened["fp32"])
    forms = {name: replace(form, precision=precision.get(name, {})) for name, form in forms.items()}
    return Exported(
        facts=dict(exportable.facts),
        models=models,
        forms=forms,
        tolerances=TOLERANCES,
        choice=choose(forms),
        shown="one picture on one thread",
    )


def exportable_detector(checkpoint: Path, size: InputSize | None = None) -> Exportable:
    """Return the network of a checkpoint with all that its file says.

    Args:
        checkpoint: that training wrote.
        size: of the pictures that the file shall take; None as it was trained. A network finds objects of
            the pixels that it learned, so anchors stay as they are.

    Raises:
        ModelError: the checkpoint is damaged, or of another network.
    """
    detector, facts = load_detector(checkpoint)
    size = size or InputSize(int(facts["input_height"]), int(facts["input_width"]))
    facts |= {"input_height": str(size.height_px), "input_width": str(size.width_px)}
    example = random_pictures(2, (detector.channels, *size), np.random.default_rng(0))
    return Exportable(
        DecodedDetector(detector).eval(),
        {"pictures": torch.from_numpy(example)},
        outputs=("boxes_px", "scores"),
        facts=facts,
    )


def random_pictures(rows: int, shape: tuple[int, ...], generator: np.random.Generator) -> UInt8:
    """Return (rows, C, h, w) pictures of blocks of noise for a shape (C, h, w)."""
    channels, height, width = shape
    blocks = (rows, channels, height // _BLOCK_PX, width // _BLOCK_PX)
    brightness = generator.integers(0, 256, blocks, dtype=np.uint8)
    return brightness.repeat(_BLOCK_PX, axis=2).repeat(_BLOCK_PX, axis=3)


def choose(forms: dict[str, Form]) -> Choice:
    """Choose 8 bits where they are faster and see as well."""
    if "int8" not in forms:
        return Choice("fp32", "no other form was asked for")
    full, short = forms["fp32"], forms["int8"]
    gain = f"{short.fastest_ms:.1f} ms beside {full.fastest_ms:.1f} ms"
    if short.fastest_ms >= full.fastest_ms:
        return Choice("fp32", f"int8 is no faster: {gain}")
    if not full.precision:
        return Choice("fp32", "the drive has no labels that would tell what int8 loses")
    lost = moderate(full) - moderate(short)
    says = f"int8 loses {lost:.2f} % of average precision, moderate; {gain}"
    return Choice("fp32" if lost > _MOST_LOST else "int8", says)


def moderate(form: Form) -> float:
    """Return the average precision in percent, moderate, over all classes at the overlap that KITTI asks for."""
    of_classes = list(form.precision.values())
    # The second half is the same at an overlap of a half.
    return float(np.mean([one["moderate"] for one in of_classes[: len(of_classes) // 2]]))


def _inputs(order: ExportOrder, detector: ModalityDetector) -> Iterator[Arrays]:
    """Yield what the network is shown of some frames of the drive."""
    for frame in order.read("calibration", _CALIBRATION_FRAMES):
        picture = picture_of(frame, detector.modality, detector.filling)
        yield {"pictures": detector.input_of(picture)}


def _open(data: bytes, file: Path) -> ModalityDetector:
    """Open a file on one thread, as it runs beside other detectors."""
    file.write_bytes(data)
    return ModalityDetector(file, threads=1)
