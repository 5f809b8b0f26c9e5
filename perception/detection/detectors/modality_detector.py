"""A detector of one modality; its file states input, map filling, JPEG quality and classes (6.2.3).

image -- compress, stretch --> network --> boxes and scores -- NMS --> detections
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib.abc import Traversable

import cv2
import numpy as np

from perception.detection.config import DEFAULT_NMS, NmsConfig
from perception.detection.detectors.input_size import InputSize, boxes_in_image
from perception.detection.detectors.modalities import CHANNELS, MapFilling
from perception.detection.detectors.network_input import prepare_image
from perception.detection.detectors.postprocess import postprocess_detections
from perception.detection.onnx_model import (
    Array,
    ModelContract,
    ModelInput,
    OnnxModel,
    shipped_model,
)
from perception.errors import ImageError, ModelError
from perception.maps.densify import FILL_METHODS
from perception.types import MODALITIES, Detections, Modality, UInt8

KIND = "detector"
CONTRACT = ModelContract(
    metadata={"kind": KIND},
    required_keys=("modality", "classes", "input_height", "input_width", "filling"),
    inputs={"images": ModelInput(np.uint8, (None, None, None, None))},
    outputs=("boxes_px", "scores"),
    warmup_rows=1,
)
_FILLINGS: tuple[MapFilling, ...] = ("sparse", *FILL_METHODS)


class ModalityDetector:
    """A trained network, from a file or of this package."""

    def __init__(
        self,
        model: Traversable | Modality,
        threads: int = 2,
        class_names: Sequence[str] | None = None,
        nms: NmsConfig = DEFAULT_NMS,
    ) -> None:
        """Open the model file.

        Args:
            model: Model file, or the modality of a model of this package.
            threads: Number of threads of the network.
            class_names: Classes that the network has to detect, in this order; else those of the file.
            nms: Score threshold and suppression.

        Raises:
            ModelError: the file does not hold a detector, or one of another modality, input or classes.
        """
        file = shipped_model(f"{model}_compact") if isinstance(model, str) else model
        required: dict[str, str] = {"modality": model} if isinstance(model, str) else {}
        if class_names is not None:
            required["classes"] = ",".join(class_names)
        self.model = OnnxModel(file, CONTRACT.with_metadata(required), threads)
        """The network."""
        self.modality: Modality = self.model.metadata_choice("modality", MODALITIES)
        """Modality of the input."""
        self.filling: MapFilling = self.model.metadata_choice("filling", _FILLINGS)
        """Filling of the maps of its training."""
        self.class_names = tuple(self.metadata["classes"].split(","))
        """Classes that it detects."""
        self.size = InputSize(self._pixels("input_height"), self._pixels("input_width"))
        """Input size, to which images are stretched."""
        self.jpeg_quality = self._jpeg_quality()
        """Quality of the JPEG compression of the images of its training, or None."""
        self._nms = nms
        self._check_input()
        self._check_classes()

    @property
    def metadata(self) -> Mapping[str, str]:
        """Metadata of the model file."""
        return self.model.metadata

    def detect(self, image: UInt8) -> Detections:
        """Return the objects in an (H, W, C) image of the modality, best first, in pixels of the image.

        Raises:
            ImageError: the image has other channels than the modality.
            ModelError: an output of the network is not finite.
        """
        return self.postprocess(image, self.model({"images": self.preprocess(image)}))

    def preprocess(self, image: UInt8) -> UInt8:
        """Return the (1, C, h, w) input of the network for an (H, W, C) image.

        Raises:
            ImageError: the image has other channels than the modality.
        """
        channels = CHANNELS[self.modality]
        if image.ndim != 3 or image.shape[2] != channels or not image.size:
            raise ImageError(
                f"image for {self.model.name}",
                expected=f"shape (H, W, {channels}) of modality {self.modality}",
                found=f"shape {image.shape}",
            )
        planes = cv2.split(prepare_image(image, self.modality, self.size, self.jpeg_quality))
        return np.stack(planes).astype(np.uint8, copy=False)[None]

    def postprocess(self, image: UInt8, outputs: Mapping[str, Array]) -> Detections:
        """Return the detections in an (H, W, C) image by the outputs of the network for it."""
        found = postprocess_detections(
            outputs["boxes_px"][0], outputs["scores"][0], self.class_names, self.size, self._nms
        )
        height, width = image.shape[:2]
        # To the centres of the outermost pixels, as in KITTI's labels.
        within = np.clip(
            boxes_in_image(found.boxes_px, self.size, image), 0, [width - 1, height - 1] * 2
        )
        return replace(found, boxes_px=within)

    def _pixels(self, key: str) -> int:
        value = self.metadata[key]
        if not value.isdecimal() or int(value) < 1:
            raise ModelError(self.model.name, expected=f"{key} in pixels", found=value)
        return int(value)

    def _jpeg_quality(self) -> int | None:
        """Return the quality that the file states; without an entry, images are not compressed."""
        text = self.metadata.get("jpeg_quality")
        if text is None:
            return None
        if not text.isdecimal() or not 1 <= int(text) <= 100:
            raise ModelError(self.model.name, expected="jpeg_quality from 1 to 100", found=text)
        return int(text)

    def _check_input(self) -> None:
        required = ModelInput(np.uint8, (None, CHANNELS[self.modality], *self.size))
        found = self.model.inputs["images"]
        if not required.accepts(found):
            raise ModelError(
                self.model.name,
                expected=f"input {required} for modality {self.modality}",
                found=str(found),
            )

    def _check_classes(self) -> None:
        class_count = self.model.output_shapes["scores"][-1]
        if class_count != len(self.class_names):
            raise ModelError(
                self.model.name,
                expected=f"scores of {len(self.class_names)} classes: {', '.join(self.class_names)}",
                found=f"scores of {class_count}",
            )
