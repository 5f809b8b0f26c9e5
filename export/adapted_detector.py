"""The detector of camera images as an adaptation trains it."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from data.array_store import ArrayStore
from data.label_proposals.proposed_labels import ProposedLabels
from data.recorded_drive import RecordedDrive
from data.samples.images.input_images import ImageConfig
from data.samples.images.labelled_images import LabelledImages
from data.synthetic.collection import SynthConfig
from export.adapted_network import SENSORS, AdaptedNetwork, Costs, MeasuredClass
from export.detector import detect_images, exportable_network, random_images
from export.onnx import Exportable, to_onnx
from export.variants import Network, fastest_ms
from perception.detection.detectors.modalities import SHIPPED_DETECTORS
from perception.detection.detectors.modality_detector import ModalityDetector
from perception.errors import UsageError
from perception.evaluation.detection.average_precision import ClassCurves, kitti_average_precision
from perception.evaluation.detection.evaluation_boxes import pair_boxes
from perception.evaluation.detection.protocol import DIFFICULTIES, kitti_class
from perception.types import Int, Labels, Progress, UInt8
from train.detector.kind import DETECTOR
from train.detector.networks import load_detector
from train.networks.yolo_detector import YoloDetector

_IOUS = (0.5, 0.6, 0.7)  # boxes projected from 3D are larger than those that are drawn by hand
_LEVEL = DIFFICULTIES[-1]  # nearly all that a training learns


class ImageSamples(NamedTuple):
    """Some frames whose images are labelled.

    Attributes:
        images: Frames of drives.
        numbers: (F,) numbers of those that count.
    """

    images: LabelledImages
    numbers: Int


class AdaptedDetector(AdaptedNetwork[ImageSamples]):
    """The detector of camera images: full precision, the labels of the main camera's image, synthetic streets beside it."""

    kind, training = DETECTOR, "yolox"
    out_file, flag = f"{SHIPPED_DETECTORS['rgb']}.onnx", "--pipeline.detection.rgb-model"
    title = "precision in the image before and after: IoU 0.5, mean of 0.5, 0.6 and 0.7"
    costs = Costs(label=20, synthesis=20, sample=9, rest=4000)

    def __init__(self, file: Path | None, drive: RecordedDrive) -> None:
        """Open a model file, for images of the size of the drive's.

        Raises:
            ModelError: It holds no detector.
            UsageError: It is not of camera images, or the drive has none with a calibration.
        """
        super().__init__(file, drive)
        self._detector = ModalityDetector(self.file, threads=1)
        if self._detector.modality != "rgb":
            found = f"modality {self._detector.modality}"
            raise UsageError(self.file, expected="a detector of modality rgb", found=found)
        image = None if drive.calibration is None else drive.image(0)
        if image is None:
            expected = "a drive with images and their calibration"
            raise UsageError(drive.root, expected=expected, found="none", advice="leave --network out")  # fmt: skip
        self._image = ImageConfig(
            "rgb", self.class_names, self._detector.size.for_image(*image.shape[:2])
        )

    @property
    def class_names(self) -> tuple[str, ...]:
        """Classes of the network."""
        return self._detector.class_names

    @property
    def runner(self) -> Network:
        """The network of the file."""
        return self._detector.model

    def pass_ms(self) -> float:
        """Return the time of a pass over an image."""
        noise = random_images(1, (3, *self._image.size), np.random.default_rng(0))
        return fastest_ms({"network": self.runner}, {"images": noise})["network"]

    def arguments(self) -> dict[str, object]:
        """Return classes and weights of the file, and the size of the drive's images."""
        return {
            "model.modality": "rgb", "model.classes": list(self.class_names),
            "model.size": str(self._image.size), "model.weights.checkpoint": self.file,
        }  # fmt: skip

    def synthetic(self, scans: int, seed: int) -> Mapping[str, SynthConfig]:
        """Return as many frames of one sensor: a camera shows the same beside each."""
        return {"HDL-64E": SynthConfig("object", SENSORS * scans, seed=seed)}

    def load(self, file: Path) -> tuple[YoloDetector, dict[str, str]]:
        """Return the network of a file, and what that states."""
        return load_detector(file)

    def exportable(self, network: YoloDetector, metadata: Mapping[str, str]) -> Exportable:
        """Return a network with the metadata of its model file, which takes as many pixels as the first one."""
        return exportable_network(network, metadata, self._detector.size)

    def content(self, exportable: Exportable, examples: ImageSamples) -> bytes:
        """Return the model file in full precision."""
        return to_onnx(exportable)

    def samples(
        self, drives: Sequence[RecordedDrive], count: int, proposals: Mapping[str, ProposedLabels]
    ) -> ImageSamples:
        """Return images of drives."""
        images = LabelledImages(drives, self._image, ArrayStore(), proposals)
        return ImageSamples(images, images.spread(count))

    def measure(
        self, networks: Mapping[str, Network], samples: ImageSamples, progress: Progress
    ) -> dict[str, dict[str, MeasuredClass]]:
        """Return the precision of boxes, as KITTI's protocol counts them at its hardest level."""
        images = (_image(samples.images, number) for number in progress(samples.numbers.tolist()))
        truths, found, frames = detect_images(networks, images, self._detector)
        classes = [kitti_class(name).at_iou(iou) for name in self.class_names for iou in _IOUS]
        result = {}
        for name, boxes in found.items():
            pairs = pair_boxes(truths, boxes, frames)
            curves = kitti_average_precision(pairs, classes, [_LEVEL])
            result[name] = {
                kind: _precision([curves[kitti_class(kind).at_iou(iou)] for iou in _IOUS])
                for kind in self.class_names
            }
        return result


def _image(images: LabelledImages, number: int) -> tuple[UInt8, Labels]:
    drive, index = images.place(number)
    assert isinstance(drive, RecordedDrive)  # which an adaptation opens
    image = drive.image(index)
    if image is None:
        raise UsageError(drive.root, expected=f"an image of frame {index}", found="none")
    return image, images.labels(number)


def _precision(curves: Sequence[ClassCurves]) -> MeasuredClass:
    """Return the precision of a class by its curves at each overlap, which are empty where nothing is detected."""
    known = [one[_LEVEL.name] for one in curves if one]
    if not known:
        return MeasuredClass(0, 0.0, 0.0)
    aps = [one.ap() / 100 for one in known]
    return MeasuredClass(known[0].truths, aps[0], float(np.mean(aps)))
