"""KITTI's tracklets, as the raw data set and CVAT write them: an object at a time, with a pose for each of its frames."""

import re
from pathlib import Path
from typing import Any

import numpy as np

from data.box_labels.boxes import Frames, LabelForm, LabelledBox, Reading, as_stated, from_bottom
from data.kitti.rows import to_numbers
from data.kitti360.storage import parse_elements
from perception.errors import LabelError
from perception.types import Float64

_DOCUMENT_TYPE = re.compile(r"<!DOCTYPE\s+\w+\s*>")  # which declares nothing
_SIZES, _POSE = ("l", "w", "h"), ("tx", "ty", "tz", "rz")


def _read(path: Path, text: Any) -> Frames:  # noqa: ANN401 - a text
    root = parse_elements(path, _DOCUMENT_TYPE.sub("", text, count=1))
    frames: dict[str, list[LabelledBox]] = {}
    for track, one in enumerate(root.findall("tracklets/item")):
        where = f"{path} tracklet {track}"
        first = one.findtext("first_frame", "").strip()
        if not first.isdecimal():
            raise LabelError(where, expected="the number of its first frame", found=repr(first))
        sizes = _numbers(one, _SIZES)
        for step, pose in enumerate(one.findall("poses/item")):
            frame = int(first) + step
            x, y, z, yaw = _numbers(pose, _POSE)
            frames.setdefault(str(frame), []).append(
                LabelledBox(
                    f"{where} frame {frame}",
                    one.findtext("objectType", "").strip(),
                    str(track),
                    (x, y, z, *sizes, yaw),
                )
            )
    return frames


def _numbers(element: Any, names: tuple[str, ...]) -> list[float]:  # noqa: ANN401 - of XML
    """Return the numbers of some names; NaN of one that is missing or no number."""
    words = [element.findtext(name, "") for name in names]
    numbers: list[float] = to_numbers([words], len(names))[0].tolist()
    return numbers


def _exported(numbers: Float64) -> Float64:
    """Return boxes of Datumaro's exporter, which writes lengths along x, y and z as w, h and l."""
    return np.column_stack([numbers[:, :3], numbers[:, [4, 5, 3]], numbers[:, 6]])


TRACKLETS = LabelForm(
    "KITTI's tracklets",
    lambda text: isinstance(text, str) and "<tracklets" in text[:4000],
    _read,
    (
        Reading("z of the bottom", from_bottom),
        Reading("z of the centre", as_stated),
        Reading("w, h and l along x, y and z", _exported),
    ),
)
