"""A detector's network: images of its input's size in, boxes and scores of the reported classes out."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from importlib.resources.abc import Traversable
from typing import get_args

import numpy as np

from perception.detection.detectors.class_columns import ClassColumns
from perception.detection.detectors.detector_description import (
    FILLINGS,
    DescribedFile,
    DetectorDescription,
    described_file,
)
from perception.detection.detectors.image_input import SIZES, ImageInput
from perception.detection.detectors.input_size import InputSize
from perception.detection.detectors.modalities import CHANNELS
from perception.detection.detectors.model_metadata import class_names, keypoint_columns
from perception.detection.detectors.network_outputs import (
    NetworkOutputs,
    Outputs,
    with_known_names,
)
from perception.detection.detectors.output_decoding import Predictions
from perception.detection.detectors.output_forms import (
    FORMS,
    OUTPUT_FORMS,
    InputFormat,
    OutputFormName,
    recognized_form,
)
from perception.detection.detectors.reported_classes import listed, reported_classes
from perception.detection.onnx_model import Array, ModelContract, ModelInput, OnnxModel
from perception.errors import ModelError
from perception.types import MODALITIES, Fit, Modality, UInt8

# Requirements on a detector that `trifuse export` writes.
KIND = "detector"
CONTRACT = ModelContract(
    metadata={"kind": KIND},
    required_keys=("modality", "classes", "input_height", "input_width", "filling"),
    inputs={"images": ModelInput(np.uint8, (None, None, None, None))},
    outputs=("boxes_px", "scores"),
)
# Size of the images of a network that takes any size.
_USUAL_SIZE = InputSize(384, 1248)
_OTHER_TASKS = ("classify", "obb")  # one class an image, rotated boxes
_MAX_AXES = 3  # of an output with boxes; others are masks, or the maps of each stride


@dataclass(frozen=True)
class DetectorNetwork:
    """A network of a known form of outputs.

    Attributes:
        model: The network in ONNX Runtime.
        description: What is known of the file: its own statements, and those of a YAML file.
        modality: Modality of the images.
        image_input: Input that takes the image.
        size: Size of the images; of a network for any size the number of pixels matters alone.
        form: Name of the form of the outputs.
        classes: Reported classes.
        fingerprint: Hash of the model file and, where one describes it, of its YAML file.
    """

    model: OnnxModel
    description: DetectorDescription
    modality: Modality
    image_input: ImageInput
    size: InputSize
    form: OutputFormName
    classes: ClassColumns
    fingerprint: str

    @cached_property
    def format(self) -> InputFormat:
        """Format of the images."""
        return self.description.input_format(FORMS[self.form].input)

    def size_for(self, height_px: int, width_px: int) -> InputSize:
        """Return the size of the input for an image: of about as many pixels where the network takes any."""
        return self.size if self.is_size_fixed else self.size.for_image(height_px, width_px)

    @property
    def is_size_fixed(self) -> bool:
        """Whether images of one size alone enter."""
        return self.image_input.fixed_size is not None

    def inputs(self, image: UInt8) -> dict[str, Array]:
        """Return the inputs of the network for an (h, w, C) image."""
        return self.image_input.arrays(image, self.format)

    def predict(self, outputs: Outputs, size: InputSize) -> Predictions:
        """Return the predictions by the outputs for an image of a size."""
        return FORMS[self.form].decode(with_known_names(outputs), size, self.classes)


def open_network(file: Traversable | DescribedFile, threads: int) -> DetectorNetwork:
    """Open a detector's ONNX file, or that of a YAML file, and run it on a blank image to know its outputs.

    Raises:
        ModelError: the file holds no detector of a known form, or one of another input or classes.
        UsageError: the YAML file holds no description of a detector.
    """
    described = file if isinstance(file, DescribedFile) else described_file(file)
    model = OnnxModel(described.model, threads=threads)
    description = described.description.over(_stated(model))
    modality = description.modality or "rgb"
    image_input = ImageInput.of(model, CHANNELS[modality])
    fixed = image_input.fixed_size
    size = description.input_size or fixed or _USUAL_SIZE
    blank = np.zeros((*size, CHANNELS[modality]), np.uint8)
    if fixed not in (None, size):
        model = _resized(described.model, threads, image_input, blank)
        image_input = ImageInput.of(model, CHANNELS[modality])
    outputs = model(image_input.arrays(blank, InputFormat()))
    model.leave_out(name for name, array in outputs.items() if array.ndim > _MAX_AXES)
    form, classes = _form_and_classes(model, description, outputs, size)
    fingerprint = _fingerprint(model, described.description)
    network = DetectorNetwork(
        model, description, modality, image_input, size, form, classes, fingerprint
    )
    _require_fitting_shapes(network, outputs)
    return network


def _resized(file: Traversable, threads: int, image_input: ImageInput, image: UInt8) -> OnnxModel:
    """Open a file for images of any size.

    Args:
        file: File that states one size.
        threads: Number of threads of the network.
        image_input: Input that takes the image.
        image: Image of another size.

    Raises:
        ModelError: the graph computes with the size that the file states.
    """
    try:
        model = OnnxModel(
            file, threads=threads, free_axes=(image_input.name, image_input.size_axes)
        )
        model(image_input.arrays(image, InputFormat()))
    except ModelError as error:
        raise ModelError(
            file.name,
            expected=f"a graph that takes images of {InputSize(*image.shape[:2])} instead of {image_input.fixed_size}",
            found=error.found,
            advice="leave out input_size, or export the network with this size",
        ) from error
    return model


def _fingerprint(model: OnnxModel, stated: DetectorDescription) -> str:
    """Return the hash of a model file and, where one describes it, of its YAML file."""
    if stated == DetectorDescription():
        return model.fingerprint
    text = f"{model.fingerprint} {stated}"
    return hashlib.blake2b(text.encode(), digest_size=8).hexdigest()


def _stated(model: OnnxModel) -> DetectorDescription:
    """Return what a file of this package states in its metadata, nothing of another.

    Raises:
        ModelError: the file is of this package, and holds no detector.
    """
    if "kind" not in model.metadata:
        return DetectorDescription()
    model.check(CONTRACT)
    names = tuple(model.metadata["classes"].split(","))
    modality = model.metadata_choice("modality", MODALITIES)
    size = InputSize(_pixels(model, "input_height"), _pixels(model, "input_width"))
    required = ModelInput(np.uint8, (None, CHANNELS[modality], *size))
    found = model.inputs["images"]
    if all(found.shape[-2:]) and not required.accepts(found):
        raise ModelError(
            model.name, expected=f"input {required} for modality {modality}", found=str(found)
        )
    return DetectorDescription(
        modality=modality,
        classes=dict(enumerate(names)),
        class_names=names,
        input_size=size,
        output="trifuse",
        filling=model.metadata_choice("filling", FILLINGS),
        jpeg_quality=_jpeg_quality(model),
        resize=model.metadata_choice("fit", get_args(Fit)) if "fit" in model.metadata else None,
    )


def _pixels(model: OnnxModel, key: str) -> int:
    value = model.metadata[key]
    if not value.isdecimal() or int(value) < 1:
        raise ModelError(model.name, expected=f"{key} in pixels", found=value)
    return int(value)


def _jpeg_quality(model: OnnxModel) -> int | None:
    """Return the quality that the file states; without an entry, images are not compressed."""
    text = model.metadata.get("jpeg_quality")
    if text is None:
        return None
    if not text.isdecimal() or not 1 <= int(text) <= 100:
        raise ModelError(model.name, expected="jpeg_quality from 1 to 100", found=text)
    return int(text)


def _form_and_classes(
    model: OnnxModel, description: DetectorDescription, outputs: Outputs, size: InputSize
) -> tuple[OutputFormName, ClassColumns]:
    """Return the form of the outputs of a run on a blank image, and the reported classes.

    Raises:
        ModelError: the outputs are of no known form, or have other classes than are stated.
    """
    task = model.metadata.get("task")
    if task in _OTHER_TASKS and description.output is None:
        raise ModelError(
            model.name,
            expected="a detector of boxes along rows and columns",
            found=f"task {task} in its metadata",
            advice="export a network of task detect, segment or pose",
        )
    names: Mapping[int, str] = dict(enumerate(description.class_names or ()))
    names = names or class_names(model.metadata, model.name)
    keypoints = keypoint_columns(model.metadata, model.name)
    known = with_known_names(outputs)
    named = max(names, default=-1) + 1
    found = NetworkOutputs(known, SIZES in model.inputs, size, named, keypoints)
    name = description.output or recognized_form(found)
    if name is None:
        raise ModelError(
            model.name,
            expected=f"outputs of a known form: {', '.join(OUTPUT_FORMS)}",
            found=_shapes(outputs),
            advice="name its form as `output` in a YAML file beside it, or export it in one of these forms",
        )
    form = FORMS[name]
    try:
        count = form.class_count(found) if form.class_count else None
    except LookupError:  # an output that a stated form has
        count = 0
    if count is not None and count < 1:
        raise _misfit(model, name, outputs)
    if count is not None and named not in (0, count):
        raise ModelError(
            model.name,
            expected=f"scores of {len(names)} classes: {listed(names.values())}",
            found=f"scores of {count} in {_shapes(outputs)}, read as {name}",
            advice="state its `class_names` or its form as `output` in a YAML file beside it",
        )
    names = names or form.coco(count)
    return name, reported_classes(names, count, description.classes, model.name)


def _require_fitting_shapes(network: DetectorNetwork, outputs: Outputs) -> None:
    """Validate that the outputs of a run on a blank image have the shapes of their form.

    Raises:
        ModelError: they contradict each other, or the form that is stated.
    """
    try:
        boxes_px, scores = network.predict(outputs, network.size)
        shapes = boxes_px.shape, scores.shape
    except (LookupError, ValueError, TypeError) as error:
        raise _misfit(network.model, network.form, outputs) from error
    if shapes != ((len(scores), 4), (len(scores), len(network.classes.names))):
        raise _misfit(network.model, network.form, outputs)


def _misfit(model: OnnxModel, form: OutputFormName, outputs: Outputs) -> ModelError:
    return ModelError(
        model.name,
        expected=f"outputs of the form {form}: {FORMS[form].layout}",
        found=_shapes(outputs),
        advice=f"name another form as `output` in a YAML file beside it: {', '.join(OUTPUT_FORMS)}",
    )


def _shapes(outputs: Outputs) -> str:
    return ", ".join(f"{name} {array.shape}" for name, array in outputs.items()) or "no array"
