"""The network that verifies proposals; its file states window, channels and method."""

from dataclasses import dataclass
from importlib.resources.abc import Traversable
from typing import Annotated, get_args

import numpy as np
from numpy.typing import NDArray

from perception.detection.depthcn.crops import (
    CROP_HEIGHT_PX,
    CROP_WIDTH_PX,
    WindowKind,
    crop_windows,
)
from perception.detection.depthcn.image import CHANNELS
from perception.detection.onnx_model import (
    Array,
    ModelContract,
    ModelInput,
    OnnxModel,
    shipped_model,
)
from perception.errors import ModelError
from perception.types import ArrayTable, Float64, Method, UInt8

KIND = "depthcn"
# Number of crops in one run of the network, whose activations stay in the processor's cache: two thirds of the time of
# all crops at once, which are written to memory layer by layer.
_BLOCK = 8
CONTRACT = ModelContract(
    metadata={
        "kind": KIND,
        "input_height": str(CROP_HEIGHT_PX),
        "input_width": str(CROP_WIDTH_PX),
    },
    required_keys=("method", "window", "channels", "classes"),
    inputs={
        "crops": ModelInput(np.uint8, (None, None, CROP_HEIGHT_PX, CROP_WIDTH_PX)),
        "windows_px": ModelInput(np.float32, (None, 4)),
    },
    outputs=("scores", "boxes_px"),
    warmup_rows=_BLOCK,
)
_WINDOWS: tuple[WindowKind, ...] = get_args(WindowKind)
_METHODS: tuple[Method, ...] = get_args(Method)


@dataclass(frozen=True)
class VerifierPrediction(ArrayTable):
    """Predictions of the network for M proposals.

    Attributes:
        scores: (M,) probabilities of the likeliest class.
        boxes_px: (M, 4) predicted boxes x1 y1 x2 y2 in the image.
        types: (M,) names of the likeliest classes.
    """

    scores: Float64
    boxes_px: Annotated[Float64, 4]
    types: NDArray[np.str_]


class Verifier:
    """A trained network, from a file or of this package."""

    def __init__(self, model: Traversable | Method = "default", threads: int = 2) -> None:
        """Open the model file.

        Args:
            model: Model file, or the method of a model of this package.
            threads: Number of threads of the network.

        Raises:
            ModelError: the file does not hold a network that verifies proposals.
        """
        file = shipped_model(f"{KIND}_{model}") if isinstance(model, str) else model
        self.model = OnnxModel(file, CONTRACT, threads)
        """The network and the metadata of its file."""
        channels = self.model.metadata["channels"].split(",")
        self._channels = [CHANNELS.index(name) for name in channels if name in CHANNELS]
        channel_count = self.model.inputs["crops"].shape[1]
        if not len(channels) == len(self._channels) == channel_count:
            raise ModelError(
                file.name,
                expected=f"channels among {', '.join(CHANNELS)}, as many as its input has",
                found=f"{', '.join(channels)} for an input of {channel_count} channels",
            )
        self.class_names = tuple(self.model.metadata["classes"].split(","))
        """Classes that it tells apart."""
        score_count = (*self.model.output_shapes["scores"], 1)[1]
        if len(self.class_names) != score_count:
            raise ModelError(
                file.name,
                expected=f"a score of each of its classes, {', '.join(self.class_names)}",
                found=f"{score_count} scores of a crop",
            )
        self.window: WindowKind = self.model.metadata_choice("window", _WINDOWS)
        """Kind of the window around a proposal."""
        self.method: Method = self.model.metadata_choice("method", _METHODS)
        """Method of the proposals, maps and crops of its training."""

    def inputs(self, image: UInt8, windows_px: Float64) -> dict[str, Array]:
        """Return the network's inputs for (M, 4) windows x1 y1 x2 y2 of an (H, W, 3) image."""
        selected = image.transpose(2, 0, 1)[self._channels].transpose(1, 2, 0)
        return {
            "crops": crop_windows(selected, windows_px, self.method),
            "windows_px": windows_px.astype(np.float32),
        }

    def predict(self, image: UInt8, windows_px: Float64) -> VerifierPrediction:
        """Return the predictions for (M, 4) windows x1 y1 x2 y2 of an (H, W, 3) image, at least one."""
        inputs = self.inputs(image, windows_px)
        blocks = [
            self.model({name: array[row : row + _BLOCK] for name, array in inputs.items()})
            for row in range(0, len(windows_px), _BLOCK)
        ]
        outputs = {name: np.concatenate([one[name] for one in blocks]) for name in blocks[0]}
        # A network of one class returns one score for each window.
        scores = outputs["scores"].astype(np.float64).reshape(-1, len(self.class_names))
        types = np.array(self.class_names, np.str_)[scores.argmax(axis=1)]
        return VerifierPrediction(scores.max(axis=1), outputs["boxes_px"].astype(np.float64), types)
