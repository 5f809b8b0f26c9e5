"""Three detectors a frame: in which arrangement, in which numbers, and by which library."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal

import numpy as np
import torch

from benchmarks.measure import Comparison, Contender, add_peer, compare
from benchmarks.openvino_peer import openvino_network
from benchmarks.stages import PreparedDrive
from export.detector import QUANTIZATION, DecodedDetector
from export.onnx import Exportable, to_onnx
from export.quantize import to_int8
from export.variants import Arrays, Network
from perception.detection.detectors.input_size import InputSize
from perception.detection.detectors.modalities import camera_image, map_image
from perception.detection.detectors.modality_detector import ModalityDetector
from perception.detection.detectors.multimodal import MultimodalDetector
from perception.detection.detectors.network_input import PixelRectangle, place, prepare_image
from perception.maps.densify import DenseMaps, densify
from perception.maps.projection import project_frame
from perception.types import MODALITIES, Modality, UInt8
from train.detector.networks import DetectorNetworkConfig, make_detector
from train.networks.yolo_detector import YoloDetector
from train.networks.yolo_head import OBJECTNESS, YoloHead

Precision = Literal["fp32", "int8"]
ModelFiles = Mapping[Precision, Path]
_SHOWN = 8
# Number of boxes at the score threshold, as after training on a busy road.
_LIKELY = 100
COMPACT, THESIS = InputSize(192, 640), InputSize(416, 416)
Open = Callable[[Path, int], Network]
_LIBRARIES: Mapping[str, Open] = {
    "ONNX Runtime": lambda file, threads: ModalityDetector(file, threads).model,
    "OpenVINO": openvino_network,
}
_FORMS: tuple[Precision, ...] = ("int8", "fp32")


def write_detector(
    folder: Path, network: str, modality: Modality, size: InputSize, images: Sequence[UInt8]
) -> ModelFiles:
    """Write a network with random weights in full precision and in 8 bits.

    Args:
        folder: Folder of the files.
        network: Name of the network: compact or yolov2.
        modality: Modality of its input.
        size: Size of its input.
        images: (H, W, C) images of this modality.
    """
    variant = DetectorNetworkConfig(modality, size=size, network=network)
    prepared = [
        prepare_image(one, modality, place(PixelRectangle.whole(one), size))
        for one in images[:_SHOWN]
    ]
    inputs = [one.transpose(2, 0, 1)[None] for one in prepared]
    torch.manual_seed(0)
    detector = make_detector(variant)
    _limit_confident_boxes(detector, torch.from_numpy(np.concatenate(inputs)))
    exportable = Exportable(
        DecodedDetector(detector.eval()).eval(),
        {"images": torch.from_numpy(np.concatenate(inputs[:1] * 2))},
        outputs=("boxes_px", "scores"),
        metadata=variant.metadata,
    )
    model = to_onnx(exportable)
    batches = [{"images": np.ascontiguousarray(one)} for one in inputs]
    contents: dict[Precision, bytes] = {
        "fp32": model,
        "int8": to_int8(model, batches, QUANTIZATION),
    }
    files = {name: folder / f"{network}_{modality}_{name}.onnx" for name in contents}
    for name, file in files.items():
        file.write_bytes(contents[name])
    return files


def _limit_confident_boxes(detector: YoloDetector, images: torch.Tensor) -> None:
    """Calibrate the batch norms, and bias the objectness so that few boxes are likely."""
    with torch.no_grad():
        for _ in range(3):
            detector.train()(images)
        logits = detector.eval()(images[:1])[:, :, OBJECTNESS].flatten()
        threshold = logits.sort(descending=True).values[min(_LIKELY, len(logits)) - 1]
        head = detector.head
        assert isinstance(head, YoloHead)  # of the networks that are compared
        bias = head.convolution.bias
        assert bias is not None  # every head has one
        of_anchors = bias.view(len(head.anchors_px), -1)
        of_anchors[:, OBJECTNESS] += float(np.log(0.01 / 0.99)) - threshold


@dataclass(frozen=True)
class Workload:
    """What is detected, and by which networks.

    Attributes:
        compact: Compact network of each modality.
        yolov2: Network of the thesis, for depth maps.
        dense: Dense maps of each frame.
        inputs: Inputs of the compact networks, by frame.
        squares: Inputs of YOLOv2, by frame.
    """

    compact: Mapping[Modality, ModelFiles]
    yolov2: ModelFiles
    dense: list[DenseMaps]
    inputs: list[dict[Modality, Arrays]]
    squares: list[Arrays]

    @classmethod
    def make(cls, prepared: PreparedDrive, folder: Path) -> "Workload":
        """Write the networks, and prepare the images of all frames.

        Raises:
            ImageError: The drive has no images.
        """
        dense = [densify(project_frame(frame)) for frame in prepared.frames]
        images: dict[Modality, list[UInt8]] = {
            "rgb": [camera_image(frame) for frame in prepared.frames],
            "dm": [map_image(maps, "dm") for maps in dense],
            "rm": [map_image(maps, "rm") for maps in dense],
        }
        compact = {
            name: write_detector(folder, "compact", name, COMPACT, images[name])
            for name in MODALITIES
        }
        yolov2 = write_detector(folder, "yolov2", "dm", THESIS, images["dm"])
        detectors = {name: ModalityDetector(files["fp32"]) for name, files in compact.items()}
        square = ModalityDetector(yolov2["fp32"])
        inputs: list[dict[Modality, Arrays]] = [
            {
                name: {"images": detector.preprocess(images[name][i])}
                for name, detector in detectors.items()
            }
            for i in range(len(dense))
        ]
        squares: list[Arrays] = [{"images": square.preprocess(one)} for one in images["dm"]]
        return cls(compact, yolov2, dense, inputs, squares)


def compare_detectors(prepared: PreparedDrive) -> Comparison:
    """Detect in maps and images that are there; from scan and image on; and the networks alone.

    Raises:
        ImageError: The drive has no images.
    """
    frames = prepared.frames
    with TemporaryDirectory() as folder:
        work = Workload.make(prepared, Path(folder))
        ours = MultimodalDetector(_open(work, "int8", threads=1))
        in_turn = MultimodalDetector(_open(work, "int8", threads=2), workers=1)
        full = MultimodalDetector(_open(work, "fp32", threads=1))
        contenders = [
            Contender(
                "Trifuse: int8, two at once", lambda i: ours.detect(frames[i], work.dense[i])
            ),
            Contender("int8, in turn", lambda i: in_turn.detect(frames[i], work.dense[i])),
            Contender("fp32, two at once", lambda i: full.detect(frames[i], work.dense[i])),
            Contender("maps alone", lambda i: densify(project_frame(frames[i]))),
            Contender("maps and Trifuse", lambda i: ours.detect(frames[i])),
        ]
        for library, variant in product(_LIBRARIES, _FORMS):
            add_peer(contenders, lambda: _three_networks(work, variant, library))  # noqa: B023 - called at once
        for library, variant in product(_LIBRARIES, _FORMS):
            add_peer(contenders, lambda: _yolov2(work, variant, library))  # noqa: B023 - called at once
        title = f"three compact detectors at {COMPACT.height_px}x{COMPACT.width_px}"
        return compare(title, contenders, len(frames))


def _open(work: Workload, variant: Precision, threads: int) -> dict[Modality, ModalityDetector]:
    return {name: ModalityDetector(files[variant], threads) for name, files in work.compact.items()}


def _three_networks(work: Workload, variant: Precision, library: str) -> Contender:
    """Run the networks alone, each on one thread, two at once."""
    networks = {
        name: _LIBRARIES[library](files[variant], 1) for name, files in work.compact.items()
    }
    workers = ThreadPoolExecutor(2)

    def run(i: int) -> list[Arrays]:
        return list(workers.map(lambda name: networks[name](work.inputs[i][name]), MODALITIES))

    return Contender(f"the networks alone, {variant}, {library}", run)


def _yolov2(work: Workload, variant: Precision, library: str) -> Contender:
    network = _LIBRARIES[library](work.yolov2[variant], 2)
    size = f"{THESIS.height_px}x{THESIS.width_px}"
    return Contender(f"one YOLOv2 {size}, {variant}, {library}", lambda i: network(work.squares[i]))
