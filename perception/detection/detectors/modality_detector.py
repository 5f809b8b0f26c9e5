"""A detector of one modality: it says by its file which pictures it takes and what it detects (6.2.3).

picture -- stretch --> input of the network --> boxes and scores -- suppress --> detections
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib.abc import Traversable

import cv2
import numpy as np

from perception.detection.config import DEFAULT_NMS, NmsConfig
from perception.detection.detectors.input_size import InputSize, boxes_in_image, stretch
from perception.detection.detectors.modalities import CHANNELS, MapFilling
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
    inputs={"pictures": ModelInput(np.uint8, (None, None, None, None))},
    outputs=("boxes_px", "scores"),
    warmup_rows=1,
)
_FILLINGS: tuple[MapFilling, ...] = ("sparse", *FILL_METHODS)


class ModalityDetector:
    """A trained network, from a file or as it ships."""

    def __init__(
        self,
        model: Traversable | Modality,
        threads: int = 2,
        class_names: Sequence[str] | None = None,
        nms: NmsConfig = DEFAULT_NMS,
    ) -> None:
        """Open it.

        Args:
            model: a file, or a modality for the network that ships.
            threads: that it runs on.
            class_names: Classes that the network has to detect, in this order; else those of the file.
            nms: Score threshold and suppression.

        Raises:
            ModelError: the file does not hold a detector, or one of other pictures or classes.
        """
        file = shipped_model(f"{model}_compact") if isinstance(model, str) else model
        required: dict[str, str] = {"modality": model} if isinstance(model, str) else {}
        if class_names is not None:
            required["classes"] = ",".join(class_names)
        self.model = OnnxModel(file, CONTRACT.with_metadata(required), threads)
        """The network itself."""
        self.modality: Modality = self.model.metadata_choice("modality", MODALITIES)
        """Which view of the road it is shown."""
        self.filling: MapFilling = self.model.metadata_choice("filling", _FILLINGS)
        """How the maps that it learned from were made."""
        self.class_names = tuple(self.metadata["classes"].split(","))
        """What it detects."""
        self.size = InputSize(self._pixels("input_height"), self._pixels("input_width"))
        """Of the pictures that go in; whatever it is shown is stretched to it."""
        self._nms = nms
        self._check_input()
        self._check_classes()

    @property
    def metadata(self) -> Mapping[str, str]:
        """What the file says of itself."""
        return self.model.metadata

    def detect(self, image: UInt8) -> Detections:
        """Return the objects in an (H, W, C) picture of its modality, best first.

        Boxes are within the picture and in its pixels. None overlaps a better one of its class by more
        than half.

        Raises:
            ImageError: the picture has other channels than the modality.
            ModelError: what comes out of the network is not finite.
        """
        return self.postprocess(image, self.model({"pictures": self.preprocess(image)}))

    def preprocess(self, image: UInt8) -> UInt8:
        """Return (1, C, h, w) what the network is shown of an (H, W, C) picture.

        Raises:
            ImageError: the picture has other channels than the modality.
        """
        channels = CHANNELS[self.modality]
        if image.ndim != 3 or image.shape[2] != channels or not image.size:
            raise ImageError(
                f"picture for {self.model.name}",
                expected=f"shape (H, W, {channels}) of modality {self.modality}",
                found=f"shape {image.shape}",
            )
        planes = cv2.split(stretch(image, self.size, self.modality))
        return np.stack(planes).astype(np.uint8, copy=False)[None]

    def postprocess(self, image: UInt8, outputs: Mapping[str, Array]) -> Detections:
        """Return what the network's answer to an (H, W, C) picture says, as `detect` does."""
        seen = postprocess_detections(
            outputs["boxes_px"][0], outputs["scores"][0], self.class_names, self.size, self._nms
        )
        height, width = image.shape[:2]
        # To the centres of the outermost pixels, as KITTI's labels are.
        within = np.clip(
            boxes_in_image(seen.boxes_px, self.size, image), 0, [width - 1, height - 1] * 2
        )
        return replace(seen, boxes_px=within)

    def _pixels(self, key: str) -> int:
        value = self.metadata[key]
        if not value.isdecimal() or int(value) < 1:
            raise ModelError(self.model.name, expected=f"{key} in pixels", found=value)
        return int(value)

    def _check_input(self) -> None:
        required = ModelInput(np.uint8, (None, CHANNELS[self.modality], *self.size))
        found = self.model.inputs["pictures"]
        if not required.accepts(found):
            raise ModelError(
                self.model.name,
                expected=f"pictures {required}, as it says that it is of {self.modality}",
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
