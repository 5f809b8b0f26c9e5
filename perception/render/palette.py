"""The style of all images and figures: colours, RGB 0 to 255, line patterns, widths of lines and heights of text."""

from dataclasses import dataclass
from typing import Self

from perception.types import Modality

Color = tuple[int, int, int]
LinePattern = tuple[float, tuple[tuple[float, float], ...]]

# Ground and obstacles (static red and moving green as in thesis Fig. 5.7).
GROUND: Color = (46, 120, 255)
GROUND_MESH: Color = (150, 200, 255)
STATIC: Color = (240, 62, 54)
MOVING: Color = (64, 232, 96)
FREE: Color = (40, 210, 190)
OCCUPIED: Color = (255, 176, 48)
# Colours of objects, neighbours far apart. With normal vision and with each kind of colour blindness
# they differ from one another and from the three colours above (tests/render/test_palette.py).
TRACKS: tuple[Color, ...] = (
    (255, 255, 0),
    (255, 85, 170),
    (170, 255, 255),
    (187, 119, 221),
    (221, 187, 170),
    (204, 255, 170),
    (187, 187, 238),
)

# Colours of classes (all but the last two of Okabe and Ito 2008), which the colour blind distinguish, too.
CLASSES: dict[str, Color] = {
    "Car": (86, 180, 233),
    "Van": (0, 158, 115),
    "Truck": (213, 94, 0),
    "Bus": (230, 159, 0),
    "Trailer": (0, 114, 178),
    "Pedestrian": (204, 121, 167),
    "Cyclist": (240, 228, 66),
    "Motorcycle": (150, 80, 250),
    "Bicycle": (200, 245, 200),
}

# Object of the one-object tracker, its region of the image and the ring around it (thesis Fig. 5.13), the path of
# the vehicle, and the label.
TRACKED_OBJECT: Color = (255, 168, 36)
INSIDE: Color = (60, 132, 255)
RING: Color = (240, 62, 54)
EGO_PATH: Color = (232, 84, 232)
TRUTH: Color = (120, 235, 160)

# Lines of the boxes of each modality's detector: length of a pattern in pixels, and the shares of it that are drawn.
LINE_PATTERNS: dict[Modality, LinePattern] = {
    "rgb": (12.0, ((0.0, 0.6),)),
    "dm": (6.0, ((0.0, 0.4),)),
    "rm": (18.0, ((0.0, 0.5), (0.67, 0.83))),
}

# Backgrounds, text and the recording vehicle.
BACKGROUND: Color = (13, 15, 20)
PANEL: Color = (20, 23, 31)
GRID: Color = (92, 106, 138)
POINTS: Color = (120, 128, 144)
GROUND_POINTS: Color = (104, 150, 226)
TEXT: Color = (226, 230, 238)
FAINT_TEXT: Color = (136, 144, 160)
VEHICLE: Color = (206, 212, 224)
GLASS: Color = (58, 68, 86)

# Colours of the pipeline's stages, and of curves and bars by number.
STAGES: tuple[Color, ...] = (
    (88, 166, 255),
    (64, 200, 190),
    (163, 128, 255),
    (255, 166, 87),
    (247, 120, 186),
    (150, 200, 90),
    (120, 130, 255),
    (220, 210, 90),
    (205, 155, 115),
    (165, 178, 195),
    (228, 160, 240),
)


def track_color(number: int) -> Color:
    """Return the colour of an object by its number; grey of one without a track, -1."""
    return TRACKS[number % len(TRACKS)] if number >= 0 else FAINT_TEXT


def class_color(name: str) -> Color:
    """Return the colour of a class; grey of another one."""
    return CLASSES.get(name, FAINT_TEXT)


def dimmed(color: Color, light: float) -> Color:
    """Return a colour at a share of its brightness."""
    red, green, blue = color
    return round(light * red), round(light * green), round(light * blue)


@dataclass(frozen=True)
class Style:
    """Line width and text height.

    Attributes:
        line_px: Width of lines in pixels.
        text_px: Height of capitals in pixels.
    """

    line_px: int = 2
    text_px: int = 10

    @classmethod
    def of_height(cls, height_px: int) -> Self:
        """Return a style that is legible in an image of a height."""
        return cls(max(round(height_px / 450), 1), max(round(height_px / 90), 7))
