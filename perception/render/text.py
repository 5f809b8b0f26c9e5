"""Anti-aliased words on a picture."""

from enum import Enum
from functools import lru_cache

import cv2

from perception.render.palette import TEXT, Color
from perception.types import UInt8

_FONT = cv2.FONT_HERSHEY_SIMPLEX


class Align(Enum):
    """Which end of a line of words stands at its position."""

    LEFT = 0.0
    CENTER = 0.5
    RIGHT = 1.0


def draw_text(
    canvas: UInt8,
    text: str,
    position_px: tuple[float, float],
    *,
    color: Color = TEXT,
    height_px: int = 11,
    align: Align = Align.LEFT,
) -> None:
    """Write one line of capitals that high onto the canvas, its baseline at (column, row)."""
    width = text_width_px(text, height_px) if align is not Align.LEFT else 0
    origin = (round(position_px[0] - width * align.value), round(position_px[1]))
    cv2.putText(canvas, text, origin, _FONT, _scale(height_px), color, 1, cv2.LINE_AA)


@lru_cache(maxsize=1024)
def text_width_px(text: str, height_px: int = 11) -> int:
    """Return the width of one line."""
    return int(cv2.getTextSize(text, _FONT, _scale(height_px), 1)[0][0])


@lru_cache
def _scale(height_px: int) -> float:
    return float(cv2.getFontScaleFromHeight(_FONT, height_px))
