"""A page that shows each proposed object from above and saves the decisions on it; one file that needs no network."""

import base64
import json
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path

import cv2
import numpy as np

from data.label_proposals.proposals import Proposal
from data.label_proposals.review import REVIEW_FORMAT
from perception.atomic_file import write_atomically
from perception.detection.bev.classes import BEV_CLASSES
from perception.types import Boxes3D, Float, UInt8

PAGE_NAME = "review.html"
_HERE = Path(__file__).parent
_SIDE_PX, _MARGIN_M = 160, 3.0
_STYLE = """
body{font:14px sans-serif;margin:1em;background:#fafafa}header{position:sticky;top:0;background:#fafafa;padding:.5em 0}
#list{display:grid;grid-template-columns:repeat(auto-fill,minmax(180px,1fr));gap:10px}
article{border:3px solid #ccc;border-radius:6px;padding:6px;background:#fff}article.accept{border-color:#2a2}
article.reject{border-color:#c22;opacity:.6}img{width:160px;display:block}p{margin:.3em 0}.reasons{color:#a40;min-height:1em}
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
            "image": _encoded(pictures.get(one.number, np.zeros((8, 8), np.uint8))),
        }
        for one in sorted(proposals, key=lambda one: -one.urgency)
    ]
    classes = sorted({*BEV_CLASSES, *(one.kind for one in proposals)})
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
    _, data = cv2.imencode(".png", image)
    return base64.b64encode(data.tobytes()).decode()
