"""Faults of sensors and stages as small lines in the corner of an image; none where all is well."""

from perception.render import palette
from perception.render.canvas import draw_text, text_width_px
from perception.types import Health, HealthLevel, UInt8

_MAX_LINES = 3
_MARGIN, _LINE = 0.8, 1.9  # in heights of the text
# Orange and red that the colour blind tell apart (Okabe and Ito 2008).
_COLORS = {HealthLevel.WARN: (230, 159, 0), HealthLevel.ERROR: (255, 96, 64)}


def draw_health(canvas: UInt8, health: Health, text_px: int) -> None:
    """Write level and name of the worst faults, upper left, on a dark ground.

    Args:
        canvas: (H, W, 3) image.
        health: Health of the frame.
        text_px: Height of capitals.
    """
    levels: dict[str, HealthLevel] = {}
    for one in health.findings:
        levels.setdefault(one.fault, one.level)
    margin, line = round(_MARGIN * text_px), round(_LINE * text_px)
    for row, (fault, level) in enumerate(list(levels.items())[:_MAX_LINES]):
        text = f"{level.name}  {fault}"
        top, width = margin + row * line, text_width_px(text, text_px)
        canvas[top : top + line, margin : 3 * margin + width] = palette.BACKGROUND
        at = (2 * margin, top + (line + text_px) / 2)
        draw_text(canvas, text, at, color=_COLORS[level], height_px=text_px)
