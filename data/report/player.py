"""The player: images of the frames, and what was tracked and detected in each."""

from base64 import b64encode
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

from data.report.frame_images import FrameImages

Cell = str | float | None


@dataclass(frozen=True)
class PlayerFrame:
    """A frame of the player.

    Attributes:
        row: Row of the frame in `frames.jsonl`.
        frame: Index of the frame in the drive.
        time_s: Time since the first frame.
        objects: Objects of the frame, a row of cells each.
    """

    row: int
    frame: int
    time_s: float
    objects: Sequence[Sequence[Cell]] = ()


@dataclass(frozen=True)
class Player:
    """Frames in the order in which they are played.

    Attributes:
        images: Images of the frames.
        frames: Frames; those without images are not played.
        columns: Headings of the objects; none for no table.
        rate_hz: Frames per second where the times of the frames do not tell.
        is_paired: Whether views stand in pairs, as of two runs.
    """

    images: FrameImages
    frames: Sequence[PlayerFrame]
    columns: Sequence[str] = ()
    rate_hz: float = 10.0
    is_paired: bool = False

    @property
    def played(self) -> list[PlayerFrame]:
        """Frames that have images."""
        return [one for one in self.frames if one.row in self.images.images]

    def markup(self) -> str:
        """Return the HTML of the player."""
        places = list(zip(self.images.views, self.images.sizes_px, strict=True))
        row = places[:2] if self.is_paired else places
        shares = " ".join(f"minmax(0, {size[0]}fr)" for _, size in row)
        views = [_view_markup(name, size) for name, size in places]
        if views and self.columns:
            views[0] = f'<div class="side">{views[0]}{self._objects_markup()}</div>'
        count, paired = len(self.played), " paired" if self.is_paired else ""
        return (
            '<div data-player role="group" aria-label="Player">'
            f'<div class="views{paired}" style="grid-template-columns:{shares}">{"".join(views)}</div>'
            f'<div class="controls">{_controls_markup(count)}</div></div>'
            '<p class="note">Keys: <kbd>←</kbd> <kbd>→</kbd> one frame, with <kbd>Shift</kbd> ten, '
            "<kbd>Home</kbd>, <kbd>End</kbd>, <kbd>Space</kbd> plays. A click on a curve shows its "
            f"frame.{self._left_out()}</p>"
        )

    def data(self) -> dict[str, object]:
        """Return what the page's script reads."""
        frames = [
            {
                "frame": one.frame,
                "time_s": round(one.time_s, 4),
                "objects": one.objects,
                "images": [
                    f"data:image/jpeg;base64,{b64encode(image).decode()}"
                    for image in self.images.images[one.row]
                ],
            }
            for one in self.played
        ]
        return {"rate_hz": self.rate_hz, "columns": list(self.columns), "frames": frames}

    def _objects_markup(self) -> str:
        head = "".join(f'<th scope="col">{escape(name)}</th>' for name in self.columns)
        return (
            '<div class="objects" tabindex="0" role="region" aria-label="Objects of the frame">'
            f"<table><thead><tr>{head}</tr></thead><tbody></tbody></table></div>"
        )

    def _left_out(self) -> str:
        count, total = len(self.played), len(self.frames)
        if count == total:
            return ""
        reason = "those of both runs" if self.is_paired else "so that this file stays small"
        return f" The player holds {count} of {total} frames, {reason}."


def _view_markup(name: str, size_px: tuple[int, int]) -> str:
    width, height = size_px
    title = escape(name)
    return (
        f'<figure class="view"><img alt="{title}" data-view="{title}" width="{width}" '
        f'height="{height}"><figcaption>{title}</figcaption></figure>'
    )


def _controls_markup(count: int) -> str:
    speeds = "".join(
        f'<option value="{speed}"{" selected" if speed == "1" else ""}>{speed}×</option>'
        for speed in ("0.25", "0.5", "1", "2", "4")
    )
    return (
        '<button type="button" data-play aria-pressed="false">Play</button>'
        '<button type="button" data-step="-1" aria-label="Previous frame">‹</button>'
        '<button type="button" data-step="1" aria-label="Next frame">›</button>'
        f'<input type="range" min="0" max="{max(count - 1, 0)}" value="0" aria-label="Frame">'
        f'<select aria-label="Speed">{speeds}</select><output></output>'
    )
