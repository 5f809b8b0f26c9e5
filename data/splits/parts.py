"""Names of the parts of a split, and what it may be drawn from."""

from typing import Literal, get_args

Part = Literal["train", "val", "test"]
PARTS: tuple[Part, ...] = get_args(Part)
SplitBy = Literal["frames", "drives"]
