"""KITTI's tracklets, as the raw data set and CVAT write them: an object at a time, with a pose for each of its frames."""

import re
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from data.box_labels.boxes import (
    Frames,
    LabelForm,
    LabelledBox,
    LabelledFrame,
    Reading,
    as_stated,
    from_bottom,
    rounded,
    write_document,
)
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


def _write(out: Path, frames: Sequence[LabelledFrame]) -> None:
    """Write each object's boxes in frames that follow each other; a gap begins a new tracklet."""
    parts: dict[str, list[list[tuple[int, LabelledBox]]]] = {}
    for frame in frames:
        for number, box in enumerate(frame.boxes):
            runs = parts.setdefault(box.track or f"{frame.number}-{number}", [])
            if not runs or runs[-1][-1][0] != frame.number - 1:
                runs.append([])
            runs[-1].append((frame.number, box))
    items = [_item(run) for runs in parts.values() for run in runs]
    text = (
        '<?xml version="1.0" encoding="UTF-8" standalone="yes" ?>\n<!DOCTYPE boost_serialization>\n'
        '<boost_serialization signature="serialization::archive" version="9">\n<tracklets class_id="0">\n'
        f"<count>{len(items)}</count>\n<item_version>1</item_version>\n{''.join(items)}</tracklets>\n</boost_serialization>\n"
    )
    write_document(out / "tracklet_labels.xml", text)


def _item(run: Sequence[tuple[int, LabelledBox]]) -> str:
    """Return the element of one object, whose sizes are those of its first box."""
    first = run[0][1]
    sizes = _elements(("l", "w", "h"), first.numbers[3:6])
    poses = ""
    for _, one in run:
        x, y, z, _, _, height, heading = one.numbers
        pose = _elements(
            ("tx", "ty", "tz", "rx", "ry", "rz"), (x, y, z - height / 2, 0, 0, heading)
        )
        poses += f"<item>{pose}<state>2</state></item>\n"
    return (
        f"<item><objectType>{escape(first.kind)}</objectType>{sizes}<first_frame>{run[0][0]}</first_frame>\n"
        f"<poses><count>{len(run)}</count><item_version>2</item_version>\n{poses}</poses><finished>1</finished></item>\n"
    )


def _elements(names: Sequence[str], values: Sequence[float]) -> str:
    pairs = zip(names, rounded(values), strict=True)
    return "".join(f"<{name}>{value}</{name}>" for name, value in pairs)


TRACKLETS = LabelForm(
    "KITTI's tracklets",
    lambda text: isinstance(text, str) and "<tracklets" in text[:4000],
    _read,
    (
        Reading("z of the bottom", from_bottom),
        Reading("z of the centre", as_stated),
        Reading("w, h and l along x, y and z", _exported),
    ),
    _write,
)
