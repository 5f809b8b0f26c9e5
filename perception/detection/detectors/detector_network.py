"""A detector's network: images of its input's size in, boxes and scores of the reported classes out."""

import ast
import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from importlib.resources.abc import Traversable
from typing import get_args

import cv2
import numpy as np

from perception.detection.detectors.class_columns import KNOWN_CLASSES, RIDDEN, ClassColumns
from perception.detection.detectors.detector_description import (
    FILLINGS,
    DescribedFile,
    DetectorDescription,
    described_file,
)
from perception.detection.detectors.input_size import InputSize
from perception.detection.detectors.modalities import CHANNELS
from perception.detection.detectors.output_forms import (
    FORMS,
    OUTPUT_FORMS,
    InputFormat,
    OutputForm,
    OutputFormName,
    Outputs,
    Predictions,
    recognized_form,
)
from perception.detection.onnx_model import Array, ModelContract, ModelInput, OnnxModel
from perception.errors import ModelError
from perception.types import MODALITIES, Fit, Float32, Modality, UInt8

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
_SIZES = "orig_target_sizes"  # input of detectors that scale their boxes to the image


@dataclass(frozen=True)
class DetectorNetwork:
    """A network of a known form of outputs.

    Attributes:
        model: The network in ONNX Runtime.
        description: What is known of the file: its own statements, and those of a YAML file.
        modality: Modality of the images.
        image_input: Name of the input that takes the image.
        size: Size of the images; of a network for any size the number of pixels matters alone.
        form: Form of the outputs.
        classes: Reported classes.
        fingerprint: Hash of the model file and, where one describes it, of its YAML file.
    """

    model: OnnxModel
    description: DetectorDescription
    modality: Modality
    image_input: str
    size: InputSize
    form: OutputForm
    classes: ClassColumns
    fingerprint: str

    @cached_property
    def format(self) -> InputFormat:
        """Format of the images."""
        return self.description.input_format(self.form.input)

    def size_for(self, height_px: int, width_px: int) -> InputSize:
        """Return the size of the input for an image: of about as many pixels where the network takes any."""
        return self.size if self.is_size_fixed else self.size.for_image(height_px, width_px)

    @property
    def is_size_fixed(self) -> bool:
        """Whether images of one size alone enter."""
        return _fixed_size(self.model.inputs[self.image_input]) is not None

    def inputs(self, image: UInt8) -> dict[str, Array]:
        """Return the inputs of the network for an (h, w, C) image."""
        return _inputs(self.model, self.image_input, image, self.format)

    def predict(self, outputs: Outputs, size: InputSize) -> Predictions:
        """Return the predictions by the outputs for an image of a size."""
        return self.form.decode(outputs, size, self.classes)


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
    name = _image_input(model, modality)
    fixed = _fixed_size(model.inputs[name])
    size = description.input_size or fixed or _USUAL_SIZE
    blank = np.zeros((*size, CHANNELS[modality]), np.uint8)
    if fixed not in (None, size):
        model = _resized(described.model, threads, (name, blank), str(fixed))
    outputs = model(_inputs(model, name, blank, InputFormat()))
    form = FORMS[description.output or _recognized(model, outputs, size)]
    classes = _classes(model, description, form, outputs)
    fingerprint = _fingerprint(model, described.description)
    network = DetectorNetwork(model, description, modality, name, size, form, classes, fingerprint)
    network.predict(outputs, size)
    return network


