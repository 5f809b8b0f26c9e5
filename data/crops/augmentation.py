"""How a candidate is changed at every look at it, so that a small set resembles what a road holds (6.1.4).

    scale, depth        closer and further objects
    flip                driving in the opposite direction
    jitter, aspect      errors of the calibration and of the labels
    cover               occlusion
    rotation            other positions on the road
    line shift          noise, and errors of the dense maps
    reflectance         other LiDARs, and returns that fade with range: ours, beside the thesis' eight

The thesis does not say how strong they are; the defaults are ours. A strength of 0 switches one off.
"""

from dataclasses import dataclass
from typing import ClassVar, Literal, get_args

import numpy as np

from data.magnitudes import AugmentationConfig
from perception.detection.depthcn.windows import CROP_HEIGHT_PX
from perception.types import Float64

Operation = Literal[
    "scale",
    "depth",
    "flip",
    "jitter",
    "aspect",
    "cover",
    "rotation_rad",
    "row_shift_px",
    "reflectance",
]
OPERATIONS: tuple[Operation, ...] = get_args(Operation)


@dataclass(frozen=True)
class CropAugmentationConfig(AugmentationConfig):
    """The strength of each operation; 0 is off.

    Attributes:
        scale: the content grows or shrinks by up to a factor of 1 + this.
        depth: depths are multiplied or divided by up to 1 + this.
        flip: probability of left and right changing places.
        jitter: the content moves by up to this share of the window, in both directions.
        aspect: the content is stretched along one direction and shrunk along the other, so that
            their ratio changes by a factor of up to 1 + this.
        cover: up to this share of the width of every second object is hidden by something nearer.
        rotation_rad: the content turns by up to this, either way.
        row_shift_px: each row of the crop moves by up to this many pixels, either way.
        reflectance: returns are weaker by up to this share.
    """

    MAX: ClassVar = {
        "flip": 1.0,
        "jitter": 0.5,
        "cover": 0.9,
        "rotation_rad": 0.5,
        "reflectance": 1.0,
    }

    scale: float = 0.12
    depth: float = 0.25
    flip: float = 0.5
    jitter: float = 0.06
    aspect: float = 0.12
    occlusion: float = 0.4
    rotation_rad: float = 0.035
    row_shift_px: float = 1.0
    reflectance: float = 0.9


@dataclass(frozen=True)
class Occluder:
    """Something nearer that hides one side of an object.

    Attributes:
        share: of the object's width that is hidden.
        from_left: which side.
        nearness: its depth as a share of the object's.
        reflectance: of it, 0..1.
    """

    share: float
    from_left: bool
    nearness: float
    reflectance: float


@dataclass(frozen=True)
class CropTransform:
    """What happens to one candidate at one look, drawn or set by hand.

    Attributes:
        scale: factor of size, above 1 larger.
        depth: factor of depth.
        is_flipped: whether left and right change places.
        shift: right and down, as shares of the window.
        aspect: factor by which width over height changes.
        occlusion: what hides a part, or None.
        rotation_rad: clockwise as seen.
        row_shifts_px: (66,) of each row of the crop to the right.
        reflectance: factor of reflectance.
    """

    scale: float = 1.0
    depth: float = 1.0
    is_flipped: bool = False
    shift: tuple[float, float] = (0.0, 0.0)
    aspect: float = 1.0
    occlusion: Occluder | None = None
    rotation_rad: float = 0.0
    row_shifts_px: Float64 | None = None
    reflectance: float = 1.0


def draw_transform(magnitudes: CropAugmentationConfig, rng: np.random.Generator) -> CropTransform:
    """Draw what happens to one candidate; the same numbers are drawn whatever is switched off."""
    # One call for all numbers: single ones would cost as much as the rest of the sample.
    scale, depth, x, y, aspect, turn, side, nearness, grey, share, flip, fade = rng.uniform(
        -1, 1, 12
    )
    rows = rng.uniform(-1, 1, CROP_HEIGHT_PX)
    occlusion = Occluder(
        share=magnitudes.occlusion * share,
        from_left=bool(side > 0),
        nearness=0.7 + 0.25 * nearness,
        reflectance=0.3 + 0.3 * grey,
    )
    return CropTransform(
        scale=(1 + magnitudes.scale) ** scale,
        depth=(1 + magnitudes.depth) ** depth,
        is_flipped=bool(abs(flip) < magnitudes.flip),
        shift=(magnitudes.jitter * x, magnitudes.jitter * y),
        aspect=(1 + magnitudes.aspect) ** aspect,
        occlusion=occlusion if occlusion.share > 0 else None,  # every second one is left open
        rotation_rad=magnitudes.rotation_rad * turn,
        row_shifts_px=magnitudes.row_shift_px * rows if magnitudes.row_shift_px else None,
        reflectance=1 - magnitudes.reflectance * abs(fade),
    )
