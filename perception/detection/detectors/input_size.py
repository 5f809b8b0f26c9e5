"""Input size of a detector: height and width in pixels."""

import math
import re
from typing import NamedTuple, Self

from perception.errors import UsageError

SIZE_STEP_PX = 32  # every trunk halves its input five times


class InputSize(NamedTuple):
    """Size of a network's input."""

    height_px: int
    width_px: int

    @classmethod
    def parse(cls, text: str) -> Self:
        """Return the size of a text such as 192x640: height and width, multiples of 32.

        Raises:
            UsageError: the text is no such size.
        """
        found = re.fullmatch(r"(\d+)x(\d+)", text)
        sides = [int(side) for side in found.groups()] if found else [0]
        if min(sides) < SIZE_STEP_PX or any(side % SIZE_STEP_PX for side in sides):
            raise UsageError(
                "input size",
                expected=f"HEIGHTxWIDTH in multiples of {SIZE_STEP_PX} pixels, such as 192x640",
                found=text,
            )
        return cls(*sides)

    def for_image(self, height_px: int, width_px: int) -> "InputSize":
        """Return a size of about as many pixels, with the aspect ratio of an image and in multiples of 32.

        >>> tuple(InputSize(192, 640).for_image(375, 1242)), tuple(InputSize(192, 640).for_image(900, 1600))
        ((192, 640), (256, 480))
        """
        aspect = width_px / height_px
        height = math.sqrt(self.height_px * self.width_px / aspect)
        rows = max(1, round(height / SIZE_STEP_PX))
        columns = max(1, round(aspect * height / SIZE_STEP_PX))
        return InputSize(SIZE_STEP_PX * rows, SIZE_STEP_PX * columns)

    def __str__(self) -> str:
        """Return the text that `parse` reads."""
        return f"{self.height_px}x{self.width_px}"
