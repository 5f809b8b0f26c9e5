"""A page that shows each proposed object from above and saves the decisions on it; one file that needs no network."""

import base64
import json
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path

import cv2
import numpy as np

from data.label_proposals.proposals import Proposal
from data.label_proposals.review import REVIEW_FORMAT, known_classes
from perception.atomic_file import write_atomically
from perception.geometry.camera import box_outlines_px
from perception.types import Boxes3D, Float, Float64, Frame, UInt8

PAGE_NAME = "review.html"
_HERE = Path(__file__).parent
_SIDE_PX, _MARGIN_M = 160, 3.0
_CROP, _MIN_CROP_PX = (
    0.75,
    40.0,
)  # half a side of a crop: by the longer one of the box, and at least
_JPEG = (cv2.IMWRITE_JPEG_QUALITY, 85)
_STYLE = """
body{font:14px sans-serif;margin:1em;background:#fafafa}header{position:sticky;top:0;background:#fafafa;padding:.5em 0}
#list{display:grid;grid-template-columns:repeat(auto-fill,minmax(335px,1fr));gap:10px}
article{border:3px solid #ccc;border-radius:6px;padding:6px;background:#fff}article.accept{border-color:#2a2}
article.reject{border-color:#c22;opacity:.6}img{height:160px;display:block}button,select{margin-right:.4em}p{margin:.3em 0}.reasons{color:#a40;min-height:1em}
"""


def preview_of(points_velo: Float, box_velo: Boxes3D) -> UInt8:
    """Return an (S, S) image of the returns around one box from above, its heading to the right; lighter is higher.

    Args:
        points_velo: (N, 3) returns, or with more columns.
        box_velo: One box.
    """
    (length, width, height), yaw = box_velo.size_m[0], float(box_velo.yaw_rad[0])
    reach_m = max(length, width) / 2 + _MARGIN_M
    offsets = points_velo[:, :3] - box_velo.bottom_m[0]
    near = offsets[(np.abs(offsets[:, :2]) < 1.5 * reach_m).all(axis=1)]
    cos, sin = np.cos(yaw), np.sin(yaw)
    x, y = cos * near[:, 0] + sin * near[:, 1], cos * near[:, 1] - sin * near[:, 0]
    scale = _SIDE_PX / (2 * reach_m)
    columns = np.floor((x + reach_m) * scale).astype(np.int64)
    rows = np.floor((reach_m - y) * scale).astype(np.int64)
    lit = np.clip(80 + 160 * near[:, 2] / max(height, 1.0), 50, 250)
    image = np.zeros((_SIDE_PX, _SIDE_PX), np.uint8)
    kept = (columns >= 0) & (columns < _SIDE_PX) & (rows >= 0) & (rows < _SIDE_PX)
    np.maximum.at(image, (rows[kept], columns[kept]), lit[kept].astype(np.uint8))
    low = (int((reach_m - length / 2) * scale), int((reach_m - width / 2) * scale))
    high = (int((reach_m + length / 2) * scale), int((reach_m + width / 2) * scale))
    cv2.rectangle(image, low, high, 255, 1)
    front = (high[0], _SIDE_PX // 2)
    cv2.line(image, (_SIDE_PX // 2, _SIDE_PX // 2), front, 255, 1)
    return image


def camera_preview(frame: Frame, box_velo: Boxes3D) -> UInt8 | None:
    """Return an (S, S, 3) crop of the image that shows a box best, drawn in it; None where no camera shows it.

    Args:
        frame: Frame with the images of its cameras.
        box_velo: One box.
    """
    shown: list[tuple[float, UInt8, Float64]] = []
    for view in frame.views:
        if view.image is not None and view.calibration is not None:
            size_px = view.image.shape[1::-1]
            box_px = box_outlines_px(view.calibration.image_P_velo, box_velo, size_px)[0]
            shown.append((abs(float(box_px[[0, 2]].mean()) - size_px[0] / 2), view.image, box_px))
    shown = [one for one in shown if np.isfinite(one[0])]
    if not shown:
        return None
    _, image, box_px = min(shown, key=lambda one: one[0])
    image_px = np.array(image.shape[1::-1])
    half_px = min(max(_CROP * (box_px[2:] - box_px[:2]).max(), _MIN_CROP_PX), image_px.min() / 2)
    middle_px = np.clip((box_px[:2] + box_px[2:]) / 2, half_px, image_px - half_px)
    (x, y), side = (middle_px - half_px).astype(np.int64), int(2 * half_px)
    crop = np.asarray(cv2.resize(image[y : y + side, x : x + side], (_SIDE_PX, _SIDE_PX)), np.uint8)
    low, high = ((box_px.reshape(2, 2) - (x, y)) * _SIDE_PX / side).round().astype(np.int64)
    cv2.rectangle(crop, low.tolist(), high.tolist(), (255, 200, 0), 1)
    return crop


def preview(frame: Frame, box_velo: Boxes3D) -> UInt8:
    """Return an (S, S, 3) image of a box from above, or (S, 2 S, 3) with that of a camera to its right.

    Args:
        frame: Frame of the box.
        box_velo: One box.
    """
    above = np.repeat(preview_of(frame.points_velo, box_velo)[:, :, None], 3, axis=2)
    seen = camera_preview(frame, box_velo)
    return above if seen is None else np.hstack([above, seen])


def write_review_page(
    folder: Path, drive: str, proposals: Sequence[Proposal], pictures: Mapping[int, UInt8]
) -> None:
    """Write the page, with the objects first that are most worth a look.

    Args:
        folder: Folder of the page.
        drive: Name of the drive.
        proposals: Proposals.
        pictures: Picture of each by its number.
    """
    objects = [
        {
            "number": one.number,
            "type": one.kind,
            "confidence": f"{one.confidence:.0%}",
            "facts": _facts(one),
            "reasons": one.reasons,
            "image": _encoded(pictures.get(one.number, np.zeros((8, 8, 3), np.uint8))),
        }
        for one in sorted(proposals, key=lambda one: -one.urgency)
    ]
    classes = known_classes(proposals)
    content = {"format": REVIEW_FORMAT, "drive": drive, "classes": classes, "objects": objects}
    text = json.dumps(content).replace("<", "\\u003c")
    page = (
        f'<!DOCTYPE html><html lang="en"><head><meta charset="utf-8"><title>{escape(drive)}</title>'
        f"<style>{_STYLE}</style></head><body><header><b>{escape(drive)}</b> <span id=count></span> "
        "<button id=save>save review.json</button></header><div id=list></div>"
        f'<script type="application/json" id="objects">{text}</script>'
        f"<script>{(_HERE / 'review.js').read_text()}</script></body></html>\n"
    )
    write_atomically(folder / PAGE_NAME, page.encode())


def _facts(one: Proposal) -> str:
    length, width, height = one.boxes_world.size_m[0]
    moves = "moving" if one.is_moving else "parked"
    return (
        f"{moves}, {length:.1f} x {width:.1f} x {height:.1f} m, frames {one.frames[0]} to {one.frames[-1]}, "
        f"up to {one.points.max()} returns"
    )


def _encoded(image: UInt8) -> str:
    _, data = cv2.imencode(".jpg", image[..., ::-1], _JPEG)
    return base64.b64encode(data.tobytes()).decode()
