"""Colours of all images and figures, RGB 0 to 255."""

from perception.types import Modality

Color = tuple[int, int, int]

# Ground and obstacles (static red and moving green as in thesis Fig. 5.7).
GROUND: Color = (46, 120, 255)
GROUND_MESH: Color = (150, 200, 255)
STATIC: Color = (240, 62, 54)
MOVING: Color = (64, 232, 96)
# Colours of tracks by id. With normal vision and with each kind of colour blindness they differ from one
# another and from the three colours above (tests/render/test_palette.py).
TRACKS: tuple[Color, ...] = (
    (255, 240, 50),
    (255, 80, 190),
    (240, 250, 255),
    (190, 145, 255),
    (250, 190, 190),
)

# Object of the one-object tracker, its region of the image and the ring around it (thesis Fig. 5.13), the path of
# the vehicle, and the label.
TRACKED_OBJECT: Color = (255, 168, 36)
INSIDE: Color = (60, 132, 255)
RING: Color = (240, 62, 54)
EGO_PATH: Color = (232, 84, 232)
TRUTH: Color = (120, 235, 160)

# Boxes of the detectors in image, depth map and reflectance map.
MODALITIES: dict[Modality, Color] = {
    "rgb": (255, 168, 36),
    "dm": (0, 214, 255),
    "rm": (214, 110, 255),
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
LIMIT: Color = (255, 196, 64)

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


def track_color(track_id: int) -> Color:
    """Return the colour of a track."""
    return TRACKS[track_id % len(TRACKS)]
