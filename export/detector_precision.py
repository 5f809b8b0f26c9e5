"""Average precision of every variant of a detector on the same labelled frames."""

from collections.abc import Mapping

from export.parity import Network
from export.result import ExportConfig
from perception.detection.detectors.modalities import modality_image
from perception.detection.detectors.modality_detector import ModalityDetector
from perception.evaluation.detection.box_rows import DetectedBoxes, TrueBoxes
from perception.types import Detections, Labels
from train.detector.metrics import measure, precision_table

Precision = dict[str, dict[str, float]]


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
    labels: list[Labels] = []
    found: dict[str, list[Detections]] = {name: [] for name in networks}
    for frame in config.read("precision"):
        labels.append(drive.labels(frame.index))
        image = modality_image(frame, detector.modality, detector.filling)
        inputs = {"images": detector.preprocess(image)}
        for name, network in networks.items():
            found[name].append(detector.postprocess(image, network(inputs)))
    truths = TrueBoxes.of_frames(labels)
    return {
        name: precision_table(
            measure(truths, DetectedBoxes.of_frames(of_variant), len(labels), detector.class_names)
        )
        for name, of_variant in found.items()
    }
