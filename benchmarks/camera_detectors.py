"""The camera view beside public networks: time and average precision on the same frames."""

import os
from collections.abc import Mapping
from functools import partial
from importlib.resources import as_file
from pathlib import Path

from benchmarks.measure import Comparison, Contender, Measurement, add_peer, compare, metric
from benchmarks.openvino_peer import openvino_network
from benchmarks.stages import PreparedDrive
from export.variants import Network
from perception.detection.detectors.detector_description import DescribedFile, DetectorDescription
from perception.detection.detectors.image_region import detection_region
from perception.detection.detectors.input_size import InputSize
from perception.detection.detectors.modalities import SHIPPED_DETECTORS, camera_image
from perception.detection.detectors.modality_detector import ModalityDetector
from perception.detection.onnx_model import shipped_model
from perception.errors import ModelError
from perception.evaluation.detection.average_precision import kitti_average_precision
from perception.evaluation.detection.box_rows import DetectedBoxes, TrueBoxes
from perception.evaluation.detection.evaluation_boxes import pair_boxes
from perception.evaluation.detection.protocol import KITTI_CLASSES, DetectionClass
from perception.evaluation.report import Column
from perception.types import Detections

_DEFAULT_FOLDER = Path(__file__).parents[2] / "shared" / "public_networks"
# Names in the table, with the files and the sizes at which they run.
PUBLIC_NETWORKS: Mapping[str, tuple[str, InputSize | None]] = {
    "YOLOX-nano": ("yolox_nano.onnx", InputSize(384, 1248)),
    "YOLOX-nano, small": ("yolox_nano.onnx", InputSize(192, 640)),
    "DEIMv2-Femto": ("deimv2_femto.onnx", None),
}


def compare_camera_detectors(prepared: PreparedDrive) -> Comparison:
    """Detect in the camera images; with average precision where the drive has labels.

    Raises:
        ImageError: the drive has no images.
    """
    camera_image(prepared.frames[0])
    ours = ModalityDetector("rgb")
    contenders = [_contender("Trifuse", ours, prepared)]
    contenders.append(_whole_image("ONNX Runtime", ours, ours.model, prepared))
    add_peer(contenders, partial(_with_openvino, ours, prepared))
    for name, (file, size) in PUBLIC_NETWORKS.items():
        add_peer(
            contenders,
            lambda: _contender(name, public_network(file, size), prepared),  # noqa: B023 - called at once
        )
    title = f"camera detectors on {len(prepared.frames)} frames, two threads"
    return compare(title, contenders, len(prepared.frames), *_precision_columns(prepared))


def public_network(file: str, size: InputSize | None) -> ModalityDetector:
    """Open a file of the folder PUBLIC_NETWORKS.

    Args:
        file: Name of the file.
        size: Size of its input; None for that of the file.

    Raises:
        ModelError: there is no such file.
    """
    return ModalityDetector(DescribedFile(public_file(file), DetectorDescription(input_size=size)))


def public_file(file: str) -> Path:
    """Return the path of a file of the folder PUBLIC_NETWORKS.

    Raises:
        ModelError: there is no such file.
    """
    path = Path(os.environ.get("PUBLIC_NETWORKS", _DEFAULT_FOLDER)) / file
    if not path.is_file():
        raise ModelError(
            file,
            expected=f"a public network in {path.parent}",
            found="no such file",
            advice="set PUBLIC_NETWORKS to the folder of public networks",
        )
    return path


def _contender(name: str, detector: ModalityDetector, prepared: PreparedDrive) -> Contender:
    def run(i: int) -> Detections:
        frame = prepared.frames[i]
        image = camera_image(frame)
        region = detection_region(frame.calibration, (image.shape[1], image.shape[0]))
        return detector.detect(image, region)

    return Contender(f"{name}, {detector.size}", run)


def _with_openvino(detector: ModalityDetector, prepared: PreparedDrive) -> Contender:
    shape = detector.preprocess(camera_image(prepared.frames[0])).shape[1:]
    with as_file(shipped_model(SHIPPED_DETECTORS["rgb"])) as file:
        network = openvino_network(file, threads=2, image_shape=shape)
    return _whole_image("OpenVINO", detector, network, prepared)


def _whole_image(
    library: str, detector: ModalityDetector, network: Network, prepared: PreparedDrive
) -> Contender:
    """Detect in whole images, so that only the library differs."""

    def run(i: int) -> Detections:
        image = camera_image(prepared.frames[i])
        return detector.postprocess(image, network({"images": detector.preprocess(image)}))

    return Contender(f"Trifuse, whole image, {library}", run)


def _precision_columns(prepared: PreparedDrive) -> list[Column[Measurement]]:
    if not prepared.drive.has_labels:
        return []
    labels = [prepared.drive.labels(frame.index) for frame in prepared.frames]
    truth = TrueBoxes.of_frames(labels)
    return [
        metric(f"{one.name} AP {one.iou:g} [%]", partial(_moderate, truth, one), ".1f")
        for one in KITTI_CLASSES
        if (truth.types == one.name).any()
    ]


def _moderate(truth: TrueBoxes, of_class: DetectionClass, found: list[Detections]) -> float:
    """Return the average precision in percent, moderate."""
    boxes = pair_boxes(truth, DetectedBoxes.of_frames(found), len(found))
    curves = kitti_average_precision(boxes, (of_class,)).get(of_class, {})
    return curves["moderate"].ap() if "moderate" in curves else 0.0
