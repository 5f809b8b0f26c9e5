"""Reader of Darknet's weight files.

    int32 major, minor, revision
    int32 or uint64 images seen: 64 bits from version 0.2 on
    float32 numbers, little-endian, of one convolution after the other in the order of the cfg:
        with batch norm      bias, scale, running mean, running variance, weights
        without              bias, weights
        weights are (out, in, height, width)

A file of the first layers alone, such as `darknet19_448.conv.23`, ends where they end.
"""

import struct
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from perception.errors import ModelError
from perception.types import Float32
from train.networks.yolov2 import YOLOv2

_VERSION = struct.Struct("<3i")
_FEW_SEEN, _MANY_SEEN = struct.Struct("<i"), struct.Struct("<Q")
_NUMBER = np.dtype("<f4")


@dataclass(frozen=True)
class DarknetHeader:
    """Header of a weight file.

    Attributes:
        major: Major version of Darknet.
        minor: Minor version of Darknet.
        revision: Revision of Darknet.
        images_seen: Number of images seen in training.
    """

    major: int = 0
    minor: int = 2
    revision: int = 0
    images_seen: int = 0

    @property
    def seen_format(self) -> struct.Struct:
        """Return the format of `images_seen`; versions over 1000 mark very old files."""
        is_long = 10 * self.major + self.minor >= 2 and max(self.major, self.minor) < 1000
        return _MANY_SEEN if is_long else _FEW_SEEN

    @property
    def size_bytes(self) -> int:
        """Return the length of the header."""
        return _VERSION.size + self.seen_format.size


def load_darknet_weights(
    network: nn.Module, path: Path, *, is_prefix: bool = False
) -> DarknetHeader:
    """Load the weights of a network, or of a part such as its backbone; return the file's header.

    Args:
        network: Network whose modules were created in the order of the cfg.
        path: Weight file.
        is_prefix: Take the first numbers and ignore the rest, for a backbone from a whole detector.

    Raises:
        ModelError: the file is unreadable, no weight file, of another network, or has numbers that are not finite.
    """
    content = _read(path)
    header = _parse_header(content, path)
    slots = list(weight_slots(network))
    required = sum(slot.numel() for slot in slots)
    numbers = _parse_numbers(content[header.size_bytes :], required, path, is_prefix)
    ends = np.cumsum([slot.numel() for slot in slots])
    with torch.no_grad():
        for slot, part in zip(slots, np.split(numbers, ends[:-1]), strict=True):
            slot.copy_(torch.from_numpy(part).reshape(slot.shape))
    return header


def init_from_darknet(detector: YOLOv2, path: Path) -> str:
    """Initialize as much of a detector as a weight file holds; return the name of that part.

    Args:
        detector: Detector with random weights.
        path: Weights of a whole detector with as many classes and anchors; of a detector with others, whose head
            is left out; or of a backbone such as `darknet19_448.conv.23`.

    Raises:
        ModelError: the file fits none of these.
    """
    with suppress(ModelError):
        load_darknet_weights(detector, path)
        return "detector"
    with suppress(ModelError):
        load_darknet_weights(detector.trunk, path, is_prefix=True)
        return "trunk"
    backbone = detector.trunk.get_submodule("backbone")
    load_darknet_weights(backbone, path, is_prefix=True)
    return "backbone"


def weight_slots(network: nn.Module) -> Iterator[Tensor]:
    """Yield the tensors of a network in the order of the file."""
    layers = [part for part in network.modules() if isinstance(part, nn.Conv2d | nn.BatchNorm2d)]
    for layer, behind in zip(layers, [*layers[1:], None], strict=True):
        if isinstance(layer, nn.BatchNorm2d):
            continue
        norm = behind if isinstance(behind, nn.BatchNorm2d) else None
        yield from _norm_slots(norm) if norm is not None else _bias_slots(layer)
        yield layer.weight


def _norm_slots(norm: nn.BatchNorm2d) -> list[Tensor]:
    statistics = [part for part in (norm.running_mean, norm.running_var) if part is not None]
    return [norm.bias, norm.weight, *statistics]


def _bias_slots(layer: nn.Module) -> list[Tensor]:
    return [layer.bias] if isinstance(layer.bias, Tensor) else []


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        reason = error.strerror or str(error)
        raise ModelError(path, expected="a readable weight file", found=reason) from error


def _parse_header(content: bytes, path: Path) -> DarknetHeader:
    shortest = _VERSION.size + _FEW_SEEN.size
    if len(content) >= shortest:
        header = DarknetHeader(*_VERSION.unpack_from(content))
        if len(content) >= header.size_bytes:
            (seen,) = header.seen_format.unpack_from(content, _VERSION.size)
            return DarknetHeader(header.major, header.minor, header.revision, seen)
    raise ModelError(
        path, expected=f"a header of {shortest} bytes or more", found=f"a file of {len(content)}"
    )


def _parse_numbers(content: bytes, required: int, path: Path, is_prefix: bool) -> Float32:
    found, rest = divmod(len(content), _NUMBER.itemsize)
    fits = found >= required if is_prefix else (found, rest) == (required, 0)
    if not fits:
        raise ModelError(
            path,
            expected=f"{'at least ' if is_prefix else ''}{required} numbers for this network",
            found=f"{found}" + (f" and {rest} bytes" if rest else ""),
            advice="check the class list, the anchors, and that the download is complete",
        )
    numbers = np.frombuffer(content, _NUMBER, required).astype(np.float32)
    if not np.isfinite(numbers).all():
        raise ModelError(path, expected="finite numbers", found="NaN or infinity")
    return numbers
