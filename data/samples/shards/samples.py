"""Samples as members of tar files: `NAME.dm.png`, `NAME.rm.png` or `NAME.rgb.png`, and `NAME.json` with the labels.

This is the convention of WebDataset, whose readers read these files too.
"""

import io
import json
import tarfile
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from data.array_store import Arrays
from perception.detection.detectors.network_input import PixelRectangle
from perception.types import Boxes3D, Labels, UInt8


@dataclass(frozen=True)
class ShardSample:
    """One sample of a shard.

    Attributes:
        labels: Labels in pixels of the original image.
        region: What the input shows of the original image.
        pictures: Encoded images, PNG, by modality.
    """

    labels: Labels
    region: PixelRectangle
    pictures: dict[str, bytes]

    def image(self, modality: str) -> UInt8:
        """Return the (h, w, C) input image of a modality."""
        data = np.frombuffer(self.pictures[modality], np.uint8)
        found = cv2.imdecode(data, cv2.IMREAD_UNCHANGED)
        image = np.atleast_3d(np.asarray(found, np.uint8))
        return np.ascontiguousarray(image[..., ::-1])  # OpenCV: blue, green, red


def members(name: str, arrays: Arrays, labels: Labels) -> Iterator[tuple[str, bytes]]:
    """Yield names and contents of the files of one sample.

    Args:
        name: Name of the sample, without dots and slashes.
        arrays: Images by modality, (h, w, C), and `region`, as `make_images` returns them.
        labels: Labels in pixels of the original image.
    """
    for modality in ("rgb", "dm", "rm"):
        if modality in arrays:
            _, encoded = cv2.imencode(".png", np.asarray(arrays[modality])[..., ::-1])
            yield f"{name}.{modality}.png", encoded.tobytes()
    boxes = labels.boxes_velo
    document = {
        "region": arrays["region"].tolist(),
        "types": labels.types.astype(str).tolist(),
        "boxes_px": labels.boxes_px.tolist(),
        "truncation": labels.truncation.tolist(),
        "occlusion": labels.occlusion.tolist(),
        "track_ids": labels.track_ids.tolist(),
        "bottom_m": boxes.bottom_m.tolist(),
        "size_m": boxes.size_m.tolist(),
        "yaw_rad": boxes.yaw_rad.tolist(),
        "dont_care_px": labels.dont_care_px.tolist(),
    }
    yield f"{name}.json", json.dumps(document).encode()


def pack(files: Iterable[tuple[str, bytes]]) -> bytes:
    """Return the tar file of some files; the same files give the same bytes."""
    stream = io.BytesIO()
    with tarfile.open(fileobj=stream, mode="w", format=tarfile.USTAR_FORMAT) as tar:
        for name, content in files:
            entry = tarfile.TarInfo(name)
            entry.size = len(content)
            tar.addfile(entry, io.BytesIO(content))
    return stream.getvalue()


def unpack(data: bytes) -> list[ShardSample]:
    """Return the samples of a tar file that `pack` made, in order."""
    files: dict[str, dict[str, bytes]] = {}
    with tarfile.open(fileobj=io.BytesIO(data), mode="r:") as tar:
        for entry in tar:
            name, _, kind = entry.name.partition(".")
            content = tar.extractfile(entry)
            assert content is not None  # the hash of the shard says that we wrote it
            files.setdefault(name, {})[kind] = content.read()
    return [_sample(of_sample) for of_sample in files.values()]


def _sample(files: dict[str, bytes]) -> ShardSample:
    document: dict[str, Any] = json.loads(files.pop("json"))
    pictures = {kind.removesuffix(".png"): content for kind, content in files.items()}
    region = PixelRectangle(*document.pop("region"))
    return ShardSample(_labels(document), region, pictures)


def _labels(document: dict[str, Any]) -> Labels:
    def rows(name: str, width: int) -> np.ndarray:
        return np.array(document[name], np.float64).reshape(-1, width)

    boxes = Boxes3D(
        bottom_m=rows("bottom_m", 3),
        size_m=rows("size_m", 3),
        yaw_rad=np.array(document["yaw_rad"], np.float64),
    )
    return Labels(
        boxes_velo=boxes,
        boxes_px=rows("boxes_px", 4),
        types=np.array(document["types"], np.str_),
        track_ids=np.array(document["track_ids"], np.int64),
        truncation=np.array(document["truncation"], np.float64),
        occlusion=np.array(document["occlusion"], np.int64),
        dont_care_px=rows("dont_care_px", 4),
    )