def _resized(
    file: Traversable, threads: int, example: tuple[str, UInt8], fixed_size: str
) -> OnnxModel:
    """Open a file for images of any size.

    Args:
        file: File that states one size.
        threads: Number of threads of the network.
        example: Name of the input, and an image of another size.
        fixed_size: Size that the file states.

    Raises:
        ModelError: the graph computes with the size that the file states.
    """
    name, image = example
    try:
        model = OnnxModel(file, threads=threads, any_image_size=True)
        model(_inputs(model, name, image, InputFormat()))
    except ModelError as error:
        raise ModelError(
            file.name,
            expected=f"a graph that takes images of {InputSize(*image.shape[:2])} instead of {fixed_size}",
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
    if _fixed_size(found) and not required.accepts(found):
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


def _image_input(model: OnnxModel, modality: Modality) -> str:
    """Return the name of the input that takes the image.

    Raises:
        ModelError: the inputs are others than an image and its size.
    """
    channels = CHANNELS[modality]
    images = [name for name in model.inputs if name != _SIZES]
    shape = model.inputs[images[0]].shape if len(images) == 1 else ()
    is_image = len(shape) in (3, 4) and shape[-3] in (None, channels)
    if not is_image or model.inputs[images[0]].type is None:
        raise ModelError(
            model.name,
            expected=f"one image (any, {channels}, height, width) of modality {modality} as input, and at most {_SIZES} beside it",
            found=", ".join(f"{name} {entry}" for name, entry in model.inputs.items()),
        )
    return str(images[0])


def _fixed_size(entry: ModelInput) -> InputSize | None:
    """Return the size of the images of an input, None for any."""
    height, width = entry.shape[-2:]
    return InputSize(height, width) if height and width else None


def _inputs(model: OnnxModel, name: str, image: UInt8, how: InputFormat) -> dict[str, Array]:
    """Return the inputs of a network for an (h, w, C) image."""
    entry = model.inputs[name]
    planes = _normalized(image, how, entry)
    inputs = {name: planes if len(entry.shape) == planes.ndim else planes[None]}
    if _SIZES in model.inputs:
        # Boxes in pixels of the input, from where they are scaled as those of every network.
        inputs[_SIZES] = np.array([image.shape[1::-1]], model.inputs[_SIZES].type)
    return inputs


def _normalized(image: UInt8, how: InputFormat, entry: ModelInput) -> Array:
    """Return the (C, h, w) planes of an image as (scale * pixel - mean) / std."""
    count = image.shape[2]
    planes: UInt8 = np.empty((count, *image.shape[:2]), np.uint8)
    cv2.split(image, list(planes[::-1] if how.color_order == "BGR" else planes))
    if entry.type is np.uint8:
        return planes
    stds, means = np.resize(how.std, count), np.resize(how.mean, count)
    normalized: Float32 = np.empty((count, *image.shape[:2]), np.float32)
    for k, plane in enumerate(planes):
        np.multiply(plane, np.float32(how.scale / stds[k]), out=normalized[k])
        normalized[k] -= np.float32(means[k] / stds[k])
    return normalized.astype(entry.type, copy=False)


def _recognized(model: OnnxModel, outputs: Outputs, size: InputSize) -> OutputFormName:
    name = recognized_form(outputs, frozenset(model.inputs), size)
    if name is None:
        shapes = ", ".join(f"{name} {array.shape}" for name, array in outputs.items())
        raise ModelError(
            model.name,
            expected=f"outputs of a known form: {', '.join(OUTPUT_FORMS)}",
            found=shapes,
            advice="name its form as `output` in a YAML file beside it, or export it in one of these forms",
        )
    return name


def _classes(
    model: OnnxModel, description: DetectorDescription, form: OutputForm, outputs: Outputs
) -> ClassColumns:
    """Return the reported classes.

    Raises:
        ModelError: the names of the network's classes are not known, or a class is none of them.
    """
    count = form.class_count(outputs)
    names = _class_names(model, description, form, count)
    if count is not None and names and max(names) != count - 1:
        raise ModelError(
            model.name,
            expected=f"scores of {len(names)} classes: {', '.join(names.values())}",
            found=f"scores of {count}",
        )
    numbers = {name.lower(): number for number, name in names.items()}
    required = description.classes or {
        name: reported
        for name, reported in KNOWN_CLASSES.items()
        if all(part in numbers for part in name.split(RIDDEN))
    }
    if not required:
        raise ModelError(
            model.name,
            expected="the 80 classes of COCO, or `classes` in a YAML file beside it, such as {0: Car}",
            found=f"{count} classes" if not names else ", ".join(names.values()),
        )
    reported: dict[int, str] = {}
    persons_of = {}
    for key, name in required.items():
        # Of "person + bicycle", the bicycle is reported until a person is found on it.
        person, _, carrier = str(key).lower().rpartition(RIDDEN)
        if person:
            persons_of[name] = reported.get(numbers.get(person, -1), "")
            if not persons_of[name]:
                expected = f"an entry of {person} before {key}"
                raise ModelError(model.name, expected=expected, found=", ".join(map(str, required)))
        number = numbers.get(carrier) if isinstance(key, str) else key
        if number is None or (count is not None and not 0 <= number < count):
            known = ", ".join(names.values()) or f"a number from 0 to {count}"
            raise ModelError(
                model.name, expected=f"classes of the network: {known}", found=str(key)
            )
        reported[number] = name
    return ClassColumns.of_numbers(reported, persons_of)


def _class_names(
    model: OnnxModel, description: DetectorDescription, form: OutputForm, count: int | None
) -> Mapping[int, str]:
    """Return the names of the network's classes by number: as described, as in its metadata, or COCO's."""
    if description.class_names:
        return dict(enumerate(description.class_names))
    if "names" in model.metadata:
        try:
            return {
                int(key): str(name)
                for key, name in ast.literal_eval(model.metadata["names"]).items()
            }
        except (ValueError, SyntaxError, AttributeError):
            pass
    return form.coco if count in (None, len(form.coco)) else {}
