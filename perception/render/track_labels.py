"""Labels of tracks beside their boxes: id and speed on dark tags that do not overlap."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from perception.render import palette
from perception.render.canvas import darken_tag, draw_text, text_width_px
from perception.render.palette import Color
from perception.render.track_figures import TrackFigures
from perception.types import Float64, UInt8

_GAP_PX = 4


@dataclass(frozen=True)
class Tag:
    """A rectangle of a canvas in whole pixels; right and bottom are exclusive."""

    left: int
    top: int
    right: int
    bottom: int

    def overlaps(self, other: "Tag") -> bool:
        """Return whether two tags share a pixel."""
        return (
            self.left < other.right
            and other.left < self.right
            and self.top < other.bottom
            and other.top < self.bottom
        )

    def is_within(self, canvas: UInt8) -> bool:
        """Return whether the tag lies on the canvas."""
        height, width = canvas.shape[:2]
        return self.left >= 0 and self.top >= 0 and self.right <= width and self.bottom <= height


def draw_track_labels(
    canvas: UInt8, outlines_px: Float64, figures: TrackFigures, text_px: int
) -> None:
    """Write id and speed beside each box, the nearest first; a label without free space is left out.

    Args:
        canvas: (H, W, 3) canvas.
        outlines_px: (T, 4) x1 y1 x2 y2 around each box; x1 > x2 where it is not visible.
        figures: (T) tracks as lines and faces.
        text_px: Height of capitals.
    """
    taken: list[Tag] = []
    # Boxes are clipped to the canvas.
    height, width = canvas.shape[:2]
    outlines = np.clip(outlines_px, 0, (width, height, width, height))
    is_observed = (outlines[:, 2:] > outlines[:, :2]).all(axis=1)
    for row in reversed(np.flatnonzero(is_observed).tolist()):
        label = _Label.of(figures, row, text_px)
        for tag in _places(np.rint(outlines[row]).astype(int).tolist(), label.size_px, width):
            if tag.is_within(canvas) and not any(tag.overlaps(other) for other in taken):
                label.draw(canvas, tag)
                taken.append(tag)
                break


@dataclass(frozen=True)
class _Label:
    """Label of one track."""

    name: str
    speed: str
    color: Color
    speed_color: Color
    text_px: int

    @classmethod
    def of(cls, figures: TrackFigures, row: int, text_px: int) -> "_Label":
        track = int(figures.tracks.ids[row])
        speed = f"{figures.speeds_m_s[row]:.1f} m/s"
        tone = palette.TEXT if figures.tracks.is_observed[row] else palette.FAINT_TEXT
        return cls(str(track), speed, palette.track_color(track), tone, text_px)

    @property
    def indent_px(self) -> int:
        """Column at which the speed begins."""
        return round(1.4 * self.text_px) + text_width_px(self.name, self.text_px)

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height of the tag."""
        width = self.indent_px + text_width_px(self.speed, self.text_px) + self.text_px // 2
        return width, round(1.9 * self.text_px)

    def draw(self, canvas: UInt8, tag: Tag) -> None:
        """Darken the tag and write the label."""
        area = canvas[tag.top : tag.bottom, tag.left : tag.right]
        darken_tag(area, self.color, self.text_px)
        baseline = tag.top + 1.45 * self.text_px
        left = tag.left + 0.6 * self.text_px
        draw_text(canvas, self.name, (left, baseline), color=self.color, height_px=self.text_px)
        draw_text(
            canvas,
            self.speed,
            (tag.left + self.indent_px, baseline),
            color=self.speed_color,
            height_px=self.text_px,
        )


def _places(
    outline_px: Sequence[int], size_px: tuple[int, int], canvas_width_px: int
) -> Iterator[Tag]:
    """Yield possible positions of a tag, best first: above its box, below, beside, higher."""
    x1, y1, x2, y2 = outline_px
    width, height = size_px
    left = min(max((x1 + x2 - width) // 2, 0), canvas_width_px - width)
    over, beside = y1 - _GAP_PX - height, (y1 + y2 - height) // 2
    corners = [(left, over), (left, y2 + _GAP_PX)]
    corners += [(x2 + _GAP_PX, beside), (x1 - _GAP_PX - width, beside)]
    corners += [(left, over - steps * (height + 2)) for steps in (1, 2)]
    for column, row in corners:
        yield Tag(column, row, column + width, row + height)
