"""Description of a detector's ONNX file: a YAML file beside it, or the metadata of a file of this package.

In YAML, with the YAML file's name as the model's where it is not given:

    model: yolox_nano.onnx
    classes: {car: Car, truck: Truck, bus: Truck, person: Pedestrian, person + bicycle: Cyclist}
    input_size: 384x1248
    output: yolox
    color_order: BGR
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any, get_args

from perception.detection.detectors.input_size import InputSize
from perception.detection.detectors.network_input import Alignment, Resize
from perception.detection.detectors.output_forms import (
    OUTPUT_FORMS,
    ColorOrder,
    InputFormat,
    OutputFormName,
)
from perception.errors import UsageError
from perception.maps.densify import FILL_METHODS
from perception.types import MODALITIES, MapFilling, Modality

YAML_SUFFIXES = (".yaml", ".yml")
FILLINGS: tuple[MapFilling, ...] = ("sparse", *FILL_METHODS)


@dataclass(frozen=True)
class DetectorDescription:
    """What a detector's file does not tell; None for what its outputs tell, or for the usual of their form.

    Attributes:
        modality: Modality of the input, else rgb.
        classes: Reported class by number or name of the network's class, or of two, person + bicycle, for the rider
            of one; the network's other classes are left out.
        class_names: Names of the network's classes in their order; else those of its metadata, or COCO's.
        input_size: Size of the input, of a fully convolutional network also where its file states another; images
            of another aspect get a size of about as many pixels.
        output: Form of the outputs.
        color_order: Order of the three colours.
        scale: Factor of the pixels' values, 0 to 255.
        mean: Mean that is subtracted from the scaled pixels.
        std: Standard deviation that the difference is divided by.
        resize: Letterbox, stretch, or the whole image and tiles of it.
        alignment: Place of the image in a letterbox.
        pad_value: Pixel value of the padding, 0 to 255.
        filling: Filling of the maps of its training, else the default.
        jpeg_quality: Quality of the JPEG compression of the images of its training, 1 to 100.
    """

    modality: Modality | None = None
    classes: Mapping[str | int, str] | None = None
    class_names: tuple[str, ...] | None = None
    input_size: InputSize | None = None
    output: OutputFormName | None = None
    color_order: ColorOrder | None = None
    scale: float | None = None
    mean: tuple[float, ...] | None = None
    std: tuple[float, ...] | None = None
    resize: Resize | None = None
    alignment: Alignment | None = None
    pad_value: int | None = None
    filling: MapFilling | None = None
    jpeg_quality: int | None = None

    def over(self, other: "DetectorDescription") -> "DetectorDescription":
        """Return another description with what this one states in place of it."""
        stated = {name: value for name, value in vars(self).items() if value is not None}
        return replace(other, **stated)

    def input_format(self, usual: InputFormat) -> InputFormat:
        """Return the format of the input: what is described, else what is usual."""
        names = (one.name for one in fields(InputFormat))
        return replace(
            usual, **{name: value for name in names if (value := getattr(self, name)) is not None}
        )


@dataclass(frozen=True)
class DescribedFile:
    """An ONNX file with its description.

    Attributes:
        model: ONNX file.
        description: Description, without any value where there is no YAML file.
    """

    model: Traversable
    description: DetectorDescription = DetectorDescription()


def described_file(file: Traversable) -> DescribedFile:
    """Return the ONNX file of a YAML file or the YAML file beside an ONNX file, where there is one.

    Raises:
        UsageError: the YAML file cannot be read, or holds something else than a description.
    """
    if not isinstance(file, Path):
        return DescribedFile(file)
    if file.suffix in YAML_SUFFIXES:
        return _read(file)
    beside = [path for suffix in YAML_SUFFIXES if (path := file.with_suffix(suffix)).is_file()]
    return replace(_read(beside[0]), model=file) if beside else DescribedFile(file)


def _read(file: Path) -> DescribedFile:
    import yaml

    from perception.yaml_text import read_yaml

    try:
        entries = read_yaml(file.read_text())
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        found = str(error).partition("\n")[0]
        raise UsageError(file, expected="a YAML file of a detector", found=found) from error
    if not isinstance(entries, dict):
        raise UsageError(file, expected="entries such as `model: file.onnx`", found=str(entries))
    known = [one.name for one in fields(DetectorDescription)]
    for name in entries:
        if name not in ("model", *known):
            expected = f"some of model, {', '.join(known)}"
            raise UsageError(file, expected=expected, found=str(name))
    model = file.parent / str(entries.pop("model", f"{file.stem}.onnx"))
    values = {name: _entry(file, name, value) for name, value in entries.items()}
    return DescribedFile(model, DetectorDescription(**values))


_WORDS: Mapping[str, tuple[str, ...]] = {
    "modality": MODALITIES,
    "output": OUTPUT_FORMS,
    "color_order": get_args(ColorOrder),
    "resize": get_args(Resize),
    "alignment": get_args(Alignment),
    "filling": FILLINGS,
}
_NUMBERS: Mapping[str, tuple[int, int]] = {"pad_value": (0, 255), "jpeg_quality": (1, 100)}


def _entry(file: Path, name: str, value: Any) -> Any:  # noqa: ANN401 - anything may stand in a YAML file
    """Return the value of an entry.

    Raises:
        UsageError: the entry cannot have this value.
    """
    where = f"{file}, {name}"
    if name in _WORDS:
        return _one_of(where, value, _WORDS[name])
    if name in _NUMBERS:
        return _whole_number(where, value, *_NUMBERS[name])
    if name == "input_size":
        return InputSize.parse(str(value))
    if name == "classes":
        return _classes(where, value)
    if name == "class_names":
        return _names(where, value)
    numbers = value if isinstance(value, list) else [value]
    if not numbers or not all(_is_number(one) for one in numbers):
        raise UsageError(where, expected="a number, or one of each colour", found=str(value))
    return tuple(map(float, numbers)) if name != "scale" else float(numbers[0])


def _one_of(where: str, value: object, known: tuple[str, ...]) -> str:
    if value not in known:
        raise UsageError(where, expected=f"one of {', '.join(known)}", found=str(value))
    return str(value)


def _whole_number(where: str, value: object, smallest: int, largest: int) -> int:
    if not isinstance(value, int) or not smallest <= value <= largest:
        expected = f"a whole number from {smallest} to {largest}"
        raise UsageError(where, expected=expected, found=str(value))
    return value


def _classes(where: str, value: Any) -> dict[str | int, str]:  # noqa: ANN401 - as above
    is_map = isinstance(value, dict) and all(isinstance(name, str) for name in value.values())
    if not value or not is_map:
        expected = "a class for each of the network's, such as {car: Car, bus: Truck} or {2: Car}"
        raise UsageError(where, expected=expected, found=str(value))
    return dict(value)


def _names(where: str, value: object) -> tuple[str, ...]:
    if not isinstance(value, list) or not value:
        raise UsageError(where, expected="a list of names", found=str(value))
    return tuple(map(str, value))


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)
